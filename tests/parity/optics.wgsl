// What tests/parity/test_optics.py runs on the GPU: rows of `given` in, rows of `result` out.
// include optics/rng.wgsl
// include optics/bsdf.wgsl
// include optics/density.wgsl

@group(0) @binding(0) var<storage, read> given: array<array<vec4f, 8>>;
@group(0) @binding(1) var<storage, read_write> result: array<array<vec4f, 4>>;
@group(0) @binding(2) var<storage, read> keys: array<vec4u>;
@group(0) @binding(3) var<storage, read_write> hashes: array<vec4u>;

@compute @workgroup_size(64)
fn rng(@builtin(global_invocation_id) id: vec3u) {
    if (id.x < arrayLength(&keys)) {
        let k = keys[id.x];
        hashes[2u * id.x] = pcg4d(k);
        hashes[2u * id.x + 1u] = bitcast<vec4u>(random4(k.x, k.y, k.z, k.w));
    }
}

fn surface(row: array<vec4f, 8>) -> Bsdf {
    var material = Material();
    material.f0 = row[1].x;
    material.specular_color = row[1].yzw;
    material.specular = row[2].w;
    material.ior = row[4].w;
    material.flags = select(0u, MATERIAL_THIN, row[5].w == 1.0);
    let maps = SpecularMaps(row[7].yzw, row[7].y);
    return surface_bsdf(row[0].xyz, row[0].w, row[2].x, row[6].w, material, maps, row[5].w != 2.0);
}

@compute @workgroup_size(64)
fn bsdf(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= arrayLength(&given)) { return; }
    let row = given[id.x];
    let b = surface(row);
    let n = row[3].xyz;
    let f = eval_bsdf(b, n, row[6].xyz, row[4].xyz, row[5].xyz);
    let g = gloss_terms(b.alpha, n, row[4].xyz, row[5].xyz);
    result[id.x][0] = vec4f(f, pdf_bsdf(b, n, row[4].xyz, row[5].xyz));
    result[id.x][1] = vec4f(g, b.alpha);
    result[id.x][2] = vec4f(b.f0, b.dielectric_f0);
    result[id.x][3] = vec4f(b.tint, b.eta + b.thin);
}

@compute @workgroup_size(64)
fn bsdf_sample(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= arrayLength(&given)) { return; }
    let row = given[id.x];
    let s = sample_bsdf(surface(row), row[3].xyz, row[6].xyz, row[4].xyz, vec3f(row[2].yz, row[3].w), row[7].x > 0.5);
    result[id.x][0] = vec4f(s.wi, select(0.0, 1.0, s.ok));
    result[id.x][1] = vec4f(s.weight, select(0.0, 1.0, s.specular));
}

@compute @workgroup_size(64)
fn specular(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= arrayLength(&given)) { return; }
    let row = given[id.x];
    let b = surface(row);
    let s = smooth_split(b, row[3].xyz, row[6].xyz, row[4].xyz);
    result[id.x][0] = vec4f(s.reflectance, select(0.0, 1.0, s.through));
    result[id.x][1] = vec4f(s.transmittance, select(0.0, 1.0, has_finite(b)));
    result[id.x][2] = vec4f(s.wi_reflected, 0.0);
    result[id.x][3] = vec4f(s.wi_transmitted, 0.0);
}

@compute @workgroup_size(64)
fn density(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= arrayLength(&given)) { return; }
    let row = given[id.x];
    let kappa = density_kernel(row[0].xyz, row[3].xyz, row[1].x, row[1].y);
    let counts = photon_counts(row[2].z, row[2].y, row[1].x > 0.5, row[1].y > 0.5);
    result[id.x][0] = vec4f(
        kappa, cosine_ratio(row[2].x, row[2].y), select(0.0, 1.0, counts),
        adjoint_factor(row[2].x, row[2].y, row[2].z, row[1].z),
    );
    result[id.x][1] = vec4f(octahedral_encode(row[3].xyz), octahedral_encode(row[4].xyz));
    let ellipse = ellipse_kernel(row[0].xyz, row[4].xyz, cross(row[3].xyz, row[4].xyz), row[3].xyz, row[1].y);
    result[id.x][2] = vec4f(octahedral_decode(octahedral_encode(row[4].xyz)), ellipse);
}
