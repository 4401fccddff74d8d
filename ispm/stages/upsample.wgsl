// Incident light from low to full resolution, and the radiance the pixel's surface makes of it.
// Joint bilateral (Kopf et al. 2007), by distance from the pixel's tangent plane rather than by depth, so
// that oblique floors find their neighbours. Pixels that find none are listed for the world-space estimate.
// include stages/camera.wgsl
// include stages/receivers.wgsl

override BLOCK: u32 = 4u;
const TOO_LITTLE = 1e-3;   // sum of weights below which a pixel has found no neighbour

struct Missed {
    pixel: u32,
    low: u32,              // index of the receiver whose block the pixel lies in
    spare0: u32,
    spare1: u32,
}

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var<storage, read> materials: array<Material>;
@group(0) @binding(2) var ids: texture_2d<u32>;
@group(0) @binding(3) var normals: texture_2d<f32>;
@group(0) @binding(4) var base: texture_2d<f32>;
@group(0) @binding(5) var emission: texture_2d<f32>;
@group(0) @binding(6) var depth: texture_depth_2d;
@group(0) @binding(7) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(8) var<storage, read> light: array<vec4f>;          // four for each receiver
@group(0) @binding(9) var<storage, read_write> missed_count: array<atomic<u32>>;
@group(0) @binding(10) var<storage, read_write> missed: array<Missed>;
@group(0) @binding(11) var<storage, read_write> missed_receivers: array<Receiver>;
@group(0) @binding(12) var indirect: texture_storage_2d<rgba32float, write>;
@group(0) @binding(13) var irradiance: texture_storage_2d<rgba32float, write>;
@group(0) @binding(14) var<storage, read> missed_list: array<Missed>;
@group(0) @binding(15) var<storage, read> missed_light: array<vec4f>;

struct Surface {
    bsdf: Bsdf,
    position: vec3f,
    ng: vec3f,
    n: vec3f,
    alpha: f32,
    plane_scale: f32,      // 1 / (2 sigma^2) of the distance from the tangent plane
    footprint: f32,
}

fn surface_at(pixel: vec2u, d: f32) -> Surface {
    var s: Surface;
    let material = textureLoad(ids, pixel, 0).y;
    let color = textureLoad(base, pixel, 0);
    let packed = textureLoad(normals, pixel, 0);
    s.bsdf = surface_bsdf(color.rgb, color.a, textureLoad(emission, pixel, 0).a, materials[material]);
    s.alpha = receiver_alpha(s.bsdf, materials[material].flags);
    if ((materials[material].flags & MATERIAL_UNLIT) != 0u) {
        s.bsdf = Bsdf(vec3f(0.0), vec3f(0.0), 0.0, 1.0, 0.0, 0.0);
    }
    s.position = world_position(vec2f(pixel) + 0.5, d);
    s.n = octahedral_decode(packed.xy);
    s.ng = octahedral_decode(packed.zw);
    s.footprint = pixel_footprint(linear_depth(d)) * f32(BLOCK);
    let cosine = max(abs(dot(view_direction(s.position), s.ng)), 0.1);
    let sigma = 0.5 * s.footprint / cosine;
    s.plane_scale = 0.5 / (sigma * sigma);
    return s;
}

struct Taps {
    sums: Incident,
    weight: f32,
    gloss_weight: f32,
}

