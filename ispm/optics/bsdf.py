"""The metallic-roughness surface of glTF 2.0 with KHR_materials_specular, _ior, _transmission and _volume.

Twin of bsdf.wgsl, with bsdf_sampling.py. Directions leave the surface, unit, tuples of three float32; the
cosine is not included. `wo` is known, `wi` is evaluated or sampled: the eye's `wo` is towards the eye, a
photon's points back along its flight. Both normals, shading n and geometric ng, are on wo's side. `b` is a
Bsdf, `fc` the weight Fc of `fresnel_weight`.

Opaque surfaces take Schlick's Fresnel term, transmitting ones the exact one. glTF weighs the Lambert lobe by
the half vector's, which gains energy: white plastic reflects 1.4 times the light from 3 degrees above it.
Sources: glTF 2.0 specification, appendix B; GGX and rough refraction: Walter et al. 2007; V: Heitz, JCGT
2014.
"""

import math
from typing import NamedTuple

import numpy as np

from ispm.optics.facets import (
    NO_ANISOTROPY,
    Anisotropy,
    facet_lobe,
    is_anisotropic,
)
from ispm.optics.jit import jit
from ispm.optics.microfacet import fresnel_dielectric, ggx, mirrored, refract, schlick, smith
from ispm.optics.sheen import eval_sheen
from ispm.optics.vector import Vector, add, dot, normalize, scale, sub

f32 = np.float32

MIN_ALPHA = f32(1e-3)  # smoother surfaces are mirrors or clear
NARROW_ALPHA = f32(0.25)  # opaque lobes below it reflect to eye paths alone: too narrow for photons
MIN_CONTRAST = f32(1e-2)  # |index - 1| below which facets bend nothing, and rough solids count as clear
_INV_PI = f32(1 / math.pi)


class Dielectric(NamedTuple):
    """What a material is where it is not metal; fields as MATERIAL has them. thin: a sheet without inside."""

    f0: np.float32
    specular_color: Vector
    specular: np.float32
    ior: np.float32
    thin: bool


class Bsdf(NamedTuple):
    """How a surface scatters at a point; fields as in bsdf.wgsl, but for the last two; float32, vectors RGB.

    diffuse  albedo of the Lambert lobe, before it gives way to reflection
    f0       reflectance of the facets along their normal
    f90      and at grazing incidence
    alpha    roughness^2; exactly 0: smooth, reflection and transmission go one way each
    dielectric_f0, dielectric_f90   the reflection that the Lambert lobe and transmission give way to
    tint     transmittance before it does; 0: opaque
    eta      index of refraction of the other side over this one's
    thin     1: a sheet without inside, light goes straight through; 0: a solid's boundary
    sheen    roughness of fibers of the color f0 that stand in place of all else, see `sheen_bsdf`; 0: none
    anisotropy   the direction in which facets are wider than alpha, of opaque surfaces
    """

    diffuse: Vector
    f0: Vector
    f90: np.float32
    alpha: np.float32
    dielectric_f0: np.float32
    dielectric_f90: np.float32
    tint: Vector
    eta: np.float32
    thin: np.float32
    sheen: np.float32
    anisotropy: Anisotropy


@jit
def surface_bsdf(base, metallic, roughness, transmission, dielectric, entering):
    """Return the Bsdf of a material at a point.

    base, metallic, roughness, transmission  RGB and float32 factors with the textures' part in them
    dielectric  a Dielectric;  entering  whether wo is outside the solid
    From within a solid its share of glass is clear glass, and the rest is matte up to the boundary: a Lambert
    lobe beside total reflection would make light.
    """
    f0, specular_color, specular, ior, thin = dielectric
    opaque = (f32(1) - metallic) * (f32(1) - transmission)
    clear = (f32(1) - metallic) * transmission
    glass = transmission if clear > f32(0) and not (thin or entering) else f32(1)
    r = min(f0 * specular_color[0], f32(1)) * specular
    g = min(f0 * specular_color[1], f32(1)) * specular
    b = min(f0 * specular_color[2], f32(1)) * specular
    alpha = roughness * roughness
    bends_nothing = clear > f32(0) and not thin and abs(ior - f32(1)) < MIN_CONTRAST
    return Bsdf(
        scale(opaque, base),
        (
            _mix(glass * r, base[0], metallic),
            _mix(glass * g, base[1], metallic),
            _mix(glass * b, base[2], metallic),
        ),
        _mix(glass * specular, f32(1), metallic),
        f32(0) if alpha < MIN_ALPHA or bends_nothing else alpha,
        max(r, max(g, b)),
        specular,
        scale(clear, base),
        ior if thin or entering else f32(1) / ior,
        f32(1) if thin else f32(0),
        f32(0),
        NO_ANISOTROPY,
    )


