"""Triangles that emit light: what a point draws of them, and that draws bring what the triangles do."""

import math

import numpy as np
import pytest
from exact_light import polygon_irradiance, solid_angle, unit
from scipy import stats

from ispm.accel.emitter_tree import (
    NO_LOBE,
    PATH_WORDS,
    Lobe,
    draw_emitter,
    draw_next,
    emitter_chance,
    leaves_for,
)
from ispm.accel.emitters import (
    EMITTER,
    emitter_hit,
    emitter_point,
    emitter_row,
    make_emitters,
    parts_of,
    sample_triangle,
    triangle_pdf,
)
from ispm.accel.records import Hit
from ispm.kernels.simd import alloca
from ispm.library.shapes import icosphere
from ispm.optics.jit import jit
from ispm.optics.rng import random4
from ispm.optics.vector import dot, sub, vec3

f32, i64, u32 = np.float32, np.int64, np.uint32
BOTH = np.zeros(3, f32)  # as a normal: both sides are lit


def emitters_of(corners, radiance=1.0, two_sided=False, lamps=1, half_angles=(), sides=1):
    """Emitters of (n, 3, 3) corners, as many to each of some lamps, whose fronts are counterclockwise;
    half_angles: of cones that lamps shine in, half of them up, half along X; sides: of their parts."""
    rows = np.zeros(len(corners), EMITTER)
    edges = corners[:, 1:] - corners[:, :1]
    across = np.cross(edges[:, 0], edges[:, 1])
    doubled = np.linalg.norm(across, axis=1)
    rows["corner"], rows["edge1"], rows["edge2"] = corners[:, 0], edges[:, 0], edges[:, 1]
    rows["normal"] = across / np.maximum(doubled, 1e-300)[:, None]
    rows["area"], each = doubled / 2.0, len(corners) // lamps
    rows["instance"], rows["primitive"] = np.divmod(np.arange(len(corners)), each)
    rows["radiance"] = np.reshape(radiance, (-1, 1))
    rows["two_sided"], rows["part"] = two_sided, (0.0, 0.0, 1.0)
    for k, angle in enumerate(half_angles):
        of_lamp = rows["instance"] == k
        rows["cone"][of_lamp], rows["axis"][of_lamp, k % 2] = 1.0 - math.cos(angle), 1.0
    return make_emitters(parts_of(rows, sides), lamps)


def scattered(count, seed, size=0.3):
    """(n, 3, 3) corners of triangles turned at random in a cube of 4 m, of all sizes up to `size`."""
    random = np.random.default_rng(seed)
    middles = random.uniform(-2, 2, (count, 1, 3))
    return middles + size * random.random((count, 1, 1)) * random.normal(size=(count, 3, 3))


def corners_of(emitters):
    """(n, 3, 3) float64 corners of the rows of Emitters."""
    rows = emitters.triangles
    a = rows["corner"].astype(float)
    return np.stack([a, a + rows["edge1"], a + rows["edge2"]], axis=1)


@jit
def chances(emitters, position, n, lobe, out):
    for row in range(len(out)):
        out[row] = emitter_chance(emitters, i64(row), position, n, lobe)


@jit
def draw(emitters, position, n, lobe, numbers, rows, told, left):
    for i in range(len(numbers)):
        rows[i], told[i], left[i] = draw_emitter(emitters, position, n, lobe, numbers[i])


def triple(a):
    return tuple(f32(c) for c in a)


def chances_at(emitters, p, n, lobe=NO_LOBE):
    out = np.zeros(len(emitters.triangles), f32)
    chances(emitters, triple(p), triple(n), lobe, out)
    return out


CASES = {
    "one": lambda: emitters_of(scattered(1, 1)),
    "two": lambda: emitters_of(scattered(2, 2)),
    "seven": lambda: emitters_of(scattered(7, 3), np.arange(1, 8)),
    "two-sided": lambda: emitters_of(scattered(33, 4), two_sided=True),
    "a thousand": lambda: emitters_of(scattered(1000, 5), np.random.default_rng(6).random(1000) ** 8),
    "dark ones among": lambda: emitters_of(scattered(100, 7), np.arange(100) % 3),
    "ball": lambda: emitters_of(2.0 * ball_corners(6)),
    "lamps": lambda: emitters_of(ball_lamps(12), lamps=12),
    "spots": lambda: emitters_of(ball_lamps(12), lamps=12, half_angles=np.linspace(0.1, 2.5, 12)),
    "far apart": lambda: emitters_of(np.concatenate([scattered(5, 8), 1e4 + scattered(5, 9, 40.0)])),
}


