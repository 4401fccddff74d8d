"""Kernels of caustics, shaped by the beams that their photons stand for.

A photon's beam lights an area that its differentials span, long and narrow where light is focused in one
direction. A kernel of that shape, as much larger as makes an even sum, is as sharp as the caustic is.
Source: Schjoth et al., Photon Differentials, GRAPHITE 2007.
"""

from __future__ import annotations

import math

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.records import CAUSTIC, INNER
from ispm.optics.sampling import orthonormal_basis
from ispm.optics.vector import add, dot, scale, vec3
from ispm.photons.density import Pixels, for_kernels, least_radius
from ispm.photons.even import Room, no_room

f32 = np.float32

OVERLAP = f32(5)  # beams' areas under a kernel: 3 leave grain (a third more error), more blur
# Likewise of lamps with a surface and of environments, in the first pass and in many: n beams that share four
# dimensions each light sqrt(n) times what n that share two would, so that they overlap by themselves. One in
# the first pass leaves streaks.
OVERLAP_OF_AREA = 2.5, 1.0
_ASPECT_MAX = f32(8)  # of a kernel's length over its width; chosen, not measured
_LENGTH_MAX = f32(0.05)  # of the scene's diagonal; likewise
_MIN_RADIUS_RATIO = f32(0.35)  # to the measured radius: beams do not know how normal maps spread light


def shape_kernels(
    photons: np.ndarray,
    beams: np.ndarray,
    clear: np.ndarray,
    diagonal: float,
    smoothing: float,
    pixels: Pixels | None,
    room: Room | None = None,
    overlap: np.ndarray | None = None,
) -> np.ndarray:
    """Return (N,) CAUSTIC: photons with kernels that are ellipses, and end at the mirror or glass they left.

    photons    (N,) PHOTON with radius and height set
    beams      (B, 9) as in a Walk, of the first B photons; the others' kernels stay discs
    clear      (B,) m: distance to the plane of the surface that each of these comes from
    diagonal, smoothing, pixels  as in `measure_caustic_radii`
    room       for kernels to be wider; None: there is none
    overlap    (B,) float32, beams' areas under a kernel; None: OVERLAP
    """
    out = np.zeros(len(photons), CAUSTIC)
    _copy(photons, out)
    room = no_room(len(beams)) if room is None else room
    overlap = np.full(len(beams), OVERLAP) if overlap is None else overlap
    sizes = f32(diagonal), f32(smoothing), for_kernels(pixels)
    _shape(photons, beams, room, overlap, clear, *sizes, out)
    return out


def overlap_of(of_area: np.ndarray, pass_index: int) -> np.ndarray:
    """Return how many beams' areas a kernel holds, (B,) float32; of_area: (B,) bool, which come from a lamp
    with a surface or from the environment."""
    first, least = OVERLAP_OF_AREA
    return np.where(of_area, f32(max(first / math.sqrt(1 + pass_index), least)), OVERLAP)


def disc_kernels(photons: np.ndarray) -> np.ndarray:
    """Return (N,) CAUSTIC: photons with discs for kernels, as ellipses that a plane can cut."""
    out = np.zeros(len(photons), CAUSTIC)
    _copy(photons, out)
    _write_discs(photons, out)
    return out


def _copy(photons: np.ndarray, out: np.ndarray) -> None:
    """Write what (N,) CAUSTIC have of (N,) PHOTON."""
    for name in ("position", "height", "flux", "wi", "bounce"):
        out[name] = photons[name]
    out["side"] = photons["instance"] & INNER


@jit
def _write_discs(photons, out):
    """Write the axes of (N,) CAUSTIC: those of the discs of (N,) PHOTON."""
    for i in range(len(photons)):
        t, b = orthonormal_basis(vec3(photons[i].normal))
        for k in range(3):
            out[i].u[k], out[i].v[k] = photons[i].radius * t[k], photons[i].radius * b[k]