@jit
def _mix(a, b, t):
    """Return a for t = 0, b for t = 1, and between them what lies between, float32."""
    return a * (f32(1) - t) + b * t


@jit
def transmits(b):
    """Return whether a Bsdf lets some light through, a bool."""
    return b.tint[0] + b.tint[1] + b.tint[2] > f32(0)


@jit
def is_within(b):
    """Return whether a Bsdf is that of a solid which lets light through, seen from within, a bool."""
    return transmits(b) and b.thin == f32(0) and b.eta < f32(1)


@jit
def reflection_over_lambert(b):
    """Return the reflectance along the normal and at grazing incidence that a Bsdf's Lambert lobe gives way
    to: that of a dielectric, from within glass none, see `surface_bsdf`."""
    return (f32(0), f32(0)) if is_within(b) else (b.dielectric_f0, b.dielectric_f90)


@jit
def is_lambert(b):
    """Return whether a Bsdf has no facets, and none that its Lambert lobe gives way to, a bool."""
    facets = b.f0[0] + b.f0[1] + b.f0[2] + b.f90 + b.dielectric_f0 + b.dielectric_f90
    return facets == f32(0) and not transmits(b)


@jit
def is_smooth(b):
    """Return whether a Bsdf reflects and transmits in one direction each, a bool."""
    return b.alpha == f32(0)


@jit
def has_finite(b):
    """Return whether photons that arrive at a Bsdf can be seen, a bool: an opaque lobe of more than one
    direction. What rough glass shows is left to eye paths.
    """
    return (b.alpha > f32(0) and not transmits(b)) or b.diffuse[0] + b.diffuse[1] + b.diffuse[2] > f32(0)


@jit
def shows_photons(b):
    """Return whether it `has_finite` lobes of which any reflects: a black surface, as lamps have, shows none
    of the photons that arrive."""
    facets = b.f0[0] + b.f0[1] + b.f0[2] + b.f90 > f32(0)
    return has_finite(b) and (facets or b.diffuse[0] + b.diffuse[1] + b.diffuse[2] > f32(0))


@jit
def is_gathered(b):
    """Return whether gather rays end at a surface, by its Bsdf: it is opaque, and scatters."""
    return has_finite(b) and not transmits(b)


@jit
def is_narrow(b):
    """Return whether a Bsdf is opaque and its lobe is left to eye paths, a bool: narrow, or anisotropic."""
    narrow = f32(0) < b.alpha < NARROW_ALPHA or is_anisotropic(b)
    return narrow and not is_lambert(b) and not transmits(b)


@jit
def gloss(alpha, n, wo, wi):
    """Return D V, 1/sr, and Fc = (1 - wo.h)^5 of the lobe D V (f0 + (f90 - f0) Fc). n.wo, n.wi > 0."""
    h = normalize(add(wo, wi))
    return ggx(alpha, n, h) * smith(alpha, dot(n, wo), dot(n, wi)), schlick(dot(wo, h))


@jit
def fresnel_weight(b, cosine):
    """Return Fc, float32, 0 to 1: a facet met at `cosine` reflects f0 + (f90 - f0) Fc.

    The exact one is (F - F0) / (1 - F0), so that plain glass reflects F.
    """
    if not transmits(b):
        return schlick(cosine)
    root = (b.eta - f32(1)) / (b.eta + f32(1))
    f0 = root * root
    return (fresnel_dielectric(min(cosine, f32(1)), b.eta) - f0) / (f32(1) - f0)


@jit
def facet_reflectance(b, fc):
    """Return what facets reflect, RGB."""
    return _mix(b.f0[0], b.f90, fc), _mix(b.f0[1], b.f90, fc), _mix(b.f0[2], b.f90, fc)


@jit
def facet_transmittance(b, fc):
    """Return what facets let through, RGB."""
    return scale(f32(1) - _mix(b.dielectric_f0, b.dielectric_f90, fc), b.tint)


@jit
def specular_split(b, h, wo):
    """Return what a facet of normal `h` makes of light along `wo`.

    -> (reflectance, transmittance, wi reflected, wi transmitted, whether any is transmitted), without the
    factor 1 / eta^2 of refracted radiance. Thin sheets let it straight through.
    """
    fc = fresnel_weight(b, dot(wo, h))
    through, beyond = False, scale(f32(-1), wo)
    if transmits(b):
        through = True
        if b.thin == f32(0):
            through, beyond = refract(wo, h, b.eta)
    transmittance = facet_transmittance(b, fc) if through else (f32(0), f32(0), f32(0))
    return facet_reflectance(b, fc), transmittance, mirrored(wo, h), beyond, through


