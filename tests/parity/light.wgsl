// What tests/parity/test_light.py runs on the GPU.
// include optics/light.wgsl

@group(0) @binding(0) var<storage, read> lights: array<Light>;
@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> result: array<array<vec4f, 2>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= arrayLength(&lights)) { return; }
    let arriving = light_arriving(lights[id.x], positions[id.x].xyz);
    result[id.x][0] = vec4f(arriving.irradiance, arriving.distance);
    result[id.x][1] = vec4f(arriving.wi, 0.0);
}