@jit
def _shape(photons, beams, room, overlap, clear, diagonal, smoothing, pixels, out):
    """Write axes, height and front of (N,) CAUSTIC; the rest as of `shape_kernels`."""
    for i in range(len(photons)):
        photon, kernel = photons[i], out[i]
        t, b = orthonormal_basis(vec3(photon.normal))
        u, v = scale(photon.radius, t), scale(photon.radius, b)
        if i < len(beams):
            least, wider = least_radius(photon, pixels), (room.factor[i], room.within[i])
            times = smoothing * math.sqrt(overlap[i] / f32(math.pi))
            u, v = _ellipse(beams[i], t, b, photon.radius, least, diagonal, times, wider)
            slenderness = photon.height / photon.radius
            kernel.height = slenderness * math.sqrt(dot(u, u))
        for k in range(3):
            kernel.u[k] = u[k]
            kernel.v[k] = v[k]
        if i < len(beams):
            end_kernel(kernel, vec3(beams[i, 6:]), clear[i])


@jit
def _ellipse(beam, t, b, measured, least, diagonal, times, wider):
    """The kernel's semi-axes in m, the longer one first: those of the ellipse that a beam's two vectors make
    of the unit circle, scaled.

    beam  (9,) as in a Walk;  t, b  unit, on the surface;  measured, least  m, radii
    times  as large;  wider  a factor and m, as in a Room
    """
    du, dv = vec3(beam), vec3(beam[3:])
    tu, tv, bu, bv = dot(du, t), dot(dv, t), dot(du, b), dot(dv, b)
    tt, tb, bb = tu * tu + tv * tv, tu * bu + tv * bv, bu * bu + bv * bv
    middle, half = f32(0.5) * (tt + bb), f32(0.5) * (tt - bb)
    apart = math.sqrt(half * half + tb * tb)
    if not apart < f32(np.inf):  # of a scene too large for squares in float32
        return scale(measured, t), scale(measured, b)
    long, wide = times * math.sqrt(middle + apart), times * math.sqrt(max(middle - apart, f32(0)))
    factor, within = wider
    long, wide = max(long, min(factor * long, within)), max(wide, min(factor * wide, within))
    short_of = _MIN_RADIUS_RATIO * measured / max(math.sqrt(long * wide), f32(1e-30))
    if short_of > f32(1):
        long, wide = short_of * long, short_of * wide
    long = min(max(long, least), _LENGTH_MAX * diagonal)
    wide = min(max(wide, max(least, long / _ASPECT_MAX)), long)
    angle = f32(0.5) * math.atan2(tb, half)
    c, s = math.cos(angle), math.sin(angle)
    return scale(long, add(scale(c, t), scale(s, b))), scale(wide, add(scale(-s, t), scale(c, b)))


@jit
def end_kernel(kernel, front, clear):
    """End a CAUSTIC at a plane, unless it already ends at one that leaves less. The rest of the kernel gets
    the light of the part behind the plane.

    front  the plane's unit normal, towards the photon;  clear  m, its distance behind the photon
    """
    x = f32(clear) / max(extent(kernel, front), f32(1e-30))
    old = vec3(kernel.front)
    x_old = f32(1)
    if dot(old, old) > f32(0):
        x_old = kernel.reach / max(extent(kernel, old), f32(1e-30))
    if x >= x_old:
        return
    brighter = part_before(x_old) / part_before(x)
    for k in range(3):
        kernel.front[k] = front[k]
        kernel.flux[k] *= brighter
    kernel.reach = clear


@jit
def extent(kernel, direction):
    """Return how far, in m, a CAUSTIC's ellipse reaches along a unit direction."""
    x = dot(vec3(kernel.u), direction)
    y = dot(vec3(kernel.v), direction)
    return math.sqrt(x * x + y * y)


@jit
def part_before(x):
    """Return the share of a unit disc's kernel left of x in [0, 1]: the integral of
    16 / (5 pi) (1 - x^2)^(5/2), which the biweight 3 / pi (1 - r^2)^2 is along lines across x."""
    xx = x * x
    root = math.sqrt(max(f32(1) - xx, f32(0)))
    part = x * root * (f32(33) - f32(26) * xx + f32(8) * xx * xx) / f32(15) + math.asin(x)
    return f32(0.5) + part / f32(math.pi)
