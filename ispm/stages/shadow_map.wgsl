// A light's shadow map as shaders read it: one face, or a cube of them, each a tile of one texture.
// Depth is reversed; perspective: near / (m ahead), without a far plane; parallel: linear.

struct ShadowMap {
    origin: vec3f,     // m, world space
    faces: u32,        // 6: a cube, turned and ordered as cube maps are; 1: a cube's +z alone
    x: vec3f,          // rows, unit, of what takes directions of the world to the cube
    parallel: u32,     // 1: orthographic
    y: vec3f,
    near: f32,         // m; parallel: depth at the origin
    z: vec3f,
    slope: f32,        // parallel: depth that is lost per m
}

struct ShadowTile {    // six for each map
    scale: vec2f,      // texels of the atlas per unit right and down, at 1 m ahead; parallel: at any
    shift: vec2f,      // texels where those are 0
    corner: vec2f,     // texels: the tile's upper left
    size: vec2f,       // texels; 0: nothing there casts a shadow
}

struct CubeFace {
    index: u32,
    on_x: bool,        // the axis it looks along; neither: z
    on_y: bool,
    sign: f32,         // which way
}

// The face that a direction about the light falls on.
fn face_of(p: vec3f, cube: bool) -> CubeFace {
    let a = abs(p);
    let on_x = cube && a.x >= max(a.y, a.z);
    let on_y = cube && !on_x && a.y >= a.z;
    let backwards = cube && select(select(p.z, p.y, on_y), p.x, on_x) < 0.0;
    let index = select(select(4u, 2u, on_y), 0u, on_x) + u32(backwards);
    return CubeFace(select(0u, index, cube), on_x, on_y, select(1.0, -1.0, backwards));
}

// A vector as a face sees it: right, down, ahead; WebGPU, section 23.2.
fn on_face(f: CubeFace, v: vec3f) -> vec3f {
    return vec3f(
        select(select(f.sign * v.x, v.x, f.on_y), -f.sign * v.z, f.on_x),
        select(-v.y, f.sign * v.z, f.on_y),
        f.sign * select(select(v.z, v.y, f.on_y), v.x, f.on_x),
    );
}
