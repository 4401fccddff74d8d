"""Eye paths against geometrical optics: where they end, and what of the light there arrives."""

import numpy as np
import pytest
from transport import Tracer

from ispm.library.shapes import box, icosphere, polygons
from ispm.paths.branch import REFLECTED, SCATTERED, TRANSMITTED
from ispm.paths.eye import trace_eye
from ispm.paths.eye_paths import EyeRays
from ispm.scene.light import PointLight
from ispm.scene.material import Material
from ispm.scene.scene import Scene

MIRROR = Material((0.9, 0.8, 0.7), metallic=1.0, roughness=0.0)
GLASS = Material((1, 1, 1), roughness=0.0, transmission=1.0, thickness=1.0)
SHEET = Material((0.9, 0.5, 0.2), roughness=0.0, transmission=1.0)
CLAY = Material((0.6, 0.4, 0.2), specular=0.0)


def floor(y=0.0, size=20.0):
    corners = [(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)]
    return polygons([np.array(corners, float) * size + (0, y, 0)])


def wall(z):
    return polygons([np.array([(-9, 0, z), (9, 0, z), (9, 9, z), (-9, 9, z)], float)])


def towards(origin, targets, distances=None):
    """Rays from a point through others; what they show lies there unless said."""
    way = np.asarray(targets, np.float64) - origin
    length = np.linalg.norm(way, axis=1)
    d = way / length[:, None]
    f4 = np.float32
    return EyeRays(
        np.tile(np.asarray(origin, f4), (len(d), 1)), d.astype(f4),
        (length if distances is None else distances).astype(f4), np.arange(len(d), dtype=np.uint32),
        (0.0, 1e-3),
    )  # fmt: skip


def follow(scene, rays, threads=2, seed=0, pass_index=0):
    tracer = Tracer(scene, threads)
    return trace_eye(tracer.packed, tracer.world, tracer.surfaces, rays, seed, pass_index)


def surrounded(scene):
    """The scene within a large white ball that shines by itself, with radiance 1."""
    scene.add(icosphere(100.0, 4), material=Material((1, 1, 1), unlit=True), name="white")
    return scene


def grid(x, y, z, count=12):
    """Points of a square grid, with a coordinate left as it is."""
    axes = [np.linspace(*a, count) if isinstance(a, tuple) else [a] for a in (x, y, z)]
    return np.stack(np.meshgrid(*axes), -1).reshape(-1, 3)


def test_a_mirror_shows_what_lies_on_the_mirrored_ray():
    """Position, weight, length of the path in the footprint, and where the light goes."""
    scene = Scene()
    scene.add(floor(), material=CLAY)
    scene.add(wall(-5.0), material=MIRROR)
    rays = towards((0.3, 1.0, 2.0), grid((-1, 1), (0.2, 0.5), -5.0))
    paths = follow(scene, rays)
    ends, points = paths.ends, paths.points
    assert len(ends) == len(rays.keys) and (ends["lane"] == REFLECTED).all()
    d = rays.directions.astype(float)
    t = -rays.origins[:, 1] / d[:, 1]
    expected = rays.origins + t[:, None] * d
    expected[:, 2] = -10.0 - expected[:, 2]
    # directions have 24 bits, over 25 m at most; the floor's slant doubles it
    assert np.abs(points["position"] - expected).max() < 2e-4
    assert points["footprint"] == pytest.approx(1e-3 * t, rel=1e-5)
    assert np.abs(points["wo"] - d * (-1, -1, 1)).max() < 1e-6
    cosine = -d[:, 2]
    f0 = np.array([0.9, 0.8, 0.7])
    fresnel = f0 + (1 - f0) * ((1 - cosine) ** 5)[:, None]
    assert ends["weight"] == pytest.approx(fresnel, rel=1e-5)