def ball_corners(cuts):
    mesh = icosphere(1.0, cuts)
    return mesh.positions[mesh.triangles].astype(float)


def ball_lamps(count):
    """(n, 3, 3) corners of balls in a row."""
    middles = np.linspace(-6.0, 6.0, count)[:, None] * np.array([1.0, 0.2, 0.3])
    return (0.1 * ball_corners(2)[None] + middles[:, None, None]).reshape(-1, 3, 3)


def places(count, seed):
    """Points in a cube of 6 m, and normals; the first few are lit from both sides."""
    random = np.random.default_rng(seed)
    normals = unit(random.normal(size=(count, 3)))
    normals[: count // 4] = 0.0
    return random.uniform(-3, 3, (count, 3)), normals


@pytest.mark.parametrize("alpha", [0.0, 0.03, 0.2])
@pytest.mark.parametrize("name", CASES)
def test_a_row_is_drawn_by_as_many_numbers_as_its_chance_says(name, alpha):
    """Numbers 1 / N apart: rows take intervals of them, whose ends move by the rounding of float32, of 2^-24
    at each of up to 11 nodes; what draws nothing is what is left to 1. And the number that is handed on is
    even again: off by what an interval's ends are, over its length. Chances told are differences from 1, of
    that rounding as well."""
    emitters, count = CASES[name](), 1 << 15
    numbers = ((np.arange(count) + 0.5) / count).astype(f32)
    slack = 2.0 + count * 12 * 2.0**-23
    drawn_somewhere = 0
    for p, n in zip(*places(12, 10), strict=True):
        lobe = Lobe(triple(n), triple(unit(n + 0.5 * p)), f32(alpha * alpha))
        expected = chances_at(emitters, p, n, lobe).astype(float)
        rows, told, left = np.zeros(count, np.int64), np.zeros(count, f32), np.zeros(count, f32)
        draw(emitters, triple(p), triple(n), lobe, numbers, rows, told, left)
        met = rows >= 0
        drawn_somewhere += met.any()
        found = np.bincount(rows[met], minlength=len(expected))
        assert np.abs(found - count * expected).max() <= slack
        assert expected.sum() <= 1.0 + 1e-5
        stretches = (np.diff(met.astype(int)) < 0).sum() + 1
        assert abs((~met).sum() - count * (1.0 - expected.sum())) <= stretches * slack
        np.testing.assert_allclose(told[met], expected[rows[met]], rtol=1e-5, atol=12 * 2.0**-24)
        assert left.min() >= 0.0 and left.max() < 1.0
        for row in np.flatnonzero(found > 500):
            handed = np.sort(left[rows == row])
            even = (np.arange(len(handed)) + 0.5) / len(handed)
            assert np.abs(handed - even).max() <= slack / len(handed)
    assert drawn_somewhere >= min(len(emitters.triangles), 6)


@jit
def draw_in_order(emitters, position, n, numbers, rows, told, least):
    path, k, level = alloca(PATH_WORDS), i64(0), i64(-1)
    for i in range(len(numbers)):
        row, told[i], least[i], k, level = draw_next(emitters, position, n, numbers[i], k, level, path)
        rows[i] = row


@pytest.mark.parametrize("name", CASES)
def test_numbers_in_order_draw_what_each_does_alone(name):
    """The same row but at the ends of intervals, whose rounding is 2^-24 at each of up to 4 nodes: of N
    numbers 1 / N apart few lie so near an end. The interval told holds the number."""
    emitters, count = CASES[name](), 1 << 12
    numbers = ((np.arange(count) + 0.5) / count).astype(f32)
    for p, n in zip(*places(12, 10), strict=True):
        alone, ordered = np.zeros((2, count), np.int64)
        told, told_too, least, left = np.zeros((4, count), f32)
        draw(emitters, triple(p), triple(n), NO_LOBE, numbers, alone, told, left)
        draw_in_order(emitters, triple(p), triple(n), numbers, ordered, told_too, least)
        same = alone == ordered
        assert (~same).sum() <= 1 + 2 * len(emitters.triangles) * count * 12 * 2.0**-23
        met = same & (alone >= 0)
        np.testing.assert_allclose(told[met], told_too[met], rtol=1e-5)
        assert (numbers >= least - 12 * 2.0**-24).all()
        assert (numbers <= least + told_too + 12 * 2.0**-24).all()


@pytest.mark.parametrize("name", CASES)
def test_each_triangle_that_may_light_a_point_has_a_chance(name):
    """Of those whose front is seen, of spots in their cone, and of which some is above the lit side: by a
    thousandth of the distance, which is far above the rounding of the tree's float32."""
    emitters = CASES[name]()
    corners, rows = corners_of(emitters), emitters.triangles
    normals = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    seen_anywhere = 0
    for p, n in zip(*places(40, 11), strict=True):
        v = corners - p
        distance = np.linalg.norm(v, axis=2).min(axis=1)
        front = -np.einsum("nk,nk->n", v.mean(axis=1), normals) / distance
        facing = (front > 1e-3) | ((rows["two_sided"] > 0) & (np.abs(front) > 1e-3))
        above = (v @ n > 1e-3 * distance[:, None]).any(axis=1) | (not n.any())
        toward = np.einsum("nkc,nc->nk", unit(-v), rows["axis"].astype(float)).max(axis=1)
        in_cone = (rows["cone"] == 0.0) | (toward > 1.0 - rows["cone"])
        found = chances_at(emitters, p, n)
        assert (found >= 0.0).all() and np.isfinite(found).all()
        seen = facing & above & in_cone
        seen_anywhere += seen.sum()
        assert (found[seen] > 0.0).all()
    assert seen_anywhere > 10


@jit
def spread(emitter, position, seed, u, v, pdf, again):
    for i in range(len(u)):
        u1, u2, _, _ = random4(u32(i), u32(0), u32(0), seed)
        u[i], v[i], pdf[i] = sample_triangle(emitter, position, u1, u2)
        again[i] = triangle_pdf(emitter, position, u[i], v[i])


SHAPES = {
    "right": np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], float),
    "needle": np.array([(0, 0, 0), (3, 0, 0), (2.9, 0.05, 0)], float),
    "large": np.array([(-8, -7, 0), (9, -6, 0), (-1, 10, 0)], float),
}
VIEWS = {
    "far": (0.4, 0.3, 30.0),
    "near": (0.4, 0.3, 0.6),
    "aside": (-1.0, 2.0, 0.3),
    "behind": (0.2, 0.1, -0.8),
    "tiny": (30.0, 40.0, 120.0),
    "touching": (0.2, 0.02, 0.02),
}


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("shape", SHAPES)
def test_points_of_a_triangle_are_drawn_as_their_density_says(shape, view):
    """A sixteenth of the triangle at a time: its share of the N = 100,000 points is the integral there of
    the density, which is its share of the solid angle, or, drawn by area, of the area. Chi-square, alpha =
    0.001 over all 18 cases (Sidak). The mean of 1 / pdf is the solid angle: within 4.5 standard errors, and
    float32, 1e-4 (of the small ones, whose corners are known to 2^-24 of the place: 1e-3)."""
    corners, p, count = SHAPES[shape], np.array(VIEWS[view]), 100_000
    emitter = emitters_of(corners[None]).triangles[0]
    u, v, pdf, again = np.zeros((4, count), f32)
    spread(emitter, triple(p), u32(7), u, v, pdf, again)
    assert u.min() >= 0.0 and v.min() >= 0.0 and (u + v).max() <= 1.0 + 1e-6
    assert (pdf > 0.0).all()
    np.testing.assert_allclose(pdf, again, rtol=1e-5)
    angle = solid_angle(corners, p)
    inverse = 1.0 / pdf.astype(float)
    error = 4.5 * inverse.std() / math.sqrt(count)
    assert inverse.mean() == pytest.approx(angle, rel=1e-3 if angle < 1e-3 else 1e-4, abs=error)
    by_area = np.ptp(pdf) > 1e-6 * pdf.max() or angle < 1e-4
    parts, cell = [], []
    for i in range(4):
        for j in range(4 - i):
            parts.append(np.array([(i, j), (i + 1, j), (i, j + 1)]) / 4.0)
            if i + j < 3:
                parts.append(np.array([(i + 1, j + 1), (i, j + 1), (i + 1, j)]) / 4.0)
    a, e, f = corners[0], corners[1] - corners[0], corners[2] - corners[0]
    sizes = [solid_angle(a + part[:, :1] * e + part[:, 1:] * f, p) for part in parts]
    expected = np.full(16, 1 / 16) if by_area else np.array(sizes) / sum(sizes)
    found = np.zeros(16)
    for k, part in enumerate(parts):
        low = part.min(axis=0) * 4
        upper = part[0].sum() > part[1].sum()
        cell = (np.minimum(u * 4, 3).astype(int) == low[0]) & (np.minimum(v * 4, 3).astype(int) == low[1])
        found[k] = (cell & (((u * 4 - low[0]) + (v * 4 - low[1]) > 1.0) == upper)).sum()
    assert found.sum() >= count - 3  # at borders
    common = expected * count > 10
    chi2 = ((found - expected * count)[common] ** 2 / (expected * count)[common]).sum()
    assert stats.chi2.sf(chi2, common.sum() - 1) > 1 - (1 - 0.001) ** (1 / 18)


