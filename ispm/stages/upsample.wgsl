// Incident light from low to full resolution, and the radiance the pixel's surface makes of it.
// Joint bilateral (Kopf et al. 2007), by distance from the pixel's tangent plane rather than by depth, so
// that oblique floors find their neighbours. Pixels to which the four about them bring little, or gloss, are left
// to `finish`: elsewhere they would slow down all. Those that find none are listed for the world-space estimate.
// include stages/camera.wgsl
// include stages/fullscreen.wgsl
// include stages/glow.wgsl
// include stages/receivers.wgsl
// include optics/gradient.wgsl
// include stages/blocks.wgsl

const PLANE_REACH = 1.3;    // low-resolution pixels: a biweight as wide as a Gaussian of 0.5
const FEW = 0.02;          // sum of weights below which farther neighbours are asked too
const TOO_LITTLE = 1e-3;   // and below which a pixel has found none
const WHOLE = 0.9;         // and above which receivers lie all around a pixel
const FAR = 0.5;           // of the filter's radius, beyond which the receivers' middle tells nothing of a pixel
const LEAST_REACH = 1.5;   // least of that radius, low-resolution pixels: _LEAST_PIXELS of stages/lattice.py
const SLIGHT = 1e-30;      // below which a sum of weights counts as none: inverses of the least numbers overflow
const TURNED = 0.01;       // least share of its weight that a receiver keeps whose bump faces elsewhere
const NO_TAP = 0x80008000u;  // in place of a packed normal, which has no such numbers: no receiver, or TAKES_NONE
const FINISHING = 64u;     // workgroups of `finish`, each of as many threads
const LEFT = 1u;           // values of GLOSS: none is looked for, it is left to `finish`, or it is found at once
const FOUND = 2u;
override GLOSS: u32 = FOUND;
override TURNED_LIGHT: bool = false;  // light follows the normal of a pixel

struct Missed {
    pixel: u32,
    low: u32,              // index of the receiver whose block the pixel lies in
    spare0: u32,
    spare1: u32,
}

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var<storage, read> materials: array<Material>;
@group(0) @binding(2) var points: texture_2d<u32>;
@group(0) @binding(3) var normals: texture_2d<u32>;
@group(0) @binding(4) var base: texture_2d<f32>;
@group(0) @binding(5) var emission: texture_2d<f32>;
@group(0) @binding(23) var specular: texture_2d<f32>;
@group(0) @binding(7) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(8) var<storage, read> light: array<vec4f>;          // four for each receiver
@group(0) @binding(6) var places: texture_2d<u32>;   // of each receiver the position and geometric normal,
@group(0) @binding(16) var lights: texture_2d<u32>;  // the irradiance and shading normal
@group(0) @binding(24) var slopes: texture_2d<u32>;  // and how that follows the normal
@group(0) @binding(25) var<storage, read> gradient: array<vec4f>;      // three for each receiver
@group(0) @binding(26) var slopes_out: texture_storage_2d<rgba32uint, write>;
@group(0) @binding(19) var places_out: texture_storage_2d<rgba32uint, write>;
@group(0) @binding(20) var lights_out: texture_storage_2d<rgba32uint, write>;
@group(0) @binding(21) var<storage, read_write> left_count: array<atomic<u32>>;
@group(0) @binding(22) var<storage, read_write> left: array<u32>;          // pixels for `finish`
@group(0) @binding(9) var<storage, read_write> missed_count: array<atomic<u32>>;
@group(0) @binding(10) var<storage, read_write> missed: array<Missed>;
@group(0) @binding(11) var<storage, read_write> missed_receivers: array<Receiver>;
@group(0) @binding(12) var indirect_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(13) var irradiance_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(17) var caustic: texture_2d<f32>;              // drawn at full resolution, or one black texel
@group(0) @binding(18) var caustic_irradiance: texture_2d<f32>;
@group(0) @binding(14) var<storage, read> missed_list: array<Missed>;
@group(0) @binding(15) var<storage, read> missed_light: array<vec4f>;

struct Surface {
    bsdf: Bsdf,
    position: vec3f,
    ng: vec3f,
    n: vec3f,
    alpha: f32,
    plane_scale: f32,      // 1 / b^2, b where the weight of the distance from the tangent plane ends
    footprint: f32,
}

