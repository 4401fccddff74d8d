// Where a ray meets a triangle that a rasteriser found at its pixel. Twin of accel/meet.py.
// include optics/sampling.wgsl

const INSET = 4e-6;        // of the coordinates: 4 times what gather rays start above surfaces for rounding

struct Met {
    position: vec3f,
    uv: vec2f,             // barycentrics of the second and third corner
    ng: vec3f,             // unit, on the side that the ray comes from
    back: bool,            // whether the corners run clockwise there
}

// The point of a triangle that a ray sees; e1, e2: edges from `corner` to the second and third. All in one space.
// parallel: rays beside it have its direction; else they come from its origin.
//
// Rasterisers snap corners to a grid, of 1/16 pixel at the coarsest, so that rays miss some of their triangles: the
// point is then what on the triangle is nearest on the screen, and a little within, before a wall at that edge.
fn meet(corner: vec3f, e1: vec3f, e2: vec3f, origin: vec3f, direction: vec3f, parallel: bool) -> Met {
    let scale = 1.0 / max(largest(e1), largest(e2));    // lest products of small edges vanish
    let a1 = scale * e1;
    let a2 = scale * e2;
    let n = cross(a1, a2);
    let inverse = 1.0 / max(dot(n, n), 1e-30);
    let facing = dot(n, direction);
    let away = origin - corner;
    var offset = away - select(0.0, dot(n, away) / facing, facing != 0.0) * direction;
    offset -= (dot(n, offset) * inverse) * n;           // what rounding left of the distance from the plane
    let u = dot(cross(scale * offset, a2), n) * inverse;
    let v = dot(cross(a1, scale * offset), n) * inverse;
    let hits = facing != 0.0 && min(min(u, v), 1.0 - u - v) >= 0.0;
    var met = Met(corner + offset, vec2f(u, v), n * sqrt(inverse) * select(1.0, -1.0, facing > 0.0), facing > 0.0);
    let frame = orthonormal_basis(normalize(direction));
    var least = 1e30;
    for (var k = select(0u, 3u, hits); k < 3u; k++) {
        let first = vec2f(f32(k == 1u), f32(k == 2u));
        let edge = vec2f(f32(k == 0u), f32(k == 1u)) - first;
        let a = from_ray(first.x * e1 + first.y * e2 - away, frame, parallel);
        let b = from_ray((first.x + edge.x) * e1 + (first.y + edge.y) * e2 - away, frame, parallel);
        let side = cross(a, b).xy;                      // of the edge's line on the screen
        let along = vec2f(-side.y, side.x);
        let run = dot(b.xy - a.xy, along);
        let share = select(0.0, clamp(-dot(a.xy, along) / run, 0.0, 1.0), run != 0.0);
        let at = mix(a, b, share);
        let off = select(1e30, dot(at.xy, at.xy) / (at.z * at.z), at.z > 0.0);
        if (k == 0u || off < least) {
            least = off;
            met.uv = within(corner, e1, e2, first + share * edge);
            met.position = corner + met.uv.x * e1 + met.uv.y * e2;
        }
    }
    return met;
}

// A point, from a ray's origin, as homogeneous coordinates on a screen that the ray meets at 0.
fn from_ray(p: vec3f, frame: mat3x3f, parallel: bool) -> vec3f {
    let q = p * frame;
    return vec3f(q.xy, select(q.z, 1.0, parallel));
}

fn largest(v: vec3f) -> f32 {
    return max(abs(v.x), max(abs(v.y), abs(v.z)));
}

// A point of a triangle, moved towards the centre of the circle within until it is clear of walls at its edges.
fn within(corner: vec3f, e1: vec3f, e2: vec3f, uv: vec2f) -> vec2f {
    let sides = vec3f(length(e2 - e1), length(e2), length(e1));
    let around = sides.x + sides.y + sides.z;
    let radius = length(cross(e1 / around, e2 / around)) * around;
    let margin = INSET * largest(corner + uv.x * e1 + uv.y * e2);
    return mix(uv, sides.yz / around, min(margin / radius, 0.5));
}
