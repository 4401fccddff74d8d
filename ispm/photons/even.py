"""Where caustics are even, and how much wider than their beams the kernels of their photons may be there.

A kernel over few beams shows each of them; one over many blurs what changes from one to the next. The light
of a beam is its flux over its area, so neighbors tell how it changes without noise.
Sources: Silverman, Density Estimation for Statistics and Data Analysis, 1986, chapter 4 (what kernels blur);
Schregle, Bias Compensation for Photon Maps, CGF 22(4), 2003 (kernels as wide as their bias allows).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import address, alloca, ldu
from ispm.optics.jit import jit
from ispm.optics.vector import add, cross, dot, sub, vec3
from ispm.photons.density import TURN, points_in_order
from ispm.photons.nearest import STACK_WORDS, NearestTree, find_nearest

f32, i64 = np.float32, np.int64

WIDEST = f32(2)  # times a kernel's radius
_NEIGHBORS = 24  # of a photon: their disc is a little wider than the widest kernel
_REACH = 0.1  # of the scene's diagonal, that they lie within
_ALIKE = f32(math.cos(math.radians(12.0)))  # of the directions of photons that came the same way
_LEAST = f32(6)  # of these, that tell anything
# The mean light of neighbors over a photon's own, less 1, times a kernel's area over its beams': light is
# blurred by a tenth of it, for a kernel brings r^2 / 16 of the Laplacian, a disc R^2 / 8. Half or double: the
# same errors.
_CHANGE = f32(0.6)
# How far aside the neighbors' mean place is, over the root of their mean square distance: .1 where an edge
# cuts off the outer quarter of the disc's radius, .3 where it cuts off half. All room up to the first of two
# numbers, none from the second on.
_ASIDE = f32(0.15), f32(0.35)
_UNLIKE = f32(1.15), f32(1.5)  # likewise: how many times as dense as beams tell photons lie, or the inverse
_CHUNK = 256  # photons a thread takes at a time


class Room(NamedTuple):
    """What kernels may be widened to, (N,) float32: a factor on their radii, from 1 to `WIDEST`, which takes
    neither axis beyond `within`, m, as far as neighbors tell that light is even."""

    factor: np.ndarray
    within: np.ndarray


def no_room(count: int) -> Room:
    """Return the Room of kernels that stay as they are."""
    return Room(np.ones(count, f32), np.zeros(count, f32))


def room_to_widen(
    photons: np.ndarray,
    beams: np.ndarray,
    wanted: np.ndarray,
    diagonal: float,
    pass_index: int = 0,
    threads: int = 1,
) -> Room:
    """Return the Room of the kernels of (N,) PHOTON.

    beams     (N, 9) as in a Walk
    wanted    (N,) bool, of which photons; others have none
    diagonal  of the scene, m
    pass_index  from 0: what is left to add to a kernel's area falls with the root of the number of passes
    It is none where neighbors that came the same way lie on one side, as at a border of light; where they lie
    more or less densely than their beams tell, as behind facets; and where their light differs from the
    photon's own in the mean, as about folds. The same bytes for any number of threads.
    """
    out = no_room(len(photons))
    if len(photons) > _NEIGHBORS and wanted.any():
        points, order = points_in_order(photons, f32(TURN * diagonal))
        tree = NearestTree(points)
        fade = f32(1.0 / math.sqrt(1 + pass_index))
        told = photons, beams, wanted, address(tree.nodes), tree.starts, order, f32(_REACH * diagonal), fade
        run_shared(lambda counter: _write_room(*told, counter, out), threads)
    return out


@jit
def _write_room(photons, beams, wanted, nodes, starts, order, reach, fade, counter, out):
    """Write the Room of as many photons as a thread gets."""
    squares, rows, stack = alloca(_NEIGHBORS), alloca(_NEIGHBORS), alloca(STACK_WORDS)
    for point in shared_rows(counter, _CHUNK, len(order)):
        i = order[point]
        if not wanted[i]:
            continue
        found = find_nearest(nodes, starts, i64(point), i64(_NEIGHBORS), reach, squares, rows, stack)
        position, wi, area = vec3(photons[i].position), vec3(photons[i].wi), _area(beams[i])
        count, light, farthest, square = f32(0), f32(0), f32(1e-30), f32(1e-30)
        middle = f32(0), f32(0), f32(0)
        for k in range(found):
            j = order[i64(ldu(rows, i64(k)))]
            away = sub(vec3(photons[j].position), position)
            farthest = max(farthest, dot(away, away))
            if dot(vec3(photons[j].wi), wi) >= _ALIKE:
                count, light = count + f32(1), light + area / _area(beams[j])
                middle, square = add(middle, away), square + dot(away, away)
        if count < _LEAST:
            continue
        aside = f32(math.sqrt(dot(middle, middle) / (count * square)))
        density = count * area / (f32(math.pi) * farthest)
        room = _CHANGE / max(abs(light / count - f32(1)), f32(1e-30))
        room = min(max(room, f32(1)), WIDEST * WIDEST) - f32(1)
        room *= fade * _share(aside, _ASIDE) * _share(max(density, f32(1) / density), _UNLIKE)
        out.factor[i], out.within[i] = f32(math.sqrt(f32(1) + room)), f32(math.sqrt(farthest))


@jit
def _share(x, limits):
    """1 up to the first limit, 0 from the second on."""
    return min(max((limits[1] - x) / (limits[1] - limits[0]), f32(0)), f32(1))


@jit
def _area(beam):
    """Area of the parallelogram of a beam, (9,), m2."""
    across = cross(vec3(beam), vec3(beam[3:]))
    return max(f32(math.sqrt(dot(across, across))), f32(1e-30))
