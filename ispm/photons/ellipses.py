"""Light of caustic photons at receivers, eight of these at a time: `blocks` with kernels that are ellipses.

Twin of caustic.wgsl.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ispm.accel.mesh import word_of
from ispm.accel.normals import unit
from ispm.kernels.simd import ldf, ldu
from ispm.optics.density import ellipse_peak
from ispm.optics.jit import jit
from ispm.optics.records import CAUSTIC
from ispm.optics.vector import add, cross, dot, scale, sub
from ispm.photons.blocks import LANES, add_arriving, add_gloss, box_of, is_inner, least_gloss, place, vector

f32, i64, uint64 = np.float32, np.int64, np.uint64

ELLIPSE_BYTES = CAUSTIC.itemsize
_HEIGHT, _FLUX, _REACH, _WI, _BOUNCE, _U, _SIDE, _V, _FRONT = (
    word_of(CAUSTIC, name) for name in ("height", "flux", "reach", "wi", "bounce", "u", "side", "v", "front")
)
_ROUND = f32(1.0001)  # a little more than reach, for the rounding of sums


class _Ellipse(NamedTuple):
    """A CAUSTIC's kernel.

    position    m
    x, y, z     1/m, along its axes: whose products with an offset are 1 at its rim
    normal, wi  unit
    inner       1 if the photon is INNER, else 0
    front       normal of the plane that ends it, `reach` m behind its position
    peak        kappa in its middle, 1/m2
    """

    position: Any
    x: Any
    y: Any
    z: Any
    normal: Any
    wi: Any
    inner: Any
    front: Any
    reach: Any
    peak: Any


@jit
def add_ellipse_to_tile(work, photon, blocks, glossy):
    """Add what a CAUSTIC brings to the sums of the tile's first blocks.

    work, photon  addresses;  glossy  whether any receiver has a glossy lobe
    """
    flux, least, kernel = vector(photon, _FLUX), least_gloss(ldu(photon, _BOUNCE)), _ellipse(photon)
    for block in range(blocks):
        if not _meets(kernel, box_of(work, i64(block))):
            continue
        rows = work + uint64(block * LANES * 4)
        if glossy:
            for k in range(LANES):
                light = _add_arriving(rows, k, kernel, flux)
                add_gloss(rows, k, light, kernel.wi, least, flux)
        else:
            for k in range(LANES):
                _add_arriving(rows, k, kernel, flux)


@jit
def _ellipse(photon):
    """The _Ellipse of a CAUSTIC."""
    u, v, height = vector(photon, _U), vector(photon, _V), ldf(photon, _HEIGHT)
    normal, uu, vv = unit(cross(u, v)), dot(u, u), dot(v, v)
    x, y, z = scale(f32(1) / uu, u), scale(f32(1) / vv, v), scale(f32(1) / height, normal)
    front, reach = vector(photon, _FRONT), ldf(photon, _REACH)
    inner, wi = f32(1) if is_inner(ldu(photon, _SIDE)) else f32(0), vector(photon, _WI)
    return _Ellipse(vector(photon, 0), x, y, z, normal, wi, inner, front, reach, ellipse_peak(uu, vv))


@jit
def _meets(kernel, box):
    """Whether a box, the address of BOX float32, lies between the planes that touch the kernel's rims."""
    low, high = vector(box, 0), vector(box, 3)
    middle, half = sub(scale(f32(0.5), add(low, high)), kernel.position), scale(f32(0.5), sub(high, low))
    return (
        _between(kernel.x, middle, half) & _between(kernel.y, middle, half) & _between(kernel.z, middle, half)
    )


@jit
def _between(axis, middle, half):
    """Whether some of a box about `middle`, m, has a product with an axis, 1/m, from -1 to 1."""
    reach = abs(axis[0]) * half[0] + abs(axis[1]) * half[1] + abs(axis[2]) * half[2]
    return abs(dot(axis, middle)) < _ROUND * (f32(1) + reach)


@jit
def _add_arriving(rows, k, kernel, flux):
    """Add a photon's irradiance and density at receiver k of a block, and return the former over its flux,
    1/m2; flux: (3,) lm."""
    offset = sub(place(rows, k), kernel.position)
    x, y, z = dot(offset, kernel.x), dot(offset, kernel.y), dot(offset, kernel.z)
    m = max(f32(1) - (x * x + y * y + z * z), f32(0))
    m = m if dot(offset, kernel.front) >= -kernel.reach else f32(0)
    return add_arriving(rows, k, kernel.peak * m * m, kernel.normal, kernel.wi, kernel.inner, flux)
