// The bytes that the CPU and the GPU share. World space, metres; flux in lumen, intensity in candela.

const NO_HIT = 0xffffffffu;

struct Vertex {            // object space
    position: vec3f,
    color: u32,            // linear RGBA, 8 bits each, red lowest
    normal: vec3f,         // 0: that of the triangle
    spare: f32,
    tangent: vec4f,        // w: handedness of the bitangent, 0: none
    uv0: vec2f,
    uv1: vec2f,
}

struct Instance {          // one mesh with one material, placed by a node
    world0: vec4f,         // rows of the 3x4 matrix that takes object space to world space
    world1: vec4f,
    world2: vec4f,
    normal0: vec4f,        // rows of its cofactor matrix, for normals (w unused)
    normal1: vec4f,
    normal2: vec4f,
    first_index: u32,      // of its first triangle in `indices`
    triangle_count: u32,
    material: u32,
    node: u32,             // what the `instance` view shows: nodes in the scene's order
    flags: u32,            // INSTANCE_*
    mesh: u32,
    spare0: u32,
    spare1: u32,
}
struct Window {            // which rows of `vertices` and `indices` are bound; all arrays count from the first of all
    first_vertex: u32,
    first_index: u32,
    first_shown: u32,      // of the indices of the triangles that lie within
    shown_count: u32,
}

const INSTANCE_MIRRORED = 1u;     // the matrix turns triangles inside out

struct TextureUse {        // a texture as one slot of a material uses it
    row0: vec3f,           // rows of the 2x3 matrix on (u, v, 1)
    texture: i32,          // row of the texture table, -1: none
    row1: vec3f,
    uv_set: u32,           // 0 or 1
}

struct Material {
    base_color: vec4f,             // linear, with opacity
    emission: vec3f,               // cd/m2 per channel, strength included
    metallic: f32,
    specular_color: vec3f,         // of KHR_materials_specular
    specular: f32,                 // likewise its factor; also F90 of a dielectric
    roughness: f32,
    f0: f32,                       // ((ior - 1) / (ior + 1))^2
    alpha_cutoff: f32,
    normal_scale: f32,
    flags: u32,                    // MATERIAL_*
    transmission: f32,             // share of the light below the reflection that goes through: tinted, straight or
                                   // refracted, or of a MATERIAL_TRANSLUCENT diffusely
    ior: f32,                      // index of refraction
    clearcoat: f32,                // share of the surface that a clear coat covers
    attenuation: vec3f,            // 1/m per channel, of light inside: exp(-attenuation distance)
    clearcoat_roughness: f32,
    base_color_texture: TextureUse,
    metallic_roughness_texture: TextureUse,
    normal_texture: TextureUse,
    emission_texture: TextureUse,
    transmission_texture: TextureUse,      // R; of a MATERIAL_TRANSLUCENT A
    clearcoat_texture: TextureUse,
    clearcoat_roughness_texture: TextureUse,
    clearcoat_normal_texture: TextureUse,
    specular_texture: TextureUse,
    specular_color_texture: TextureUse,
    sheen_color_texture: TextureUse,
    sheen_roughness_texture: TextureUse,
    anisotropy_texture: TextureUse,
    diffuse_transmission_color_texture: TextureUse,
    sheen_color: vec3f,            // of KHR_materials_sheen; black: none
    sheen_roughness: f32,
    clearcoat_normal_scale: f32,
    anisotropy: f32,               // strength of KHR_materials_anisotropy; 0: none
    anisotropy_direction: vec2f,   // in the plane of tangent and bitangent, unit; a texture's is turned by it
    diffuse_transmission_color: vec3f,     // of KHR_materials_diffuse_transmission
    half_spread: f32,              // of a MATERIAL_DISPERSIVE: what red's index is below `ior`, and blue's above
    beam: vec2f,                   // of a lamp: scale and offset of the cosine to its -Z, see SpotLight.falloff
}
const MATERIAL_MASK = 1u;          // opacity below alpha_cutoff is a hole
const MATERIAL_BLEND = 2u;         // opacity is a probability
const MATERIAL_DOUBLE_SIDED = 4u;
const MATERIAL_UNLIT = 8u;         // base colour is shown as it is; black to light
const MATERIAL_TRANSMITS = 16u;    // some light goes through
const MATERIAL_THIN = 32u;         // and straight on: the surface has no inside
const MATERIAL_CAUSTIC = 64u;      // a mirror or glass that casts caustics, worth aiming photons at
const MATERIAL_COATED = 128u;      // under a clear coat
const MATERIAL_SPECULAR_MAPPED = 256u;   // textures multiply `specular` or `specular_color`
const MATERIAL_SHEEN = 512u;       // under sheen
const MATERIAL_ANISOTROPIC = 1024u;  // facets are wider in one direction: their lobe is left to eye paths
const MATERIAL_TRANSLUCENT = 2048u;  // a thin sheet that lets light through diffusely
const MATERIAL_DISPERSIVE = 4096u;   // a solid whose index depends on the band
const MATERIAL_HAS_INNER = MATERIAL_TRANSMITS | MATERIAL_TRANSLUCENT;  // either: photons at its back are INNER
const MATERIAL_HIDES_PHOTONS = 8192u;  // all of it: photons that arrive are not seen there

