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
    """The lights that have rays: rows of the lights, -1 of none.

    best, second  those that bring most, where it is much
    drawn         one of the others
    weight        of its light: 1 over the probability with which it was drawn
    """

    best: np.int64
    second: np.int64
    drawn: np.int64
    weight: np.float32


@jit
def choose(values, pick):
    """Return the Few of lights by their values, (n,) float32: what each brings without shadows, in any unit.

    pick  random in [0, 1): even picks draw evenly
    """
    total, best, second = f32(0), i64(-1), i64(-1)
    for k in range(len(values)):
        value = values[k]
        total += value
        if value > (values[best] if best >= i64(0) else f32(0)):
            best, second = i64(k), best
        elif value > (values[second] if second >= i64(0) else f32(0)):
            second = i64(k)
    if best >= i64(0) and values[best] <= _SHARE * total:
        best = i64(-1)
    if second >= i64(0) and values[second] <= _SHARE * total:
        second = i64(-1)
    others = f32(0)
    for k in range(len(values)):
        others += values[k] if k != best and k != second else f32(0)
    drawn, before = i64(-1), f32(0)
    for k in range(len(values)):
        if k != best and k != second and values[k] > f32(0) and (drawn < i64(0) or before <= pick * others):
            drawn, before = i64(k), before + values[k]
    return Few(best, second, drawn, others / values[drawn] if drawn >= i64(0) else f32(0))


@jit
def light_of_few(tables, x, wo, pick, scratch, values):
    """Return what `punctual_light` does, in the mean over `pick`, by three rays at most.

    pick    random in [0, 1), to draw a light by
    values  (n,) float32 of any content, overwritten: a number for each of the lights
    """
    lights = tables.lights
    for k in range(len(lights)):
        radiance = unshadowed(lights[k], x, wo, f32(np.inf)).radiance
        values[k] = radiance[0] + radiance[1] + radiance[2]
    few = choose(values, pick)
    total, traced = (f32(0), f32(0), f32(0)), i64(0)
    for row in (few.best, few.second, few.drawn):
        if row >= i64(0):
            light, rays = shadowed(tables, x, unshadowed(lights[row], x, wo, f32(np.inf)), scratch)
            weight = few.weight if row == few.drawn else f32(1)
            total, traced = add(total, scale(weight, light)), traced + rays
    return total, traced
