// The first hits of a light's photons: which triangle each texel of a face sees.
// include stages/face.wgsl
// include stages/geometry.wgsl

@group(0) @binding(0) var<uniform> face: Face;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) ids: vec2u,   // instance, primitive
}

struct MaskedCorner {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) ids: vec2u,
    @location(1) uv: vec4f,
    @location(2) color: vec4f,
}

@vertex
fn vs(@builtin(vertex_index) corner: u32, @builtin(instance_index) instance: u32) -> Corner {
    let position = point_to_world(instance, vertices[vertex_row(instance, corner)].position);
    return Corner(clip_from_world(position), vec2u(instance, corner / 3u));
}

@fragment
fn fs(c: Corner) -> @location(0) vec2u {
    return c.ids;
}

@vertex
fn vs_masked(@builtin(vertex_index) corner: u32, @builtin(instance_index) instance: u32) -> MaskedCorner {
    let row = vertex_row(instance, corner);
    let position = point_to_world(instance, vertices[row].position);
    return MaskedCorner(
        clip_from_world(position), vec2u(instance, corner / 3u),
        vec4f(vertices[row].uv0, vertices[row].uv1), unpack4x8unorm(vertices[row].color),
    );
}

@fragment
fn fs_masked(c: MaskedCorner) -> @location(0) vec2u {
    if (is_hole(finest_opacity(c.uv, c.color), texel_key(c.clip.xy, c.ids.x))) {
        discard;
    }
    return c.ids;
}
