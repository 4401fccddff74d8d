// A triangle that covers the screen: its corners 0 to 2.
@vertex
fn vs(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    return vec4f(vec2f(f32(corner & 1u), f32(corner >> 1u)) * 4.0 - 1.0, 0.5, 1.0);
}
