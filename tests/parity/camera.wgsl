// include stages/camera.wgsl

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var<storage, read> points: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> result: array<vec4f>;

// For each point: what the shader makes of its place on the screen.
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= arrayLength(&points)) {
        return;
    }
    let point = points[id.x].xyz;
    let clip = camera.clip_from_world * vec4f(point, 1.0);
    let ndc = clip.xyz / clip.w;
    let pixel = (ndc.xy * vec2f(0.5, -0.5) + 0.5) * camera.size;
    let ray = pixel_ray(pixel);
    result[4u * id.x] = vec4f(ray.origin, view_depth(point));
    result[4u * id.x + 1u] = vec4f(view_direction(point), pixel_footprint(view_depth(point)));
    result[4u * id.x + 2u] = vec4f(pixel, ndc.z, clip_depth(point));
    result[4u * id.x + 3u] = vec4f(ray.direction, 0.0);
}
