// Pixels that show mirrors, glass, narrow lobes or blended surfaces: which they are, and the light that eye paths
// bring to them.
// include stages/material.wgsl

@group(0) @binding(0) var<storage, read> materials: array<Material>;
@group(0) @binding(1) var ids: texture_2d<u32>;
@group(0) @binding(2) var points: texture_2d<u32>;
@group(0) @binding(3) var base: texture_2d<f32>;
@group(0) @binding(4) var glow: texture_2d<f32>;
@group(0) @binding(5) var<storage, read_write> seen_count: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read_write> seen: array<Seen>;
@group(0) @binding(7) var<storage, read_write> brought: array<Brought>;
@group(0) @binding(8) var direct_in: texture_2d<f32>;
@group(0) @binding(9) var indirect_in: texture_2d<f32>;
@group(0) @binding(10) var emission_in: texture_2d<f32>;
@group(0) @binding(11) var<storage, read> summed: array<Brought>;
@group(0) @binding(12) var direct_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(13) var indirect_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(14) var emission_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(15) var through_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(16) var specular: texture_2d<f32>;
@group(0) @binding(17) var irradiance_in: texture_2d<f32>;

struct Seen {              // a pixel that shows a mirror, glass or a narrow lobe, and the triangle
    pixel: u32,
    instance: u32,
    primitive: u32,
    layers: u32,           // LAYER_*: from which of its layers eye rays go on, and whether it has sheen
}
const LAYER_BASE = 1u;     // what is under a coat, or all
const LAYER_COAT = 2u;
const LAYER_SHEEN = 4u;    // none goes on, but it is lit
const LAYER_BEHIND = 8u;   // what a blended surface lets through
const LAYER_FAR = 16u;     // none goes on, but the other side of a sheet is lit

struct Brought {           // the light that specular paths bring to a pixel
    direct: vec3f,
    pixel: u32,
    indirect: vec3f,
    hidden: f32,           // share that a coat, sheen and transparency hide of the light that is shown already
    emission: vec3f,
    clear: f32,            // share that transparency hides of emission
    through: vec3f,        // share of the background that it shows
    spare2: u32,
    albedo: vec3f,         // of sheen: share of light from all around that it reflects to the eye
    spare3: u32,
}

// Whether eye rays have to go on from a surface: it transmits, is a mirror, or its lobe is narrow.
fn leads_on(b: Bsdf) -> bool {
    let shiny = max(b.f90, max(b.f0.x, max(b.f0.y, b.f0.z))) > 0.0;
    return transmits(b) || (shiny && is_smooth(b)) || is_narrow(b);
}

// Whether a material may be such: the whole of it costs much to read, and most pixels show others.
fn may_lead_on(row: u32) -> bool {
    let roughness = materials[row].roughness;
    let textured = materials[row].metallic_roughness_texture.texture >= 0;
    let by_flags = MATERIAL_TRANSMITS | MATERIAL_COATED | MATERIAL_SHEEN | MATERIAL_ANISOTROPIC | MATERIAL_TRANSLUCENT;
    let layered = (materials[row].flags & by_flags) != 0u;
    return layered || textured || roughness * roughness < 1.01 * NARROW_ALPHA;
}

@compute @workgroup_size(8, 8)
fn find_specular(@builtin(global_invocation_id) thread: vec3u) {
    let pixel = thread.xy;
    let size = textureDimensions(ids);
    if (any(pixel >= size)) {
        return;
    }
    let word = textureLoad(points, pixel, 0).w;
    let row = material_row(word);
    if (word == 0u) {
        return;
    }
    let behind = select(0u, LAYER_BEHIND, (materials[row].flags & MATERIAL_BLEND) != 0u);
    let lit = (materials[row].flags & MATERIAL_UNLIT) == 0u && may_lead_on(row);
    if (behind == 0u && !lit) {
        return;
    }
    let roughness = textureLoad(glow, pixel, 0).a;
    let maps = seen_specular(specular, pixel, materials[row].flags);
    let b = seen_bsdf(word, textureLoad(base, pixel, 0), roughness, maps, materials[row]);
    let coated = (materials[row].flags & MATERIAL_COATED) != 0u;
    let sheen = select(0u, LAYER_SHEEN, (materials[row].flags & MATERIAL_SHEEN) != 0u);
    let anisotropic = (materials[row].flags & MATERIAL_ANISOTROPIC) != 0u;
    let far = select(0u, LAYER_FAR, (materials[row].flags & MATERIAL_TRANSLUCENT) != 0u);
    let own = select(0u, LAYER_BASE, leads_on(b) || anisotropic) | select(0u, LAYER_COAT, coated) | sheen | far;
    let layers = behind | select(0u, own, lit);
    if (layers == 0u) {
        return;
    }
    let slot = atomicAdd(&seen_count[0], 1u);
    if (slot < arrayLength(&seen)) {
        let triangle = textureLoad(ids, pixel, 0).xy;
        seen[slot] = Seen(pixel.y * size.x + pixel.x, triangle.x - 1u, triangle.y, layers);
    }
}

const THREADS = 16384u;    // that share the list among them

fn pixel_of(number: u32, width: u32) -> vec2u {
    return vec2u(number % width, number / width);
}

// Add what the pixels have already, in a pass of its own: no texture of this format can be read and written.
@compute @workgroup_size(64)
fn add_pixels(@builtin(global_invocation_id) thread: vec3u) {
    let width = textureDimensions(direct_in).x;
    for (var i = thread.x; i < arrayLength(&brought); i += THREADS) {
        let pixel = pixel_of(brought[i].pixel, width);
        let shown = 1.0 - brought[i].hidden;
        brought[i].direct += shown * textureLoad(direct_in, pixel, 0).rgb;
        let matte = brought[i].albedo / PI * textureLoad(irradiance_in, pixel, 0).rgb;
        brought[i].indirect += shown * textureLoad(indirect_in, pixel, 0).rgb + matte;
        brought[i].emission += (1.0 - brought[i].clear) * textureLoad(emission_in, pixel, 0).rgb;
    }
}

@compute @workgroup_size(64)
fn write_pixels(@builtin(global_invocation_id) thread: vec3u) {
    let width = textureDimensions(direct_out).x;
    for (var i = thread.x; i < arrayLength(&summed); i += THREADS) {
        let pixel = pixel_of(summed[i].pixel, width);
        textureStore(direct_out, pixel, vec4f(summed[i].direct, 1.0));
        textureStore(indirect_out, pixel, vec4f(summed[i].indirect, 1.0));
        textureStore(emission_out, pixel, vec4f(summed[i].emission, 1.0));
        if (all(pixel < textureDimensions(through_out))) {    // one texel where there is none
            textureStore(through_out, pixel, vec4f(summed[i].through, 1.0));
        }
    }
}
