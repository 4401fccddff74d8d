// Caustics: each photon that met only mirrors and glass is drawn, at full resolution, as a triangle round
// its kernel, and what the pixels' surfaces make of its light is added up.
// include stages/camera.wgsl
// include stages/receivers.wgsl
// include optics/density.wgsl

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var<storage, read> photons: array<Caustic>;
@group(0) @binding(2) var<storage, read> materials: array<Material>;
@group(0) @binding(3) var points: texture_2d<u32>;
@group(0) @binding(4) var normals: texture_2d<u32>;
@group(0) @binding(5) var base: texture_2d<f32>;
@group(0) @binding(6) var emission: texture_2d<f32>;
@group(0) @binding(7) var specular: texture_2d<f32>;

override BOUND_SCALE: f32 = 1.0;   // a smaller triangle would cut the kernel
const MARGIN = 0.125;              // pixels, for rounding; the kernel falls to zero at its edge
const TRIANGLE = array(vec2f(-sqrt(3.0), -1.0), vec2f(sqrt(3.0), -1.0), vec2f(0.0, 2.0));   // round the unit disc

struct Splat {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) photon: u32,
}

struct Arrived {
    @location(0) radiance: vec4f,     // that the pixel's surface reflects to the eye
    @location(1) irradiance: vec4f,
}

// One triangle a photon: of a kernel as small as a pixel its setup is half the cost. Not instances, since
// some drivers pay for each.
@vertex
fn vs(@builtin(vertex_index) index: u32) -> Splat {
    let clip = on_screen(photons[index / 3u], BOUND_SCALE * TRIANGLE[index % 3u]);
    return Splat(vec4f(clip, 0.5, 1.0), index / 3u);
}

// The normalised device coordinates of a point given in units of a disc, when the unit disc is mapped to the
// ellipse that a photon's kernel covers on the screen.
//
// The plane x - s w = 0 through the eye touches the kernel's ellipsoid where its value at the center,
// squared, is the ellipsoid's form of it. With x counted from the center's projection that is
// d s^2 + 2 b s - a = 0, in which nothing cancels; likewise for any other direction than x. So the
// ellipse has the center -b / d and the covariance a / d + b b^T / d^2. Exact for any projection.
fn on_screen(photon: Caustic, disc: vec2f) -> vec2f {
    let rows = transpose(camera.clip_from_world);
    let center = vec4f(photon.position, 1.0);
    let w = dot(rows[3], center);
    let d = w * w - form(photon, rows[3].xyz, rows[3].xyz);
    if (!(d > 0.0)) {
        return 2.0 * disc;        // it reaches round the eye: the whole screen
    }
    if (w < 0.0) {
        return vec2f(2.0);        // behind the eye: nothing
    }
    let at = vec2f(dot(rows[0], center), dot(rows[1], center)) / w;
    let x = rows[0].xyz - at.x * rows[3].xyz;
    let y = rows[1].xyz - at.y * rows[3].xyz;
    let b = vec2f(form(photon, x, rows[3].xyz), form(photon, y, rows[3].xyz)) / d;
    let margin = MARGIN * 2.0 / camera.size;
    let variance = vec2f(form(photon, x, x), form(photon, y, y)) / d + b * b + margin * margin;
    let width = sqrt(variance.x);
    let shear = (form(photon, x, y) / d + b.x * b.y) / width;
    let height = sqrt(max(variance.y - shear * shear, margin.y * margin.y));
    return at - b + vec2f(width * disc.x, shear * disc.x + height * disc.y);
}

// The ellipsoid's quadratic form: a^T (u u^T + v v^T + h^2 n n^T) b.
fn form(photon: Caustic, a: vec3f, b: vec3f) -> f32 {
    let n = photon.height * normal_of(photon);
    return dot(a, photon.u) * dot(b, photon.u) + dot(a, photon.v) * dot(b, photon.v) + dot(a, n) * dot(b, n);
}

fn normal_of(photon: Caustic) -> vec3f {
    return normalize(cross(photon.u, photon.v));
}

@fragment
fn fs(splat: Splat) -> Arrived {
    let photon = photons[splat.photon];
    let pixel = vec2u(splat.clip.xy);
    let packed = textureLoad(normals, pixel, 0);
    let n = unpack_normal(packed.x);
    let ng = unpack_normal(packed.y);
    let seen = textureLoad(points, pixel, 0);
    let position = bitcast<vec3f>(seen.xyz);
    let offset = position - photon.position;
    let normal = normal_of(photon);
    let wi_ng = dot(photon.wi, ng);
    let kappa = ellipse_kernel(offset, photon.u, photon.v, normal, photon.height);
    let before = dot(offset, photon.front) >= -photon.reach;
    let counts = seen.w != 0u && before && photon_counts(wi_ng, dot(normal, ng), is_inner(photon.side), shows_inner(seen.w, materials[material_row(seen.w)].flags));
    let arriving = select(0.0, kappa * cosine_ratio(dot(photon.wi, n), wi_ng), counts);
    let light = arriving * photon.flux;
    let wo = view_direction(position);
    let radiance = reflected(pixel, seen.w, light, n, wo, photon);
    return Arrived(vec4f(radiance, 0.0), vec4f(light, 0.0));
}

// Radiance towards the eye of a photon's light, as if it came from the estimators.
fn reflected(pixel: vec2u, word: u32, light: vec3f, n: vec3f, wo: vec3f, photon: Caustic) -> vec3f {
    let material = material_row(word);
    let maps = seen_specular(specular, pixel, materials[material].flags);
    let roughness = textureLoad(emission, pixel, 0).a;
    let b = seen_bsdf(word, textureLoad(base, pixel, 0), roughness, maps, materials[material]);
    let alpha = receiver_alpha(b, materials[material].flags);
    let terms = photon_gloss(max(alpha, MIN_ALPHA), n, wo, photon.wi, photon.bounce);
    let gloss = select(vec3f(0.0), terms, alpha > 0.0);
    return reflect_incident(b, Incident(light, light * gloss.z, light * gloss.x, light * gloss.y));
}
