// Depth of what a light sees through one face of its map; both sides of every surface cast.
// include stages/geometry.wgsl

struct View {
    clip_from_local: mat4x4f,   // local: from the origin, along the world's axes
    origin: vec3f,
    pass_index: u32,
}

@group(0) @binding(0) var<uniform> view: View;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) uv: vec4f,
    @location(1) color: vec4f,
    @location(2) @interpolate(flat) instance: u32,
}

fn clip_from_world(position: vec3f) -> vec4f {
    return view.clip_from_local * vec4f(position - view.origin, 1.0);
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
    let texel = vec2u(c.clip.xy);
    let key = vec4u(texel.x | texel.y << 16u, 0u, c.instance, view.pass_index);
    if (is_hole(base_color_at(c.uv, c.color).a, key)) {
        discard;
    }
}
