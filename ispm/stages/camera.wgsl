// Where the eye is and what its pixels see. A shader that includes this binds `camera` itself:
// @group(0) @binding(0) var<uniform> camera: Camera;
// Depth in clip space is reversed: 1 at the near plane, 0 infinitely far (orthographic: at `far`).

struct Camera {
    clip_from_world: mat4x4f,   // jitter included
    world_from_clip: mat4x4f,
    eye: vec3f,
    orthographic: u32,          // 1: parallel rays along `forward`
    forward: vec3f,             // unit
    near: f32,                  // m
    size: vec2f,                // pixels
    jitter: vec2f,              // pixels that the samples lie right of and below the pixels' centres
    footprint: f32,             // a pixel's side in m: at 1 m of depth, or at any (orthographic)
    far: f32,                   // m, orthographic only
    pass_index: u32,
    spare: u32,
}

// The point at `pixel` (x right, y down; centres at .5) and a depth in clip space above 0.
fn world_position(pixel: vec2f, depth: f32) -> vec3f {
    let ndc = vec2f(2.0, -2.0) * pixel / camera.size + vec2f(-1.0, 1.0);
    let world = camera.world_from_clip * vec4f(ndc, depth, 1.0);
    return world.xyz / world.w;
}

// wo: the unit vector from `position` towards the eye.
fn view_direction(position: vec3f) -> vec3f {
    if (camera.orthographic != 0u) {
        return -camera.forward;
    }
    return normalize(camera.eye - position);
}

// Distance along the view axis in m, of a depth in clip space.
fn linear_depth(depth: f32) -> f32 {
    if (camera.orthographic != 0u) {
        return camera.far - depth * (camera.far - camera.near);
    }
    return camera.near / depth;
}

// Side in m of what a pixel covers at a linear depth, seen face on.
fn pixel_footprint(distance: f32) -> f32 {
    return camera.footprint * select(distance, 1.0, camera.orthographic != 0u);
}
