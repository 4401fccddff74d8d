"""The metallic-roughness surface of glTF 2.0 with KHR_materials_specular and KHR_materials_ior.

Twin of bsdf.wgsl. Directions leave the surface; the cosine is not included. A Bsdf is a tuple of ten float32:
diffuse r, g, b; f0 r, g, b; f90; alpha; dielectric_f0; dielectric_f90. Directions are tuples of three.
glTF weighs the Lambert lobe by the half vector's Fresnel, which gains energy at grazing angles: a smooth
white dielectric reflects 1.4 times the light that comes in at 3 degrees above it, 1.01 at 37 degrees.
Sources: glTF 2.0 specification, appendix B; GGX: Walter et al. 2007; V: Heitz, JCGT 2014.
"""

import math

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.sampling import cosine_hemisphere, to_local, to_world
from ispm.optics.vector import add, cross, dot, luminance, normalize, scale, sub

f32 = np.float32

MIN_ALPHA = f32(1e-3)  # smoother surfaces are mirrors
_INV_PI = f32(1 / math.pi)
_TWO_PI = f32(2 * math.pi)

# Places of the scalars in a Bsdf tuple.
_F90, _ALPHA, _DIELECTRIC_F0, _DIELECTRIC_F90 = 6, 7, 8, 9


@jit
def surface_bsdf(base, metallic, roughness, f0, specular_color, specular):
    """Return the Bsdf of a material at a point.

    base, metallic, roughness     factors with the textures' part in them
    f0, specular_color, specular  as MATERIAL has them
    """
    kept = f32(1) - metallic
    r = min(f0 * specular_color[0], f32(1)) * specular
    g = min(f0 * specular_color[1], f32(1)) * specular
    b = min(f0 * specular_color[2], f32(1)) * specular
    return (
        base[0] * kept,
        base[1] * kept,
        base[2] * kept,
        _mix(r, base[0], metallic),
        _mix(g, base[1], metallic),
        _mix(b, base[2], metallic),
        _mix(specular, f32(1), metallic),
        max(roughness * roughness, MIN_ALPHA),
        max(r, max(g, b)),
        specular,
    )


@jit
def _mix(a, b, t):
    return a * (f32(1) - t) + b * t


@jit
def gloss(alpha, n, wo, wi):
    """Return D V and Fc = (1 - wo.h)^5: the glossy lobe is D V (f0 + (f90 - f0) Fc). n.wo, n.wi > 0."""
    h = normalize(add(wo, wi))
    return ggx(alpha, n, h) * smith(alpha, dot(n, wo), dot(n, wi)), schlick(dot(wo, h))


@jit
def ggx(alpha, n, h):
    """Return the GGX distribution of normals.

    The sine comes from n x h: 1 - (n.h)^2 would lose it for small alpha.
    """
    nxh = cross(n, h)
    nh = dot(n, h)
    k = alpha / (alpha * alpha * nh * nh + dot(nxh, nxh))
    return k * k * _INV_PI


@jit
def smith(alpha, nv, nl):
    """Return height-correlated Smith shadowing as G / (4 n.wo n.wi)."""
    a2 = alpha * alpha
    one_a2 = f32(1) - a2
    return f32(0.5) / (nl * math.sqrt(nv * nv * one_a2 + a2) + nv * math.sqrt(nl * nl * one_a2 + a2))


@jit
def schlick(cosine):
    """Return (1 - cosine)^5, safe against rounding."""
    m = min(max(f32(1) - cosine, f32(0)), f32(1))
    return m * m * m * m * m


@jit
def eval_bsdf(b, n, wo, wi):
    """Return f(wo, wi) in 1/sr, RGB; zero unless both are above the shading normal's horizon."""
    if dot(n, wo) <= f32(0) or dot(n, wi) <= f32(0):
        return f32(0), f32(0), f32(0)
    dv, fc = gloss(b[_ALPHA], n, wo, wi)
    lambert = (f32(1) - _mix(b[_DIELECTRIC_F0], b[_DIELECTRIC_F90], fc)) * _INV_PI
    return (
        b[0] * lambert + dv * _mix(b[3], b[_F90], fc),
        b[1] * lambert + dv * _mix(b[4], b[_F90], fc),
        b[2] * lambert + dv * _mix(b[5], b[_F90], fc),
    )


