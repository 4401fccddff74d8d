// The material of a pixel as the G-buffer keeps it: in one word, 0 where nothing is, the row of its Material,
// whether its back is seen, and the share of light that it transmits, diffusely or not, with the texture's part in it.
// include optics/bsdf.wgsl

fn pack_material(row: u32, back: bool, transmission: f32) -> u32 {
    return (row + 1u) | select(0u, PIXEL_BACK, back) | (u32(round(clamp(transmission, 0.0, 1.0) * 255.0)) << 24u);
}

fn material_row(word: u32) -> u32 {
    return (word & (PIXEL_BACK - 1u)) - 1u;
}

// Whether photons are INNER there; flags: the Material's.
fn shows_inner(word: u32, flags: u32) -> bool {
    return (word & PIXEL_BACK) != 0u && (flags & MATERIAL_HAS_INNER) != 0u;
}

fn material_transmission(word: u32) -> f32 {
    return f32(word >> 24u) / 255.0;
}

// The surface in a pixel: the word above, what the G-buffer has in `base` and `specular`, and roughness. Anisotropic
// facets are left out, which eye paths light; the Lambert lobe gives way to them. So is the light that a translucent
// sheet lets through, paths/far.py. Twin: stages/pixels.py's.
fn seen_bsdf(word: u32, base: vec4f, roughness: f32, specular: vec4f, material: Material) -> Bsdf {
    let maps = SpecularMaps(specular.rgb, specular.a);
    let share = material_transmission(word);
    let translucent = (material.flags & MATERIAL_TRANSLUCENT) != 0u;
    var b = surface_bsdf(base.rgb, base.a, roughness, select(share, 0.0, translucent), material, maps, true);
    if (translucent) {
        b.diffuse *= 1.0 - select(material.transmission, share, material.transmission_texture.texture >= 0);
    }
    if ((material.flags & MATERIAL_ANISOTROPIC) != 0u) {
        b.f0 = vec3f(0.0);
        b.f90 = 0.0;
    }
    return b;
}

// What the G-buffer has in `specular`, of a material of these flags: 1 without textures.
fn seen_specular(specular: texture_2d<f32>, pixel: vec2u, flags: u32) -> vec4f {
    if ((flags & MATERIAL_SPECULAR_MAPPED) == 0u) {
        return vec4f(1.0);
    }
    return textureLoad(specular, pixel, 0);
}
