// Depth of what a light sees through one face of a cube; both sides of every surface cast.
// include stages/face.wgsl
// include stages/geometry.wgsl

@group(0) @binding(0) var<uniform> face: Face;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) uv: vec4f,
    @location(1) color: vec4f,
    @location(2) @interpolate(flat) instance: u32,
}

@vertex
fn vs(@location(0) position: vec3f, @builtin(instance_index) instance: u32) -> @builtin(position) vec4f {
    return clip_from_world(point_to_world(instance, position));
}

@vertex
fn vs_masked(
    @location(0) position: vec3f,
    @location(1) color: vec4f,
    @location(2) uv0: vec2f,
    @location(3) uv1: vec2f,
    @builtin(instance_index) instance: u32,
) -> Corner {
    return Corner(clip_from_world(point_to_world(instance, position)), vec4f(uv0, uv1), color, instance);
}

@fragment
fn fs_masked(c: Corner) {
    if (is_hole(base_color_at(c.uv, c.color).a, texel_key(c.clip.xy, c.instance))) {
        discard;
    }
}
