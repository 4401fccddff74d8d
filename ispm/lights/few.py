"""Light of many lights without a surface by few shadow rays.

The two that bring most have a ray each, where they bring enough; of the others one is drawn in proportion to
what it brings without shadows, which keeps the mean (Shirley, Wang and Zimmerman, Monte Carlo Techniques for
Direct Lighting Calculations, TOG 1996, section 4).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ispm.lights.nee import shadowed, unshadowed
from ispm.optics.jit import jit
from ispm.optics.vector import add, scale

f32, i64 = np.float32, np.int64

_SHARE = f32(0.25)  # of a point's light, that is worth a ray of its own


class Few(NamedTuple):
    """The lights that have rays, of those offered so far: rows of the lights, -1 of none, and their values.

    best, second  those that bring most
    drawn         one of the others
    others, total sums of the values of these others and of all
    pick          random in [0, 1), uniform again after each draw
    """

    best: np.int64
    best_value: np.float32
    second: np.int64
    second_value: np.float32
    drawn: np.int64
    drawn_value: np.float32
    others: np.float32
    total: np.float32
    pick: np.float32


@jit
def no_lights(pick):
    """Return the Few of no lights; pick: random in [0, 1), float32."""
    none, zero = i64(-1), f32(0)
    return Few(none, zero, none, zero, none, zero, zero, zero, pick)


@jit
def offer(few, row, value):
    """Return the Few after another light, whose value is what it brings without shadows, in any unit."""
    best, best_value, second, second_value, drawn, drawn_value, others, total, pick = few
    total += value
    if value > best_value:
        best, best_value, row, value = i64(row), value, best, best_value
    if value > second_value:
        second, second_value, row, value = i64(row), value, second, second_value
    return _draw(
        Few(best, best_value, second, second_value, drawn, drawn_value, others, total, pick), row, value
    )


@jit
def settled(few):
    """Return the Few when all have been offered: what brings little is one of the others."""
    best, best_value, second, second_value = few.best, few.best_value, few.second, few.second_value
    if best_value <= _SHARE * few.total:
        few, best = _draw(few, best, best_value), i64(-1)
    if second_value <= _SHARE * few.total:
        few, second = _draw(few, second, second_value), i64(-1)
    rest = few.drawn, few.drawn_value, few.others, few.total, few.pick
    return Few(best, best_value, second, second_value, *rest)


@jit
def _draw(few, row, value):
    """The Few after one more light among the others, unless its value is 0."""
    best, best_value, second, second_value, drawn, drawn_value, others, total, pick = few
    if value <= f32(0):
        return few
    others += value
    if pick * others < value:
        drawn, drawn_value, pick = i64(row), value, pick * (others / value)
    else:
        pick = (pick * others - value) / max(others - value, f32(1e-30))
    return Few(best, best_value, second, second_value, drawn, drawn_value, others, total, pick)


@jit
def light_of_few(tables, x, wo, u, pick, scratch):
    """Return what `punctual_light` does, in the mean over `pick`, by three rays at most.

    u, pick  random in [0, 1), for holes that shadow rays meet, and to draw a light by
    """
    lights, few = tables.lights, no_lights(pick)
    for k in range(len(lights)):
        radiance = unshadowed(lights[k], x, wo, f32(np.inf)).radiance
        few = offer(few, i64(k), radiance[0] + radiance[1] + radiance[2])
    few = settled(few)
    total, traced = (f32(0), f32(0), f32(0)), i64(0)
    for row in (few.best, few.second, few.drawn):
        if row >= i64(0):
            light, rays = shadowed(tables, x, unshadowed(lights[row], x, wo, f32(np.inf)), u, scratch)
            weight = few.others / few.drawn_value if row == few.drawn else f32(1)
            total, traced = add(total, scale(weight, light)), traced + rays
    return total, traced
