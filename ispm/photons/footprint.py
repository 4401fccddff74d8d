"""Kernels of caustics, shaped by the beams that their photons stand for.

A photon's beam lights an area that its differentials span, long and narrow where light is focused in one
direction. A kernel of that shape, as much larger as makes an even sum, is as sharp as the caustic is.
Source: Schjoth et al., Photon Differentials, GRAPHITE 2007.
"""

from __future__ import annotations

import math

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.records import CAUSTIC, PHOTON
from ispm.optics.sampling import orthonormal_basis
from ispm.optics.vector import add, dot, scale
from ispm.photons.density import least_radius

f32 = np.float32

OVERLAP = f32(5)  # beams' areas under a kernel: 3 leave grain (a third more error), more blur
_ASPECT_MAX = f32(8)  # of a kernel's length over its width
_LENGTH_MAX = f32(0.05)  # of the scene's diagonal
_MIN_RADIUS_RATIO = f32(0.35)  # to the measured radius: beams do not know how normal maps spread light

# columns of PHOTON and CAUSTIC records seen as words
_RADIUS, _NORMAL, _PHOTON_HEIGHT = 3, 12, 15
_CAUSTIC_HEIGHT, _FLUX = 3, 4
REACH, U, V, FRONT = 7, 12, 16, 20


def shape_kernels(
    photons: np.ndarray,
    beams: np.ndarray,
    clear: np.ndarray,
    diagonal: float,
    smoothing: float,
    pixel: np.ndarray,
    eye: np.ndarray,
) -> np.ndarray:
    """Return (N,) CAUSTIC: photons with kernels that are ellipses, and end at the mirror or glass they left.

    photons    (N,) PHOTON with radius and height set
    beams      (B, 9) as in a Walk, of the first B photons; the others' kernels stay discs
    clear      (B,) m: how far away the plane is of the surface that each of these comes from
    diagonal, smoothing, pixel, eye  as in `measure_caustic_radii`
    """
    out = np.zeros(len(photons), CAUSTIC)
    for name in ("position", "height", "flux", "wi"):
        out[name] = photons[name]
    limits = np.array([diagonal, smoothing], np.float32)
    _shape(
        photons.view(np.float32).reshape(-1, PHOTON.itemsize // 4), beams, clear, limits,
        pixel.astype(np.float32), np.asarray(eye, np.float32),
        out.view(np.float32).reshape(-1, CAUSTIC.itemsize // 4),
    )  # fmt: skip
    return out


@jit
def _shape(words, beams, clear, limits, pixel, eye, out):
    for i in range(len(words)):
        t, b = orthonormal_basis((words[i, _NORMAL], words[i, _NORMAL + 1], words[i, _NORMAL + 2]))
        u, v = scale(words[i, _RADIUS], t), scale(words[i, _RADIUS], b)
        if i < len(beams):
            u, v = _ellipse(beams, i, t, b, words[i, _RADIUS], least_radius(words, i, pixel, eye), limits)
            slenderness = words[i, _PHOTON_HEIGHT] / words[i, _RADIUS]
            out[i, _CAUSTIC_HEIGHT] = slenderness * math.sqrt(dot(u, u))
        for k in range(3):
            out[i, U + k] = u[k]
            out[i, V + k] = v[k]
        if i < len(beams):
            end_kernel(out, i, (beams[i, 6], beams[i, 7], beams[i, 8]), clear[i])


@jit
def _ellipse(beams, i, t, b, measured, least, limits):
    """The kernel's semi-axes, the longer one first: those of the ellipse that the beam's two vectors make of
    the unit circle, scaled."""
    du, dv = (beams[i, 0], beams[i, 1], beams[i, 2]), (beams[i, 3], beams[i, 4], beams[i, 5])
    tu, tv, bu, bv = dot(du, t), dot(dv, t), dot(du, b), dot(dv, b)
    tt, tb, bb = tu * tu + tv * tv, tu * bu + tv * bv, bu * bu + bv * bv
    middle, half = f32(0.5) * (tt + bb), f32(0.5) * (tt - bb)
    apart = math.sqrt(half * half + tb * tb)
    if not apart < f32(np.inf):  # of a scene too large for squares in float32
        return scale(measured, t), scale(measured, b)
    k = limits[1] * math.sqrt(OVERLAP / f32(math.pi))
    long, wide = k * math.sqrt(middle + apart), k * math.sqrt(max(middle - apart, f32(0)))
    short_of = _MIN_RADIUS_RATIO * measured / max(math.sqrt(long * wide), f32(1e-30))
    if short_of > f32(1):
        long, wide = short_of * long, short_of * wide
    long = min(max(long, least), _LENGTH_MAX * limits[0])
    wide = min(max(wide, max(least, long / _ASPECT_MAX)), long)
    angle = f32(0.5) * math.atan2(tb, half)
    c, s = math.cos(angle), math.sin(angle)
    return scale(long, add(scale(c, t), scale(s, b))), scale(wide, add(scale(-s, t), scale(c, b)))


@jit
def end_kernel(out, i, front, clear):
    """End kernel `i` at a plane, where it is cut by none that leaves less; what is behind goes to the rest.

    front  the plane's unit normal, towards the photon;  clear  m, how far behind the photon it is
    """
    x = f32(clear) / max(_extent(out, i, front), f32(1e-30))
    old = (out[i, FRONT], out[i, FRONT + 1], out[i, FRONT + 2])
    x_old = f32(1)
    if dot(old, old) > f32(0):
        x_old = out[i, REACH] / max(_extent(out, i, old), f32(1e-30))
    if x >= x_old:
        return
    brighter = _part_before(x_old) / _part_before(x)
    for k in range(3):
        out[i, FRONT + k] = front[k]
        out[i, _FLUX + k] *= brighter
    out[i, REACH] = clear


@jit
def _extent(out, i, direction):
    """How far kernel `i` reaches along a direction."""
    x = dot(axis_of(out, i, U), direction)
    y = dot(axis_of(out, i, V), direction)
    return math.sqrt(x * x + y * y)


@jit
def axis_of(out, i, which):
    """Return a semi-axis of kernel `i`, the one at word `which`."""
    return out[i, which], out[i, which + 1], out[i, which + 2]


@jit
def _part_before(x):
    """The kernel's part of a disc left of x in [0, 1]: the integral of 16 / (5 pi) (1 - x^2)^(5/2)."""
    xx = x * x
    root = math.sqrt(max(f32(1) - xx, f32(0)))
    part = x * root * (f32(33) - f32(26) * xx + f32(8) * xx * xx) / f32(15) + math.asin(x)
    return f32(0.5) + part / f32(math.pi)
