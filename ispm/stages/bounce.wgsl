// The first hits of a light's photons: which triangle each texel of a cube face sees, and where on it.
// include stages/face.wgsl
// include stages/geometry.wgsl

@group(0) @binding(0) var<uniform> face: Face;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) ids: vec2u,   // instance, primitive
    @location(1) barycentrics: vec2f,
    @location(2) to_light: vec3f,
}

struct MaskedCorner {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) ids: vec2u,
    @location(1) barycentrics: vec2f,
    @location(2) to_light: vec3f,
    @location(3) uv: vec4f,
    @location(4) color: vec4f,
}

fn barycentrics_of(corner: u32) -> vec2f {
    return vec2f(f32(corner % 3u == 1u), f32(corner % 3u == 2u));
}

fn texel(ids: vec2u, barycentrics: vec2f) -> vec4u {
    let u = clamp(barycentrics.x, 0.0, 1.0);
    let v = clamp(barycentrics.y, 0.0, 1.0 - u);
    return vec4u(ids, bitcast<u32>(u), bitcast<u32>(v));
}

@vertex
fn vs(@builtin(vertex_index) corner: u32, @builtin(instance_index) instance: u32) -> Corner {
    let position = point_to_world(instance, vertices[vertex_row(instance, corner)].position);
    return Corner(
        clip_from_world(position), vec2u(instance, corner / 3u), barycentrics_of(corner), face.position - position,
    );
}

@fragment
fn fs(c: Corner) -> @location(0) vec4u {
    if (length(c.to_light) > face.range) {
        discard;
    }
    return texel(c.ids, c.barycentrics);
}

@vertex
fn vs_masked(@builtin(vertex_index) corner: u32, @builtin(instance_index) instance: u32) -> MaskedCorner {
    let row = vertex_row(instance, corner);
    let position = point_to_world(instance, vertices[row].position);
    return MaskedCorner(
        clip_from_world(position), vec2u(instance, corner / 3u), barycentrics_of(corner), face.position - position,
        vec4f(vertices[row].uv0, vertices[row].uv1), unpack4x8unorm(vertices[row].color),
    );
}

// Opacity as rays meet it, in its finest texels: averaged over a map's coarse texels it would be that of
// whatever else is in the picture.
fn opacity_at(c: MaskedCorner) -> f32 {
    let uv = texture_uv(material.base_color_texture, c.uv);
    return material.base_color.a * c.color.a * textureSampleLevel(base_color_map, base_color_sampler, uv, 0.0).a;
}

@fragment
fn fs_masked(c: MaskedCorner) -> @location(0) vec4u {
    let hole = is_hole(opacity_at(c), texel_key(c.clip.xy, c.ids.x));
    if (hole || length(c.to_light) > face.range) {
        discard;
    }
    return texel(c.ids, c.barycentrics);
}
