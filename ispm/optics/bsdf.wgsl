// The metallic-roughness surface of glTF 2.0 with KHR_materials_specular and KHR_materials_ior.
// Twin of bsdf.py. Directions leave the surface; the cosine is not included.
// Sources: glTF 2.0 specification, appendix B; GGX: Walter et al. 2007; V: Heitz, JCGT 2014.
// include optics/records.wgsl
// include optics/sampling.wgsl

const MIN_ALPHA = 1e-3;   // smoother surfaces are mirrors

struct Bsdf {
    diffuse: vec3f,        // albedo of the Lambert lobe, before it gives way to reflection
    f0: vec3f,             // reflectance of the glossy lobe along the normal
    f90: f32,              // and at grazing incidence
    alpha: f32,            // roughness^2
    dielectric_f0: f32,    // what the Lambert lobe gives way to
    dielectric_f90: f32,
}

// A material at a point: its base colour, metallic and roughness with the textures' part in them.
fn surface_bsdf(base: vec3f, metallic: f32, roughness: f32, material: Material) -> Bsdf {
    let dielectric = min(material.f0 * material.specular_color, vec3f(1.0)) * material.specular;
    return Bsdf(
        base * (1.0 - metallic),
        mix(dielectric, base, metallic),
        mix(material.specular, 1.0, metallic),
        max(roughness * roughness, MIN_ALPHA),
        max(dielectric.x, max(dielectric.y, dielectric.z)),
        material.specular,
    );
}

// D V and Fc = (1 - wo.h)^5 of the glossy lobe: f = D V (f0 + (f90 - f0) Fc). n.wo, n.wi > 0.
fn gloss(alpha: f32, n: vec3f, wo: vec3f, wi: vec3f) -> vec2f {
    let h = normalize(wo + wi);
    return vec2f(ggx(alpha, n, h) * smith(alpha, dot(n, wo), dot(n, wi)), schlick(dot(wo, h)));
}

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

// f(wo, wi) in 1/sr; zero unless both are above the shading normal's horizon.
fn eval_bsdf(b: Bsdf, n: vec3f, wo: vec3f, wi: vec3f) -> vec3f {
    if (dot(n, wo) <= 0.0 || dot(n, wi) <= 0.0) {
        return vec3f(0.0);
    }
    let g = gloss(b.alpha, n, wo, wi);
    let kept = 1.0 - mix(b.dielectric_f0, b.dielectric_f90, g.y);
    return b.diffuse * (kept / PI) + g.x * mix(b.f0, vec3f(b.f90), g.y);
}

// (D V (1 - Fc), D V Fc, Fc): f = (1 - mix(dielectric_f0, dielectric_f90, Fc)) diffuse / pi + f0 x + f90 y.
fn gloss_terms(alpha: f32, n: vec3f, wo: vec3f, wi: vec3f) -> vec3f {
    if (dot(n, wo) <= 0.0 || dot(n, wi) <= 0.0) {
        return vec3f(0.0);
    }
    let g = gloss(alpha, n, wo, wi);
    return vec3f(g.x * (1.0 - g.y), g.x * g.y, g.y);
}

// Chance that sample_bsdf draws from the glossy lobe; exactly 0 for Lambert, 1 for metal.
fn gloss_share(b: Bsdf, n: vec3f, wo: vec3f) -> f32 {
    let glossy = luminance(mix(b.f0, vec3f(b.f90), schlick(dot(n, wo))));
    let diffuse = luminance(b.diffuse) * (1.0 - b.dielectric_f0);
    return select(0.0, glossy / (glossy + diffuse), glossy > 0.0);
}

fn luminance(c: vec3f) -> f32 {
    return dot(c, vec3f(0.2126, 0.7152, 0.0722));
}

// Density of sample_bsdf's wi, 1/sr.
fn pdf_bsdf(b: Bsdf, n: vec3f, wo: vec3f, wi: vec3f) -> f32 {
    let nv = dot(n, wo);
    let nl = dot(n, wi);
    if (nv <= 0.0 || nl <= 0.0) {
        return 0.0;
    }
    let share = gloss_share(b, n, wo);
    let visible = ggx(b.alpha, n, normalize(wo + wi)) / (2.0 * (nv + sqrt(nv * nv * (1.0 - b.alpha * b.alpha) + b.alpha * b.alpha)));
    return mix(nl / PI, visible, share);
}

struct BsdfSample {
    ok: bool,              // false: absorbed, and nothing else means anything
    wi: vec3f,
    weight: vec3f,         // f cos / pdf
}

// Draw wi from one lobe and weigh it by both lobes' pdf (balance heuristic). u in [0, 1)^3.
fn sample_bsdf(b: Bsdf, n: vec3f, wo: vec3f, u: vec3f) -> BsdfSample {
    var wi = to_world(cosine_hemisphere(u.x, u.y), n);
    if (u.z < gloss_share(b, n, wo)) {
        let h = to_world(visible_normal(b.alpha, to_local(wo, n), u.x, u.y), n);
        wi = normalize(2.0 * dot(wo, h) * h - wo);
    }
    let pdf = pdf_bsdf(b, n, wo, wi);
    let weight = eval_bsdf(b, n, wo, wi) * (dot(n, wi) / select(1.0, pdf, pdf > 0.0));
    return BsdfSample(pdf > 0.0 && max(weight.x, max(weight.y, weight.z)) > 0.0, wi, weight);
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

// What shading normals do to flux that scatters from `wi` to `wo`: in towards where the photon came
// from, out where it goes; ns shading, ng geometric. Veach 1997, 5.3, clamped.
fn adjoint_factor(in_ns: f32, in_ng: f32, out_ns: f32, out_ng: f32) -> f32 {
    return clamp(abs(in_ns * out_ng) / max(abs(in_ng * out_ns), 1e-20), 0.1, 10.0);
}
