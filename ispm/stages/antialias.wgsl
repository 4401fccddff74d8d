// Edges supersampled: each of a pixel's four samples takes the light of the pixel among 3 x 3 that shows
// its surface, or of the nearest one among 7 x 7; if none does, what the surface glows with. Geometry is
// sampled four times, shading once.
// Source: Chajdas, McGuire and Luebke, Subpixel Reconstruction Antialiasing, I3D 2011.
// include stages/camera.wgsl
// include optics/sampling.wgsl
// include optics/records.wgsl

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var sample_ids: texture_multisampled_2d<u32>;
@group(0) @binding(2) var sample_depth: texture_depth_multisampled_2d;
@group(0) @binding(3) var ids: texture_2d<u32>;
@group(0) @binding(4) var normals: texture_2d<u32>;
@group(0) @binding(5) var points: texture_2d<u32>;
@group(0) @binding(18) var depth: texture_2d<f32>;
@group(0) @binding(6) var direct_in: texture_2d<f32>;
@group(0) @binding(7) var indirect_in: texture_2d<f32>;
@group(0) @binding(8) var emission_in: texture_2d<f32>;
@group(0) @binding(9) var<storage, read_write> edge_count: array<atomic<u32>>;
@group(0) @binding(10) var<storage, read_write> edges: array<Edge>;
@group(0) @binding(11) var<storage, read> mixed: array<Edge>;
@group(0) @binding(12) var<storage, read> listed_count: array<u32>;
@group(0) @binding(13) var direct_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(14) var indirect_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(15) var emission_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(16) var through_in: texture_2d<f32>;  // one texel where nothing shows it
@group(0) @binding(17) var through_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(19) var<storage, read> instances: array<Instance>;
@group(0) @binding(20) var<storage, read> materials: array<Material>;

struct Edge {              // a pixel whose samples see more than one surface, and its light
    direct: vec3f,
    pixel: u32,
    indirect: vec3f,
    seen: f32,             // share of the samples that see a surface
    emission: vec3f,
    spare0: u32,
    through: vec3f,        // share of the background that glass shows
    spare1: u32,
}

const SAMPLES = 4;
const WIDE = 7;            // pixels across, among which a sample finds its surface at all
const NONE = 1e30;
const LOST = -1;           // of a sample whose surface no pixel shows
const IDS = 65535u;        // that samples tell apart
const OFF_PLANE = 0.25;    // pixels that a sample may lie off its surface's plane
const SNAPPED = 0.0625;    // pixels that rasterisers move corners by at most, and so the depth of a sample

// Places of the samples in the pixel: the pattern that WebGPU's adapters share.
const SAMPLE_X = vec4f(0.375, 0.875, 0.125, 0.625);
const SAMPLE_Y = vec4f(0.125, 0.375, 0.625, 0.875);

fn short_id(pixel: vec2i) -> u32 {
    let id = textureLoad(ids, pixel, 0).x;
    return select((id - 1u) % IDS + 1u, 0u, id == 0u);
}

struct Depths {
    at: vec4f,             // depths in clip space
    mirrored: vec4f,       // likewise, on the other side of the pixel's middle line
    slack: f32,            // by which a rasteriser may have them otherwise
}

// The depths in clip space that the plane seen in a pixel has at four places on the screen, x and y, and
// at the same places with x mirrored in pixel `own`.
// A plane is linear in clip space: with its equation there, depth follows from x and y alone.
fn plane_depths(pixel: vec2i, own: vec2i, x: vec4f, y: vec4f) -> Depths {
    let position = bitcast<vec3f>(textureLoad(points, pixel, 0).xyz);
    let ng = unpack_normal(textureLoad(normals, pixel, 0).y);
    let plane = vec4f(ng, -dot(ng, position)) * camera.world_from_clip;
    let scale = vec2f(2.0, -2.0) / camera.size;
    let depths = -(plane.x * (x * scale.x - 1.0) + plane.y * (y * scale.y + 1.0) + plane.w) / plane.z;
    let across = 2.0 * (f32(own.x) + 0.5 - x);
    return Depths(depths, depths - plane.x * scale.x / plane.z * across, SNAPPED * length(plane.xy * scale / plane.z));
}

