// A light's shadow map as shaders read it: one face, or a cube of them, in an atlas of depth.
// Depth is reversed; perspective: near / (m ahead), without a far plane; parallel: linear.

struct ShadowMap {
    origin: vec3f,     // m, world space
    faces: u32,        // 6: a cube, turned and ordered as cube maps are; 1: a cube's +z alone; 0: no map
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
    side: f32,         // texels; 0: nothing there casts a shadow
    spare: f32,
}