struct Light {
    position: vec3f,
    kind: u32,             // LIGHT_*
    intensity: vec3f,      // cd per channel; directional: lx on a surface that faces it
    range: f32,            // m, 0: without end
    direction: vec3f,      // that a spot or directional light shines in, unit
    cone_scale: f32,       // a spot's falloff is clamp(cos scale + offset, 0, 1)^2, cos from its axis;
    cone_offset: f32,      // of the others it is 1: scale 0, offset 1
    spare0: u32,
    spare1: u32,
    spare2: u32,
}
const LIGHT_POINT = 0u;
const LIGHT_SPOT = 1u;
const LIGHT_DIRECTIONAL = 2u;

struct Emitted {           // a photon at its first hit, as the bounce map holds it
    instance: u32,         // NO_HIT: it left the scene
    primitive: u32,
    u: f32,                // barycentric coordinates of the triangle's second and third vertex
    v: f32,
    flux: vec3f,           // lm
    key: u32,              // identity for random numbers
    origin: vec3f,         // where it left a lamp with a surface, m; of an environment its direction
    light: u32,            // row of the lights, or EMITTED_*
    emitter: u32,          // row of the emissive triangle that it left
    spread: f32,           // m, side of the part of its lamp's area that is the photon's own
    turn: f32,             // and of its directions, 1
    spare: u32,
}
const EMITTED_BY_SURFACE = 0xffffffffu;
const EMITTED_BY_ENVIRONMENT = 0xfffffffeu;

struct Photon {            // a photon as it is stored, one for each hit after the first
    position: vec3f,
    radius: f32,           // of its kernel in the surface's plane
    flux: vec3f,
    bounce: u32,           // non-specular scatters before this hit
    wi: vec3f,             // towards where it came from
    instance: u32,         // its row; and INNER
    normal: vec3f,         // geometric, on the side that was hit
    height: f32,           // of its kernel along the normal
}

struct Caustic {           // a photon of a caustic, with a kernel of its own: an ellipse, cut by a plane
    position: vec3f,
    height: f32,           // of the kernel across the ellipse, m
    flux: vec3f,           // lm, of the uncut kernel whose rest holds what the photon brings
    reach: f32,            // how far behind the photon the plane is, m
    wi: vec3f,
    bounce: u32,           // as a Photon's; 1 of light that paths find which meet its lamp
    u: vec3f,              // semi-axes of the ellipse, m; u x v is on the side that was hit
    side: u32,             // INNER or 0
    v: vec3f,
    spare1: u32,
    front: vec3f,          // the plane's normal; nothing behind the plane is lit. 0: uncut
    spare2: u32,
}

struct Receiver {          // a point whose incident light is estimated: a low-resolution pixel's surface
    position: vec3f,
    alpha: f32,            // of the glossy lobe, 0: none; TAKES_NONE
    ng: vec3f,             // geometric normal, on the eye's side
    valid: u32,            // 0: nothing is seen here; a pixel's: instance row + 1; and INNER
    n: vec3f,              // shading normal
    footprint: f32,        // m, width of the low-resolution pixel at the point, seen face on
    wo: vec3f,             // towards the eye
    slant: f32,            // 1 / |wo.ng|
}

// Alpha of mirrors and clear glass: they show none of the light that arrives, which no surface beside them shares.
const TAKES_NONE = -1.0;

// Set where light arrives at the back of a surface that lets light through, as within glass or a paper lantern: the
// front of another may be close by, in the same plane and lit otherwise.
const INNER = 0x80000000u;

fn is_inner(word: u32) -> bool {
    return (word & INNER) != 0u;
}

const PIXEL_BACK = 0x800000u;    // in the word that tells a pixel's material, above its row: the back is seen