// Which of the pixels about `own` shows each sample's surface, as `aside` tells by a number: of 3 x 3 the one
// of the same id whose plane is nearest, and of these the nearest on the screen; if none does, of 7 x 7 the
// nearest of the same id, or LOST: far wires and lamps are thinner than pixels, whose centers show some of them.
fn best_pixels(own: vec2i, id: vec4u, d: vec4f) -> vec4i {
    var best = vec4i(WIDE * WIDE / 2);
    var least = vec4f(NONE);
    let x = vec4f(f32(own.x)) + SAMPLE_X;
    let y = vec4f(f32(own.y)) + SAMPLE_Y;
    let unit = select(camera.footprint * d, vec4f(camera.footprint / (camera.far - camera.near)), camera.orthographic != 0u);
    let last = vec2i(camera.size) - 1;
    for (var k = 0; k < 9; k++) {
        let pixel = own + vec2i(k % 3, k / 3) - 1;
        if (any(pixel < vec2i(0)) || any(pixel > last)) {
            continue;
        }
        let seen = short_id(pixel);
        let away = abs(x - f32(pixel.x) - 0.5) + abs(y - f32(pixel.y) - 0.5);
        var found = 0.1 * away;
        if (seen != 0u) {
            // SwiftShader interpolates a sample's depth at its place mirrored in x.
            let plane = plane_depths(pixel, own, x, y);
            let off = min(abs(plane.at - d), abs(plane.mirrored - d)) - plane.slack;
            found += max(off / unit - OFF_PLANE, vec4f(0.0));
        }
        let better = (vec4u(seen) == id) & (found < least);
        least = select(least, found, better);
        best = select(best, vec4i((k / 3 + WIDE / 2 - 1) * WIDE + k % 3 + WIDE / 2 - 1), better);
    }
    let lost = (least == vec4f(NONE)) & (id != vec4u(0u));
    if (!any(lost)) {
        return best;
    }
    for (var k = 0; k < WIDE * WIDE; k++) {
        let pixel = own + aside(k);
        if (any(pixel < vec2i(0)) || any(pixel > last)) {
            continue;
        }
        let away = abs(x - f32(pixel.x) - 0.5) + abs(y - f32(pixel.y) - 0.5);
        let better = lost & (vec4u(short_id(pixel)) == id) & (away < least);
        least = select(least, away, better);
        best = select(best, vec4i(k), better);
    }
    return select(best, vec4i(LOST), lost & (least == vec4f(NONE)));
}

// What the surface of a LOST sample glows with, cd/m2, and 1; zeros: that depends on where it is, or it does not.
fn glow_of(id: u32) -> vec4f {
    if (arrayLength(&instances) > IDS) {
        return vec4f(0.0);
    }
    let row = instances[id - 1u].material;
    let clear = materials[row].flags & (MATERIAL_MASK | MATERIAL_BLEND | MATERIAL_TRANSMITS);
    let everywhere = clear == 0u && materials[row].emission_texture.texture < 0 && materials[row].beam.x == 0.0;
    let glows = everywhere && any(materials[row].emission > vec3f(0.0));
    return select(vec4f(0.0), vec4f(materials[row].emission, 1.0), glows);
}

// How far pixel number `k` of 7 x 7 lies aside of the middle one.
fn aside(k: i32) -> vec2i {
    return vec2i(k % WIDE, k / WIDE) - WIDE / 2;
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
    let d = textureLoad(depth, own, 0).r;
    let bend = max(
        abs(textureLoad(sample_depth, own, 0) + textureLoad(sample_depth, own, 3) - 2.0 * d),
        abs(textureLoad(sample_depth, own, 1) + textureLoad(sample_depth, own, 2) - 2.0 * d),
    );
    let span = select(d, 1.0 / (camera.far - camera.near), camera.orthographic != 0u);
    return bend <= OFF_PLANE * camera.footprint * span;
}