def test_a_mirror_ball_reflects_about_the_sphere_s_normal():
    """Its smooth normals stand for the sphere: facets of 1 degree, ends some 3 m away."""
    scene = Scene()
    scene.add(floor(-3.0), material=CLAY)
    scene.add(icosphere(1.0, 72), material=MIRROR)
    targets = grid((-0.5, 0.5), (-0.6, -0.1), 0.3)
    origin = np.array([0.0, 0.0, 6.0])
    d = (targets - origin) / np.linalg.norm(targets - origin, axis=1)[:, None]
    b = d @ origin
    t = -b - np.sqrt(b * b - (origin @ origin - 1.0))
    hit = origin + t[:, None] * d
    r = d - 2 * np.einsum("ij,ij->i", d, hit)[:, None] * hit
    down = r[:, 1] < -0.3
    paths = follow(scene, towards(origin, hit))
    s = (-3.0 - hit[:, 1]) / r[:, 1]
    expected = (hit + s[:, None] * r)[down]
    rows = np.flatnonzero(down)
    found = paths.points["position"][np.isin(paths.ends["slot"], rows)]
    assert len(found) == len(rows) > 30
    assert np.abs(found - expected).max() < 0.01 * s[down].max()


@pytest.mark.parametrize("ior", [1.2, 1.5, 2.4])
def test_a_slab_moves_what_lies_behind_by_snell_s_law(ior):
    """And lets through what Fresnel's equations and Beer's law leave."""
    glass = Material(
        (0.9, 0.7, 0.5), roughness=0.0, transmission=1.0, thickness=1.0, ior=ior,
        attenuation_color=(0.8, 0.5, 0.3), attenuation_distance=0.5,
    )  # fmt: skip
    scene = Scene()
    scene.add(floor(-1.0), material=CLAY)
    scene.add(box((-9, 1, -9), (9, 1.7, 9)), material=glass)
    rays = towards((0.0, 3.0, 0.0), grid((-2, 2), 1.7, (-2, 2)))
    paths = follow(scene, rays)
    through = paths.ends["lane"] == TRANSMITTED
    assert through.sum() == len(rays.keys)
    d = rays.directions.astype(float)
    inner = np.stack([d[:, 0] / ior, -np.sqrt(1 - (d[:, 0] ** 2 + d[:, 2] ** 2) / ior**2), d[:, 2] / ior], 1)
    entry = rays.origins + (-1.3 / d[:, 1])[:, None] * d
    leave = entry + (-0.7 / inner[:, 1])[:, None] * inner
    expected = leave + (-2.0 / d[:, 1])[:, None] * d
    # as for a mirror, over some 5 m; the corners of the slab and the floor are 20 m away
    assert np.abs(paths.points["position"][through] - expected).max() < 6e-5
    c, e = -d[:, 1], -inner[:, 1]
    reflected = 0.5 * (((c - ior * e) / (c + ior * e)) ** 2 + ((ior * c - e) / (ior * c + e)) ** 2)
    kept = np.array([0.8, 0.5, 0.3]) ** (0.7 / e[:, None] / 0.5)
    tint = np.array([0.9, 0.7, 0.5])
    let_in = tint * (1 - reflected[:, None]) * kept
    expected = let_in * tint * (1 - reflected[:, None])
    assert paths.ends["weight"][through] == pytest.approx(expected, rel=1e-4)


def test_what_a_slab_reflects_within_leaves_it_above():
    """A second path: in, back from the lower face, and out to what hangs above, 2 d / cos of glass later."""
    glass = Material((1, 1, 1), roughness=0.0, transmission=1.0, thickness=1.0, ior=1.5)
    scene = Scene()
    scene.add(floor(4.0), material=CLAY)
    scene.add(box((-9, 1, -9), (9, 1.7, 9)), material=glass)
    rays = towards((0.0, 3.0, 0.0), grid((-2, 2), 1.7, (-2, 2)))
    paths = follow(scene, rays)
    within = paths.ends["lane"] == SCATTERED
    assert within.sum() == len(rays.keys)
    d = rays.directions.astype(float)
    inner = np.stack([d[:, 0] / 1.5, -np.sqrt(1 - (d[:, 0] ** 2 + d[:, 2] ** 2) / 2.25), d[:, 2] / 1.5], 1)
    leave = rays.origins + (-1.3 / d[:, 1])[:, None] * d + (-1.4 / inner[:, 1])[:, None] * inner * (1, 0, 1)
    expected = leave + (-2.3 / d[:, 1])[:, None] * d * (1, -1, 1)
    assert np.abs(paths.points["position"][within] - expected).max() < 1e-4
    c, e = -d[:, 1], -inner[:, 1]
    reflected = 0.5 * (((c - 1.5 * e) / (c + 1.5 * e)) ** 2 + ((1.5 * c - e) / (1.5 * c + e)) ** 2)
    # at the face where it leaves it stands for what is reflected once more as well
    assert paths.ends["weight"][within][:, 0] == pytest.approx((1 - reflected) * reflected, rel=1e-4)


