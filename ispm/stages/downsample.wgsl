// One receiver for each block of BLOCK x BLOCK pixels: a pixel's surface point, where a mean would lie between
// two surfaces. The first pass takes, of the pixels in one plane with that of median depth, the one in the middle:
// which of them has that depth would be up to rounding, and to each pixel at an edge. Later ones take each in turn.
// include stages/camera.wgsl
// include stages/receivers.wgsl
// include stages/blocks.wgsl

const SIDE_MAX = 4u;       // of larger blocks a 4 x 4 subset is looked at
const COUNT_MAX = 16u;
const SAME_PLANE = 1.0;    // pixels that one may lie off the plane of another whose surface it shares

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var<storage, read> materials: array<Material>;
@group(0) @binding(2) var points: texture_2d<u32>;
@group(0) @binding(3) var normals: texture_2d<u32>;
@group(0) @binding(4) var base: texture_2d<f32>;
@group(0) @binding(5) var emission: texture_2d<f32>;
@group(0) @binding(6) var depth: texture_2d<f32>;
@group(0) @binding(7) var ids: texture_2d<u32>;
@group(0) @binding(8) var<storage, read_write> receivers: array<Receiver>;
@group(0) @binding(9) var specular: texture_2d<f32>;

// The pixel in the middle of what a block shows; (-1, -1) where it shows nothing.
fn middle_pixel(block: vec2u) -> vec2i {
    var depths = array<f32, COUNT_MAX>();
    let size = vec2u(camera.size);
    let side = min(BLOCK, SIDE_MAX);
    var seen = 0u;
    for (var k = 0u; k < side * side; k++) {
        let pixel = block_pixel(block, side, k);
        depths[k] = select(0.0, textureLoad(depth, pixel, 0).r, all(pixel < size));
        seen += u32(depths[k] > 0.0);
    }
    if (seen == 0u) {
        return vec2i(-1);
    }
    var median = 0u;
    for (var k = 0u; k < side * side; k++) {
        var nearer = 0u;
        for (var j = 0u; j < side * side; j++) {
            nearer += u32((depths[j] > depths[k]) || (depths[j] == depths[k] && j < k));
        }
        if (depths[k] > 0.0 && nearer == seen / 2u) {
            median = k;
        }
    }
    // In clip space a plane's depth is linear: times its z, depth changes by its x and y times the distance on
    // the screen.
    let own = block_pixel(block, side, median);
    let position = bitcast<vec3f>(textureLoad(points, own, 0).xyz);
    let ng = unpack_normal(textureLoad(normals, own, 0).y);
    let plane = vec4f(ng, -dot(ng, position)) * camera.world_from_clip;
    let slope = vec2f(2.0, -2.0) / camera.size * plane.xy;
    let unit = camera.footprint * select(depths[median], 1.0 / (camera.far - camera.near), camera.orthographic != 0u);
    let middle = vec2f(block * BLOCK) + 0.5 * f32(BLOCK) - 0.5 + select(-0.25, 0.25, ((block.x + block.y) & 1u) == 1u);
    var chosen = own;
    var nearest = 1e9;
    for (var k = 0u; k < side * side; k++) {
        let pixel = block_pixel(block, side, k);
        let off = (depths[k] - depths[median]) * plane.z + dot(slope, vec2f(pixel) - vec2f(own));
        let offset = vec2f(pixel) - middle;
        if (depths[k] > 0.0 && abs(off) <= SAME_PLANE * unit * abs(plane.z) && dot(offset, offset) < nearest) {
            nearest = dot(offset, offset);
            chosen = pixel;
        }
    }
    return vec2i(chosen);
}

// This pass's pixel of a block, where it sees anything; else that in its middle.
fn receiver_pixel(block: vec2u) -> vec2i {
    let pixel = block * BLOCK + vec2u(receiver_offset());
    let seen = all(pixel < vec2u(camera.size)) && textureLoad(depth, pixel, 0).r > 0.0;
    if (camera.pass_index == 0u || !seen) {
        return middle_pixel(block);
    }
    return vec2i(pixel);
}

fn block_pixel(block: vec2u, side: u32, k: u32) -> vec2u {
    return block * BLOCK + (vec2u(k % side, k / side) * BLOCK + BLOCK / 2u) / side;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let low = (vec2u(camera.size) + BLOCK - 1u) / BLOCK;
    if (any(id.xy >= low)) {
        return;
    }
    var r = Receiver();
    let pixel = receiver_pixel(id.xy);
    if (pixel.x >= 0) {
        let at = textureLoad(points, pixel, 0);
        let packed = textureLoad(normals, pixel, 0);
        let word = at.w;
        let material = material_row(word);
        let color = textureLoad(base, pixel, 0);
        let maps = seen_specular(specular, vec2u(pixel), materials[material].flags);
        let b = seen_bsdf(word, color, textureLoad(emission, pixel, 0).a, maps, materials[material]);
        r.position = bitcast<vec3f>(at.xyz);
        r.alpha = receiver_alpha(b, materials[material].flags);
        r.n = unpack_normal(packed.x);
        r.ng = unpack_normal(packed.y);
        r.valid = textureLoad(ids, pixel, 0).r | select(0u, INNER, shows_inner(word, materials[material].flags));
        r.footprint = pixel_footprint(view_depth(r.position)) * f32(BLOCK);
        r.wo = view_direction(r.position);
        r.slant = 1.0 / max(abs(dot(r.wo, r.ng)), 0.02);
    }
    receivers[id.y * low.x + id.x] = r;
}
