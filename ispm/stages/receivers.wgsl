// Receivers: the surfaces whose incident light is estimated, and what becomes of it at a pixel.
// include optics/records.wgsl
// include stages/material.wgsl

// Alpha of the lobe by which a receiver weighs light, 0: none; TAKES_NONE where none is shown. Smooth surfaces and
// narrow lobes need the Fresnel term, for their diffuse part.
fn receiver_alpha(b: Bsdf, flags: u32) -> f32 {
    if (!has_finite(b) && (flags & MATERIAL_SHEEN) == 0u) {
        return TAKES_NONE;
    }
    let glossy = max(b.f90, b.dielectric_f90) > 0.0 || max(b.f0.x, max(b.f0.y, b.f0.z)) > 0.0;
    let counts = glossy && has_finite(b) && (flags & MATERIAL_UNLIT) == 0u;
    return select(0.0, max(b.alpha, MIN_ALPHA), counts);
}

struct Incident {          // sums over photons, see `estimators`
    irradiance: vec3f,
    fresnel: vec3f,        // irradiance weighted by Fc = (1 - wo.h)^5
    gloss: vec3f,          // weighted by D V (1 - Fc)
    grazing: vec3f,        // weighted by D V Fc
}

// Reflected radiance: f summed over photons, with the lobe's colors put in afterwards. What is mirrored or
// comes through is left to eye paths.
fn reflect_incident(b: Bsdf, i: Incident) -> vec3f {
    let kept = (1.0 - b.dielectric_f0) * i.irradiance - (b.dielectric_f90 - b.dielectric_f0) * i.fresnel;
    let diffuse = b.diffuse / PI * kept;
    if (is_smooth(b) || transmits(b)) {
        return max(diffuse, vec3f(0.0));
    }
    return max(diffuse + b.f0 * i.gloss + b.f90 * i.grazing, vec3f(0.0));
}
