// Points on spheres and hemispheres, and the frames they live in. Twin of sampling.py.

const PI = 3.14159265358979;

// Duff et al., Building an Orthonormal Basis, Revisited, JCGT 2017. Columns: tangent, bitangent, n.
fn orthonormal_basis(n: vec3f) -> mat3x3f {
    let s = select(-1.0, 1.0, n.z >= -0.125);
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    return mat3x3f(vec3f(1.0 + s * n.x * n.x * a, s * b, -s * n.x), vec3f(b, s + n.y * n.y * a, -n.y), n);
}

fn to_world(local: vec3f, n: vec3f) -> vec3f {
    return orthonormal_basis(n) * local;
}

fn to_local(direction: vec3f, n: vec3f) -> vec3f {
    return direction * orthonormal_basis(n);
}

// A direction about +z with pdf cos / pi.
fn cosine_hemisphere(u1: f32, u2: f32) -> vec3f {
    let radius = sqrt(u1);
    let phi = 2.0 * PI * u2;
    return vec3f(radius * cos(phi), radius * sin(phi), sqrt(1.0 - u1));
}

// A unit vector as a point of [-1, 1]^2. Cigolle et al., A Survey of Efficient Representations for
// Independent Unit Vectors, JCGT 2014.
fn octahedral_encode(n: vec3f) -> vec2f {
    let p = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
    return select(p, octahedral_fold(p), n.z < 0.0);
}

fn octahedral_decode(p: vec2f) -> vec3f {
    let z = 1.0 - abs(p.x) - abs(p.y);
    return normalize(vec3f(select(p, octahedral_fold(p), z < 0.0), z));
}

// In 16 bits a coordinate, rounded alike by all drivers, as floats of 16 bits need not be.
fn pack_normal(n: vec3f) -> u32 {
    return pack2x16snorm(octahedral_encode(n));
}

fn unpack_normal(word: u32) -> vec3f {
    return octahedral_decode(unpack2x16snorm(word));
}

// Turn the corners of the square over its diamond's edges.
fn octahedral_fold(p: vec2f) -> vec2f {
    return (1.0 - abs(p.yx)) * select(vec2f(-1.0), vec2f(1.0), p >= vec2f(0.0));
}
