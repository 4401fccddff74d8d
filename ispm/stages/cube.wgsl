// One face of the cube of directions about a light. A shader that includes this binds `face` itself.
// Faces are ordered and turned as cube maps are: +x, -x, +y, -y, +z, -z, seen from inside; s points
// right and t down. Twin of cube.py, whose axes it is given.

struct Face {
    position: vec3f,     // of the light
    range: f32,          // m, infinite as 3.4e38
    s: vec3f,
    near: f32,           // m along the face's axis
    t: vec3f,
    pass_index: u32,
    axis: vec3f,
    index: u32,          // 6 light + face
    shift: vec2f,        // that the samples lie right of and below the texels' centres; the face spans 2
    spare0: u32,
    spare1: u32,
}

// Reversed depth without a far plane: near / (distance along the axis).
fn clip_from_world(position: vec3f) -> vec4f {
    let p = position - face.position;
    let depth = dot(p, face.axis);
    let st = vec2f(dot(p, face.s), dot(p, face.t)) - face.shift * depth;
    return vec4f(st.x, -st.y, face.near, depth);
}

// What is_hole needs to know apart one texel, light, surface and pass from another.
fn texel_key(texel: vec2f, instance: u32) -> vec4u {
    let xy = vec2u(texel);
    return vec4u(xy.x | xy.y << 16u, face.index, instance, face.pass_index);
}
