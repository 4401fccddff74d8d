"""Drawing directions by a Bsdf's lobes, and the densities with which they are drawn; terms as in bsdf.py."""

import math

import numpy as np

from ispm.optics.bsdf import (
    eval_bsdf,
    facet_reflectance,
    facet_transmittance,
    fresnel_weight,
    is_lambert,
    is_smooth,
    smooth_split,
    transmits,
    transmitting_facet,
)
from ispm.optics.facets import visible_facet, visible_pdf
from ispm.optics.jit import jit
from ispm.optics.microfacet import mirrored, refract, schlick
from ispm.optics.sampling import cosine_hemisphere, to_world
from ispm.optics.vector import add, dot, luminance, normalize, scale, sub

f32 = np.float32

_INV_PI = f32(1 / math.pi)


@jit
def gloss_share(b, n, wo):
    """Return the chance, float32, that sample_bsdf draws a facet instead of the Lambert lobe; exactly 0
    without facets, 1 without that lobe."""
    fc = schlick(dot(n, wo))
    glossy = f32(0)
    if transmits(b):
        fc = fresnel_weight(b, dot(n, wo))
        glossy = luminance(facet_transmittance(b, fc))
    glossy += luminance(facet_reflectance(b, fc))
    diffuse = luminance(b.diffuse) * (f32(1) - b.dielectric_f0)
    return glossy / (glossy + diffuse) if glossy > f32(0) else f32(0)


@jit
def reflection_chance(b, cosine):
    """Return the chance, float32, that sample_bsdf reflects at a facet met at `cosine`, else transmits."""
    if not transmits(b):
        return f32(1)
    fc = fresnel_weight(b, cosine)
    reflected = luminance(facet_reflectance(b, fc))
    both = reflected + luminance(facet_transmittance(b, fc))
    return reflected / both if both > f32(0) else f32(1)


@jit
def pdf_bsdf(b, n, wo, wi):
    """Return the density of sample_bsdf's wi, in 1/sr, where it is not one of a smooth surface's two."""
    nv, nl = dot(n, wo), dot(n, wi)
    if nv <= f32(0):
        return f32(0)
    if b.sheen > f32(0):
        return max(nl, f32(0)) * _INV_PI
    share = gloss_share(b, n, wo)
    lambert = max(nl, f32(0)) * _INV_PI * (f32(1) - share)
    if is_smooth(b) or (nl <= f32(0) and not transmits(b)):
        return lambert
    if nl > f32(0):
        h = normalize(add(wo, wi))
        return lambert + share * reflection_chance(b, dot(wo, h)) * visible_pdf(b, n, wo, h)
    h, spread = transmitting_facet(b, n, wo, wi)
    return share * (f32(1) - reflection_chance(b, dot(wo, h))) * visible_pdf(b, n, wo, h) * spread


@jit
def sample_bsdf(b, n, ng, wo, u1, u2, u3, radiance):
    """Draw wi from one lobe and weigh it by the pdf of all that spread (balance heuristic).

    radiance  refracted light takes the factor 1 / eta^2: True on paths from the eye, False for photons
    ->        (ok, wi, weight, specular): weight = f cos / pdf, RGB, of a smooth surface's own directions
              (specular) reflectance or transmittance over their chance; wi.ng < 0: transmitted;
              not ok: absorbed, and the rest means nothing
    """
    if is_lambert(b):  # nothing for it to give way to, so that the weight is its albedo
        wi = to_world(cosine_hemisphere(u1, u2), n)
        return (
            dot(ng, wi) > f32(0) and b.diffuse[0] + b.diffuse[1] + b.diffuse[2] > f32(0),
            wi,
            b.diffuse,
            False,
        )
    share = gloss_share(b, n, wo) if b.sheen == f32(0) else f32(0)
    ok = True
    if u3 >= share:
        wi = to_world(cosine_hemisphere(u1, u2), n)
    elif is_smooth(b):
        return _sample_smooth(b, n, ng, wo, u3 / share, share, radiance)
    else:
        ok, wi = _sample_facet(b, n, wo, u1, u2, u3 / share)
    pdf = pdf_bsdf(b, n, wo, wi)
    if not ok or pdf <= f32(0):
        return False, wi, (f32(0), f32(0), f32(0)), False
    weight = scale(abs(dot(n, wi)) / pdf, eval_bsdf(b, n, ng, wo, wi))
    if radiance and dot(n, wi) < f32(0):
        weight = scale(_compression(b), weight)
    return max(weight[0], max(weight[1], weight[2])) > f32(0), wi, weight, False


@jit
def _compression(b):
    """What refraction multiplies radiance by, float32: 1 / eta^2; 1 for a sheet."""
    return f32(1) if b.thin > f32(0) else f32(1) / (b.eta * b.eta)


@jit
def _sample_smooth(b, n, ng, wo, u, share, radiance):
    """`sample_bsdf` of a smooth surface's own directions; u: uniform in [0, 1), share: their chance."""
    reflectance, transmittance, above, beyond, through = smooth_split(b, n, ng, wo)
    reflected, transmitted = luminance(reflectance), luminance(transmittance)
    chance = reflected / (reflected + transmitted) if transmitted > f32(0) else f32(1)
    if u < chance or not through:
        weight, wi = scale(f32(1) / (share * chance), reflectance), above
    else:
        factor = _compression(b) if radiance else f32(1)
        weight, wi = scale(factor / (share * (f32(1) - chance)), transmittance), beyond
    return max(weight[0], max(weight[1], weight[2])) > f32(0), wi, weight, True


@jit
def _sample_facet(b, n, wo, u1, u2, u3):
    """(ok, unit wi) from a facet that wo sees; not ok: it leads to the wrong side of the surface."""
    h = visible_facet(b, n, wo, u1, u2)
    above = mirrored(wo, h)
    if not transmits(b) or u3 < reflection_chance(b, dot(wo, h)):
        return dot(n, above) > f32(0), above
    if b.thin > f32(0):
        return dot(n, above) > f32(0), sub(above, scale(f32(2) * dot(n, above), n))
    through, beyond = refract(wo, h, b.eta)
    return through and dot(n, beyond) < f32(0), beyond
