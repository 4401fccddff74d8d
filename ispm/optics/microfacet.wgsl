// Facets of rough surfaces: how their normals lie, shade each other, reflect and refract. Twin of microfacet.py.
// Sources: GGX: Walter et al. 2007; V: Heitz, JCGT 2014.
// include optics/sampling.wgsl

// GGX distribution of normals. The sine comes from n x h: 1 - (n.h)^2 would lose it for small alpha.
fn ggx(alpha: f32, n: vec3f, h: vec3f) -> f32 {
    let nxh = cross(n, h);
    let nh = dot(n, h);
    let k = alpha / (alpha * alpha * nh * nh + dot(nxh, nxh));
    return k * k / PI;
}

// Height-correlated Smith: G / (4 n.wo n.wi).
fn smith(alpha: f32, nv: f32, nl: f32) -> f32 {
    let a2 = alpha * alpha;
    return 0.5 / (nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2));
}

fn schlick(cosine: f32) -> f32 {
    let m = clamp(1.0 - cosine, 0.0, 1.0);
    return m * m * m * m * m;
}

// Share of unpolarised light that a boundary reflects; 1 at total internal reflection. The cosine is this
// side's; eta: index of the other side over this one's.
fn fresnel_dielectric(cosine: f32, eta: f32) -> f32 {
    let square = eta * eta - 1.0 + cosine * cosine;    // (eta cos)^2 of the other side
    if (square <= 0.0) {
        return 1.0;
    }
    let other = sqrt(square);
    let s = (cosine - other) / (cosine + other);
    let p = (eta * eta * cosine - other) / (eta * eta * cosine + other);
    return 0.5 * (s * s + p * p);
}

fn mirrored(wo: vec3f, h: vec3f) -> vec3f {
    return normalize(2.0 * dot(wo, h) * h - wo);
}

struct Refracted {
    through: bool,
    wi: vec3f,
}

// wi beyond the surface of normal h, which is on wo's side; Snell's law.
fn refract(wo: vec3f, h: vec3f, eta: f32) -> Refracted {
    let c = dot(wo, h);
    let square = eta * eta - 1.0 + c * c;
    if (square <= 0.0) {
        return Refracted(false, wo);
    }
    return Refracted(true, normalize((c - sqrt(square)) * h - wo));
}

// A GGX normal as seen from wo, both local. Dupuy and Benyoub, Sampling Visible GGX Normals with
// Spherical Caps, HPG 2023.
fn visible_normal(alpha: f32, wo: vec3f, u1: f32, u2: f32) -> vec3f {
    let stretched = normalize(vec3f(alpha * wo.xy, wo.z));
    let phi = 2.0 * PI * u1;
    let z = (1.0 - u2) * (1.0 + stretched.z) - stretched.z;
    let r = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
    let h = vec3f(r * cos(phi), r * sin(phi), z) + stretched;
    return normalize(vec3f(alpha * h.xy, h.z));
}