fn surface_at(pixel: vec2u, seen: vec4u) -> Surface {
    var s = Surface();
    let word = seen.w;
    let material = material_row(word);
    let color = textureLoad(base, pixel, 0);
    let packed = textureLoad(normals, pixel, 0);
    let maps = seen_specular(specular, pixel, materials[material].flags);
    s.bsdf = seen_bsdf(word, color, textureLoad(emission, pixel, 0).a, maps, materials[material]);
    s.alpha = receiver_alpha(s.bsdf, materials[material].flags);
    if ((materials[material].flags & MATERIAL_UNLIT) != 0u) {
        s.bsdf = Bsdf();
    }
    s.position = bitcast<vec3f>(seen.xyz);
    s.n = unpack_normal(packed.x);
    s.ng = unpack_normal(packed.y);
    s.footprint = pixel_footprint(view_depth(s.position)) * f32(BLOCK);
    let cosine = max(abs(dot(view_direction(s.position), s.ng)), 0.1);
    let reach = PLANE_REACH * s.footprint / cosine;
    s.plane_scale = 1.0 / (reach * reach);
    return s;
}

struct Tap {               // a receiver and its light
    position: vec3f,
    valid: f32,            // 0: there is none, or its light is not to be spread
    ng: vec3f,
    alpha: f32,
    n: vec3f,
    takes: bool,           // false: TAKES_NONE
    light: Incident,
    slope: vec3u,
    reach: f32,            // radius, m, of the filter that its light has passed; 0: of none
}

struct Taps {
    sums: Incident,
    weight: f32,
    away: vec3f,           // to the receivers, m, times their weights
    reach: f32,            // likewise their filter's radius
    fresnel_weight: f32,
    gloss_weight: f32,     // of lobes that are narrow, or not, as the surface's
}

// What all taps need, in two texels: llvmpipe takes longer for two words of a buffer.
@compute @workgroup_size(8, 8)
fn pack_receivers(@builtin(global_invocation_id) id: vec3u) {
    let low = low_size();
    if (any(vec2i(id.xy) >= low)) {
        return;
    }
    let k = id.y * u32(low.x) + id.x;
    let r = receivers[k];
    let i = light[4u * k];
    let ng = select(NO_TAP, pack_normal(r.ng), (r.valid != 0u) && (i.w >= 0.0));
    textureStore(places_out, id.xy, vec4u(bitcast<vec3u>(r.position), ng));
    let n = select(pack_normal(r.n), NO_TAP, r.alpha == TAKES_NONE);
    textureStore(lights_out, id.xy, vec4u(bitcast<vec3u>(i.rgb), n));
    if (TURNED_LIGHT) {
        let g = 3u * k;
        let frame = unpack_normal(pack_normal(r.n));  // of load_tap's normal
        let slope = pack_slope(i.rgb, gradient[g].rgb, gradient[g + 1u].rgb, gradient[g + 2u].rgb, frame);
        textureStore(slopes_out, id.xy, vec4u(slope, 0u));
    }
}

fn low_size() -> vec2i {
    return (vec2i(camera.size) + i32(BLOCK) - 1) / i32(BLOCK);
}

fn load_tap(at: vec2i, low: vec2i) -> Tap {
    var tap = Tap();
    if (any(at < vec2i(0)) || any(at >= low)) {
        return tap;
    }
    let place = textureLoad(places, at, 0);
    let shone = textureLoad(lights, at, 0);
    tap.position = bitcast<vec3f>(place.xyz);
    tap.valid = select(1.0, 0.0, place.w == NO_TAP);
    tap.ng = unpack_normal(place.w);
    tap.takes = shone.w != NO_TAP;
    tap.n = select(tap.ng, unpack_normal(shone.w), tap.takes);
    tap.light.irradiance = bitcast<vec3f>(shone.xyz);
    if (TURNED_LIGHT) {
        tap.slope = textureLoad(slopes, at, 0).xyz;
    }
    if (GLOSS == FOUND) {
        let k = u32(at.y * low.x + at.x);
        tap.alpha = receivers[k].alpha;
        tap.reach = light[4u * k + 2u].w;
        if (tap.alpha > 0.0) {
            tap.light.fresnel = light[4u * k + 1u].rgb;
            tap.light.gloss = light[4u * k + 2u].rgb;
            tap.light.grazing = light[4u * k + 3u].rgb;
        }
    }
    return tap;
}

