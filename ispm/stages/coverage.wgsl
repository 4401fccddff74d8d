// Which surface each of a pixel's four samples sees, and how far it is.
// include stages/camera.wgsl
// include stages/geometry.wgsl

@group(0) @binding(0) var<uniform> camera: Camera;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) instance: u32,
}

struct MaskedCorner {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) instance: u32,
    @location(1) @interpolate(perspective, sample) uv: vec4f,  // so that holes, too, are sampled four times
    @location(2) color: vec4f,
}

// Ids are told apart within 3 x 3 pixels only, so their low bits serve; 0 is nothing.
fn short_id(instance: u32) -> u32 {
    return instance % 65535u + 1u;
}

@vertex
fn vs(@location(0) position: vec3f, @builtin(instance_index) instance: u32) -> Corner {
    return Corner(camera.clip_from_world * vec4f(point_to_world(instance, position), 1.0), instance);
}

@fragment
fn fs(c: Corner) -> @location(0) u32 {
    return short_id(c.instance);
}

@vertex
fn vs_masked(v: MaskedVertex, @builtin(instance_index) instance: u32) -> MaskedCorner {
    let clip = camera.clip_from_world * vec4f(point_to_world(instance, v.position), 1.0);
    return MaskedCorner(clip, instance, vec4f(v.uv0, v.uv1), v.color);
}

@fragment
fn fs_masked(c: MaskedCorner) -> @location(0) u32 {
    if (is_clear(c.uv, c.color)) {
        discard;
    }
    return short_id(c.instance);
}
