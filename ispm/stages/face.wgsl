// One face of a light's map: of a cube, a square view, or a parallel one. A shader that includes this
// binds `face` itself. s points right and t down. The axes are those of lights/lightmap.py.

struct Face {
    position: vec3f,     // of the light; of a parallel view its middle
    spare0: u32,
    s: vec3f,
    near: f32,           // m along the face's axis, not of a parallel view
    t: vec3f,
    pass_index: u32,
    axis: vec3f,
    index: u32,          // 6 map + face
    shift: vec2f,        // that the samples lie right of and below the texels' centres; the face spans 2
    orthographic: u32,   // 1: a parallel view
    spare1: u32,
}

// Reversed depth: near / (distance along the axis), without a far plane; of a parallel view 1 at its near
// plane, 0 at its far one.
fn clip_from_world(position: vec3f) -> vec4f {
    let p = position - face.position;
    let st = vec2f(dot(p, face.s), dot(p, face.t));
    let depth = dot(p, face.axis);
    // no branch on the uniform: Mesa 22.3 compiles a shader anew for each of its values, and keeps them all
    let parallel = face.orthographic == 1u;
    let w = select(depth, 1.0, parallel);
    let shifted = st - face.shift * w;
    return vec4f(shifted.x, -shifted.y, select(face.near, 0.5 - 0.5 * depth, parallel), w);
}

// What is_hole needs to know apart one texel, light, surface and pass from another.
fn texel_key(texel: vec2f, instance: u32) -> vec4u {
    let xy = vec2u(texel);
    return vec4u(xy.x | (xy.y << 16u), face.index, instance, face.pass_index);
}
