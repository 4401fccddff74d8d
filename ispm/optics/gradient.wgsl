// Irradiance as a linear function of the shading normal. Twin of gradient.py.
// include optics/sampling.wgsl

const MOST_TURNED = 0.5;   // sine of the angle between normals up to which the fit is followed
const STEEPEST = 6e4;      // slope relative to the light that 16 bits hold

// How irradiance changes per unit of the tangent and of the bitangent of a normal, relative to itself, lx/lx. In
// three words of 16-bit floats: absolute slopes would leave their range.
fn pack_slope(light: vec3f, along_x: vec3f, along_y: vec3f, along_z: vec3f, n: vec3f) -> vec3u {
    let basis = orthonormal_basis(n);
    let relative = select(vec3f(0.0), 1.0 / light, light > vec3f(0.0));
    let gradient = mat3x3f(along_x, along_y, along_z);
    let u = clamp(relative * (gradient * basis[0]), vec3f(-STEEPEST), vec3f(STEEPEST));
    let v = clamp(relative * (gradient * basis[1]), vec3f(-STEEPEST), vec3f(STEEPEST));
    return vec3u(pack2x16float(u.xy), pack2x16float(vec2f(u.z, v.x)), pack2x16float(v.yz));
}

// Irradiance `light` of a surface of normal `n` on one of normal `m`.
fn turned_light(light: vec3f, slope: vec3u, n: vec3f, m: vec3f) -> vec3f {
    let basis = orthonormal_basis(n);
    var off = vec2f(dot(m, basis[0]), dot(m, basis[1]));
    off *= min(1.0, MOST_TURNED * inverseSqrt(max(dot(off, off), 1e-12)));
    let a = unpack2x16float(slope.x);
    let b = unpack2x16float(slope.y);
    let c = unpack2x16float(slope.z);
    return light * max(1.0 + off.x * vec3f(a, b.x) + off.y * vec3f(b.y, c), vec3f(0.0));
}
