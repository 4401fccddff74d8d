// The metallic-roughness surface of glTF 2.0 with KHR_materials_specular, _ior, _transmission and _volume.
// Twin of bsdf.py, which says more. Directions leave the surface; the cosine is not included. Both normals,
// shading n and geometric ng, are on wo's side.
// Sources: glTF 2.0 specification, appendix B; GGX and rough refraction: Walter et al. 2007; V: Heitz, JCGT 2014.
// include optics/records.wgsl
// include optics/sampling.wgsl
// include optics/microfacet.wgsl

const MIN_ALPHA = 1e-3;      // smoother surfaces are mirrors or clear
const NARROW_ALPHA = 0.25;    // opaque lobes below it reflect to eye paths alone: too narrow for photons
const MIN_CONTRAST = 1e-2;   // |index - 1| below which facets bend nothing, and rough solids count as clear

struct Bsdf {
    diffuse: vec3f,        // albedo of the Lambert lobe, before it gives way to reflection
    f0: vec3f,             // reflectance of the facets along their normal
    f90: f32,              // and at grazing incidence
    alpha: f32,            // roughness^2; exactly 0: smooth, reflection and transmission go one way each
    dielectric_f0: f32,    // the reflection that the Lambert lobe and transmission give way to
    dielectric_f90: f32,
    tint: vec3f,           // transmittance before it does; 0: opaque
    eta: f32,              // index of refraction of the other side over this one's
    thin: f32,             // 1: a sheet without inside, light goes straight through; 0: a solid's boundary
}

// What textures make of a material's `specular_color` and `specular`.
struct SpecularMaps {
    color: vec3f,
    factor: f32,
}

// A material at a point: base colour, metallic, roughness and transmission with the textures' part in them;
// maps: the textures of specular reflection; entering: wo is outside the solid. From within its share of glass is
// clear glass, and the rest is matte up to the boundary: a Lambert lobe beside total reflection would make light.
fn surface_bsdf(
    base: vec3f, metallic: f32, roughness: f32, transmission: f32, material: Material, maps: SpecularMaps, entering: bool,
) -> Bsdf {
    let opaque = (1.0 - metallic) * (1.0 - transmission);
    let clear = (1.0 - metallic) * transmission;
    let specular = material.specular * maps.factor;
    let dielectric = min(material.f0 * (material.specular_color * maps.color), vec3f(1.0)) * specular;
    let thin = (material.flags & MATERIAL_THIN) != 0u;
    let alpha = roughness * roughness;
    let glass = select(1.0, transmission, (clear > 0.0) & !thin & !entering);
    let bends_nothing = (clear > 0.0) & !thin & (abs(material.ior - 1.0) < MIN_CONTRAST);  // & : no branch, see stages/face.wgsl
    return Bsdf(
        base * opaque,
        mix(glass * dielectric, base, metallic),
        mix(glass * specular, 1.0, metallic),
        select(alpha, 0.0, alpha < MIN_ALPHA || bends_nothing),
        max(dielectric.x, max(dielectric.y, dielectric.z)),
        specular,
        base * clear,
        select(1.0 / material.ior, material.ior, thin | entering),
        select(0.0, 1.0, thin),
    );
}

// Whether some light goes through.
fn transmits(b: Bsdf) -> bool {
    return b.tint.x + b.tint.y + b.tint.z > 0.0;
}

// Whether there are no facets, neither reflection nor transmission that the Lambert lobe gives way to.
fn is_lambert(b: Bsdf) -> bool {
    return b.f0.x + b.f0.y + b.f0.z + b.f90 + b.dielectric_f0 + b.dielectric_f90 == 0.0 && !transmits(b);
}

// Whether reflection and transmission go one way each.
fn is_smooth(b: Bsdf) -> bool {
    return b.alpha == 0.0;
}

// Whether photons that arrive here can be seen: a lobe of more than one direction, and opaque.
// What rough glass shows is left to eye paths.
fn has_finite(b: Bsdf) -> bool {
    return (b.alpha > 0.0 && !transmits(b)) || b.diffuse.x + b.diffuse.y + b.diffuse.z > 0.0;
}

// Whether it is opaque and its lobe is left to eye paths.
fn is_narrow(b: Bsdf) -> bool {
    return b.alpha > 0.0 && b.alpha < NARROW_ALPHA && !is_lambert(b) && !transmits(b);
}