@jit
def irradiance(emitters, position, n, seed, out):
    """Irradiance by one draw each, as if nothing cast shadows."""
    for i in range(len(out)):
        u0, u1, u2, _ = random4(u32(i), u32(1), u32(0), seed)
        row, chance, _ = draw_emitter(emitters, position, n, NO_LOBE, u0)
        if row < 0:
            continue
        emitter = emitters.triangles[row]
        u, v, pdf = sample_triangle(emitter, position, u1, u2)
        segment = sub(emitter_point(emitter, u, v), position)
        if emitter.two_sided == u32(0) and dot(segment, vec3(emitter.normal)) >= f32(0):
            continue
        cosine = dot(n, segment) / f32(math.sqrt(dot(segment, segment)))
        if pdf > f32(0) and cosine > f32(0):
            out[i] = emitter.radiance[0] * cosine / (pdf * chance)


def exact_irradiance(emitters, p, n):
    total, corners = 0.0, corners_of(emitters)
    for k, row in enumerate(emitters.triangles):
        front = np.cross(corners[k, 1] - corners[k, 0], corners[k, 2] - corners[k, 0]) @ (p - corners[k, 0])
        if front > 0.0 or row["two_sided"]:
            total += float(row["radiance"][0]) * polygon_irradiance(corners[k], p, n)
    return total