@jit
def smooth_split(b, n, ng, wo):
    """Return `specular_split` of a smooth surface, with the unit directions on their sides of ng.

    Where the shading normal n leads to the wrong one, ng decides.
    """
    reflectance, transmittance, above, beyond, through = specular_split(b, n, wo)
    if through and dot(beyond, ng) >= f32(0):
        return specular_split(b, ng, wo)
    if dot(above, ng) <= f32(0):
        above = mirrored(wo, ng)
    return reflectance, transmittance, above, beyond, through


@jit
def eval_bsdf(b, n, ng, wo, wi):
    """Return f(wo, wi) in 1/sr, RGB, of the lobes that spread: a smooth surface's own count 0.

    Reflection for wi above both normals' horizons, transmission below both. Solids: the share of flux along
    wo that leaves along wi; for radiance times 1 / eta^2.
    """
    nl = dot(n, wi)
    if dot(n, wo) <= f32(0) or nl * dot(ng, wi) <= f32(0):
        return f32(0), f32(0), f32(0)
    if nl < f32(0):
        return _eval_transmission(b, n, wo, wi)
    if is_lambert(b) and b.sheen == f32(0):  # the same without what follows, which takes longer
        return scale(_INV_PI, b.diffuse)
    h = normalize(add(wo, wi))
    if b.sheen > f32(0):
        return scale(eval_sheen(b.sheen, n, wo, wi, h), b.f0)
    fc = fresnel_weight(b, dot(wo, h))
    f0, f90 = reflection_over_lambert(b)
    lambert = (f32(1) - _mix(f0, f90, fc)) * _INV_PI
    if is_smooth(b):
        return b.diffuse[0] * lambert, b.diffuse[1] * lambert, b.diffuse[2] * lambert
    dv = facet_lobe(b, n, wo, wi, h)
    return (
        b.diffuse[0] * lambert + dv * _mix(b.f0[0], b.f90, fc),
        b.diffuse[1] * lambert + dv * _mix(b.f0[1], b.f90, fc),
        b.diffuse[2] * lambert + dv * _mix(b.f0[2], b.f90, fc),
    )


@jit
def _eval_transmission(b, n, wo, wi):
    """`eval_bsdf` below the surface: D V s T, and s as `transmitting_facet` has it."""
    if is_smooth(b) or not transmits(b):
        return f32(0), f32(0), f32(0)
    h, spread = transmitting_facet(b, n, wo, wi)
    if spread <= f32(0):
        return f32(0), f32(0), f32(0)
    dvs = ggx(b.alpha, n, h) * smith(b.alpha, dot(n, wo), -dot(n, wi)) * spread
    return scale(dvs, facet_transmittance(b, fresnel_weight(b, dot(wo, h))))


@jit
def transmitting_facet(b, n, wo, wi):
    """Return the unit normal h of the facets that take wo to wi, and 4 wo.h |d omega_h / d omega_i|, float32.

    Reflecting facets have 1 for the latter. 0: there are none. Thin sheets mirror their reflection through;
    solids: Walter et al. 2007, equations 16 and 17.
    """
    if b.thin > f32(0):
        return normalize(add(wo, sub(wi, scale(f32(2) * dot(n, wi), n)))), f32(1)
    sum_ = add(wo, scale(b.eta, wi))
    square = dot(sum_, sum_)
    if square <= f32(0):
        return n, f32(0)
    h = scale((f32(1) if dot(n, sum_) > f32(0) else f32(-1)) / math.sqrt(square), sum_)
    co, ci = dot(wo, h), dot(wi, h)
    if co <= f32(0) or ci >= f32(0):
        return n, f32(0)
    return h, f32(-4) * co * ci * b.eta * b.eta / square


@jit
def gloss_terms(alpha, n, wo, wi):
    """Return (D V (1 - Fc), D V Fc, Fc), from which any color of the surface can be made afterwards:

    f = (1 - mix(dielectric_f0, dielectric_f90, Fc)) diffuse / pi + f0 first + f90 second.
    """
    if dot(n, wo) <= f32(0) or dot(n, wi) <= f32(0):
        return f32(0), f32(0), f32(0)
    dv, fc = gloss(alpha, n, wo, wi)
    return dv * (f32(1) - fc), dv * fc, fc
