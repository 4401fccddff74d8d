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

struct Ray {
    origin: vec3f,
    direction: vec3f,          // a metre along the view axis
}

// The ray that `pixel` samples (x right, y down; centres at .5).
fn pixel_ray(pixel: vec2f) -> Ray {
    let ndc = vec2f(2.0, -2.0) * pixel / camera.size + vec2f(-1.0, 1.0);
    if (camera.orthographic != 0u) {
        return Ray((camera.world_from_clip * vec4f(ndc, 1.0, 1.0)).xyz, camera.forward);
    }
    return Ray(camera.eye, (camera.world_from_clip * vec4f(ndc, 0.0, 1.0)).xyz);
}

// wo: the unit vector from `position` towards the eye.
fn view_direction(position: vec3f) -> vec3f {
    if (camera.orthographic != 0u) {
        return -camera.forward;
    }
    return normalize(camera.eye - position);
}

// Distance along the view axis in m.
fn view_depth(position: vec3f) -> f32 {
    return dot(position - camera.eye, camera.forward);
}

// Depth in clip space of a point ahead of the eye.
fn clip_depth(position: vec3f) -> f32 {
    if (camera.orthographic != 0u) {
        return (camera.far - view_depth(position)) / (camera.far - camera.near);
    }
    return camera.near / view_depth(position);
}

// Side in m of what a pixel covers at a distance along the view axis, seen face on.
fn pixel_footprint(distance: f32) -> f32 {
    return camera.footprint * select(distance, 1.0, camera.orthographic != 0u);
}
