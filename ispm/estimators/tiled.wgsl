// Photons to receivers through tiles of the screen. In order: `bound` the tiles, `count` their photons,
// `scan` the counts, `fill` the lists, `sort` them, `gather`.
// include estimators/incident.wgsl

struct Screen {
    clip_from_world: mat4x4f,
    size: vec2u,
    tiles: vec2u,
    photon_count: u32,
}

struct Box {               // of a tile's receivers; inside out where it has none
    low: vec3f,
    glossy: u32,
    high: vec3f,
    spare: u32,
}

@group(0) @binding(0) var<uniform> screen: Screen;
@group(0) @binding(1) var<storage, read> receivers: array<Receiver>;
@group(0) @binding(2) var<storage, read> photons: array<Photon>;
@group(0) @binding(3) var<storage, read_write> boxes: array<Box>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> starts: array<u32>;    // of each tile's list, and their end
@group(0) @binding(6) var<storage, read_write> members: array<u32>;
@group(0) @binding(7) var<storage, read_write> result: array<array<vec4f, 4>>;

const SIDE = 8u;           // receivers along a tile's edge
const FAR = 1e30;
const SLACK = 1.0001;      // for the rounding of sums

@compute @workgroup_size(64)
fn bound(@builtin(global_invocation_id) id: vec3u) {
    let tile = id.x;
    if (tile >= screen.tiles.x * screen.tiles.y) { return; }
    var box = Box(vec3f(FAR), 0u, vec3f(-FAR), 0u);
    let corner = SIDE * vec2u(tile % screen.tiles.x, tile / screen.tiles.x);
    let end = min(corner + SIDE, screen.size);
    for (var y = corner.y; y < end.y; y++) {
        for (var x = corner.x; x < end.x; x++) {
            let receiver = receivers[y * screen.size.x + x];
            if (receiver.valid != 0u) {
                box.low = min(box.low, receiver.position);
                box.high = max(box.high, receiver.position);
                box.glossy |= select(0u, 1u, receiver.alpha > 0.0);
            }
        }
    }
    boxes[tile] = box;
    atomicStore(&counts[tile], 0u);
}

// First and last tile, x and y, in which a photon's ellipsoid may be seen; last < first: in none.
// A plane through the eye, row - s w_row, touches the ellipsoid where its value at the center squared
// equals its quadratic form: an equation of second degree in s. Exact for any projection.
fn seen_in(photon: Photon) -> vec4i {
    let rows = transpose(screen.clip_from_world);
    let center = vec4f(photon.position, 1.0);
    let w = dot(rows[3], center);
    let a = w * w - form(photon, rows[3].xyz, rows[3].xyz);
    let last_tile = vec2i(screen.tiles) - 1;
    if (a <= 0.0) {
        return vec4i(0, 0, last_tile);    // it reaches around the eye
    }
    if (w < 0.0) {
        return vec4i(0, 0, -1, -1);
    }
    let at = vec2f(dot(rows[0], center), dot(rows[1], center));
    let b = at * w - vec2f(form(photon, rows[0].xyz, rows[3].xyz), form(photon, rows[1].xyz, rows[3].xyz));
    let c = at * at - vec2f(form(photon, rows[0].xyz, rows[0].xyz), form(photon, rows[1].xyz, rows[1].xyz));
    let root = sqrt(max(b * b - a * c, vec2f(0.0)));
    let low = (b - root) / a;
    let high = (b + root) / a;
    let size = vec2f(screen.size);
    // One pixel of slack: the low resolution need not divide the picture, and pixels may be jittered.
    let first_px = (vec2f(low.x, -high.y) * 0.5 + 0.5) * size - 1.0;   // rows count from the top
    let last_px = (vec2f(high.x, -low.y) * 0.5 + 0.5) * size + 1.0;
    let first = vec2i(floor(clamp(first_px, vec2f(0.0), size + f32(SIDE)) / f32(SIDE)));
    let last = vec2i(floor(clamp(last_px, vec2f(-1.0), size) / f32(SIDE)));
    return vec4i(first, min(last, last_tile));
}

// The ellipsoid's quadratic form: a^T (r^2 (1 - n n^T) + h^2 n n^T) b.
fn form(photon: Photon, a: vec3f, b: vec3f) -> f32 {
    let along = dot(a, photon.normal) * dot(b, photon.normal);
    return photon.radius * photon.radius * (dot(a, b) - along) + photon.height * photon.height * along;
}

// Whether a photon's ellipsoid may reach into a box: its sphere does, and its slab does.
fn meets(photon: Photon, box: Box) -> bool {
    let outside = max(max(box.low - photon.position, photon.position - box.high), vec3f(0.0));
    let reach = SLACK * max(photon.radius, photon.height);
    let half = dot(box.high - box.low, abs(photon.normal));
    let along = dot(box.low + box.high - 2.0 * photon.position, photon.normal);
    return dot(outside, outside) < reach * reach && abs(along) - SLACK * half < 2.0 * SLACK * photon.height;
}

@compute @workgroup_size(64)
fn count(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= screen.photon_count) { return; }
    let photon = photons[id.x];
    let seen = seen_in(photon);
    for (var y = seen.y; y <= seen.w; y++) {
        for (var x = seen.x; x <= seen.z; x++) {
            let tile = u32(y) * screen.tiles.x + u32(x);
            if (meets(photon, boxes[tile])) {
                atomicAdd(&counts[tile], 1u);
            }
        }
    }
}