def test_a_sheet_tints_what_lies_behind_and_reflects_the_rest():
    scene = Scene()
    scene.add(floor(-1.0), material=CLAY)
    scene.add(floor(4.0), material=CLAY)
    scene.add(floor(1.0, 9.0), material=SHEET)
    rays = towards((0.0, 3.0, 0.0), grid((-2, 2), 1.0, (-2, 2)))
    paths = follow(scene, rays)
    d = rays.directions.astype(float)
    c = -d[:, 1]
    e = np.sqrt(1 - (1 - c * c) / 1.5**2)
    reflected = (0.5 * (((c - 1.5 * e) / (c + 1.5 * e)) ** 2 + ((1.5 * c - e) / (1.5 * c + e)) ** 2))[:, None]
    through = paths.ends["lane"] == TRANSMITTED
    straight = rays.origins + (-4.0 / d[:, 1])[:, None] * d
    assert np.abs(paths.points["position"][through] - straight).max() < 6e-5
    tint = np.array([0.9, 0.5, 0.2])
    assert paths.ends["weight"][through] == pytest.approx((1 - reflected) * tint, rel=1e-4)
    above = paths.ends["lane"] == REFLECTED
    assert paths.points["position"][above][:, 1] == pytest.approx(4.0)
    assert paths.ends["weight"][above] == pytest.approx(np.broadcast_to(reflected, (len(d), 3)), rel=1e-4)


def fresnel(cosine, ior=1.5):
    e = np.sqrt(1 - (1 - cosine**2) / ior**2)
    across, along = (cosine - ior * e) / (cosine + ior * e), (ior * cosine - e) / (ior * cosine + e)
    return 0.5 * (across**2 + along**2)


@pytest.mark.parametrize("pass_index", [0, 1])
def test_what_glass_mirrors_is_seen_through_a_sheet(pass_index):
    """Though what lies below that glass is the stronger: the path parts twice. In the first pass the second
    branch takes over what the block's other faces reflect, of .08 of the light at most."""
    scene = Scene()
    scene.add(box((-9, -9, -9), (9, 0, 9)), material=GLASS)
    scene.add(wall(-8.0), material=CLAY)
    scene.add(wall(1.0), material=SHEET)
    floor_at = grid((-1, 1), 0.0, (-2, -0.5))
    origin = np.array([0.0, 1.0, 2.0])
    d = (floor_at - origin) / np.linalg.norm(floor_at - origin, axis=1)[:, None]
    sheet_at = origin - d / d[:, 2:]
    paths = follow(scene, towards(origin, sheet_at), pass_index=pass_index)
    up = d * (1, -1, 1)
    expected = floor_at + ((-8.0 - floor_at[:, 2]) / up[:, 2])[:, None] * up
    away = np.abs(paths.points["position"] - expected[paths.ends["slot"]]).max(axis=1)
    ends = paths.ends[away < 1e-4]  # others went through the block below, and came up by chance
    assert np.array_equal(np.sort(ends["slot"]), np.arange(len(d))) and (ends["lane"] == SCATTERED).all()
    ends = ends[np.argsort(ends["slot"])]
    weight = ((1 - fresnel(-d[:, 2])) * fresnel(-d[:, 1]))[:, None] * np.array([0.9, 0.5, 0.2])
    more = ends["weight"] - weight
    assert (np.abs(more) if pass_index else -more).max() < 1e-4 * weight.max()
    assert more.max() <= 0.08


def test_a_ball_of_the_index_of_air_is_not_seen():
    scene = Scene()
    scene.add(floor(-2.0), material=CLAY)
    air = Material((1, 1, 1), roughness=0.0, transmission=1.0, thickness=1.0, ior=1.0)
    scene.add(icosphere(1.0, 12), material=air)
    rays = towards((0.0, 5.0, 0.0), grid((-0.6, 0.6), 0.0, (-0.6, 0.6)), np.full(144, 4.1))
    paths = follow(scene, rays)
    d = rays.directions.astype(float)
    assert len(paths.ends) == len(d)
    assert np.abs(paths.points["position"] - (rays.origins + (-7.0 / d[:, 1])[:, None] * d)).max() < 6e-5
    assert paths.ends["weight"] == pytest.approx(1.0, rel=1e-5)


