// The triangles of the scene, fetched by number, and their opacity.
// include optics/records.wgsl
// include optics/rng.wgsl

@group(0) @binding(1) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(2) var<storage, read> indices: array<u32>;
@group(0) @binding(3) var<storage, read> instances: array<Instance>;
@group(0) @binding(6) var<uniform> window: Window;
@group(1) @binding(0) var<uniform> material: Material;
@group(1) @binding(1) var base_color_map: texture_2d<f32>;
@group(1) @binding(2) var base_color_sampler: sampler;

struct MaskedVertex {      // what an alpha mask reads of a vertex, as attributes
    @location(0) position: vec3f,
    @location(1) color: vec4f,
    @location(2) uv0: vec2f,
    @location(3) uv1: vec2f,
}

fn point_to_world(i: u32, p: vec3f) -> vec3f {
    let q = vec4f(p, 1.0);
    return vec3f(dot(instances[i].world0, q), dot(instances[i].world1, q), dot(instances[i].world2, q));
}

// A direction in a surface, such as a tangent; not unit.
fn direction_to_world(i: u32, d: vec3f) -> vec3f {
    return vec3f(dot(instances[i].world0.xyz, d), dot(instances[i].world1.xyz, d), dot(instances[i].world2.xyz, d));
}

// A normal; not unit.
fn normal_to_world(i: u32, n: vec3f) -> vec3f {
    return vec3f(dot(instances[i].normal0.xyz, n), dot(instances[i].normal1.xyz, n), dot(instances[i].normal2.xyz, n));
}

// Whether the window shows a corner of an instance's triangles, counted through all triangles.
fn is_in_window(instance: u32, corner: u32) -> bool {
    return instances[instance].first_index + corner - window.first_shown < window.shown_count;
}

// The row of `vertices` that a corner is, which is in the window.
fn vertex_row(instance: u32, corner: u32) -> u32 {
    return indices[instances[instance].first_index + corner - window.first_index] - window.first_vertex;
}

// Where a texture is to be read for a vertex's two sets of coordinates, xy and zw.
fn texture_uv(slot: TextureUse, uv: vec4f) -> vec2f {
    let p = vec3f(select(uv.xy, uv.zw, slot.uv_set == 1u), 1.0);
    return vec2f(dot(slot.row0, p), dot(slot.row1, p));
}

override LEVEL_BIAS: f32 = 0.0;  // of the base color's levels

// Base color and opacity of the material at a point whose vertices have this color.
fn base_color_at(uv: vec4f, color: vec4f) -> vec4f {
    let texel = textureSampleBias(base_color_map, base_color_sampler, texture_uv(material.base_color_texture, uv), LEVEL_BIAS);
    return material.base_color * color * texel;
}

// Opacity as rays meet it, in its finest texels: averaged over coarse ones it would be that of whatever else is in
// the picture, and a mask all or nothing.
fn finest_opacity(uv: vec4f, color: vec4f) -> f32 {
    let place = texture_uv(material.base_color_texture, uv);
    return material.base_color.a * color.a * textureSampleLevel(base_color_map, base_color_sampler, place, 0.0).a;
}

const LEAST_OPACITY = 1.0 / 512.0;  // of a blended surface that the eye sees

// Whether the eye sees nothing of the material at a point whose vertices have this color. What lies behind blended
// surfaces eye paths find.
fn is_clear(uv: vec4f, color: vec4f) -> bool {
    if ((material.flags & MATERIAL_MASK) != 0u) {
        return finest_opacity(uv, color) < material.alpha_cutoff;
    }
    return base_color_at(uv, color).a < LEAST_OPACITY;
}

// Whether light passes the material where it has this opacity. `key` makes BLEND's chance: a place
// and an instance, so that surfaces one behind the other are independent.
fn is_hole(opacity: f32, key: vec4u) -> bool {
    if ((material.flags & MATERIAL_MASK) != 0u) {
        return opacity < material.alpha_cutoff;
    }
    return (material.flags & MATERIAL_BLEND) != 0u && uniform_float(pcg4d(key).x) >= opacity;
}
