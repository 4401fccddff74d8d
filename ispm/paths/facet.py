"""How eye paths continue from mirrors, glass and narrow lobes: by one facet of the surface, and where one
path serves for both branches, by the stronger one."""

from __future__ import annotations

import math

import numpy as np

from ispm.accel.surface import SurfacePoint
from ispm.lights.nee import greatest
from ispm.optics.bsdf import (
    NARROW_ALPHA,
    Bsdf,
    facet_reflectance,
    is_narrow,
    is_smooth,
    smooth_split,
    specular_split,
    transmits,
)
from ispm.optics.dispersion import BANDS
from ispm.optics.facet_albedo import albedo_gain
from ispm.optics.facets import (
    Anisotropy,
    is_anisotropic,
    mean_alpha,
    shadowing_alpha,
    unshadowed,
    visible_facet,
    visible_pdf,
)
from ispm.optics.jit import jit
from ispm.optics.microfacet import schlick
from ispm.optics.records import MATERIAL_ANISOTROPIC, MATERIAL_DISPERSIVE, MATERIAL_TRANSMITS
from ispm.optics.rng import random4
from ispm.optics.sampling import LATTICE
from ispm.optics.vector import add, dot, luminance, normalize, scale, sub
from ispm.scene.packed import Packed

f32, u32 = np.float32, np.uint32

_LOBES = 1 << 23  # of the random numbers that shift the lattice of paths from lobes
_STEPS = tuple(round(step * 2**32) for step in LATTICE)
_BLUR = f32(0.75)  # more is bias, less is noise
ROUGH_SAMPLES = 8  # facets that are drawn where a pixel shows rough glass; a power of 2


@jit
def sample_specular_lobe(x, wo, u1, u2, least, pick):
    """Return how a path that comes along -wo continues from a mirror or glass at a SurfacePoint: whether it
    does, wi, the factor (RGB) of its weight; whether a second path starts, that one's wi and factor.

    Where smooth glass both reflects and transmits `least` or more, the path parts: the second is reflected.
    Else one goes on: the one that `pick` draws in proportion to its share, or below 0 the stronger one, which
    from within a solid is the one that leaves it; the last factor is then the other's, which is left over.
    u1, u2, pick  random in [0, 1)
    """
    b, entering = x.bsdf, x.entering
    reflectance, transmittance, above, beyond, through = facet_split(x, wo, u1, u2)
    both, none = add(reflectance, transmittance), (f32(0), f32(0), f32(0))
    if not through:
        return greatest(both) > f32(0), above, both, False, wo, none
    if is_smooth(b) and min(greatest(reflectance), greatest(transmittance)) >= least:
        return True, beyond, transmittance, True, above, reflectance
    reflected, passed = luminance(reflectance), luminance(transmittance)
    if pick < f32(0):
        leaves = not entering or passed > reflected
        if leaves:
            return True, beyond, transmittance, False, wo, reflectance
        return greatest(both) > f32(0), above, reflectance, False, wo, transmittance
    chance = passed / (reflected + passed) if passed > f32(0) else f32(0)
    if pick < chance:
        return True, beyond, scale(f32(1) / chance, transmittance), False, wo, none
    return reflected > f32(0), above, scale(f32(1) / (f32(1) - chance), reflectance), False, wo, none


@jit
def sample_lobe(x, wo, u1, u2):
    """Return how a path that comes along -wo continues by the lobe of an opaque rough SurfacePoint: whether
    it does, unit wi, the factor (RGB) of its weight, and the density of wi, 1/sr.

    u1, u2  random in [0, 1)
    """
    b = x.bsdf
    factor, _, wi, _, _ = facet_split(x, wo, u1, u2)
    pdf = visible_pdf(b, x.n, wo, normalize(add(wo, wi)))
    return greatest(factor) > f32(0), wi, factor, pdf


@jit
def lobe_blur(b, pdf):
    """Return the alpha, float32, as which narrower lobes count to a path that comes along a direction which
    the facets of a rough Bsdf drew with the density `pdf`, 1/sr; 0 of 0.

    About normal incidence 1 / sqrt(4 pi pdf) is (alpha^2 + t^2) / alpha, t the facet's angle to the normal.
    Far out that exceeds t, over which the density changes: light seen there would count in the middle, too,
    where the density is many times as high. Its geometric mean with alpha is sqrt(alpha^2 + t^2), of which
    this is a part.
    """
    if pdf <= f32(0):
        return f32(0)
    dense = f32(0.5) / math.sqrt(f32(math.pi) * pdf)
    return _BLUR * f32(math.sqrt(mean_alpha(b) * dense))


@jit
def widened(x, wo, alpha):
    """Return a SurfacePoint, seen along wo, whose opaque lobe is no narrower than `alpha`, float32 at most
    that of wide ones, and reflects as much.

    Source: Kaplanyan and Dachsbacher, Path Space Regularization for Holistic and Robust Light Transport,
    Eurographics 2013.
    """
    b = x.bsdf
    if not is_narrow(b) or b.alpha >= min(alpha, NARROW_ALPHA):
        return x
    wide = min(alpha, NARROW_ALPHA)
    anisotropy = b.anisotropy
    if is_anisotropic(b):
        anisotropy = Anisotropy(max(anisotropy.alpha, wide), anisotropy.tangent)
    kept = b.dielectric_f0, b.dielectric_f90, b.tint, b.eta, b.thin, b.sheen, anisotropy
    own, b = shadowing_alpha(b), Bsdf(b.diffuse, b.f0, b.f90, wide, *kept)
    gain = albedo_gain(own, shadowing_alpha(b), dot(x.n, wo))
    b = Bsdf(b.diffuse, scale(gain, b.f0), gain * b.f90, wide, *kept)
    return SurfacePoint(x.hit, x.position, x.ng, x.n, b, x.flags, x.entering, x.coat, x.sheen, x.translucence)


