// Light that reaches the eye's pixels straight from the lights, with shadows.
// include stages/camera.wgsl
// include stages/fullscreen.wgsl
// include stages/material.wgsl
// include stages/shadow_map.wgsl
// include optics/light.wgsl

override ADDS: bool = false;        // to what the lights before these brought
override TRANSMITS: bool = true;    // some surface lets light through
override SHEETS: bool = true;       // some sheets tint the light
override ALONE: bool = false;       // there is one light: not to search spares a quarter of the time

struct Lamps {                      // uniform: on llvmpipe a storage buffer costs a fifth more
    texel: vec2f,                   // 1 / the atlas's size
    count: u32,                     // of lights
    first: u32,                     // number of the first in the scene
    extent: f32,                    // m, the scene's diagonal
    lights: array<Light, 128>,
    maps: array<ShadowMap, 128>,
    tiles: array<ShadowTile, 768>,
}

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var<uniform> lamps: Lamps;
@group(0) @binding(2) var<storage, read> materials: array<Material>;
@group(0) @binding(3) var points: texture_2d<u32>;
@group(0) @binding(4) var normals: texture_2d<u32>;
@group(0) @binding(5) var base: texture_2d<f32>;
@group(0) @binding(6) var emission: texture_2d<f32>;
@group(0) @binding(7) var specular: texture_2d<f32>;
@group(0) @binding(8) var before: texture_2d<f32>;
@group(0) @binding(9) var atlas: texture_depth_2d;
@group(0) @binding(10) var sheets: texture_depth_2d;
@group(0) @binding(11) var tints: texture_2d<f32>;
@group(0) @binding(12) var nearest: sampler;
@group(0) @binding(13) var<storage, read_write> doubt_count: array<atomic<u32>>;
@group(0) @binding(14) var<storage, read_write> doubts: array<Doubt>;

const REACH = 1.0;      // texels at most between a point and the centres of those its filter reads
const GRAZING = 1e-3;   // ten times what packed normals are uncertain by, kept: radians
const SNAP = 0.0625;    // texels that rasterisers may move corners by: subPixelPrecisionBits is 4 at least
const ROUND = 0.05;     // of what a texel is wide, that depths may round by

// What a light would bring to a pixel where its map does not tell whether anything is between.
struct Doubt {
    position: vec3f,    // m, world space
    pixel: u32,         // y width + x
    radiance: vec3f,    // towards the eye, unless something shades
    light: u32,         // row of the lights
    ng: vec3f,          // on the light's side
    texel: f32,         // m that one of the map's is wide there
}

// Four texels about a point in the order of textureGather: left below, right below, right above, left above.
struct Lookup {
    middle: vec2f,      // where they meet, in texels of the atlas
    share: vec4f,       // of each in the point's light
    free: vec4f,        // what is no nearer does not shade
    shaded: vec4f,      // what is nearer does
    texel: f32,         // m that one is wide at the point
    within: bool,       // the map's tile holds the point
    shades: bool,       // whether anything may
}

// Where a point is looked up in the map of light `i`; ng: its surface's normal on the light's side.
//
// The depth stored in a texel belongs to its centre, so the point is compared there as its surface's plane
// would be stored: depth in clip space is linear across the map. A rasteriser that moves corners stores the
// plane's depth SNAP texels aside at most. What is nearer than that may shade; what is REACH texels nearer
// still does, if all four are, for a corner's other wall may be as near as that and shade nothing.
// A driver that interpolates from the corners of a triangle that reaches behind the light, and not from where it
// is cut, moves the plane there by more: as corners |w| m ahead or behind it move by as many texels at |w|, a
// point of weights k at w ahead moves by the sum of k |w| / w. Rays decide what shades by less than that.
fn lookup(i: u32, position: vec3f, ng: vec3f) -> Lookup {
    let map = lamps.maps[i];
    let parallel = map.parallel != 0u;
    let from_light = position - map.origin;
    let p = vec3f(dot(map.x, from_light), dot(map.y, from_light), dot(map.z, from_light));
    let face = face_of(p, map.faces == 6u);
    let tile = lamps.tiles[6u * i + face.index];
    let point = on_face(face, p);
    let n = on_face(face, vec3f(dot(map.x, ng), dot(map.y, ng), dot(map.z, ng)));
    let size = select(length(point), 1.0, parallel);
    let facing = min(select(dot(n, point), n.z, parallel), -2.0 * GRAZING * size) + GRAZING * size;
    let slope = (select(map.near, map.slope, parallel) / facing) * n.xy / tile.scale;
    let w = select(point.z, 1.0, parallel);
    let wide = w * max(1.0 / tile.scale.x, 1.0 / tile.scale.y);
    let nearer = point.z - REACH * wide;
    let depth = (map.near - map.slope * vec2f(point.z, nearer)) / select(vec2f(point.z, nearer), vec2f(1.0), parallel);
    let texel = tile.scale * (point.xy / w) + tile.shift;
    let held = clamp(texel, tile.corner + REACH, tile.corner + tile.size - REACH);
    let middle = floor(held - 0.5) + 1.0;
    let f = fract(held - 0.5);
    let x = middle.x - texel.x + vec4f(-0.5, 0.5, 0.5, -0.5);
    let y = middle.y - texel.y + vec4f(0.5, 0.5, -0.5, -0.5);
    let snap = SNAP * (abs(slope.x) + abs(slope.y));
    let plane = slope.x * x + slope.y * y + snap;
    let behind = select(max(lamps.extent / point.z - 1.0, 0.0), 0.0, parallel) * snap;
    return Lookup(
        middle,
        vec4f(1.0 - f.x, f.x, f.x, 1.0 - f.x) * vec4f(f.y, f.y, 1.0 - f.y, 1.0 - f.y),
        mix(depth.x, depth.y, ROUND) + plane,
        depth.y + plane + behind,
        wide,
        all(held == texel),
        tile.size.x > 0.0,
    );
}

