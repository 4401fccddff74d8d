// What one photon brings to one receiver; every estimator on the GPU sums this.
// include optics/bsdf.wgsl
// include optics/density.wgsl

fn arrives(receiver: Receiver, photon: Photon, wi_ng: f32) -> bool {
    let normal_ng = dot(photon.normal, receiver.ng);
    return photon_counts(wi_ng, normal_ng, is_inner(photon.instance), is_inner(receiver.valid));
}

// kappa, and kappa times the cosine ratio; zero where the photon does not count.
fn arrival(receiver: Receiver, photon: Photon) -> vec2f {
    let wi_ng = dot(photon.wi, receiver.ng);
    if (receiver.valid == 0u || !arrives(receiver, photon, wi_ng)) {
        return vec2f(0.0);
    }
    let kappa = density_kernel(receiver.position - photon.position, photon.normal, photon.radius, photon.height);
    return kappa * vec2f(1.0, cosine_ratio(dot(photon.wi, receiver.n), wi_ng));
}

// D V (1 - Fc), D V Fc and Fc; zero where the receiver has no glossy lobe.
fn arrival_gloss(receiver: Receiver, wi: vec3f, bounce: u32) -> vec3f {
    if (receiver.alpha <= 0.0) {
        return vec3f(0.0);
    }
    return photon_gloss(receiver.alpha, receiver.n, receiver.wo, wi, bounce);
}