// D V and Fc = (1 - wo.h)^5 of the glossy lobe: f = D V (f0 + (f90 - f0) Fc). n.wo, n.wi > 0.
fn gloss(alpha: f32, n: vec3f, wo: vec3f, wi: vec3f) -> vec2f {
    let h = normalize(wo + wi);
    return vec2f(ggx(alpha, n, h) * smith(alpha, dot(n, wo), dot(n, wi)), schlick(dot(wo, h)));
}

// Fc: a facet met at `cosine` reflects f0 + (f90 - f0) Fc; exact where light goes through, else Schlick's.
fn fresnel_weight(b: Bsdf, cosine: f32) -> f32 {
    if (!transmits(b)) {
        return schlick(cosine);
    }
    let root = (b.eta - 1.0) / (b.eta + 1.0);
    let f0 = root * root;
    return (fresnel_dielectric(min(cosine, 1.0), b.eta) - f0) / (1.0 - f0);
}

// What facets reflect.
fn facet_reflectance(b: Bsdf, fc: f32) -> vec3f {
    return mix(b.f0, vec3f(b.f90), fc);
}

// What they let through.
fn facet_transmittance(b: Bsdf, fc: f32) -> vec3f {
    return b.tint * (1.0 - mix(b.dielectric_f0, b.dielectric_f90, fc));
}

struct SpecularSplit {
    reflectance: vec3f,
    transmittance: vec3f,  // without the factor 1 / eta^2 of refracted radiance
    wi_reflected: vec3f,
    wi_transmitted: vec3f,
    through: bool,         // whether any is transmitted
}

// What a facet of normal h makes of light along wo. Thin sheets let it straight through.
fn specular_split(b: Bsdf, h: vec3f, wo: vec3f) -> SpecularSplit {
    let fc = fresnel_weight(b, dot(wo, h));
    var beyond = Refracted(transmits(b), -wo);
    if (beyond.through && b.thin == 0.0) {
        beyond = refract(wo, h, b.eta);
    }
    let transmittance = select(vec3f(0.0), facet_transmittance(b, fc), beyond.through);
    return SpecularSplit(facet_reflectance(b, fc), transmittance, mirrored(wo, h), beyond.wi, beyond.through);
}

// specular_split of a smooth surface, with the directions on their sides of ng.
// Where the shading normal n leads to the wrong one, ng decides.
fn smooth_split(b: Bsdf, n: vec3f, ng: vec3f, wo: vec3f) -> SpecularSplit {
    var split = specular_split(b, n, wo);
    if (split.through && dot(split.wi_transmitted, ng) >= 0.0) {
        return specular_split(b, ng, wo);
    }
    if (dot(split.wi_reflected, ng) <= 0.0) {
        split.wi_reflected = mirrored(wo, ng);
    }
    return split;
}

// f(wo, wi) in 1/sr of the lobes that spread: a smooth surface's own count 0. Reflection for wi above both
// normals' horizons, transmission below both. Solids: of flux; for radiance times 1 / eta^2.
fn eval_bsdf(b: Bsdf, n: vec3f, ng: vec3f, wo: vec3f, wi: vec3f) -> vec3f {
    let nl = dot(n, wi);
    if (dot(n, wo) <= 0.0 || nl * dot(ng, wi) <= 0.0) {
        return vec3f(0.0);
    }
    if (nl < 0.0) {
        return eval_transmission(b, n, wo, wi);
    }
    let h = normalize(wo + wi);
    let fc = fresnel_weight(b, dot(wo, h));
    let within = transmits(b) && b.thin == 0.0 && b.eta < 1.0;
    let kept = select(1.0 - mix(b.dielectric_f0, b.dielectric_f90, fc), 1.0, within);
    if (is_smooth(b)) {
        return b.diffuse * (kept / PI);
    }
    return b.diffuse * (kept / PI) + ggx(b.alpha, n, h) * smith(b.alpha, dot(n, wo), nl) * facet_reflectance(b, fc);
}

fn eval_transmission(b: Bsdf, n: vec3f, wo: vec3f, wi: vec3f) -> vec3f {
    if (is_smooth(b) || !transmits(b)) {
        return vec3f(0.0);
    }
    let facet = transmitting_facet(b, n, wo, wi);
    if (facet.w <= 0.0) {
        return vec3f(0.0);
    }
    let dvs = ggx(b.alpha, n, facet.xyz) * smith(b.alpha, dot(n, wo), -dot(n, wi)) * facet.w;
    return dvs * facet_transmittance(b, fresnel_weight(b, dot(wo, facet.xyz)));
}

