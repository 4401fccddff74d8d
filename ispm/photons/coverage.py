"""Kernels lose the light that falls past edges; here each photon gets back what its own loses.

Points are drawn with the kernel's density until one lies on a surface that the photon may light. Their mean
number is the inverse of the share c of the kernel on such surfaces: multiplied by it, the flux that reaches
surfaces is the photon's, without bias. On slopes c exceeds 1, so the series 1 / c = 1 + (1 - c) +
(1 - c)^2 + ... is summed, each factor by a draw of its own, with roulette.
Floors continue below what stands on them. Kernels light these parts as well, but no gather ray meets them:
with `solids`, points within solids do not count. Without gather rays they do: what photons lose there is as
much as leaks past thin walls.
Source: Qin et al., Unbiased Photon Gathering for Light Transport Simulation, SIGGRAPH Asia 2015, section 4.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ispm.accel.intersect import STACK_WORDS, closest, read_hit
from ispm.accel.mesh import hit_plane
from ispm.accel.normals import unit
from ispm.accel.records import Ray, Scratch, Trees
from ispm.accel.surface import SurfaceTable, material_flags, opacity
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca
from ispm.optics.density import SAME_SURFACE
from ispm.optics.jit import jit
from ispm.optics.records import (
    INNER,
    MATERIAL_BLEND,
    MATERIAL_DOUBLE_SIDED,
    MATERIAL_HAS_INNER,
    MATERIAL_HIDES_PHOTONS,
    MATERIAL_MASK,
    MATERIAL_TRANSLUCENT,
    MATERIAL_TRANSMITS,
)
from ispm.optics.rng import random4
from ispm.optics.sampling import orthonormal_basis
from ispm.optics.vector import Vector, add, cross, dot, scale, sub, vec3

f32, i64, u32 = np.float32, np.int64, np.uint32

_DRAWS_MAX = 32  # of a kernel: what is brighter by more would be fireflies, where next to nothing is lit
_LAYERS = 4  # surfaces that are looked at about a point, until one is lit that hides what is behind it
_LEAST_TERM = f32(0.25)  # of a series, below which chance ends it: with 1 photons alone err a tenth more
_PAST = f32(1e-3)  # of a kernel's thickness, by which rays start behind what they met
_LIFT = f32(0.05)  # of the distance to the photon, by which rays to it run above the surfaces
_DIMENSION = 1 << 24  # of the first trial's random numbers
_CHUNK = 256  # kernels a thread takes at a time

_TURNS = 2.0 * np.pi * (np.arange(256) + 0.5) / 256
_CIRCLE = np.stack([np.cos(_TURNS), np.sin(_TURNS)], axis=1).astype(np.float32)


class Draws(NamedTuple):
    """What the trials of kernels are drawn by.

    keys    (N,) uint32 of their random numbers, with the pass and the seed
    series  whose mean is taken where a kernel loses something: more, less noise and more rays
    """

    keys: np.ndarray
    seed: int | np.integer
    pass_index: int | np.integer
    series: int | np.integer = 1


def keep_light(
    photons: np.ndarray,
    draws: Draws,
    world: World,
    surfaces: SurfaceTable,
    *,
    solids: bool = False,
    rows: np.ndarray | None = None,
) -> None:
    """Multiply the flux of photons by the inverse of the share of their kernels on surfaces, in expectation.

    photons  (N,) PHOTON with radius and height set, or CAUSTIC; flux changed in place
    solids   whether points on surfaces within solids do not count
    rows     (n,) uint32, the photons to change; None: all
    """
    rows = np.arange(len(photons), dtype=np.uint32) if rows is None else rows
    if not len(rows):
        return
    scene = _Traced(world.trees, surfaces.addresses, surfaces.texels, surfaces.rows, solids)
    numbers = Draws(draws.keys, u32(draws.seed), u32(draws.pass_index), i64(draws.series))
    keep: Callable[..., None] = _keep_ellipses if "front" in (photons.dtype.names or ()) else _keep_discs
    run_shared(lambda counter: keep(scene, photons, rows, numbers, counter), world.threads)


class _Traced(NamedTuple):
    """What rays meet: a World's trees, a SurfaceTable's addresses, texels and rows, and whether points within
    solids do not count."""

    trees: Trees
    surfaces: np.ndarray
    texels: np.ndarray
    rows: np.ndarray
    solids: bool


class _Kernel(NamedTuple):
    """A kernel about a photon: its position, direction wi and surface's normal, float32, world space.

    u, v, height  axes of its middle section and half its thickness, m
    front, reach  normal of the plane that cuts it off, and how far behind the photon that is, m
    side          uint32, with INNER
    """

    position: Vector
    wi: Vector
    normal: Vector
    u: Vector
    v: Vector
    height: np.float32
    front: Vector
    reach: np.float32
    side: np.uint32


@jit
def _keep_discs(scene, photons, rows, numbers, counter):
    """Change the flux of as many of the (N,) PHOTON at (n,) uint32 rows as a thread gets."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    uncut = (f32(0), f32(0), f32(0))
    for k in shared_rows(counter, _CHUNK, len(rows)):
        photon, n = photons[rows[k]], vec3(photons[rows[k]].normal)
        t, b = orthonormal_basis(n)
        u, v = scale(photon.radius, t), scale(photon.radius, b)
        cut = uncut, f32(1), photon.instance
        kernel = _Kernel(vec3(photon.position), vec3(photon.wi), n, u, v, photon.height, *cut)
        _keep(scene, photon, kernel, numbers.keys[rows[k]], numbers, scratch)


