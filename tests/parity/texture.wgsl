// What tests/parity/test_texture.py runs on the GPU.
@group(0) @binding(0) var picture: texture_2d<f32>;
@group(0) @binding(1) var filtering: sampler;
@group(0) @binding(2) var<storage, read> lookups: array<vec4f>;   // u, v, level
@group(0) @binding(3) var<storage, read_write> result: array<vec4f>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x < arrayLength(&lookups)) {
        let at = lookups[id.x];
        result[id.x] = textureSampleLevel(picture, filtering, at.xy, at.z);
    }
}
