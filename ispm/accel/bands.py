"""How a band of light meets glass whose index depends on it, see `optics.dispersion`."""

from __future__ import annotations

import numpy as np

from ispm.accel.mesh import MATERIALS, triangle_at, word_of
from ispm.accel.records import Hit
from ispm.accel.surface import SurfacePoint, material_flags
from ispm.kernels.simd import ldf
from ispm.optics.bsdf import Bsdf, transmits
from ispm.optics.dispersion import MIDDLE_BAND
from ispm.optics.jit import jit
from ispm.optics.records import MATERIAL, MATERIAL_DISPERSIVE, NO_HIT
from ispm.optics.vector import scale

f32, i64, u32 = np.float32, np.int64, np.uint32

_IOR, _HALF_SPREAD = word_of(MATERIAL, "ior"), word_of(MATERIAL, "half_spread")


@jit
def is_dispersive(x):
    """Return whether bands go ways of their own at a SurfacePoint, a bool."""
    return x.flags & u32(MATERIAL_DISPERSIVE) != u32(0) and transmits(x.bsdf)


@jit
def is_dispersed_first(tables, photon):
    """Return whether the material that an EMITTED photon meets first disperses light, a bool."""
    if photon.instance == u32(NO_HIT):
        return False
    hit = Hit(photon.instance, photon.primitive, photon.u, photon.v)
    return material_flags(tables.surfaces, hit) & u32(MATERIAL_DISPERSIVE) != u32(0)


@jit
def in_band(tables, x, band):
    """Return a SurfacePoint that disperses light as a band of it meets it.

    With the index changes what the facets of glass reflect along their normal; what is metal at such a point
    counts as glass in this.
    """
    _, material, _ = triangle_at(tables.surfaces, x.hit)
    materials = tables.surfaces[MATERIALS]
    middle, b = ldf(materials, material + _IOR), x.bsdf
    ior = middle + f32(band - MIDDLE_BAND) * ldf(materials, material + _HALF_SPREAD)
    root = (ior - f32(1)) * (middle + f32(1)) / max((ior + f32(1)) * (middle - f32(1)), f32(1e-30))
    more = min(root * root, f32(1) / max(b.dielectric_f0, f32(1e-30)))
    eta = ior if x.entering else f32(1) / ior
    fixed = b.tint, eta, b.thin, b.sheen, b.anisotropy
    b = Bsdf(b.diffuse, scale(more, b.f0), b.f90, b.alpha, more * b.dielectric_f0, b.dielectric_f90, *fixed)
    return SurfacePoint(x.hit, x.position, x.ng, x.n, b, x.flags, x.entering, x.coat, x.sheen, x.translucence)