struct Visible {
    share: vec3f,       // of the light that passes
    certain: bool,
}

// Share of the light that passes all opaque surfaces.
fn visibility(at: Lookup) -> Visible {
    let stored = textureGather(atlas, nearest, at.middle * lamps.texel);
    let share = dot(at.share, select(vec4f(0.0), vec4f(1.0), stored <= at.shaded));
    return Visible(vec3f(share), at.within && (all(stored <= at.free) || all(stored > at.shaded)));
}

// Share of it that passes all sheets, where the nearest stands before the point.
fn tint(at: Lookup) -> Visible {
    let stored = textureGather(sheets, nearest, at.middle * lamps.texel);
    let share = select(vec4f(0.0), at.share, stored > at.shaded);
    let k = vec2u(at.middle);
    let passed = 1.0 - dot(share, vec4f(1.0))
        + share.x * textureLoad(tints, k - vec2u(1u, 0u), 0).rgb + share.y * textureLoad(tints, k, 0).rgb
        + share.z * textureLoad(tints, k - vec2u(0u, 1u), 0).rgb + share.w * textureLoad(tints, k - vec2u(1u, 1u), 0).rgb;
    return Visible(passed, all(stored <= at.free) || all(stored > at.shaded));
}

@fragment
fn fs(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let pixel = vec2u(position.xy);
    let seen = textureLoad(points, pixel, 0);
    if (seen.w == 0u || (materials[material_row(seen.w)].flags & MATERIAL_UNLIT) != 0u) {
        return vec4f(0.0, 0.0, 0.0, 1.0);
    }
    var sum = lit(pixel, bitcast<vec3f>(seen.xyz), seen.w);
    if (ADDS) {
        sum += textureLoad(before, pixel, 0).rgb;
    }
    return vec4f(sum, 1.0);
}

struct Surface {
    bsdf: Bsdf,
    position: vec3f,
    n: vec3f,
    ng: vec3f,
    wo: vec3f,
    thin: bool,
}

// Radiance towards the eye, cd/m2, of the surface in a pixel.
fn lit(pixel: vec2u, position: vec3f, word: u32) -> vec3f {
    let packed = textureLoad(normals, pixel, 0);
    let color = textureLoad(base, pixel, 0);
    let roughness = textureLoad(emission, pixel, 0).a;
    var s = Surface();
    s.n = unpack_normal(packed.x);
    s.ng = unpack_normal(packed.y);
    s.position = position;
    s.wo = view_direction(s.position);
    let material = material_row(word);
    let maps = seen_specular(specular, pixel, materials[material].flags);
    s.bsdf = seen_bsdf(word, color, roughness, maps, materials[material]);
    if (!TRANSMITS) {
        s.bsdf.tint = vec3f(0.0);  // so that the compiler leaves the lobe out
    }
    s.thin = TRANSMITS && s.bsdf.thin > 0.0;
    let number = pixel.y * u32(camera.size.x) + pixel.x;
    if (ALONE) {
        return select(vec3f(0.0), reflected(s, 0u, number), may_light(s, 0u));
    }
    var sum = vec3f(0.0);
    for (var i = next_light(s, 0u); i < lamps.count; i = next_light(s, i + 1u)) {
        sum += reflected(s, i, number);
    }
    return sum;
}

// Whether light `i` may light a surface: all that this stage asks for a light's kind.
fn may_light(s: Surface, i: u32) -> bool {
    let light = lamps.lights[i];
    let far = light.kind == LIGHT_DIRECTIONAL;
    let to_light = select(light.position - s.position, -light.direction, far);
    let above = dot(to_light, s.ng) > 0.0;
    let faces = (above && dot(to_light, s.n) > 0.0) || (s.thin && !above);
    return faces && (far || light.range <= 0.0 || dot(to_light, to_light) < light.range * light.range);
}

// The next of those, from row `first` on. Where branches are masked, as on llvmpipe, the lanes of a pixel's group
// so meet at the lights that they need, and wait only for the one that needs most.
fn next_light(s: Surface, first: u32) -> u32 {
    var i = first;
    while (i < lamps.count && !may_light(s, i)) {
        i++;
    }
    return i;
}

// What a surface makes of one light; black where that is in doubt and listed.
fn reflected(s: Surface, i: u32, pixel: u32) -> vec3f {
    let light = light_arriving(lamps.lights[i], s.position);
    let crosses = s.thin && dot(light.wi, s.ng) <= 0.0;
    let ng = select(s.ng, -s.ng, crosses);
    let at = lookup(i, s.position, ng);
    let arriving = light.irradiance * abs(dot(light.wi, s.n));
    let radiance = eval_bsdf(s.bsdf, s.n, s.ng, s.wo, light.wi) * arriving;
    if (!at.shades) {
        return radiance;
    }
    var seen = visibility(at);
    if (SHEETS) {
        let through = tint(at);
        let dark = seen.certain && seen.share.x == 0.0;
        seen = Visible(seen.share * through.share, seen.certain && (through.certain || dark));
    }
    if (!seen.certain && any(radiance > vec3f(0.0))) {
        let slot = atomicAdd(&doubt_count[0], 1u);
        if (slot < arrayLength(&doubts)) {
            doubts[slot] = Doubt(s.position, pixel, radiance, lamps.first + i, ng, at.texel);
            return vec3f(0.0);
        }
    }
    return radiance * seen.share;
}