// List the pixels on edges. They are mixed from the list, not here: few among their neighbours, they would
// leave most of the device's lanes idle.
@compute @workgroup_size(8, 8)
fn find_edges(@builtin(global_invocation_id) thread: vec3u) {
    let own = vec2i(thread.xy);
    if (any(own >= vec2i(camera.size)) || is_plain(own)) {
        return;
    }
    let slot = atomicAdd(&edge_count[0], 1u);
    if (slot < arrayLength(&edges)) {
        edges[slot].pixel = thread.y * u32(camera.size.x) + thread.x;
    }
}

const THREADS = 16384u;    // that share the list among them

fn listed_pixel(number: u32) -> vec2i {
    let width = u32(camera.size.x);
    return vec2i(vec2u(number % width, number / width));
}

// Mix the light of the listed pixels from what the picture is so far.
@compute @workgroup_size(64)
fn mix_edges(@builtin(global_invocation_id) thread: vec3u) {
    let count = min(listed_count[0], arrayLength(&edges));
    let shown = vec2i(textureDimensions(through_in));
    for (var i = thread.x; i < count; i += THREADS) {
        let own = listed_pixel(edges[i].pixel);
        let id = vec4u(sample_id(own, 0), sample_id(own, 1), sample_id(own, 2), sample_id(own, 3));
        let d = vec4f(
            textureLoad(sample_depth, own, 0), textureLoad(sample_depth, own, 1),
            textureLoad(sample_depth, own, 2), textureLoad(sample_depth, own, 3),
        );
        let best = best_pixels(own, id, d);
        var direct = vec3f(0.0);
        var indirect = vec3f(0.0);
        var emission = vec3f(0.0);
        var through = vec3f(0.0);
        var seen = 0.0;        // samples of a surface that no pixel shows have no light to cover others with
        for (var k = 0; k < SAMPLES; k++) {
            var pixel = own;
            if (best[k] == LOST) {
                let glow = glow_of(id[k]);
                emission += glow.rgb;
                seen += glow.a;
                if (glow.a > 0.0) {
                    continue;
                }
            } else {
                pixel += aside(best[k]);
            }
            direct += textureLoad(direct_in, pixel, 0).rgb;
            indirect += textureLoad(indirect_in, pixel, 0).rgb;
            emission += textureLoad(emission_in, pixel, 0).rgb;
            seen += select(0.0, 1.0, id[k] != 0u && short_id(pixel) != 0u);
            if (all(pixel < shown)) {
                through += textureLoad(through_in, pixel, 0).rgb;
            }
        }
        let share = 1.0 / f32(SAMPLES);
        edges[i].direct = share * direct;
        edges[i].indirect = share * indirect;
        edges[i].emission = share * emission;
        edges[i].through = share * through;
        edges[i].seen = share * seen;
    }
}

// Write the listed pixels, once all of them are mixed.
@compute @workgroup_size(64)
fn write_edges(@builtin(global_invocation_id) thread: vec3u) {
    let count = min(listed_count[0], arrayLength(&mixed));
    for (var i = thread.x; i < count; i += THREADS) {
        let edge = mixed[i];
        let pixel = listed_pixel(edge.pixel);
        textureStore(direct_out, pixel, vec4f(edge.direct, edge.seen));
        textureStore(indirect_out, pixel, vec4f(edge.indirect, edge.seen));
        textureStore(emission_out, pixel, vec4f(edge.emission, edge.seen));
        if (all(vec2u(pixel) < textureDimensions(through_out))) {
            textureStore(through_out, pixel, vec4f(edge.through, 1.0));
        }
    }
}

fn sample_id(own: vec2i, k: i32) -> u32 {
    return textureLoad(sample_ids, own, k).x;
}
