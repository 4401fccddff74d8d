// Nothing but blending: how many pixels an adapter adds to in a second.

// include stages/fullscreen.wgsl

@fragment
fn fs() -> @location(0) vec4f {
    return vec4f(0.001);
}
