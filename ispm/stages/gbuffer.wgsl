// Which triangle each pixel of the eye sees, and the colors there. The point and the normals come later, from the
// triangle itself: what is interpolated here is off by as much as the rasteriser snaps corners to its grid.
// include stages/camera.wgsl
// include stages/geometry.wgsl
// include stages/glow.wgsl
// include optics/sampling.wgsl

override MASKED: bool = false;     // the material has holes
override TEXTURED: bool = false;   // the material has textures

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(4) var drawn_ids: texture_2d<u32>;     // the pixels' ids, drawn before
@group(1) @binding(3) var metallic_roughness_map: texture_2d<f32>;
@group(1) @binding(4) var metallic_roughness_sampler: sampler;
@group(1) @binding(5) var normal_map: texture_2d<f32>;
@group(1) @binding(6) var normal_sampler: sampler;
@group(1) @binding(7) var emission_map: texture_2d<f32>;
@group(1) @binding(8) var emission_sampler: sampler;
@group(1) @binding(9) var transmission_map: texture_2d<f32>;
@group(1) @binding(10) var transmission_sampler: sampler;
@group(1) @binding(11) var specular_map: texture_2d<f32>;
@group(1) @binding(12) var specular_sampler: sampler;
@group(1) @binding(13) var specular_color_map: texture_2d<f32>;
@group(1) @binding(14) var specular_color_sampler: sampler;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) color: vec4f,
    @location(1) @interpolate(flat) ids: vec2u,
    @location(2) uv: vec4f,
}

struct Pixel {
    @location(0) ids: vec2u,
    @location(1) bump: vec4f,
    @location(2) base: vec4f,
    @location(3) emission: vec4f,
}

@vertex
fn vs(@builtin(vertex_index) corner: u32, @builtin(instance_index) instance: u32) -> Corner {
    let row = vertex_row(instance, corner);
    let position = point_to_world(instance, vertices[row].position);
    var uv = vec4f(0.0);
    if (TEXTURED) {
        uv = vec4f(vertices[row].uv0, vertices[row].uv1);
    }
    return Corner(
        camera.clip_from_world * vec4f(position, 1.0), unpack4x8unorm(vertices[row].color),
        vec2u(instance + 1u, corner / 3u), uv,
    );
}

// The share of its emission that a lamp sends along d, unit: 1 but for spots with a radius.
fn beam_to(instance: u32, d: vec3f) -> f32 {
    let back = direction_to_world(instance, vec3f(0.0, 0.0, 1.0));
    let cosine = -dot(back, d) / max(length(back), 1e-30);
    let edge = clamp(cosine * material.beam.x + material.beam.y, 0.0, 1.0);
    return edge * edge;
}

// The normal that the map shows, in the frame of the surface, octahedral; 0 is the surface's own.
fn bump_of(texel: vec3f) -> vec2f {
    let m = (2.0 * texel - 1.0) * vec3f(vec2f(material.normal_scale), 1.0);
    let shown = material.normal_texture.texture >= 0 && dot(m, m) > 0.0;
    return octahedral_encode(select(vec3f(0.0, 0.0, 1.0), normalize(m), shown));
}

@fragment
fn fs(c: Corner) -> Pixel {
    var base = material.base_color * c.color;
    var metallic_roughness = vec2f(material.metallic, material.roughness);
    var emission = material.emission;
    if (material.beam.x != 0.0) {
        emission *= beam_to(c.ids.x - 1u, -normalize(pixel_ray(c.clip.xy).direction));
    }
    var transmission = material.transmission;
    var bump = vec2f(0.0);
    if (TEXTURED) {
        base = base_color_at(c.uv, c.color);
        metallic_roughness *= textureSample(metallic_roughness_map, metallic_roughness_sampler, texture_uv(material.metallic_roughness_texture, c.uv)).bg;
        emission *= textureSample(emission_map, emission_sampler, texture_uv(material.emission_texture, c.uv)).rgb;
        let texel = textureSample(transmission_map, transmission_sampler, texture_uv(material.transmission_texture, c.uv));
        transmission *= select(texel.r, texel.a, (material.flags & MATERIAL_TRANSLUCENT) != 0u);
        bump = bump_of(textureSample(normal_map, normal_sampler, texture_uv(material.normal_texture, c.uv)).xyz);
    }
    if (MASKED && is_clear(c.uv, c.color)) {
        discard;
    }
    if ((material.flags & MATERIAL_UNLIT) != 0u) {
        emission = base.rgb;
        base = vec4f(0.0);
    }
    return Pixel(
        c.ids, vec4f(bump, transmission, 0.0), vec4f(base.rgb, metallic_roughness.x),
        vec4f(pack_glow(emission), metallic_roughness.y),
    );
}

// What textures make of specular color and factor where the pixel shows this triangle: a pass of its own, as
// WebGPU's 32 bytes a pixel are taken above, and most scenes have no such textures.
@fragment
fn fs_specular(c: Corner) -> @location(0) vec4f {
    let color = textureSample(specular_color_map, specular_color_sampler, texture_uv(material.specular_color_texture, c.uv)).rgb;
    let factor = textureSample(specular_map, specular_sampler, texture_uv(material.specular_texture, c.uv)).a;
    if (any(textureLoad(drawn_ids, vec2u(c.clip.xy), 0).xy != c.ids)) {
        discard;
    }
    return vec4f(color, factor);
}