@jit
def as_wide(b, cosine, least):
    """Return a Bsdf whose opaque facets reflect as much as they do where alpha counts as `least` at least;
    cosine: n.wo."""
    wide = max(mean_alpha(b), min(least, NARROW_ALPHA))
    gain = albedo_gain(shadowing_alpha(b), wide, cosine)
    if transmits(b) or gain == f32(1):
        return b
    kept = b.alpha, b.dielectric_f0, b.dielectric_f90, b.tint, b.eta, b.thin, b.sheen, b.anisotropy
    return Bsdf(b.diffuse, scale(gain, b.f0), gain * b.f90, *kept)


@jit
def mean_reflectance(x, wo):
    """Return what the lobe of an opaque SurfacePoint reflects of even light along wo, RGB, nearly."""
    return facet_reflectance(x.bsdf, schlick(dot(x.n, wo)))


@jit
def facet_split(x, wo, u1, u2):
    """Return what a mirror or glass at a SurfacePoint makes of light along wo, as `specular_split` has it.

    Where it is rough, by one of the facets visible along wo, drawn by u1 and u2 of [0, 1), times the share
    that others do not shadow.
    """
    b, n, ng = x.bsdf, x.n, x.ng
    if is_smooth(b):
        return smooth_split(b, n, ng, wo)
    h = visible_facet(b, n, wo, u1, u2)
    reflectance, transmittance, above, beyond, through = specular_split(b, h, wo)
    if b.thin > f32(0):
        beyond = sub(above, scale(f32(2) * dot(n, above), n))
    shown = dot(above, ng) > f32(0) and dot(above, n) > f32(0)
    through = through and dot(beyond, ng) < f32(0) and dot(beyond, n) < f32(0)
    reflected = unshadowed(b, n, wo, above) if shown else f32(0)
    passed = unshadowed(b, n, wo, beyond) if through else f32(0)
    return scale(reflected, reflectance), scale(passed, transmittance), above, beyond, through


def bands_most(packed: Packed) -> int:
    """Return the most bands that paths may part into, see `optics.dispersion`."""
    return BANDS if (packed.materials["flags"] & MATERIAL_DISPERSIVE != 0).any() else 1


def samples_most(packed: Packed) -> int:
    """Return the most paths that a branch at a pixel's surface may become."""
    materials = packed.materials
    textured = materials["metallic_roughness_texture"]["texture"] >= 0
    rough = (materials["roughness"] > 0.0) & (
        (materials["flags"] & MATERIAL_TRANSMITS != 0)
        | (materials["roughness"] ** 2 < NARROW_ALPHA)
        | textured
    )
    rough |= materials["flags"] & MATERIAL_ANISOTROPIC != 0
    return ROUGH_SAMPLES if rough.any() else 1


@jit
def facet_numbers(key, dimension, pass_index, seed):
    """Return three float32 random numbers of [0, 1) for an event of a path.

    A lattice (Roberts 2018) even over the samples, in another order and differently shifted for each event.
    dimension  uint32, 256 times the sample, and the event
    """
    rate_y, rate_z = LATTICE
    event, k = dimension & u32(255), dimension >> u32(8)
    k = k * (u32(2) * event + u32(1)) & u32(ROUGH_SAMPLES - 1)
    u1, u2, u3, _ = random4(key, event, pass_index, seed)
    u1 += f32(k) * f32(1.0 / ROUGH_SAMPLES)
    u2 += f32(k) * f32(rate_y)
    u3 += f32(k) * f32(rate_z)
    return u1 - f32(math.floor(u1)), u2 - f32(math.floor(u2)), u3 - f32(math.floor(u3))


@jit
def lobe_numbers(view, key, k, count, sparse):
    """Return two float32 random numbers of [0, 1) for path `k` of `count` from a pixel's lobe.

    A lattice along the Morton curve, on which each aligned square of pixels is one stretch, shifted anew in
    each pass: even over what a filter averages.
    sparse  one pixel of 2 x 2 has paths
    """
    u1, u2, _, _ = random4(u32(0) if view.columns > u32(0) else key, u32(_LOBES), view.pass_index, view.seed)
    row = u32(k)
    if view.columns > u32(0):
        along = _spread_bits(key % view.columns) | _spread_bits(key // view.columns) << u32(1)
        row += (along >> u32(2) if sparse else along) * u32(count)
    return _fraction(u1, row * u32(_STEPS[0])), _fraction(u2, row * u32(_STEPS[1]))


@jit
def _spread_bits(x):
    """The lower 16 bits of a uint32 with a 0 before each."""
    x = x & u32(0xFFFF)
    x = (x | x << u32(8)) & u32(0x00FF00FF)
    x = (x | x << u32(4)) & u32(0x0F0F0F0F)
    x = (x | x << u32(2)) & u32(0x33333333)
    return (x | x << u32(1)) & u32(0x55555555)


@jit
def _fraction(start, steps):
    """start + steps / 2^32 modulo 1, float32 below 1; steps: uint32."""
    sum_ = u32(start * f32(2.0**24)) + (u32(steps) >> u32(8))
    return f32(sum_ & u32(0xFFFFFF)) * f32(2.0**-24)
