// Depth of what a light sees through one face of its map, and the tint of thin sheets on its way; both
// sides of every surface count. Blended surfaces are sheets that tint. The viewport is the face's tile.
// include stages/geometry.wgsl
// include optics/bsdf.wgsl

struct View {
    clip_from_local: mat4x4f,   // local: from the origin, along the world's axes
    origin: vec3f,              // m, world space
    spare: u32,
    light: vec4f,               // where the light is and 1, or the direction towards it and 0
}

@group(0) @binding(0) var<uniform> view: View;
@group(1) @binding(3) var transmission_map: texture_2d<f32>;
@group(1) @binding(4) var transmission_sampler: sampler;
@group(1) @binding(5) var specular_map: texture_2d<f32>;
@group(1) @binding(6) var specular_sampler: sampler;
@group(1) @binding(7) var specular_color_map: texture_2d<f32>;
@group(1) @binding(8) var specular_color_sampler: sampler;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) uv: vec4f,
    @location(1) color: vec4f,
    @location(2) local: vec3f,
}

fn clip_from_local(local: vec3f) -> vec4f {
    return view.clip_from_local * vec4f(local, 1.0);
}

@vertex
fn vs(@location(0) position: vec3f, @builtin(instance_index) instance: u32) -> @builtin(position) vec4f {
    return clip_from_local(point_to_world(instance, position) - view.origin);
}

@vertex
fn vs_masked(v: MaskedVertex, @builtin(instance_index) instance: u32) -> Corner {
    let local = point_to_world(instance, v.position) - view.origin;
    return Corner(clip_from_local(local), vec4f(v.uv0, v.uv1), v.color, local);
}

// The base color, and the opacity where it is between; a hole discards the fragment.
fn cover(c: Corner) -> vec4f {
    let color = base_color_at(c.uv, c.color);
    let blends = (material.flags & MATERIAL_BLEND) != 0u;
    if (select(color.a < material.alpha_cutoff && (material.flags & MATERIAL_MASK) != 0u, color.a <= 0.0, blends)) {
        discard;
    }
    return vec4f(color.rgb, select(1.0, color.a, blends));
}

@fragment
fn fs_masked(c: Corner) {
    _ = cover(c);
}

// What a sheet lets through at this incidence, or a blended surface in the mean.
@fragment
fn fs_sheet(c: Corner) -> @location(0) vec4f {
    let n = normalize(cross(dpdx(c.local), dpdy(c.local)));
    let wi = normalize(view.light.xyz - view.light.w * (c.local + view.origin));
    let texel = textureSample(transmission_map, transmission_sampler, texture_uv(material.transmission_texture, c.uv)).r;
    let maps = SpecularMaps(
        textureSample(specular_color_map, specular_color_sampler, texture_uv(material.specular_color_texture, c.uv)).rgb,
        textureSample(specular_map, specular_sampler, texture_uv(material.specular_texture, c.uv)).a,
    );
    let base = cover(c);
    let b = surface_bsdf(base.rgb, material.metallic, 0.0, material.transmission * texel, material, maps, true);
    let smooth_sheet = material.roughness * material.roughness < MIN_ALPHA;
    let clear = select(0.0, 1.0, ((material.flags & MATERIAL_THIN) != 0u) & smooth_sheet);  // & : no branch, see face.wgsl
    let passed = clear * facet_transmittance(b, fresnel_weight(b, abs(dot(n, wi))));
    return vec4f(mix(vec3f(1.0), passed, base.a), 1.0);
}
