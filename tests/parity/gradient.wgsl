// What tests/parity/test_gradient.py runs on the GPU: light as it is on a surface that is turned.
// include optics/gradient.wgsl

@group(0) @binding(0) var<storage, read> given: array<array<vec4f, 6>>;   // light, gradient, normals n and m
@group(0) @binding(1) var<storage, read_write> result: array<vec4f>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= arrayLength(&given)) { return; }
    let row = given[id.x];
    let slope = pack_slope(row[0].rgb, row[1].rgb, row[2].rgb, row[3].rgb, row[4].xyz);
    result[id.x] = vec4f(turned_light(row[0].rgb, slope, row[4].xyz, row[5].xyz), 0.0);
}