// Add a tap whose place on the screen has the weight `near`.
fn add_tap(taps: ptr<function, Taps>, s: Surface, tap: Tap, near: f32) {
    let away = tap.position - s.position;
    let z = dot(s.ng, away);
    var facing = max(dot(s.ng, tap.ng), 0.0);
    facing *= facing;
    facing *= facing;
    facing *= facing;
    var bump = max(dot(s.n, tap.n), 0.0);
    bump *= bump;
    bump *= bump;
    bump *= bump;
    let close = max(1.0 - z * z * s.plane_scale, 0.0);
    let alike = select(0.0, 1.0, tap.takes == (s.alpha != TAKES_NONE));
    let w = near * tap.valid * alike * facing * max(bump, TURNED) * close * close;
    if (TURNED_LIGHT) {
        (*taps).sums.irradiance += w * turned_light(tap.light.irradiance, tap.slope, tap.n, s.n);
    } else {
        (*taps).sums.irradiance += w * tap.light.irradiance;
    }
    (*taps).weight += w;
    (*taps).away += w * away;
    (*taps).reach += w * tap.reach;
    if (s.alpha > 0.0 && tap.alpha > 0.0) {
        let g = w * max(1.0 - 4.0 * abs(s.alpha - tap.alpha), 1e-3);
        let same = select(0.0, g, (s.alpha < NARROW_ALPHA) == (tap.alpha < NARROW_ALPHA));
        (*taps).sums.fresnel += g * tap.light.fresnel;
        (*taps).sums.gloss += same * tap.light.gloss;
        (*taps).sums.grazing += same * tap.light.grazing;
        (*taps).fresnel_weight += g;
        (*taps).gloss_weight += same;
    }
}

// Whether the receivers' middle is farther than a radius, m. Where some of those about a pixel are on other
// surfaces, the rest may lie all on one side: of a wall seen aslant, by many times what light is even over.
fn is_aside(taps: Taps, radius: f32) -> bool {
    return length(taps.away) > radius * taps.weight;
}

fn mean_of(taps: Taps) -> Incident {
    let w = 1.0 / max(taps.weight, 1e-20);
    let f = select(0.0, 1.0 / taps.fresnel_weight, taps.fresnel_weight > SLIGHT);
    let g = select(0.0, 1.0 / taps.gloss_weight, taps.gloss_weight > SLIGHT);
    return Incident(w * taps.sums.irradiance, f * taps.sums.fresnel, g * taps.sums.gloss, g * taps.sums.grazing);
}

struct Lit {                                  // WebGPU's 32 bytes a pixel: emission takes a pass of its own
    @location(0) indirect: vec4f,
    @location(1) irradiance: vec4f,
}

// What a surface makes of light, and what was drawn sharp.
fn lit(pixel: vec2u, b: Bsdf, i: Incident) -> Lit {
    let sharp = textureLoad(caustic, pixel, 0).rgb;
    return Lit(
        vec4f(reflect_incident(b, i) + sharp, 1.0),
        vec4f(i.irradiance + textureLoad(caustic_irradiance, pixel, 0).rgb, 1.0),
    );
}

@fragment
fn fs(@builtin(position) at: vec4f) -> Lit {
    let pixel = vec2u(at.xy);
    let seen = textureLoad(points, pixel, 0);
    if (seen.w == 0u) {
        return Lit(vec4f(0.0), vec4f(0.0));
    }
    let s = surface_at(pixel, seen);
    let taps = nearest_taps(pixel, s);
    let aside = (taps.weight < WHOLE) && is_aside(taps, FAR * LEAST_REACH * s.footprint);
    if ((taps.weight < FEW) || aside || ((GLOSS == LEFT) && (s.alpha > 0.0))) {
        let slot = atomicAdd(&left_count[0], 1u);
        if (slot < arrayLength(&left)) {
            left[slot] = pixel.y * u32(camera.size.x) + pixel.x;
        }
    }
    return lit(pixel, s.bsdf, mean_of(taps));
}

// A pixel among the receivers: the upper left of the four about it, and how far right of and below that it is.
struct Corner {
    at: vec2i,
    f: vec2f,
}

fn corner_of(pixel: vec2u) -> Corner {
    let q = (vec2f(pixel) - receiver_offset()) / f32(BLOCK);
    let at = floor(q);
    return Corner(vec2i(at), q - at);
}

