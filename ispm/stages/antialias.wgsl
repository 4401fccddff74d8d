// Edges supersampled: each of a pixel's four samples takes the light of the pixel among 3 x 3 that shows
// its surface. Geometry is sampled four times, shading once.
// Source: Chajdas, McGuire and Luebke, Subpixel Reconstruction Antialiasing, I3D 2011.
// include stages/camera.wgsl
// include optics/sampling.wgsl

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var sample_ids: texture_multisampled_2d<u32>;
@group(0) @binding(2) var sample_depth: texture_depth_multisampled_2d;
@group(0) @binding(3) var ids: texture_2d<u32>;
@group(0) @binding(4) var normals: texture_2d<f32>;
@group(0) @binding(5) var depth: texture_depth_2d;
@group(0) @binding(6) var direct: texture_2d<f32>;
@group(0) @binding(7) var indirect: texture_2d<f32>;
@group(0) @binding(8) var emission: texture_2d<f32>;
@group(0) @binding(9) var direct_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(10) var indirect_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(11) var emission_out: texture_storage_2d<rgba32float, write>;

const SAMPLES = 4;
const OFF_PLANE = 0.25;    // pixels that a sample may lie off its surface's plane

// Places of the samples in the pixel: the pattern that WebGPU's adapters share.
fn sample_place(k: i32) -> vec2f {
    let x = array(0.375, 0.875, 0.125, 0.625);
    return vec2f(x[k], 0.125 + 0.25 * f32(k));
}

fn short_id(pixel: vec2i) -> u32 {
    let id = textureLoad(ids, pixel, 0).x;
    return select((id - 1u) % 65535u + 1u, 0u, id == 0u);
}

// How badly a pixel stands in for a sample: distance from the pixel's plane and along it, in pixels.
fn mismatch(pixel: vec2i, id: u32, d: f32, place: vec2f) -> f32 {
    if (short_id(pixel) != id) {
        return 1e30;
    }
    let away = length(place - vec2f(pixel) - 0.5);
    if (id == 0u) {
        return away;
    }
    let position = world_position(vec2f(pixel) + 0.5, textureLoad(depth, pixel, 0));
    let ng = octahedral_decode(textureLoad(normals, pixel, 0).zw);
    let off = dot(ng, world_position(place, d) - position) / pixel_footprint(linear_depth(d));
    return max(abs(off) - OFF_PLANE, 0.0) + 0.1 * away;
}

fn best_pixel(own: vec2i, id: u32, d: f32, place: vec2f) -> vec2i {
    var best = own;
    var least = mismatch(own, id, d, place);
    if (least < OFF_PLANE) {
        return own;
    }
    let last = vec2i(camera.size) - 1;
    for (var k = 0; k < 9; k++) {
        let pixel = own + vec2i(k % 3, k / 3) - 1;
        if (any(pixel < vec2i(0)) || any(pixel > last)) {
            continue;
        }
        let found = mismatch(pixel, id, d, place);
        if (found < least) {
            least = found;
            best = pixel;
        }
    }
    return best;
}

// Whether all samples lie on the pixel's own plane. In clip space the depth of a plane is linear over the
// screen, and the samples lie two and two opposite about the pixel's centre.
fn is_plain(own: vec2i) -> bool {
    let id = short_id(own);
    for (var k = 0; k < SAMPLES; k++) {
        if (textureLoad(sample_ids, own, k).x != id) {
            return false;
        }
    }
    let d = textureLoad(depth, own, 0);
    let bend = max(
        abs(textureLoad(sample_depth, own, 0) + textureLoad(sample_depth, own, 3) - 2.0 * d),
        abs(textureLoad(sample_depth, own, 1) + textureLoad(sample_depth, own, 2) - 2.0 * d),
    );
    let span = select(d, 1.0 / (camera.far - camera.near), camera.orthographic != 0u);
    return bend <= OFF_PLANE * camera.footprint * span;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) thread: vec3u) {
    let own = vec2i(thread.xy);
    if (any(own >= vec2i(camera.size))) {
        return;
    }
    if (is_plain(own)) {
        let seen = f32(textureLoad(ids, own, 0).x != 0u);
        textureStore(direct_out, own, vec4f(textureLoad(direct, own, 0).rgb, seen));
        textureStore(indirect_out, own, vec4f(textureLoad(indirect, own, 0).rgb, seen));
        textureStore(emission_out, own, vec4f(textureLoad(emission, own, 0).rgb, seen));
        return;
    }
    var sums = array(vec3f(0.0), vec3f(0.0), vec3f(0.0));
    var seen = 0.0;
    for (var k = 0; k < SAMPLES; k++) {
        let id = textureLoad(sample_ids, own, k).x;
        let d = textureLoad(sample_depth, own, k);
        let pixel = best_pixel(own, id, d, vec2f(own) + sample_place(k));
        sums[0] += textureLoad(direct, pixel, 0).rgb;
        sums[1] += textureLoad(indirect, pixel, 0).rgb;
        sums[2] += textureLoad(emission, pixel, 0).rgb;
        seen += f32(id != 0u);
    }
    let share = 1.0 / f32(SAMPLES);
    textureStore(direct_out, own, vec4f(share * sums[0], share * seen));
    textureStore(indirect_out, own, vec4f(share * sums[1], share * seen));
    textureStore(emission_out, own, vec4f(share * sums[2], share * seen));
}