@pytest.mark.parametrize("material", [MIRROR, GLASS, SHEET], ids=["mirror", "glass", "sheet"])
def test_white_surroundings_stay_white(material):
    """What is neither absorbed nor tinted: a white ball, mirror or glass, cannot be told from the white."""
    scene = Scene()
    white = Material((1, 1, 1), material.metallic, 0.0, transmission=material.transmission,
                     thickness=material.thickness)  # fmt: skip
    scene.add(icosphere(1.0, 24), material=white)
    angle, radius = np.meshgrid(np.linspace(0, 6, 16), np.linspace(0.05, 0.95, 16))
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - radius**2)], -1)
    rays = towards((0.0, 0.0, 9.0), points.reshape(-1, 3))
    paths = follow(surrounded(scene), rays)
    # what is below a thousandth is not followed
    assert paths.emission == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize("roughness", [0.2, 0.5])
@pytest.mark.parametrize("thickness", [0.0, 1.0])
def test_rough_glass_in_white_surroundings_loses_what_facets_shadow(roughness, thickness):
    """Facets steeper than 45 degrees, a^2 / (1 + a^2) of those seen face on, reflect into the surface, and
    less again is shadowed; refraction loses less."""
    scene = Scene()
    scene.add(floor(0.0), material=Material((1, 1, 1), 0.0, roughness, transmission=1.0, thickness=thickness))
    rays = towards((0.0, 5.0, 0.0), grid((-1, 1), 0.0, (-1, 1), 20))
    entered = follow(scene, rays).through.mean() if thickness else 0.0
    paths = follow(surrounded(scene), rays)
    lost = roughness**4 / (1 + roughness**4)
    mean = paths.emission.mean() + entered * (1 - 1 / 1.5**2)  # within glass radiance would be n^2 as large
    # 3200 facets of weights in [0, 1]
    assert 1 - 2 * lost - 4 * (lost / 3200) ** 0.5 < mean < 1.0


BALL = [(0.0, 0.0), (0.3, 0.1), (-0.2, 0.6), (0.5, -0.6), (0.9, 0.0)]


@pytest.mark.parametrize("material", [MIRROR, GLASS, SHEET], ids=["mirror", "glass", "sheet"])
def test_a_background_is_seen_through_glass_and_in_no_mirror(material):
    """Of a ball of glass all that enters comes out again: 1 - R of what goes straight in. A sheet reflects
    and tints twice."""
    scene = Scene()
    scene.add(icosphere(1.0, 48), material=material)
    x, y = np.array(BALL).T
    points = np.stack([x, y, np.sqrt(1 - x * x - y * y)], -1)
    origin = np.array([0.0, 0.0, 900.0])  # far away, so that cosines are the points' z
    paths = follow(scene, towards(origin, points))
    c = points[:, 2]
    e = np.sqrt(1 - (1 - c * c) / 1.5**2)
    r = 0.5 * (((c - 1.5 * e) / (c + 1.5 * e)) ** 2 + ((1.5 * c - e) / (1.5 * c + e)) ** 2)
    if material is MIRROR:
        assert not paths.through.any()
    elif material is GLASS:
        assert paths.through == pytest.approx(np.stack([1 - r] * 3, 1), rel=5e-3)
    else:
        expected = ((1 - r)[:, None] * np.array([0.9, 0.5, 0.2])) ** 2
        assert paths.through[0] == pytest.approx(expected[0], rel=5e-3)
        assert not paths.emission.any()