// Add receiver `at`, whose place on the screen has the weight `near`.
fn add_tap(taps: ptr<function, Taps>, s: Surface, at: vec2i, low: vec2i, near: f32) {
    if (any(at < vec2i(0)) || any(at >= low)) {
        return;
    }
    let k = u32(at.y * low.x + at.x);
    if (receivers[k].valid == 0u) {
        return;
    }
    let z = dot(s.ng, receivers[k].position - s.position);
    var facing = max(dot(s.ng, receivers[k].ng), 0.0);
    facing *= facing;
    facing *= facing;
    facing *= facing;
    let w = near * facing * exp(-z * z * s.plane_scale);
    (*taps).sums.irradiance += w * light[4u * k].rgb;
    (*taps).weight += w;
    if (s.alpha > 0.0 && receivers[k].alpha > 0.0) {
        let g = w * max(1.0 - 4.0 * abs(s.alpha - receivers[k].alpha), 1e-3);
        (*taps).sums.fresnel += g * light[4u * k + 1u].rgb;
        (*taps).sums.gloss += g * light[4u * k + 2u].rgb;
        (*taps).sums.grazing += g * light[4u * k + 3u].rgb;
        (*taps).gloss_weight += g;
    }
}

fn mean_of(taps: Taps) -> Incident {
    let w = 1.0 / max(taps.weight, 1e-20);
    let g = select(0.0, 1.0 / taps.gloss_weight, taps.gloss_weight > 0.0);
    return Incident(w * taps.sums.irradiance, g * taps.sums.fresnel, g * taps.sums.gloss, g * taps.sums.grazing);
}

fn write_out(pixel: vec2u, b: Bsdf, i: Incident) {
    textureStore(indirect, pixel, vec4f(reflect_incident(b, i), 1.0));
    textureStore(irradiance, pixel, vec4f(i.irradiance, 1.0));
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let size = vec2u(camera.size);
    if (any(id.xy >= size)) {
        return;
    }
    let d = textureLoad(depth, id.xy, 0);
    if (d == 0.0) {
        textureStore(indirect, id.xy, vec4f(0.0));
        textureStore(irradiance, id.xy, vec4f(0.0));
        return;
    }
    let s = surface_at(id.xy, d);
    let low = vec2i((size + BLOCK - 1u) / BLOCK);
    let place = (vec2f(id.xy) + 0.5) / f32(BLOCK) - 0.5;
    let corner = vec2i(floor(place));
    let f = place - vec2f(corner);
    var taps: Taps;
    for (var j = 0; j < 2; j++) {
        for (var i = 0; i < 2; i++) {
            let near = select(1.0 - f.x, f.x, i == 1) * select(1.0 - f.y, f.y, j == 1);
            add_tap(&taps, s, corner + vec2i(i, j), low, near + 1e-3);
        }
    }
    if (taps.weight < 0.02) {
        for (var j = -1; j < 3; j++) {
            for (var i = -1; i < 3; i++) {
                let away = vec2f(vec2i(i, j)) - f;
                add_tap(&taps, s, corner + vec2i(i, j), low, exp(-dot(away, away)));
            }
        }
    }
    if (taps.weight < TOO_LITTLE) {
        let slot = atomicAdd(&missed_count[0], 1u);
        if (slot < arrayLength(&missed)) {
            let block = min(id.xy / BLOCK, vec2u(low) - 1u);
            missed[slot] = Missed(id.y * size.x + id.x, block.y * u32(low.x) + block.x, 0u, 0u);
            let wo = view_direction(s.position);
            let slant = 1.0 / max(abs(dot(wo, s.ng)), 0.02);
            missed_receivers[slot] = Receiver(s.position, s.alpha, s.ng, 1u, s.n, s.footprint, wo, slant);
            return;
        }
    }
    write_out(id.xy, s.bsdf, mean_of(taps));
}

// Give the listed pixels the light that was estimated for them.
@compute @workgroup_size(64)
fn patch_missed(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= arrayLength(&missed_light) / 4u) {
        return;
    }
    let width = u32(camera.size.x);
    let pixel = vec2u(missed_list[id.x].pixel % width, missed_list[id.x].pixel / width);
    let s = surface_at(pixel, textureLoad(depth, pixel, 0));
    let k = 4u * id.x;
    write_out(pixel, s.bsdf, Incident(
        missed_light[k].rgb, missed_light[k + 1u].rgb, missed_light[k + 2u].rgb, missed_light[k + 3u].rgb,
    ));
}