@compute @workgroup_size(64)
fn fill(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= screen.photon_count) { return; }
    let photon = photons[id.x];
    let seen = seen_in(photon);
    for (var y = seen.y; y <= seen.w; y++) {
        for (var x = seen.x; x <= seen.z; x++) {
            let tile = u32(y) * screen.tiles.x + u32(x);
            if (meets(photon, boxes[tile])) {
                members[starts[tile] + atomicAdd(&counts[tile], 1u)] = id.x;
            }
        }
    }
}

// Sums of the counts before each tile, by one workgroup; the counts become 0 again.
const SCANNERS = 256u;
var<workgroup> partial: array<u32, SCANNERS>;

@compute @workgroup_size(256)
fn scan(@builtin(local_invocation_id) id: vec3u) {
    let tile_count = screen.tiles.x * screen.tiles.y;
    let share = (tile_count + SCANNERS - 1u) / SCANNERS;
    let first = min(id.x * share, tile_count);
    let end = min(first + share, tile_count);
    var sum = 0u;
    for (var tile = first; tile < end; tile++) {
        sum += atomicLoad(&counts[tile]);
    }
    partial[id.x] = sum;
    workgroupBarrier();
    var start = 0u;
    for (var k = 0u; k < id.x; k++) {
        start += partial[k];
    }
    for (var tile = first; tile < end; tile++) {
        starts[tile] = start;
        start += atomicExchange(&counts[tile], 0u);
    }
    if (id.x == SCANNERS - 1u) {
        starts[tile_count] = start;
    }
}

// Put a tile's list in the photons' order: it was filled in whatever order threads came, and sums of floats would
// differ by it. A bitonic sort whose runs all ascend, so that what lies beyond the end need not be there.
const SORTERS = 256u;
var<workgroup> list: vec2u;        // its first member, and their number

@compute @workgroup_size(256)
fn sort(@builtin(workgroup_id) tile: vec3u, @builtin(local_invocation_id) id: vec3u) {
    if (id.x == 0u) {
        list = vec2u(starts[tile.x], starts[tile.x + 1u] - starts[tile.x]);
    }
    let own = workgroupUniformLoad(&list);
    for (var run = 2u; run < 2u * own.y; run = 2u * run) {
        for (var apart = run / 2u; apart > 0u; apart = apart / 2u) {
            for (var i = id.x; i < own.y; i += SORTERS) {
                let j = i ^ select(apart, run - 1u, apart == run / 2u);
                if (j > i && j < own.y) {
                    let a = members[own.x + i];
                    let b = members[own.x + j];
                    members[own.x + i] = min(a, b);
                    members[own.x + j] = max(a, b);
                }
            }
            storageBarrier();
        }
    }
}

// A thread sums a column of a tile, so that a photon is read once for all of its receivers.
@compute @workgroup_size(64)
fn gather(@builtin(global_invocation_id) id: vec3u) {
    let tile = id.x / SIDE;
    if (tile >= screen.tiles.x * screen.tiles.y) { return; }
    let corner = SIDE * vec2u(tile % screen.tiles.x, tile / screen.tiles.x);
    let x = corner.x + id.x % SIDE;
    var own = array<Receiver, SIDE>();
    var light = array<vec4f, SIDE>();
    for (var k = 0u; k < SIDE; k++) {
        if (all(vec2u(x, corner.y + k) < screen.size)) {
            own[k] = receivers[(corner.y + k) * screen.size.x + x];
        }
    }
    for (var m = starts[tile]; m < starts[tile + 1u]; m++) {
        let photon = photons[members[m]];
        for (var k = 0u; k < SIDE; k++) {
            let found = arrival(own[k], photon);
            light[k] += vec4f(found.y * photon.flux, found.x);
        }
    }
    for (var k = 0u; k < SIDE; k++) {
        if (all(vec2u(x, corner.y + k) < screen.size)) {
            result[(corner.y + k) * screen.size.x + x][0] = light[k];
        }
    }
}

// The sums of the glossy lobe, for tiles that have one. Three sums a receiver fill the registers of
// half as many receivers.
const HALF = SIDE / 2u;

@compute @workgroup_size(64)
fn gather_gloss(@builtin(global_invocation_id) id: vec3u) {
    let tile = id.x / (2u * SIDE);
    if (tile >= screen.tiles.x * screen.tiles.y || boxes[tile].glossy == 0u) { return; }
    let corner = SIDE * vec2u(tile % screen.tiles.x, tile / screen.tiles.x);
    let x = corner.x + id.x % SIDE;
    let top = corner.y + (id.x / SIDE) % 2u * HALF;
    var own = array<Receiver, HALF>();
    var fresnel = array<vec3f, HALF>();
    var f0 = array<vec3f, HALF>();
    var f90 = array<vec3f, HALF>();
    for (var k = 0u; k < HALF; k++) {
        if (all(vec2u(x, top + k) < screen.size)) {
            own[k] = receivers[(top + k) * screen.size.x + x];
        }
    }
    for (var m = starts[tile]; m < starts[tile + 1u]; m++) {
        let photon = photons[members[m]];
        for (var k = 0u; k < HALF; k++) {
            let light = arrival(own[k], photon).y * photon.flux;
            let gloss = arrival_gloss(own[k], photon.wi, photon.bounce);
            f0[k] += light * gloss.x;
            f90[k] += light * gloss.y;
            fresnel[k] += light * gloss.z;
        }
    }
    for (var k = 0u; k < HALF; k++) {
        if (all(vec2u(x, top + k) < screen.size)) {
            let i = (top + k) * screen.size.x + x;
            result[i][1] = vec4f(fresnel[k], 0.0);
            result[i][2] = vec4f(f0[k], 0.0);
            result[i][3] = vec4f(f90[k], 0.0);
        }
    }
}