// The four receivers about a pixel.
fn nearest_taps(pixel: vec2u, s: Surface) -> Taps {
    let low = low_size();
    let c = corner_of(pixel);
    let f = c.f;
    let least = select(1e-3, 0.0, BLOCK == 1u);  // any of the four may have to serve; at K = 1 its own does
    var taps = Taps();    // without a value, some compilers keep that of the turn before
    add_tap(&taps, s, load_tap(c.at, low), (1.0 - f.x) * (1.0 - f.y) + least);
    add_tap(&taps, s, load_tap(c.at + vec2i(1, 0), low), f.x * (1.0 - f.y) + least);
    add_tap(&taps, s, load_tap(c.at + vec2i(0, 1), low), (1.0 - f.x) * f.y + least);
    add_tap(&taps, s, load_tap(c.at + vec2i(1, 1), low), f.x * f.y + least);
    return taps;
}

// Write the pixels that were left.
@compute @workgroup_size(64)
fn finish(@builtin(global_invocation_id) id: vec3u) {
    let count = min(atomicLoad(&left_count[0]), arrayLength(&left));
    for (var k = id.x; k < count; k += 64u * FINISHING) {
        let width = u32(camera.size.x);
        let pixel = vec2u(left[k] % width, left[k] / width);
        let s = surface_at(pixel, textureLoad(points, pixel, 0));
        var taps = nearest_taps(pixel, s);
        if (taps.weight < FEW) {
            add_ring(&taps, s, pixel);
        }
        let reach = taps.reach / max(taps.weight, SLIGHT);
        let aside = (taps.weight < WHOLE) && (reach > 0.0) && is_aside(taps, FAR * reach);
        if ((taps.weight < TOO_LITTLE) || aside) {
            list_missed(pixel, s);
        }
        let out = lit(pixel, s.bsdf, mean_of(taps));
        textureStore(indirect_out, pixel, out.indirect);
        textureStore(irradiance_out, pixel, out.irradiance);
    }
}

// Emission as it is.
@fragment
fn fs_glow(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let pixel = vec2u(at.xy);
    return select(vec4f(0.0), vec4f(unpack_glow(textureLoad(emission, pixel, 0).rgb), 1.0), textureLoad(points, pixel, 0).w != 0u);
}

// The 4 x 4 receivers about a pixel.
fn add_ring(taps: ptr<function, Taps>, s: Surface, pixel: vec2u) {
    let c = corner_of(pixel);
    for (var k = 0; k < 16; k++) {
        let at = vec2i(k % 4, k / 4) - 1;
        let away = vec2f(at) - c.f;
        add_tap(taps, s, load_tap(c.at + at, low_size()), exp(-dot(away, away)));
    }
}

// Ask for an estimate of this pixel's own.
fn list_missed(pixel: vec2u, s: Surface) {
    let slot = atomicAdd(&missed_count[0], 1u);
    if (slot >= arrayLength(&missed)) {
        return;
    }
    let low = vec2u(low_size());
    let block = min(pixel / BLOCK, low - 1u);
    missed[slot] = Missed(pixel.y * u32(camera.size.x) + pixel.x, block.y * low.x + block.x, 0u, 0u);
    let wo = view_direction(s.position);
    let slant = 1.0 / max(abs(dot(wo, s.ng)), 0.02);
    missed_receivers[slot] = Receiver(s.position, s.alpha, s.ng, 1u, s.n, s.footprint, wo, slant);
}

// Give the listed pixels the light that was estimated for them.
@compute @workgroup_size(64)
fn patch_missed(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= arrayLength(&missed_light) / 4u) {
        return;
    }
    let width = u32(camera.size.x);
    let pixel = vec2u(missed_list[id.x].pixel % width, missed_list[id.x].pixel / width);
    let s = surface_at(pixel, textureLoad(points, pixel, 0));
    let k = 4u * id.x;
    let out = lit(pixel, s.bsdf, Incident(
        missed_light[k].rgb, missed_light[k + 1u].rgb, missed_light[k + 2u].rgb, missed_light[k + 3u].rgb,
    ));
    textureStore(indirect_out, pixel, out.indirect);
    textureStore(irradiance_out, pixel, out.irradiance);
}
