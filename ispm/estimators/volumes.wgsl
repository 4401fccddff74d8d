// Photon volumes: each photon is drawn as the polyhedron round its kernel, and its light is added to the
// pixels whose receivers lie inside. McGuire and Luebke, Hardware-Accelerated Global Illumination by Image
// Space Photon Mapping, HPG 2009, section 3.4.
// include estimators/incident.wgsl

struct Screen {
    clip_from_world: mat4x4f,
    size: vec2u,
}

@group(0) @binding(0) var<uniform> screen: Screen;
@group(0) @binding(1) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(2) var<storage, read> photons: array<Photon>;

// An icosahedron with its corners on the unit sphere holds the sphere only when it is larger by 1 / inradius.
override BOUND_SCALE: f32 = 1.25840857;
// The estimate of the talk, and the slips of its slide.
override TALK: bool = false;
override TALK_ERRORS: bool = false;
// Receivers lie anywhere in their pixels, and rasterisation asks for the centres.
const MARGIN = 1.0;   // pixels
const GOLDEN = 1.618033988749895;

struct Volume {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) position_radius: vec4f,
    @location(1) @interpolate(flat) normal_height: vec4f,
    @location(2) @interpolate(flat) wi: vec3f,
    @location(3) @interpolate(flat) flux: vec3f,
    @location(4) @interpolate(flat) bounce: u32,
    @location(5) @interpolate(flat) instance: u32,
}

@vertex
fn vs(@builtin(vertex_index) corner: u32, @builtin(instance_index) index: u32) -> Volume {
    let photon = photons[index];
    let reach = max(photon.radius, photon.height);
    let margin = MARGIN * pixel_width(photon.position, reach);
    let v = BOUND_SCALE * icosahedron(corner);
    let frame = orthonormal_basis(photon.normal);
    let axes = vec3f(photon.radius, photon.radius, photon.height) + margin;
    let clip = screen.clip_from_world * vec4f(photon.position + frame * (axes * v), 1.0);
    return Volume(
        // Half way between the near and far planes at any distance: neither cuts a volume open.
        vec4f(clip.xy, 0.5 * clip.w, clip.w),
        vec4f(photon.position, photon.radius), vec4f(photon.normal, photon.height), photon.wi, photon.flux,
        photon.bounce, photon.instance,
    );
}

// Corner of 12: the cyclic shifts of (0, +-1, +-golden ratio), on the unit sphere.
fn icosahedron(corner: u32) -> vec3f {
    let v = vec3f(0.0, select(-1.0, 1.0, (corner & 1u) != 0u), select(-GOLDEN, GOLDEN, (corner & 2u) != 0u));
    let shift = corner >> 2u;
    return select(select(v.yzx, v.zxy, shift == 1u), v, shift == 0u) * inverseSqrt(1.0 + GOLDEN * GOLDEN);
}

// Width in m of a pixel at the far side of a sphere.
fn pixel_width(center: vec3f, radius: f32) -> f32 {
    let rows = transpose(screen.clip_from_world);
    let w = abs(dot(rows[3], vec4f(center, 1.0))) + radius * length(rows[3].xyz);
    return 2.0 * w / min(f32(screen.size.x) * length(rows[0].xyz), f32(screen.size.y) * length(rows[1].xyz));
}

fn receiver_at(clip: vec4f) -> Receiver {
    let pixel = vec2u(clip.xy);
    return receivers[pixel.y * screen.size.x + pixel.x];
}

fn photon_of(volume: Volume) -> Photon {
    return Photon(
        volume.position_radius.xyz, volume.position_radius.w, volume.flux, volume.bounce,
        volume.wi, volume.instance, volume.normal_height.xyz, volume.normal_height.w,
    );
}

// As `arrival`, by the kernel that was asked for.
fn brought(receiver: Receiver, photon: Photon) -> vec2f {
    if (!TALK) {
        return arrival(receiver, photon);
    }
    let wi_ng = dot(photon.wi, receiver.ng);
    if (receiver.valid == 0u || !arrives(receiver, photon, wi_ng)) {
        return vec2f(0.0);
    }
    let wi_n = dot(photon.wi, receiver.n);
    // Photons already land by the cosine; the slide applies it again.
    let cosine = select(cosine_ratio(wi_n, wi_ng), max(wi_n, 0.0), TALK_ERRORS);
    return talk_kernel(receiver.position - photon.position, photon) * vec2f(1.0, cosine);
}

// exp(-t^2 / 2 s^2), s = 1/3, up to t = 1, where the talk leaves the constant open:
// 1 / (2 pi s^2 (1 - exp(-1 / 2 s^2))) makes its integral over the disc 1.
const GAUSSIAN_NORMALISATION = 1.4484857;

fn talk_kernel(offset: vec3f, photon: Photon) -> f32 {
    let d = length(offset);
    let z = abs(dot(offset, photon.normal));
    let planar2 = max(d * d - z * z, 0.0) / (photon.radius * photon.radius);
    if (planar2 + z * z / (photon.height * photon.height) >= 1.0) {   // the volume ends here
        return 0.0;
    }
    // t = d / radius (1 +- c (radius - height) / height), with c d = z; the slide has the minus.
    let stretch = z / photon.radius * (photon.radius - photon.height) / photon.height;
    let t = max(d / photon.radius + select(stretch, -stretch, TALK_ERRORS), 0.0);
    let kappa = GAUSSIAN_NORMALISATION / (photon.radius * photon.radius) * exp(-4.5 * t * t);
    return select(0.0, kappa, t < 1.0);
}

struct LightSums {
    @location(0) light: vec4f,     // sum of flux kappa c; sum of kappa
    @location(1) fresnel: vec4f,   // sum of flux kappa c Fc
}

struct GlossSums {
    @location(0) f0: vec4f,        // sum of flux kappa c D V (1 - Fc)
    @location(1) f90: vec4f,       // sum of flux kappa c D V Fc
}

@fragment
fn fs_diffuse(volume: Volume) -> @location(0) vec4f {
    let found = brought(receiver_at(volume.clip), photon_of(volume));
    if (found.x == 0.0) { discard; }
    return vec4f(found.y * volume.flux, found.x);
}

@fragment
fn fs_light(volume: Volume) -> LightSums {
    let receiver = receiver_at(volume.clip);
    let found = brought(receiver, photon_of(volume));
    if (found.x == 0.0) { discard; }
    let light = found.y * volume.flux;
    return LightSums(vec4f(light, found.x), vec4f(light * arrival_gloss(receiver, volume.wi, volume.bounce).z, 0.0));
}

@fragment
fn fs_gloss(volume: Volume) -> GlossSums {
    let receiver = receiver_at(volume.clip);
    let found = brought(receiver, photon_of(volume));
    if (found.y == 0.0 || receiver.alpha <= 0.0) { discard; }
    let light = found.y * volume.flux;
    let gloss = arrival_gloss(receiver, volume.wi, volume.bounce);
    return GlossSums(vec4f(light * gloss.x, 0.0), vec4f(light * gloss.y, 0.0));
}
