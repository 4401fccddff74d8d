// Light that reaches the eye's pixels straight from the lights, with shadows.
// include stages/camera.wgsl
// include optics/bsdf.wgsl

struct Shadows {
    light_count: u32,
    side: f32,          // texels of a map's edge
    near: f32,          // m
    spare: f32,
}

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var<uniform> shadows: Shadows;
@group(0) @binding(2) var<storage, read> lights: array<Light>;
@group(0) @binding(3) var<storage, read> materials: array<Material>;
@group(0) @binding(4) var ids: texture_2d<u32>;
@group(0) @binding(5) var normals: texture_2d<f32>;
@group(0) @binding(6) var base: texture_2d<f32>;
@group(0) @binding(7) var emission: texture_2d<f32>;
@group(0) @binding(8) var depth: texture_depth_2d;
@group(0) @binding(9) var cubes: texture_depth_cube_array;
@group(0) @binding(10) var farther: sampler_comparison;

const TAP = 0.5;             // texels that each of four taps lies off in both directions
const REACH = TAP + 1.0;     // texels at most between the point and what a tap reads, bilinear
const SEAM = 6.0;            // texels from a cube's edge within which taps may fall on the next face

// Share of the light that reaches a point, `p` from the light with the normal ng, both on the cube of
// its maps, where an aimed light's narrow view is stretched sideways to a whole face.
//
// A tap compares a point beside p with the depth stored up to REACH texels from p. On p's own plane the
// two agree to within that distance across the view, so the plane shades itself nowhere if p is first
// raised by REACH texels times the slope of the plane in the face: ng's components along the face's
// edges. That is exact for planes, in units of texels, so no scene needs a bias of its own. Bringing the
// point REACH texels nearer as well keeps the other wall of a corner from shading the first.
fn visibility(light: u32, spread: f32, p: vec3f, ng: vec3f) -> f32 {
    let across = abs(p);
    let distance = max(across.x, max(across.y, across.z));
    let texel = 2.0 * distance / shadows.side;
    let axes = step(vec3f(distance * (1.0 - SEAM / shadows.side)), across);
    let edges = select(1.0 - axes, vec3f(1.0), axes.x + axes.y + axes.z > 1.0);
    let raised = p + ng * (REACH * texel * dot(abs(ng), edges));
    let s = select(vec3f(1.0, 0.0, 0.0), vec3f(0.0, 1.0, 0.0), across.x == distance);
    let t = select(vec3f(0.0, 0.0, 1.0), vec3f(0.0, 1.0, 0.0), across.z == distance);
    let nearer = 1.0 + 2.0 * REACH * spread / shadows.side;
    var sum = 0.0;
    for (var i = 0u; i < 4u; i++) {
        let tap = vec2f(f32(i & 1u), f32(i >> 1u)) * 2.0 - 1.0;
        let q = raised + (TAP * texel) * (tap.x * s + tap.y * t);
        let axial = max(abs(q.x), max(abs(q.y), abs(q.z)));
        sum += textureSampleCompareLevel(cubes, farther, q, light, nearer * shadows.near / axial);
    }
    return 0.25 * sum;
}

// 1 to 0 at the light's range; KHR_lights_punctual.
fn range_window(distance: f32, range: f32) -> f32 {
    let x = distance / range;
    return select(1.0, clamp(1.0 - x * x * x * x, 0.0, 1.0), range > 0.0);
}

@vertex
fn vs(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    return vec4f(vec2f(f32(corner & 1u), f32(corner >> 1u)) * 4.0 - 1.0, 0.5, 1.0);
}

@fragment
fn fs(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let pixel = vec2u(position.xy);
    let seen = textureLoad(ids, pixel, 0).xy;
    if (seen.x == 0u || (materials[seen.y].flags & MATERIAL_UNLIT) != 0u) {
        return vec4f(0.0, 0.0, 0.0, 1.0);
    }
    return vec4f(lit(pixel, seen.y), 1.0);
}

// Radiance towards the eye, cd/m2, of the surface in a pixel.
fn lit(pixel: vec2u, material: u32) -> vec3f {
    let packed = textureLoad(normals, pixel, 0);
    let n = octahedral_decode(packed.xy);
    let ng = octahedral_decode(packed.zw);
    let position = world_position(vec2f(pixel) + 0.5, textureLoad(depth, pixel, 0));
    let wo = view_direction(position);
    let color = textureLoad(base, pixel, 0);
    let bsdf = surface_bsdf(color.rgb, color.a, textureLoad(emission, pixel, 0).a, materials[material].transmission, materials[material], true);
    var sum = vec3f(0.0);
    for (var i = 0u; i < shadows.light_count; i++) {
        let light = lights[i];
        let from_light = position - light.position;
        let distance = length(from_light);
        let wi = -from_light / distance;
        let window = range_window(distance, light.range);
        if (window == 0.0 || dot(wi, ng) <= 0.0 || dot(wi, n) <= 0.0) {
            continue;
        }
        let p = vec3f(dot(light.map_x, from_light), dot(light.map_y, from_light), dot(light.map_z, from_light));
        let k2 = light.spread * light.spread;
        let np = vec3f(k2 * dot(light.map_x, ng), k2 * dot(light.map_y, ng), dot(light.map_z, ng));
        let visible = visibility(i, light.spread, p, normalize(np));
        if (visible > 0.0) {
            let irradiance = light.intensity * (visible * window * dot(wi, n) / (distance * distance));
            sum += eval_bsdf(bsdf, n, ng, wo, wi) * irradiance;
        }
    }
    return sum;
}
