// Blocks of BLOCK x BLOCK pixels, which share a receiver. A shader that includes this binds `camera`.

override BLOCK: u32 = 4u;
const STEP = 89u;          // a prime: coprime to any BLOCK^2. Of those under 700 it spreads few passes best

// Where in a block its receiver lies, pixels right of and below the block's first: in the first pass anywhere,
// the middle at best; later at each of its pixels in turn, evenly spread over any few passes.
fn receiver_offset() -> vec2f {
    if (camera.pass_index == 0u) {
        return vec2f(0.5 * f32(BLOCK) - 0.5);
    }
    let k = camera.pass_index * STEP % (BLOCK * BLOCK);
    return vec2f(f32(k % BLOCK), f32(k / BLOCK));
}