RECTANGLE = np.array([[(-1, 2, -0.5), (1, 2, -0.5), (1, 2, 0.5)], [(-1, 2, -0.5), (1, 2, 0.5), (-1, 2, 0.5)]])
LIT = {
    "rectangle": (lambda: emitters_of(RECTANGLE.astype(float)), 400_000),
    "a thousand": (CASES["a thousand"], 400_000),
    "two-sided": (CASES["two-sided"], 400_000),
    "ball": (CASES["ball"], 400_000),
    "far apart": (CASES["far apart"], 400_000),
}


@pytest.mark.parametrize("name", LIT)
def test_draws_bring_the_irradiance_of_lambert(name):
    """The sum over triangles of Lambert's polygon, cut at the horizon, nothing in the shadow: 8 places, each
    within 4.5 standard errors, and 1e-4 of float32."""
    make, count = LIT[name]
    emitters, lit = make(), 0
    points, normals = places(8, 12)
    normals[:2] = (0, 1, 0), (0.6, 0.8, 0)
    for k, (p, n) in enumerate(zip(points, normals, strict=True)):
        out = np.zeros(count, f32)
        irradiance(emitters, triple(p), triple(n), u32(k), out)
        exact = exact_irradiance(emitters, p, n)
        error = 4.5 * out.std(dtype=float) / math.sqrt(count)
        assert out.mean(dtype=float) == pytest.approx(exact, rel=1e-4, abs=error + 1e-9)
        lit += exact > 0.0 and error < 0.2 * exact
    assert lit >= 3


def test_a_rectangle_over_a_plane_is_drawn_evenly():
    """Of two halves of a rectangle seen alike each draw brings about the same: what the tree and spherical
    triangles leave is the cosine, whose spread is known: standard error of N = 10,000 below 0.3 %."""
    emitters, out = LIT["rectangle"][0](), np.zeros(10_000, f32)
    irradiance(emitters, triple((0, 0, 0)), triple((0, 1, 0)), u32(3), out)
    assert out.std() / out.mean() < 0.3


