// What each pixel shows: the point of its triangle, the normals there and the material.
// include stages/camera.wgsl
// include stages/fullscreen.wgsl
// include stages/meet.wgsl
// include stages/geometry.wgsl
// include stages/material.wgsl

override BUMPY: bool = true;       // some material has a normal map

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(4) var ids: texture_2d<u32>;
@group(0) @binding(5) var bumps: texture_2d<f32>;

struct Shown {
    @location(0) point: vec4u,
    @location(1) normals: vec2u,
    @location(2) depth: f32,
}

@fragment
fn fs(@builtin(position) at: vec4f) -> Shown {
    let pixel = vec2u(at.xy);
    let seen = textureLoad(ids, pixel, 0).xy;
    let instance = seen.x - 1u;
    if (seen.x == 0u || !is_in_window(instance, 3u * seen.y)) {
        discard;
    }
    let bump = textureLoad(bumps, pixel, 0).xyz;
    let rows = vec3u(
        vertex_row(instance, 3u * seen.y), vertex_row(instance, 3u * seen.y + 1u), vertex_row(instance, 3u * seen.y + 2u),
    );
    let first = vertices[rows.x].position;
    let e1 = direction_to_world(instance, vertices[rows.y].position - first);
    let e2 = direction_to_world(instance, vertices[rows.z].position - first);
    let ray = pixel_ray(at.xy);
    let met = meet(point_to_world(instance, first), e1, e2, ray.origin, ray.direction, camera.orthographic != 0u);
    let weights = vec3f(1.0 - met.uv.x - met.uv.y, met.uv);
    let normals = mat3x3f(vertices[rows.x].normal, vertices[rows.y].normal, vertices[rows.z].normal);
    var n = met.ng;
    if (any(normals[0] != vec3f(0.0))) {
        n = normalize(normal_to_world(instance, normals * weights));
    }
    let side = select(-1.0, 1.0, dot(n, met.ng) >= 0.0);
    if (BUMPY) {
        let tangent = mat3x3f(
            vertices[rows.x].tangent.xyz, vertices[rows.y].tangent.xyz, vertices[rows.z].tangent.xyz,
        ) * weights;
        n = bumped(n, direction_to_world(instance, tangent), turn_of(instance, rows.x), octahedral_decode(bump.xy));
    }
    let wo = view_direction(met.position);
    // A shading normal that a map or coarse triangles turned past the surface, or away from the eye, is put
    // back: no light would leave it, and silhouettes would have black pixels.
    n = bend(bend(side * n, met.ng), wo);
    let back = met.back != ((instances[instance].flags & INSTANCE_MIRRORED) != 0u);
    return Shown(
        vec4u(bitcast<vec3u>(met.position), pack_material(instances[instance].material, back, bump.z)),
        vec2u(pack_normal(n), pack_normal(met.ng)), clip_depth(met.position),
    );
}

// The bitangent's sign, -1 or 1; 0: there is none.
fn turn_of(instance: u32, row: u32) -> f32 {
    return vertices[row].tangent.w * select(1.0, -1.0, (instances[instance].flags & INSTANCE_MIRRORED) != 0u);
}

// The normal that a map shows, `m`, at a normal `n` of the surface.
fn bumped(n: vec3f, tangent: vec3f, turn: f32, m: vec3f) -> vec3f {
    let t = tangent - n * dot(n, tangent);
    let square = dot(t, t);
    if (turn == 0.0 || square == 0.0) {
        return n;
    }
    let unit = t * inverseSqrt(square);
    return normalize(unit * m.x + cross(n, unit) * turn * m.y + n * m.z);
}

// `n`, or the unit vector next to it that is just on the side of `toward`. Twin of accel/normals.py's.
fn bend(n: vec3f, toward: vec3f) -> vec3f {
    let beyond = dot(n, toward);
    if (beyond >= 0.0) {
        return n;
    }
    return normalize(n - (beyond - 1e-3) * toward);
}
