// How one photon spreads over the surface it hit, and which points it may light. Twin of density.py.
// Source: biweight kernel, Silverman 1986, in an ellipsoid flattened along the photon's normal.

const KERNEL_NORMALISATION = 0.954929658551372;  // 3 / pi: the integral of (1 - t^2)^2 over the unit disc is pi / 3
const SAME_SURFACE = 0.5;     // photons on surfaces turned more than 60 degrees lie round a corner
const MAX_COSINE_RATIO = 10.0;

// kappa in 1/m2 at `offset` from a photon; radius in its plane, height along its normal.
fn density_kernel(offset: vec3f, normal: vec3f, radius: f32, height: f32) -> f32 {
    let z = dot(offset, normal);
    let planar2 = dot(offset, offset) - z * z;
    let t2 = planar2 / (radius * radius) + z * z / (height * height);
    let m = max(1.0 - t2, 0.0);
    return KERNEL_NORMALISATION / (radius * radius) * m * m;
}

// Likewise of an ellipse with the semi-axes u and v and the unit normal n.
fn ellipse_kernel(offset: vec3f, u: vec3f, v: vec3f, n: vec3f, height: f32) -> f32 {
    let uu = dot(u, u);
    let vv = dot(v, v);
    let at = vec3f(dot(offset, u) / uu, dot(offset, v) / vv, dot(offset, n) / height);
    let m = max(1.0 - dot(at, at), 0.0);
    return KERNEL_NORMALISATION / sqrt(uu * vv) * m * m;
}

// Whether a photon lights a point: it came from the point's side, onto the same surface.
fn photon_counts(wi_ng: f32, normal_ng: f32, inner: bool, point_inner: bool) -> bool {
    return wi_ng > 0.0 && normal_ng > SAME_SURFACE && inner == point_inner;
}

// What a shading normal makes of a photon; wi_ng > 0.
fn cosine_ratio(wi_n: f32, wi_ng: f32) -> f32 {
    return min(max(wi_n, 0.0) / wi_ng, MAX_COSINE_RATIO);
}
