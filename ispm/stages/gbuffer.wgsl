// What each pixel of the eye sees.
// Vertices are fetched by number instead of through a vertex buffer, so that every corner knows its whole
// triangle: the geometric normal is then exact and flat, where screen-space derivatives of the position
// lose it on triangles smaller than a pixel.
// include stages/camera.wgsl
// include stages/geometry.wgsl
// include stages/material.wgsl

override MASKED: bool = false;     // the material has holes
override TEXTURED: bool = false;   // the material has textures
override MIRRORED: bool = false;   // the instances turn triangles inside out

@group(0) @binding(0) var<uniform> camera: Camera;
@group(1) @binding(3) var metallic_roughness_map: texture_2d<f32>;
@group(1) @binding(4) var metallic_roughness_sampler: sampler;
@group(1) @binding(5) var normal_map: texture_2d<f32>;
@group(1) @binding(6) var normal_sampler: sampler;
@group(1) @binding(7) var emission_map: texture_2d<f32>;
@group(1) @binding(8) var emission_sampler: sampler;
@group(1) @binding(9) var transmission_map: texture_2d<f32>;
@group(1) @binding(10) var transmission_sampler: sampler;

const LARGEST_HALF = 65504.0;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) color: vec4f,
    @location(3) @interpolate(flat) ng: vec3f,
    @location(4) @interpolate(flat) ids: vec2u,
    @location(5) tangent: vec4f,
    @location(6) uv: vec4f,
}

struct Pixel {
    @location(0) ids: vec2u,
    @location(1) normals: vec4f,
    @location(2) base: vec4f,
    @location(3) emission: vec4f,
}

@vertex
fn vs(@builtin(vertex_index) corner: u32, @builtin(instance_index) instance: u32) -> Corner {
    let first = corner - corner % 3u;
    let row = vertex_row(instance, corner);
    let p0 = vertices[vertex_row(instance, first)].position;
    let p1 = vertices[vertex_row(instance, first + 1u)].position;
    let p2 = vertices[vertex_row(instance, first + 2u)].position;
    var out = Corner();
    out.position = point_to_world(instance, vertices[row].position);
    out.clip = camera.clip_from_world * vec4f(out.position, 1.0);
    out.normal = normal_to_world(instance, vertices[row].normal);
    out.ng = normalize(normal_to_world(instance, cross(p1 - p0, p2 - p0)));
    out.color = unpack4x8unorm(vertices[row].color);
    out.ids = vec2u(instance + 1u, instances[instance].material);
    if (TEXTURED) {
        let tangent = vertices[row].tangent;
        out.tangent = vec4f(direction_to_world(instance, tangent.xyz), tangent.w);
        out.uv = vec4f(vertices[row].uv0, vertices[row].uv1);
    }
    return out;
}

// The normal that the map shows, on the front of the surface.
fn mapped_normal(c: Corner, texel: vec3f) -> vec3f {
    let n = normalize(c.normal);
    let t = c.tangent.xyz - n * dot(n, c.tangent.xyz);
    if (material.normal_texture.texture < 0 || c.tangent.w == 0.0 || dot(t, t) == 0.0) {
        return n;
    }
    let tangent = normalize(t);
    let bitangent = cross(n, tangent) * select(c.tangent.w, -c.tangent.w, MIRRORED);
    let m = (2.0 * texel - 1.0) * vec3f(vec2f(material.normal_scale), 1.0);
    return normalize(tangent * m.x + bitangent * m.y + n * m.z);
}

// Both normals on the eye's side. A shading normal that a map or coarse triangles turned past the surface,
// or away from the eye, is put back: no light would leave it, and silhouettes would have black pixels.
fn seen_normals(c: Corner, mapped: vec3f) -> vec4f {
    let wo = view_direction(c.position);
    let ng = c.ng * select(-1.0, 1.0, dot(c.ng, wo) >= 0.0);
    let n = mapped * select(-1.0, 1.0, dot(c.normal, ng) >= 0.0);
    return vec4f(octahedral_encode(bend(bend(n, ng), wo)), octahedral_encode(ng));
}

// `n`, or the unit vector next to it that is just on the side of `toward`. Twin of tracer/surface.py's.
fn bend(n: vec3f, toward: vec3f) -> vec3f {
    let beyond = dot(n, toward);
    if (beyond >= 0.0) {
        return n;
    }
    return normalize(n - (beyond - 1e-3) * toward);
}

@fragment
fn fs(c: Corner) -> Pixel {
    var base = material.base_color * c.color;
    var metallic_roughness = vec2f(material.metallic, material.roughness);
    var emission = material.emission;
    var transmission = material.transmission;
    var n = normalize(c.normal);
    if (TEXTURED) {
        base = base_color_at(c.uv, c.color);
        metallic_roughness *= textureSample(metallic_roughness_map, metallic_roughness_sampler, texture_uv(material.metallic_roughness_texture, c.uv)).bg;
        emission *= textureSample(emission_map, emission_sampler, texture_uv(material.emission_texture, c.uv)).rgb;
        transmission *= textureSample(transmission_map, transmission_sampler, texture_uv(material.transmission_texture, c.uv)).r;
        let texel = textureSample(normal_map, normal_sampler, texture_uv(material.normal_texture, c.uv));
        n = mapped_normal(c, texel.xyz);
    }
    if (MASKED) {
        let key = vec4u(vec2u(c.clip.xy), c.ids.x, camera.pass_index);
        if (is_hole(base.a, key)) {
            discard;
        }
    }
    if ((material.flags & MATERIAL_UNLIT) != 0u) {
        emission = base.rgb;
        base = vec4f(0.0);
    }
    var out = Pixel();
    out.ids = vec2u(c.ids.x, pack_material(c.ids.y, transmission));
    out.normals = seen_normals(c, n);
    out.base = vec4f(base.rgb, metallic_roughness.x);
    out.emission = vec4f(min(emission, vec3f(LARGEST_HALF)), metallic_roughness.y);
    return out;
}