@jit
def gloss_terms(alpha, n, wo, wi):
    """Return (D V (1 - Fc), D V Fc, Fc), from which any colour of the surface can be made afterwards:

    f = (1 - mix(dielectric_f0, dielectric_f90, Fc)) diffuse / pi + f0 first + f90 second.
    """
    if dot(n, wo) <= f32(0) or dot(n, wi) <= f32(0):
        return f32(0), f32(0), f32(0)
    dv, fc = gloss(alpha, n, wo, wi)
    return dv * (f32(1) - fc), dv * fc, fc


@jit
def gloss_share(b, n, wo):
    """Return the chance that sample_bsdf draws from the glossy lobe; exactly 0 for Lambert, 1 for metal."""
    fc = schlick(dot(n, wo))
    f90 = b[_F90]
    glossy = luminance((_mix(b[3], f90, fc), _mix(b[4], f90, fc), _mix(b[5], f90, fc)))
    diffuse = luminance((b[0], b[1], b[2])) * (f32(1) - b[_DIELECTRIC_F0])
    return glossy / (glossy + diffuse) if glossy > f32(0) else f32(0)


@jit
def pdf_bsdf(b, n, wo, wi):
    """Return the density of sample_bsdf's wi, in 1/sr."""
    nv, nl = dot(n, wo), dot(n, wi)
    if nv <= f32(0) or nl <= f32(0):
        return f32(0)
    a2 = b[_ALPHA] * b[_ALPHA]
    visible = ggx(b[_ALPHA], n, normalize(add(wo, wi))) / (
        f32(2) * (nv + math.sqrt(nv * nv * (f32(1) - a2) + a2))
    )
    return _mix(nl * _INV_PI, visible, gloss_share(b, n, wo))


@jit
def sample_bsdf(b, n, wo, u1, u2, u3):
    """Draw wi from one lobe and weigh it by both lobes' pdf (balance heuristic).

    -> (ok, wi, weight): weight = f cos / pdf, RGB; not ok: absorbed, and the rest means nothing
    """
    if u3 < gloss_share(b, n, wo):
        h = to_world(visible_normal(b[_ALPHA], to_local(wo, n), u1, u2), n)
        wi = normalize(sub(scale(f32(2) * dot(wo, h), h), wo))
    else:
        wi = to_world(cosine_hemisphere(u1, u2), n)
    pdf = pdf_bsdf(b, n, wo, wi)
    if pdf <= f32(0):
        return False, wi, (f32(0), f32(0), f32(0))
    weight = scale(dot(n, wi) / pdf, eval_bsdf(b, n, wo, wi))
    return max(weight[0], max(weight[1], weight[2])) > f32(0), wi, weight


@jit
def visible_normal(alpha, wo, u1, u2):
    """Return a GGX normal as seen from `wo`, both local.

    Source: Dupuy and Benyoub, Sampling Visible GGX Normals with Spherical Caps, HPG 2023.
    """
    stretched = normalize((alpha * wo[0], alpha * wo[1], wo[2]))
    phi = _TWO_PI * u1
    z = (f32(1) - u2) * (f32(1) + stretched[2]) - stretched[2]
    r = math.sqrt(max(f32(1) - z * z, f32(0)))
    h = add((r * math.cos(phi), r * math.sin(phi), z), stretched)
    return normalize((alpha * h[0], alpha * h[1], h[2]))


@jit
def adjoint_factor(in_ns, in_ng, out_ns, out_ng):
    """Return what shading normals do to the flux of a photon that scatters, within [0.1, 10].

    in_*   cosines of the direction towards where it came from with the shading and geometric normal
    out_*  and of the direction it goes
    Source: Veach 1997, section 5.3.
    """
    factor = abs(in_ns * out_ng) / max(abs(in_ng * out_ns), f32(1e-20))
    return min(max(factor, f32(0.1)), f32(10))