def test_triangles_without_area_or_light_are_no_rows():
    """They are left out, the rest keep their primitives, and the lamp's area is that of all."""
    corners = np.array(scattered(9, 13))
    corners[[2, 5]] = corners[[2, 5], :1]  # points
    corners[7, 2] = corners[7, 1]  # a line
    emitters = emitters_of(corners, [1, 1, 1, 0, 1, 1, 1, 1, 1])
    left = [0, 1, 4, 6, 8]
    assert sorted(emitters.triangles["primitive"]) == left
    for primitive in range(9):
        row, _, _ = emitter_row(emitters, Hit(u32(0), u32(primitive), f32(0.25), f32(0.25)))
        assert row == -1 if primitive not in left else emitters.triangles["primitive"][row] == primitive
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    ).sum()
    np.testing.assert_allclose(emitters.triangles["lamp"], area / 2, rtol=1e-5)
    sums = [chances_at(emitters, p, BOTH).sum() for p in places(20, 14)[0]]
    assert np.isfinite(sums).all() and max(sums) == pytest.approx(1.0, abs=1e-5)
    assert emitters_of(corners[[2, 5]]).triangles.size == 0


@pytest.mark.parametrize("sides", [2, 3, 8])
def test_parts_of_a_triangle_are_found_by_where_they_lie(sides):
    """They fill it once, and each of its points is a point of the part that lies there."""
    corners = np.array(scattered(3, 15))
    whole, parts = emitters_of(corners), emitters_of(corners, sides=sides)
    assert len(parts.triangles) == 3 * sides**2
    assert parts.triangles["area"].sum(dtype=float) == pytest.approx(whole.triangles["area"].sum(), rel=1e-5)
    np.testing.assert_allclose(parts.triangles["lamp"], whole.triangles["lamp"][0], rtol=1e-5)
    random = np.random.default_rng(16)
    met = np.zeros(len(parts.triangles), int)
    for primitive in range(3):
        for u, v in random.dirichlet((1, 1, 1), 400)[:, :2].astype(f32):
            hit = Hit(u32(0), u32(primitive), u, v)
            row, a, b = emitter_row(parts, hit)
            assert min(a, b, 1.0 - a - b) > -1e-5
            there = emitter_hit(parts.triangles[row], a, b)
            assert tuple(there[:2]) == (0, primitive)
            assert there[2:4] == pytest.approx((u, v), abs=1e-6)
            expected = corners[primitive].T @ (1.0 - u - v, u, v)
            assert emitter_point(parts.triangles[row], a, b) == pytest.approx(expected, abs=1e-5)
            met[row] += 1
    assert sides > 3 or met.all()


def test_a_lobe_draws_what_it_reflects():
    """Of balls in a row the ones that a mirror would show, where draws by irradiance take the nearest."""
    emitters, alpha = emitters_of(ball_lamps(12), lamps=12), 0.05
    p, n = np.array([0.0, -1.5, 0.0]), np.array([0.0, 1.0, 0.0])
    for shown in (2, 9):
        lamp = emitters.triangles["corner"][emitters.triangles["instance"] == shown].mean(axis=0)
        wo = unit((lamp - p) * np.array([-1.0, 1.0, -1.0]))
        lobe = Lobe(triple(n), triple(wo), f32(alpha * alpha))
        chance = [chances_at(emitters, p, n, each) for each in (NO_LOBE, lobe)]
        evenly, by_lobe = (np.bincount(emitters.triangles["instance"], c, 12) for c in chance)
        assert by_lobe.argmax() == shown and by_lobe[shown] > 5.0 * evenly[shown]


def test_a_lamp_has_a_part_of_the_tree_of_its_own():
    emitters = emitters_of(ball_lamps(12), lamps=12)
    lamps = emitters.triangles["instance"][emitters.leaves]
    count = len(emitters.triangles) // 12
    parts = np.where(emitters.leaves < 0, -1, lamps.astype(int)).reshape(-1, leaves_for(count))
    assert all(len(set(part) - {-1}) <= 1 for part in parts)
    assert (np.sort(emitters.leaves[emitters.places]) == np.arange(12 * count)).all()
