// Emission, cd/m2 to 4.29e9, in half floats: below 32768 as it is, above its root, negative.
const PLAIN_GLOW = 32768.0;
const LARGEST_HALF = 65504.0;

fn pack_glow(emission: vec3f) -> vec3f {
    return select(emission, -min(sqrt(emission), vec3f(LARGEST_HALF)), emission > vec3f(PLAIN_GLOW));
}

fn unpack_glow(kept: vec3f) -> vec3f {
    return select(kept, kept * kept, kept < vec3f(0.0));
}
