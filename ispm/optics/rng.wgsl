// Random numbers without state: a pure function of what they are for. Twin of rng.py, equal to the bit.
// Source: Jarzynski and Olano, Hash Functions for GPU Rendering, JCGT 2020.

fn pcg4d(key: vec4u) -> vec4u {
    var v = key * 1664525u + 1013904223u;
    v.x += v.y * v.w; v.y += v.z * v.x; v.z += v.x * v.y; v.w += v.y * v.z;
    v ^= v >> vec4u(16u);
    v.x += v.y * v.w; v.y += v.z * v.x; v.z += v.x * v.y; v.w += v.y * v.z;
    return v;
}

// The top 24 bits as a number in [0, 1).
fn uniform_float(x: u32) -> f32 {
    return f32(x >> 8u) * 0x1p-24;
}

// Four numbers in [0, 1) for the path `key` and the use `dimension` of them.
fn random4(key: u32, dimension: u32, pass_index: u32, seed: u32) -> vec4f {
    let v = pcg4d(vec4u(key, dimension, pass_index, seed));
    return vec4f(uniform_float(v.x), uniform_float(v.y), uniform_float(v.z), uniform_float(v.w));
}
