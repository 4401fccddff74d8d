// Light that reaches the eye's pixels straight from the lights, with shadows.
// include stages/camera.wgsl
// include stages/shadow_map.wgsl
// include optics/bsdf.wgsl
// include optics/light.wgsl

struct Direct {
    light_count: u32,
    spare0: u32,
    texel: vec2f,       // 1 / the atlas's size
}

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var<uniform> direct: Direct;
@group(0) @binding(2) var<storage, read> lights: array<Light>;
@group(0) @binding(3) var<storage, read> materials: array<Material>;
@group(0) @binding(4) var ids: texture_2d<u32>;
@group(0) @binding(5) var normals: texture_2d<f32>;
@group(0) @binding(6) var base: texture_2d<f32>;
@group(0) @binding(7) var emission: texture_2d<f32>;
@group(0) @binding(8) var depth: texture_depth_2d;
@group(0) @binding(9) var atlas: texture_depth_2d;
@group(0) @binding(10) var farther: sampler_comparison;
@group(0) @binding(11) var<storage, read> maps: array<ShadowMap>;
@group(0) @binding(12) var<storage, read> tiles: array<ShadowTile>;

const REACH = 1.5;             // texels at most between a point and the centres of those its filter reads
const TAP = 0.5;               // texels that each of four bilinear taps lies off, right and down

struct Lookup {
    texel: vec2f,       // of the atlas
    depth: f32,         // nearer stored ones shade
    side: f32,          // of the tile; 0: nothing shades
}

fn turned(map: ShadowMap, v: vec3f) -> vec3f {
    return vec3f(dot(map.x, v), dot(map.y, v), dot(map.z, v));
}

// Where a point of a surface with the normal ng, on the light's side, is looked up in map `light`.
//
// A tap compares the point with the depth stored up to REACH texels beside it. On the point's own plane
// the two agree to within that distance across the view, so the plane shades itself nowhere if the point
// is first raised by REACH texels times the slope of the plane in the face: ng's components along the
// face's edges. That is exact for planes, in units of texels, so no scene needs a bias of its own.
// Bringing the point REACH texels nearer as well keeps the other wall of a corner from shading the first.
fn lookup(light: u32, position: vec3f, ng: vec3f) -> Lookup {
    let map = maps[light];
    let parallel = map.parallel != 0u;
    let p = turned(map, position - map.origin);
    let n = turned(map, ng);
    let a = abs(p);
    let on_x = map.faces == 6u && a.x >= max(a.y, a.z);
    let on_y = map.faces == 6u && !on_x && a.y >= a.z;
    let along = select(select(p.z, p.y, on_y), p.x, on_x);
    let sign = select(-1.0, 1.0, along >= 0.0 || map.faces == 1u);
    let axis = select(select(2u, 1u, on_y), 0u, on_x);
    let tile = tiles[6u * light + select(0u, 2u * axis + u32(sign < 0.0), map.faces == 6u)];
    let on = vec2<bool>(on_x, on_y);
    let st = on_face(p, on, sign);
    let ns = on_face(n, on, sign);
    let texels = REACH / tile.scale;
    let slope = dot(texels, abs(ns.xy));
    let divisor = select(st.z, 1.0, parallel);
    let raised = st + ns * (slope * divisor / (1.0 - slope * select(ns.z, 0.0, parallel)));
    let w = select(raised.z, 1.0, parallel);
    let nearer = raised.z - max(texels.x, texels.y) * w;
    let texel = tile.scale * (raised.xy / w) + tile.shift;
    let low = tile.corner + REACH;
    return Lookup(
        clamp(texel, low, low + (tile.side - 2.0 * REACH)),
        (map.near - map.slope * nearer) / select(nearer, 1.0, parallel),
        tile.side,
    );
}

// Right, down and ahead as a face sees them; WebGPU, section 23.2.
fn on_face(v: vec3f, on: vec2<bool>, sign: f32) -> vec3f {
    return vec3f(
        select(select(sign * v.x, v.x, on.y), -sign * v.z, on.x),
        select(-v.y, sign * v.z, on.y),
        sign * select(select(v.z, v.y, on.y), v.x, on.x),
    );
}

// Share of the light that passes all surfaces, over three by three texels.
fn visibility(at: Lookup) -> f32 {
    var sum = 0.0;
    for (var i = 0u; i < 4u; i++) {
        let tap = vec2f(f32(i & 1u), f32(i >> 1u)) * (2.0 * TAP) - TAP;
        sum += textureSampleCompareLevel(atlas, farther, (at.texel + tap) * direct.texel, at.depth);
    }
    return 0.25 * sum;
}

@vertex
fn vs(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    return vec4f(vec2f(f32(corner & 1u), f32(corner >> 1u)) * 4.0 - 1.0, 0.5, 1.0);
}

@fragment
fn fs(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let pixel = vec2u(position.xy);
    let seen = textureLoad(ids, pixel, 0).xy;
    let material = seen.y & 0xffffffu;
    if (seen.x == 0u || (materials[material].flags & MATERIAL_UNLIT) != 0u) {
        return vec4f(0.0, 0.0, 0.0, 1.0);
    }
    return vec4f(lit(pixel, material), 1.0);
}

// Radiance towards the eye, cd/m2, of the surface in a pixel.
fn lit(pixel: vec2u, material: u32) -> vec3f {
    let packed = textureLoad(normals, pixel, 0);
    let n = octahedral_decode(packed.xy);
    let ng = octahedral_decode(packed.zw);
    let position = world_position(vec2f(pixel) + 0.5, textureLoad(depth, pixel, 0));
    let wo = view_direction(position);
    let color = textureLoad(base, pixel, 0);
    let bsdf = surface_bsdf(color.rgb, color.a, textureLoad(emission, pixel, 0).a, materials[material]);
    var sum = vec3f(0.0);
    for (var i = 0u; i < direct.light_count; i++) {
        let light = light_arriving(lights[i], position);
        if (dot(light.wi, ng) <= 0.0 || dot(light.wi, n) <= 0.0 || max(light.irradiance.x, max(light.irradiance.y, light.irradiance.z)) <= 0.0) {
            continue;
        }
        let at = lookup(i, position, ng);
        var visible = 1.0;
        if (at.side > 0.0) {
            visible = visibility(at);
        }
        if (visible > 0.0) {
            sum += eval_bsdf(bsdf, n, wo, light.wi) * light.irradiance * (visible * dot(light.wi, n));
        }
    }
    return sum;
}