@jit
def _keep_ellipses(scene, photons, rows, numbers, counter):
    """Likewise of (N,) CAUSTIC."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for k in shared_rows(counter, _CHUNK, len(rows)):
        photon = photons[rows[k]]
        u, v, front = vec3(photon.u), vec3(photon.v), vec3(photon.front)
        n, position = unit(cross(u, v)), vec3(photon.position)
        cut = front, photon.reach, photon.side
        kernel = _Kernel(position, vec3(photon.wi), n, u, v, photon.height, *cut)
        _keep(scene, photon, kernel, numbers.keys[rows[k]], numbers, scratch)


@jit
def _keep(scene, photon, kernel, key, numbers, scratch):
    """Multiply the flux of a PHOTON or CAUSTIC by 1 over the share of its _Kernel on lit surfaces, in
    expectation: by the terms of series, which share the first point. key: uint32."""
    first = u32(_DIMENSION)
    total, term = _terms(scene, kernel, key, numbers, first, i64(1), scratch)
    if term != f32(0):
        rest = f32(0)
        for _ in range(numbers.series):
            first += u32(2 * _DRAWS_MAX)
            part, _ = _terms(scene, kernel, key, numbers, first, i64(_DRAWS_MAX), scratch)
            rest += part
        total += term * rest / f32(numbers.series)
    for c in range(3):
        photon.flux[c] *= total


@jit
def _terms(scene, kernel, key, numbers, first, most, scratch):
    """Return the sum of a series's first terms, at most so many, and the next one, 0 where roulette ended it.

    first  uint32, dimension of the first random numbers
    """
    total, term = f32(0), f32(1)
    for _ in range(_DRAWS_MAX):
        turn, a, b, c = random4(key, first, numbers.pass_index, numbers.seed)
        # The greatest of three is below x with the chance x^3: within s lies 1 - (1 - s^2)^3 of a kernel.
        outside = max(max(a, b), max(c, f32(1e-6)))
        offset, thickness = _point_of(kernel, outside, turn)
        first += u32(2)
        if dot(offset, kernel.front) < -kernel.reach:
            continue  # cut off: the kernel holds its flux without it
        total += term
        term *= f32(1) - _lit_share(scene, kernel, add(kernel.position, offset), thickness, scratch)
        if abs(term) < _LEAST_TERM:
            chance, _, _, _ = random4(key, first - u32(1), numbers.pass_index, numbers.seed)
            if chance * _LEAST_TERM >= abs(term):
                return total, f32(0)
            term = _LEAST_TERM if term > f32(0) else -_LEAST_TERM
        most -= i64(1)
        if most == i64(0):
            break
    return total, term


@jit
def _point_of(kernel, outside, turn):
    """Return the offset in m of a point of a _Kernel's middle section, and half the thickness there, m.

    outside  1 - s^2 of its distance s from the middle, 1 at the rim;  turn  in [0, 1), of a whole one
    """
    s, k = f32(math.sqrt(f32(1) - outside)), i64(turn * f32(len(_CIRCLE)))
    offset = add(scale(s * _CIRCLE[k, 0], kernel.u), scale(s * _CIRCLE[k, 1], kernel.v))
    return offset, kernel.height * f32(math.sqrt(outside))


@jit
def _lit_share(scene, kernel, middle, thickness, scratch):
    """Return the kernel where it meets a surface that its photon lights, over the kernel at a point of its
    middle section, times the area of surface to that of section: 0 without one, at most 1 / SAME_SURFACE.
    Where one is seen through another, the greater of both.

    middle  (3,) float32, the point;  thickness  m, half the kernel's there
    """
    n, share = kernel.normal, f32(0)
    top, down, length = add(middle, scale(thickness, n)), scale(f32(-1), n), f32(2) * thickness
    for _ in range(_LAYERS):
        t = closest(scene.trees, Ray(top, down, length), scratch)
        if not t < length:
            break
        hit = read_hit(scratch.found)
        flags, (_, front) = material_flags(scene.surfaces, hit), hit_plane(scene.surfaces, hit)
        facing, side = dot(front, n), u32(0)
        if facing < f32(0):
            front, facing = scale(f32(-1), front), -facing
            if flags & u32(MATERIAL_HAS_INNER) != u32(0):
                side = u32(INNER)
        lit = facing >= SAME_SURFACE and dot(kernel.wi, front) > f32(0)
        lit = (
            lit
            and flags & u32(MATERIAL_HIDES_PHOTONS) == u32(0)
            and (kernel.side ^ side) & u32(INNER) == u32(0)
            and (flags & u32(MATERIAL_MASK | MATERIAL_BLEND) == u32(0) or opacity(scene, hit) > f32(0))
        )
        if lit and not (scene.solids and _is_inside(scene, kernel, add(top, scale(t, down)), front, scratch)):
            z = (length - t) / thickness - f32(1)
            m = max(f32(1) - z * z, f32(0))
            share = max(share, m * m / facing)
            if flags & u32(MATERIAL_BLEND | MATERIAL_TRANSMITS) == u32(0):
                break
        t += _PAST * thickness
        top, length = add(top, scale(t, down)), length - t
    return share


@jit
def _is_inside(scene, kernel, point, front, scratch):
    """Whether a point lies within a solid: between it and the kernel's photon stands the back of a surface.

    Those of double-sided or translucent materials may be sheets, and are none; through glass one sees it.
    point, front  (3,) float32, its position and its surface's normal
    """
    center = kernel.position
    lift = _LIFT * f32(math.sqrt(dot(sub(center, point), sub(center, point))))
    start = add(point, scale(lift, front))
    across = sub(add(center, scale(lift, kernel.normal)), start)
    length = f32(math.sqrt(dot(across, across)))
    d = scale(f32(1) / max(length, f32(1e-30)), across)
    t = closest(scene.trees, Ray(start, d, length), scratch)
    if not t < length:
        return False
    hit = read_hit(scratch.found)
    _, front = hit_plane(scene.surfaces, hit)
    none = u32(MATERIAL_DOUBLE_SIDED | MATERIAL_TRANSLUCENT | MATERIAL_TRANSMITS)
    return dot(front, d) > f32(0) and material_flags(scene.surfaces, hit) & none == u32(0)