// The normal h of the facets that take wo to wi, and 4 wo.h |d omega_h / d omega_i|, 0: there are none.
// Thin sheets mirror their reflection through; solids: Walter et al. 2007, equations 16 and 17.
fn transmitting_facet(b: Bsdf, n: vec3f, wo: vec3f, wi: vec3f) -> vec4f {
    if (b.thin > 0.0) {
        return vec4f(normalize(wo + wi - 2.0 * dot(n, wi) * n), 1.0);
    }
    let sum = wo + b.eta * wi;
    let square = dot(sum, sum);
    if (square <= 0.0) {
        return vec4f(n, 0.0);
    }
    let h = sum * (select(-1.0, 1.0, dot(n, sum) > 0.0) / sqrt(square));
    let co = dot(wo, h);
    let ci = dot(wi, h);
    if (co <= 0.0 || ci >= 0.0) {
        return vec4f(n, 0.0);
    }
    return vec4f(h, -4.0 * co * ci * b.eta * b.eta / square);
}

// (D V (1 - Fc), D V Fc, Fc): f = (1 - mix(dielectric_f0, dielectric_f90, Fc)) diffuse / pi + f0 x + f90 y.
fn gloss_terms(alpha: f32, n: vec3f, wo: vec3f, wi: vec3f) -> vec3f {
    if (dot(n, wo) <= 0.0 || dot(n, wi) <= 0.0) {
        return vec3f(0.0);
    }
    let g = gloss(alpha, n, wo, wi);
    return vec3f(g.x * (1.0 - g.y), g.x * g.y, g.y);
}

// gloss_terms of a photon that has scattered so many times. Narrow lobes leave those that have to eye paths,
// which do not find the others: their lights are points.
fn photon_gloss(alpha: f32, n: vec3f, wo: vec3f, wi: vec3f, bounce: u32) -> vec3f {
    let g = gloss_terms(alpha, n, wo, wi);
    return select(g, vec3f(0.0, 0.0, g.z), bounce > 0u && alpha < NARROW_ALPHA);
}

// Chance that sample_bsdf draws a facet instead of the Lambert lobe; exactly 0 without facets, 1 without
// that lobe.
fn gloss_share(b: Bsdf, n: vec3f, wo: vec3f) -> f32 {
    let fc = fresnel_weight(b, dot(n, wo));
    let glossy = luminance(facet_reflectance(b, fc)) + luminance(facet_transmittance(b, fc));
    let diffuse = luminance(b.diffuse) * (1.0 - b.dielectric_f0);
    return select(0.0, glossy / (glossy + diffuse), glossy > 0.0);
}

fn luminance(c: vec3f) -> f32 {
    return dot(c, vec3f(0.2126, 0.7152, 0.0722));
}

// Chance that sample_bsdf reflects at a facet met at `cosine`, rather than transmits.
fn reflection_chance(b: Bsdf, cosine: f32) -> f32 {
    if (!transmits(b)) {
        return 1.0;
    }
    let fc = fresnel_weight(b, cosine);
    let reflected = luminance(facet_reflectance(b, fc));
    let both = reflected + luminance(facet_transmittance(b, fc));
    return select(1.0, reflected / both, both > 0.0);
}

// Density of sample_bsdf's wi, 1/sr, where it is not one of a smooth surface's two.
fn pdf_bsdf(b: Bsdf, n: vec3f, wo: vec3f, wi: vec3f) -> f32 {
    let nv = dot(n, wo);
    let nl = dot(n, wi);
    if (nv <= 0.0) {
        return 0.0;
    }
    let share = gloss_share(b, n, wo);
    let lambert = max(nl, 0.0) / PI * (1.0 - share);
    if (is_smooth(b) || (nl <= 0.0 && !transmits(b))) {
        return lambert;
    }
    if (nl > 0.0) {
        let h = normalize(wo + wi);
        return lambert + share * reflection_chance(b, dot(wo, h)) * visible(b.alpha, n, nv, h);
    }
    let facet = transmitting_facet(b, n, wo, wi);
    return share * (1.0 - reflection_chance(b, dot(wo, facet.xyz))) * visible(b.alpha, n, nv, facet.xyz) * facet.w;
}

