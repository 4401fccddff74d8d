// Light that reaches the eye's pixels straight from the lights, with shadows.
// include stages/camera.wgsl
// include stages/shadow_map.wgsl
// include optics/bsdf.wgsl
// include optics/light.wgsl

override ADDS: bool = false;        // to what the lights before these brought
override TRANSMITS: bool = true;    // some surface lets light through
override SHEETS: bool = true;       // some sheets tint the light

struct Lamps {                      // uniform: on llvmpipe a storage buffer costs a fifth more
    texel: vec2f,                   // 1 / the atlas's size
    count: u32,                     // of lights
    spare: u32,
    lights: array<Light, 128>,
    maps: array<ShadowMap, 128>,
    tiles: array<ShadowTile, 768>,
}

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var<uniform> lamps: Lamps;
@group(0) @binding(2) var<storage, read> materials: array<Material>;
@group(0) @binding(3) var ids: texture_2d<u32>;
@group(0) @binding(4) var normals: texture_2d<f32>;
@group(0) @binding(5) var base: texture_2d<f32>;
@group(0) @binding(6) var emission: texture_2d<f32>;
@group(0) @binding(7) var depth: texture_depth_2d;
@group(0) @binding(8) var before: texture_2d<f32>;
@group(0) @binding(9) var atlas: texture_depth_2d;
@group(0) @binding(10) var sheets: texture_depth_2d;
@group(0) @binding(11) var tints: texture_2d<f32>;
@group(0) @binding(12) var farther: sampler_comparison;

const REACH = 1.5;   // texels at most between a point and the centres of those its filter reads
const TAP = 0.5;     // texels that each of four bilinear taps lies off, right and down

struct Lookup {
    texel: vec2f,    // of the atlas
    depth: f32,      // surfaces that are nearer shade
    side: f32,       // of the tile; 0: nothing shades
}

// Where a point is looked up in the map of light `i`; ng: its surface's normal on the light's side.
//
// A tap compares the point with the depth stored up to REACH texels beside it. On the point's own plane
// the two agree to within that distance across the view, so the plane shades itself nowhere if the point
// is first raised by REACH texels times the slope of the plane in the face: ng's components along the
// face's edges. That is exact for planes, in units of texels, so no scene needs a bias of its own.
// Bringing the point REACH texels nearer as well keeps the other wall of a corner from shading the first.
fn lookup(i: u32, position: vec3f, ng: vec3f) -> Lookup {
    let map = lamps.maps[i];
    let parallel = map.parallel != 0u;
    let to_map = vec3f(dot(map.x, ng), dot(map.y, ng), dot(map.z, ng));
    let from_light = position - map.origin;
    let p = vec3f(dot(map.x, from_light), dot(map.y, from_light), dot(map.z, from_light));
    let face = face_of(p, map.faces == 6u);
    let tile = lamps.tiles[6u * i + face.index];
    let n = on_face(face, to_map);
    let point = on_face(face, p);
    let texels = REACH / tile.scale;
    let slope = dot(texels, abs(n.xy));
    let growth = select(slope * n.z, 0.0, parallel);    // of the texels on the way up
    let raised = point + n * (slope * select(point.z, 1.0, parallel) / (1.0 - growth));
    let w = select(raised.z, 1.0, parallel);
    let nearer = raised.z - max(texels.x, texels.y) * w;
    let low = tile.corner + REACH;
    return Lookup(
        clamp(tile.scale * (raised.xy / w) + tile.shift, low, low + (tile.side - 2.0 * REACH)),
        (map.near - map.slope * nearer) / select(nearer, 1.0, parallel),
        tile.side,
    );
}

// Share of the light that passes all opaque surfaces, over three by three texels.
fn visibility(at: Lookup) -> f32 {
    var sum = 0.0;
    for (var i = 0u; i < 4u; i++) {
        let tap = vec2f(f32(i & 1u), f32(i >> 1u)) * (2.0 * TAP) - TAP;
        sum += textureSampleCompareLevel(atlas, farther, (at.texel + tap) * lamps.texel, at.depth);
    }
    return 0.25 * sum;
}

// Share of it that passes all sheets, where the nearest stands before the point; over the same texels.
fn tint(at: Lookup) -> vec3f {
    let first = floor(at.texel - 1.0);
    let f = at.texel - 1.0 - first;
    let x = vec3f(1.0 - f.x, 1.0, f.x);
    let y = vec3f(1.0 - f.y, 1.0, f.y);
    var sum = vec3f(0.0);
    for (var i = 0u; i < 9u; i++) {
        let offset = vec2u(i % 3u, i / 3u);
        let texel = vec2u(first) + offset;
        let shaded = textureLoad(sheets, texel, 0) > at.depth;
        sum += (0.25 * x[offset.x] * y[offset.y]) * select(vec3f(1.0), textureLoad(tints, texel, 0).rgb, shaded);
    }
    return sum;
}

@vertex
fn vs(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    return vec4f(vec2f(f32(corner & 1u), f32(corner >> 1u)) * 4.0 - 1.0, 0.5, 1.0);
}

@fragment
fn fs(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let pixel = vec2u(position.xy);
    let seen = textureLoad(ids, pixel, 0).xy;
    let row = seen.y & 0xffffffu;
    if (seen.x == 0u || (materials[row].flags & MATERIAL_UNLIT) != 0u) {
        return vec4f(0.0, 0.0, 0.0, 1.0);
    }
    var sum = lit(pixel, seen.y);
    if (ADDS) {
        sum += textureLoad(before, pixel, 0).rgb;
    }
    return vec4f(sum, 1.0);
}

// Radiance towards the eye, cd/m2, of the surface in a pixel.
fn lit(pixel: vec2u, word: u32) -> vec3f {
    let packed = textureLoad(normals, pixel, 0);
    let n = octahedral_decode(packed.xy);
    let ng = octahedral_decode(packed.zw);
    let position = world_position(vec2f(pixel) + 0.5, textureLoad(depth, pixel, 0));
    let wo = view_direction(position);
    let color = textureLoad(base, pixel, 0);
    let row = word & 0xffffffu;
    var bsdf = surface_bsdf(color.rgb, color.a, textureLoad(emission, pixel, 0).a, materials[row].transmission, materials[row], true);
    if (!TRANSMITS) {
        bsdf.tint = vec3f(0.0);  // so that the compiler leaves the lobe out
    }
    var sum = vec3f(0.0);
    for (var i = 0u; i < lamps.count; i++) {
        let light = light_arriving(lamps.lights[i], position);
        let above = dot(light.wi, ng) > 0.0;
        let crosses = TRANSMITS && bsdf.thin > 0.0 && !above;
        if (!any(light.irradiance > vec3f(0.0)) || !(above && dot(light.wi, n) > 0.0 || crosses)) {
            continue;
        }
        let at = lookup(i, position, select(ng, -ng, crosses));
        var arriving = light.irradiance * abs(dot(light.wi, n));
        if (at.side > 0.0) {
            arriving *= visibility(at);
            if (SHEETS) {
                arriving *= tint(at);
            }
        }
        sum += eval_bsdf(bsdf, n, ng, wo, light.wi) * arriving;
    }
    return sum;
}