def test_light_at_the_end_is_exact_with_its_shadows():
    """A floor seen in a mirror, lit by a lamp: beside, through a sheet, and behind a block."""
    scene = Scene()
    scene.add(floor(), material=CLAY)
    scene.add(wall(-5.0), material=MIRROR)
    scene.add(floor(1.0, 0.5), material=SHEET)
    scene.add(box((2.0, 1.0, -0.5), (3.0, 1.2, 0.5)), material=GLASS)
    scene.add(PointLight((5.0, 6.0, 7.0)), translation=(0.0, 2.0, 0.0))
    spots = np.array([(-4, 0, 0), (0.3, 0, 0.4), (5, 0, 0.1)], float)  # open, tinted, dark
    mirrored = spots * (1, 1, -1) + (0, 0, -10)
    origin = np.array([0.0, 0.7, 3.0])
    t = (-5 - origin[2]) / (mirrored[:, 2] - origin[2])
    paths = follow(scene, towards(origin, origin + t[:, None] * (mirrored - origin)))
    order = np.argsort(paths.ends["slot"])
    weight = paths.ends["weight"][order][paths.ends["lane"][order] == REFLECTED][:3]
    way = np.array([0.0, 2.0, 0.0]) - spots
    square = (way**2).sum(1)
    c = 2.0 / np.sqrt(square)
    lit = np.array([5.0, 6.0, 7.0]) * (c / square)[:, None] * np.array([0.6, 0.4, 0.2]) / np.pi
    e = np.sqrt(1 - (1 - c[1] ** 2) / 1.5**2)
    r = 0.5 * (((c[1] - 1.5 * e) / (c[1] + 1.5 * e)) ** 2 + ((1.5 * c[1] - e) / (1.5 * c[1] + e)) ** 2)
    lit[1] *= (1 - r) * np.array([0.9, 0.5, 0.2])
    lit[2] = 0.0
    assert paths.direct == pytest.approx(weight * lit, rel=1e-4, abs=1e-9)


def test_radiance_within_glass_is_told_from_that_outside():
    """A floor at the bottom of a tank of glass: 1 / n^2 of the flux's density, which the end has."""
    scene = Scene()
    scene.add(floor(0.2, 3.0), material=CLAY)
    scene.add(box((-9, 0, -9), (9, 1, 9)), material=GLASS)
    paths = follow(scene, towards((0.0, 3.0, 0.0), [(0.0, 1.0, 0.001)]))
    inside = paths.ends["lane"] == TRANSMITTED
    assert paths.ends["weight"][inside] == pytest.approx(0.96 / 2.25, rel=1e-4)


def test_glow_and_color_of_what_is_unlit_arrive():
    scene = Scene()
    scene.add(floor(0.0), material=Material((0.5,) * 3, emission=(3.0, 2.0, 1.0)))
    scene.add(floor(6.0), material=Material((0.2, 0.3, 0.4), unlit=True))
    scene.add(floor(2.0, 9.0), material=SHEET)
    paths = follow(scene, towards((0.0, 4.0, 0.0), [(0.0, 2.0, 0.0)]))
    expected = 0.96 * np.array([0.9, 0.5, 0.2]) * (3, 2, 1) + 0.04 * np.array([0.2, 0.3, 0.4])
    assert paths.emission[0] == pytest.approx(expected, rel=1e-4)


def mixed():
    scene = Scene()
    scene.add(floor(-1.0), material=Material((0.5, 0.6, 0.7), roughness=0.0))
    frost = Material((0.9, 0.9, 1), 0.0, 0.4, transmission=1.0, thickness=1.0)
    for x, material in enumerate((MIRROR, GLASS, SHEET, frost)):
        scene.add(icosphere(0.6, 8), material=material, translation=(1.3 * x - 2.0, -0.4, 0.0))
    scene.add(PointLight((5.0,) * 3), translation=(0.0, 3.0, 2.0))
    surrounded(scene)
    targets = grid((-2.5, 2.5), (-0.9, 0.1), 0.0, 40)
    way = targets - (0.2, 0.5, 5.0)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    hits = Tracer(scene).world.trace(np.tile((0.2, 0.5, 5.0), (1600, 1)), way)
    return scene, towards((0.2, 0.5, 5.0), targets, hits["t"])


def test_paths_are_the_same_bytes_for_any_number_of_threads(monkeypatch):
    """And for any number of batches: some of these threads take one, others seven."""
    monkeypatch.setattr("ispm.paths.eye._BATCH", 256)
    scene, rays = mixed()
    first, *others = (follow(scene, rays, threads) for threads in (1, 2, 5, 26))
    assert len(first.ends) > 1600
    for other in others:
        for name in ("direct", "emission", "through", "ends", "points"):
            assert getattr(first, name).tobytes() == getattr(other, name).tobytes()
        assert first.rays == other.rays
    assert follow(scene, rays, seed=1).direct.tobytes() != first.direct.tobytes()


def test_everything_that_arrives_is_a_number():
    scene, rays = mixed()
    paths = follow(scene, rays)
    for values in (
        paths.direct,
        paths.emission,
        paths.through,
        paths.ends["weight"],
        paths.points["position"],
    ):
        assert np.isfinite(values).all()
    assert paths.direct.min() >= 0.0 and paths.emission.min() >= 0.0