// Density of `visible_normal` over 4 wo.h: that of the reflected direction.
fn visible(alpha: f32, n: vec3f, nv: f32, h: vec3f) -> f32 {
    let a2 = alpha * alpha;
    return ggx(alpha, n, h) / (2.0 * (nv + sqrt(nv * nv * (1.0 - a2) + a2)));
}

struct BsdfSample {
    ok: bool,              // false: absorbed, and nothing else means anything
    wi: vec3f,             // wi.ng < 0: transmitted
    weight: vec3f,         // f cos / pdf; specular: reflectance or transmittance over its chance
    specular: bool,        // wi is one of a smooth surface's own directions
}

// Draw wi from one lobe and weigh it by the pdf of all that spread (balance heuristic). u in [0, 1)^3.
// radiance: refracted light takes the factor 1 / eta^2, true on paths from the eye.
fn sample_bsdf(b: Bsdf, n: vec3f, ng: vec3f, wo: vec3f, u: vec3f, radiance: bool) -> BsdfSample {
    var facet = Refracted(true, to_world(cosine_hemisphere(u.x, u.y), n));
    if (is_lambert(b)) {    // nothing for it to give way to, so that the weight is its albedo
        let ok = dot(ng, facet.wi) > 0.0 && b.diffuse.x + b.diffuse.y + b.diffuse.z > 0.0;
        return BsdfSample(ok, facet.wi, b.diffuse, false);
    }
    let share = gloss_share(b, n, wo);
    if (u.z < share) {
        if (is_smooth(b)) {
            return sample_smooth(b, n, ng, wo, u.z / share, share, radiance);
        }
        facet = sample_facet(b, n, wo, vec3f(u.xy, u.z / share));
    }
    let wi = facet.wi;
    let pdf = pdf_bsdf(b, n, wo, wi);
    if (!facet.through || pdf <= 0.0) {
        return BsdfSample(false, wi, vec3f(0.0), false);
    }
    let factor = select(1.0, compression(b), radiance && dot(n, wi) < 0.0);
    let weight = eval_bsdf(b, n, ng, wo, wi) * (factor * abs(dot(n, wi)) / pdf);
    return BsdfSample(max(weight.x, max(weight.y, weight.z)) > 0.0, wi, weight, false);
}

// What refraction makes of radiance: 1 / eta^2; 1 for a sheet.
fn compression(b: Bsdf) -> f32 {
    return select(1.0 / (b.eta * b.eta), 1.0, b.thin > 0.0);
}

fn sample_smooth(b: Bsdf, n: vec3f, ng: vec3f, wo: vec3f, u: f32, share: f32, radiance: bool) -> BsdfSample {
    let split = smooth_split(b, n, ng, wo);
    let reflected = luminance(split.reflectance);
    let transmitted = luminance(split.transmittance);
    let chance = select(1.0, reflected / (reflected + transmitted), transmitted > 0.0);
    var wi = split.wi_reflected;
    var weight = split.reflectance / (share * chance);
    if (u >= chance && split.through) {
        wi = split.wi_transmitted;
        weight = split.transmittance * (select(1.0, compression(b), radiance) / (share * (1.0 - chance)));
    }
    return BsdfSample(max(weight.x, max(weight.y, weight.z)) > 0.0, wi, weight, true);
}

// A direction from a facet that wo sees; through: it leads to the right side of the surface.
fn sample_facet(b: Bsdf, n: vec3f, wo: vec3f, u: vec3f) -> Refracted {
    let h = to_world(visible_normal(b.alpha, to_local(wo, n), u.x, u.y), n);
    let above = mirrored(wo, h);
    let nl = dot(n, above);
    if (!transmits(b) || u.z < reflection_chance(b, dot(wo, h))) {
        return Refracted(nl > 0.0, above);
    }
    if (b.thin > 0.0) {
        return Refracted(nl > 0.0, above - 2.0 * nl * n);
    }
    let beyond = refract(wo, h, b.eta);
    return Refracted(beyond.through && dot(n, beyond.wi) < 0.0, beyond.wi);
}

// What shading normals do to flux that scatters from `wi` to `wo`: in towards where the photon came
// from, out where it goes; ns shading, ng geometric. Veach 1997, 5.3, clamped. Twin: photons/scatter.py's.
fn adjoint_factor(in_ns: f32, in_ng: f32, out_ns: f32, out_ng: f32) -> f32 {
    return clamp(abs(in_ns * out_ng) / max(abs(in_ng * out_ns), 1e-20), 0.1, 10.0);
}
