"""Glass that bends each band of light by another angle, against Snell's law and Fresnel's equations."""

import math

import numpy as np
import pytest
from transport import Tracer, aim, render, total

from ispm.library.shapes import icosphere, polygons
from ispm.optics.dispersion import band_number
from ispm.optics.records import MATERIAL_DISPERSIVE
from ispm.paths.branch import REFLECTED, TRANSMITTED
from ispm.paths.eye import trace_eye
from ispm.paths.eye_paths import EyeRays
from ispm.reference.paths import path_light
from ispm.scene.camera import Camera
from ispm.scene.environment import Environment
from ispm.scene.light import DirectionalLight
from ispm.scene.material import Material
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView

f32, u32 = np.float32, np.uint32

INDEX, DISPERSION = 1.6, 4.0
INDICES = INDEX + (INDEX - 1.0) * 0.025 * DISPERSION * np.array([-1.0, 0.0, 1.0])
ANGLE, TURN = math.radians(40.0), math.radians(20.0)  # of the prism's edge; of the light against its top
UP, LOWER = np.array([0.0, 1.0, 0.0]), np.array([math.sin(ANGLE), math.cos(ANGLE), 0.0])
DOWN = np.array([-math.sin(TURN), -math.cos(TURN), 0.0])
EDGE, SIZE, WALL = np.array([-1.0, 0.0, 0.0]), 4.0, -8.0
BLACK = Material((1e-6,) * 3, specular=0.0)  # which keeps photons that arrive, and sends none on


def glass(dispersion=DISPERSION, **other):
    given = {"roughness": 0.0, "transmission": 1.0, "thickness": 1.0, "ior": INDEX, **other}
    return Material((1, 1, 1), dispersion=dispersion, **given)


def quad(*corners):
    return polygons([np.array(corners, float)])


def prism(material):
    """A prism whose top is y = 0, x from EDGE on; the lower face goes down from the edge by ANGLE. What would
    leave its other side is absorbed; a wall at y = WALL takes what it sends down."""
    (x0, _, _), x1, y1, z = EDGE, EDGE[0] + SIZE, -SIZE * math.tan(ANGLE), SIZE
    a, b, c = (x0, 0.0), (x1, 0.0), (x1, y1)
    near, far = ([(*corner, side) for corner in (a, b, c)] for side in (z, -z))
    scene = Scene()
    scene.add(quad(near[0], near[1], far[1], far[0]), material=material, name="top")
    scene.add(quad(near[0], far[0], far[2], near[2]), material=material, name="lower")
    scene.add(quad(near[1], near[2], far[2], far[1]), material=BLACK, name="side")
    for name, (p, q, r) in ("near", (near[0], near[2], near[1])), ("far", (far[0], far[1], far[2])):
        scene.add(polygons([np.array([p, q, r], float)]), material=BLACK, name=name)
    wall = quad((-60, WALL, -60), (-60, WALL, 60), (60, WALL, 60), (60, WALL, -60))
    scene.add(wall, material=Material((0.5,) * 3, specular=0.0), name="wall")
    return scene


def with_sun(scene, d=DOWN):
    """The scene with light of 1 lx along d."""
    axis = np.array([*np.cross((0.0, 0.0, -1.0), d), 1.0 - d[2]])  # takes -z to it
    scene.add(DirectionalLight((1.0,) * 3), rotation=tuple(axis / np.linalg.norm(axis)))
    return scene


def bent(d, normal, eta):
    """Snell's law: unit d beyond a face with the unit normal against it, eta: the index there over this."""
    c = -d @ normal
    return d / eta + (c / eta - math.sqrt(1.0 - (1.0 - c * c) / eta**2)) * normal


def reflectance(d, normal, eta):
    """Fresnel's equations for unpolarized light."""
    c = -d @ normal
    t = math.sqrt(eta * eta - 1.0 + c * c)
    return 0.5 * (((c - t) / (c + t)) ** 2 + ((eta**2 * c - t) / (eta**2 * c + t)) ** 2)


def through(n):
    """Where light along DOWN goes within the prism and behind it, and the share that passes both faces."""
    inside = bent(DOWN, UP, n)
    passed = (1.0 - reflectance(DOWN, UP, n)) * (1.0 - reflectance(inside, LOWER, 1.0 / n))
    return inside, bent(inside, LOWER, 1.0 / n), passed


def on_wall(top, n):
    """Where light along DOWN that meets the prism's top at a point meets the wall."""
    inside, outside, _ = through(n)
    leaves = top + inside * ((EDGE - top) @ LOWER / (inside @ LOWER))
    return leaves + outside * (WALL - leaves[1]) / outside[1]


def with_mirror(scene):
    """The scene below a mirror, y = 3, that light which the prism's top reflects passes by."""
    face, white = (
        quad((1.5, 3, -9), (9, 3, -9), (9, 3, 9), (1.5, 3, 9)),
        Material(metallic=1.0, roughness=0.0),
    )
    scene.add(face, material=white, name="mirror")
    return scene


def by_mirror(tops):
    """Where rays begin, below the mirror, that it sends along DOWN to points on the prism's top, and their
    direction."""
    up = DOWN * (1, -1, 1)
    return tops + DOWN * 3.0 / DOWN[1] - up, up


def lit_prism(material, flux=(1.0, 1.0, 1.0), count=10_000, mirrored=False):
    """A Tracer, and photons of a sun that come to the prism's top side by side, `flux` lm together, straight
    or by way of a mirror."""
    scene = prism(material)
    tops = np.zeros((count, 3))
    tops[:, 0] = np.linspace(1.0, 2.0, count)
    starts, d = tops - DOWN, DOWN
    if mirrored:
        scene, (starts, d) = with_mirror(scene), by_mirror(tops)
    tracer = Tracer(with_sun(scene, d))
    np.testing.assert_allclose(tracer.packed.lights["direction"][0], d, atol=1e-6)
    emitted = aim(tracer, starts, np.tile(d, (count, 1)))
    emitted["flux"] = f32(flux) / f32(count)
    return tracer, emitted


def is_direct(photons, n):
    """Whether photons passed both faces without being reflected in between."""
    _, outside, _ = through(n)
    return np.abs(photons["wi"] + outside).max(axis=1) < 1e-5


@pytest.mark.parametrize("mirrored", [False, True])
def test_photons_leave_a_prism_in_the_direction_of_their_band(mirrored):
    tracer, emitted = lit_prism(glass(), mirrored=mirrored)
    found = tracer.walk(emitted, 0).photons
    bands = found["flux"] > 0.0
    assert (bands.sum(axis=1) == 1).all()
    for band, n in enumerate(INDICES):
        own = found[bands[:, band]]
        assert is_direct(own, n).mean() > 0.8  # others are reflected within; float32 directions
        for other in np.delete(INDICES, band):
            assert not is_direct(own, other).any()


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("flux", [(1.0, 1.0, 1.0), (1.0, 0.6, 0.2), (0.5, 0.0, 1.0)])
def test_each_band_keeps_the_flux_that_its_faces_let_through(flux, mirrored):
    """A photon of a band passes both faces by chance: five deviations of the number of those that do. What
    draws its band, behind the mirror, has all the flux: of that three photons more, by which the number of
    draws is off. Of what is drawn nothing is lost."""
    tracer, emitted = lit_prism(glass(), flux, mirrored=mirrored)
    found = tracer.walk(emitted, 0)
    np.testing.assert_allclose(found.absorbed + found.escaped + found.dropped, found.emitted, atol=1e-6)
    np.testing.assert_allclose(found.emitted, flux, rtol=1e-6)
    for band, n in enumerate(INDICES):
        _, _, passed = through(n)
        one = emitted["flux"][0].sum(dtype=float) if mirrored else emitted["flux"][0, band] + 1e-30
        drawn = found.emitted[band] / one
        direct = total(found.photons[is_direct(found.photons, n)])[band] / one
        deviation = math.sqrt(drawn * passed * (1.0 - passed))
        assert abs(direct - drawn * passed) <= 5.0 * deviation + 3.0 * mirrored


def test_photons_that_met_something_before_draw_one_band_each():
    tracer, emitted = lit_prism(glass(), count=3000, mirrored=True)
    found = tracer.walk(emitted, 0)
    assert len(found.photons) <= 3000 and found.photon_count == 3000
    np.testing.assert_allclose(found.photons["flux"].max(axis=1), 3.0 / 3000, rtol=1e-5)
    alone = lit_prism(glass(), flux=(0.0, 0.0, 1.0), count=3000, mirrored=True)
    found = alone[0].walk(alone[1], 0).photons
    assert (found["flux"][:, :2] == 0.0).all()  # that of one band goes on as it is
    np.testing.assert_allclose(found["flux"][:, 2], 1.0 / 3000, rtol=1e-5)


def test_beams_of_a_drawn_band_are_as_much_wider():
    """The area that a photon stands for is in proportion to its flux; both are three times those of one
    that was split."""
    wide, split = (
        (walk.photons, walk.beams[:, :6].reshape(-1, 2, 3))
        for mirrored in (True, False)
        for tracer, emitted in [lit_prism(glass(), count=300, mirrored=mirrored)]
        for walk in [tracer.walk(emitted, 0)]
    )
    for band, n in enumerate(INDICES):
        areas = []
        for photons, beams in (wide, split):
            own = is_direct(photons, n) & (photons["flux"][:, band] > 0.0)
            areas.append(np.linalg.norm(np.cross(beams[own, 0], beams[own, 1]), axis=1))
        np.testing.assert_allclose(areas[0].mean(), 3.0 * areas[1].mean(), rtol=1e-4)


def test_without_dispersion_photons_keep_their_bands():
    tracer, emitted = lit_prism(glass(0.0), count=3000)
    assert not (tracer.packed.materials["flags"] & MATERIAL_DISPERSIVE).any()
    assert (tracer.walk(emitted, 0).photons["flux"] > 0.0).all()
    for other in ({"thickness": 0.0}, {"transmission": 0.0}, {"ior": 0.0}, {"unlit": True}):
        assert not glass(**other).dispersive


def test_three_photons_in_a_row_have_three_bands():
    keys = np.arange(999, dtype=u32)
    drawn = np.array([[band_number(key, u32(number), u32(0)) for key in keys] for number in range(8)])
    thirds = np.floor(3.0 * drawn).astype(int).reshape(8, -1, 3)
    assert (np.sort(thirds, axis=2) == np.arange(3)).all()
    even = (np.arange(999) + 0.5) / 999
    assert np.abs(np.sort(drawn, axis=1) - even).max() < 0.01  # by chance .03 and more (Kolmogorov)
    assert len({tuple(first) for first in thirds[:, 0].tolist()}) == 3  # passes differ


def follow(scene, origin, direction):
    """Eye paths along a ray."""
    tracer = Tracer(scene)
    origins, directions = f32([origin]), f32([direction])
    hits = tracer.world.trace(origins, directions)
    rays = EyeRays(origins, directions, hits["t"].copy(), np.zeros(1, u32), (0.0, 1e-3))
    return trace_eye(tracer.packed, tracer.world, tracer.surfaces, rays, 0, 0)


def assert_ends(paths, lane, top, weights):
    """One end of each band, where Snell's law leads from a point on the prism's top, and of its weight."""
    ends, places = paths.ends[paths.ends["lane"] == lane], paths.points[paths.ends["lane"] == lane]
    bands = ends["weight"] > 0.0
    np.testing.assert_array_equal(bands.sum(axis=0), 1)
    np.testing.assert_array_equal(bands.sum(axis=1), 1)
    for band, n in enumerate(INDICES):
        (own,) = np.flatnonzero(bands[:, band])
        np.testing.assert_allclose(places["position"][own], on_wall(top, n), atol=1e-4)
        assert ends["weight"][own, band] == pytest.approx(weights[band], rel=1e-4)


def test_eye_paths_end_where_their_band_leads():
    top = np.array([1.5, 0.0, 0.0])
    paths = follow(prism(glass()), top - DOWN, DOWN)
    assert_ends(paths, TRANSMITTED, top, [through(n)[2] for n in INDICES])


def test_a_mirror_shows_each_band_where_it_leads():
    """A path that meets the prism later has all bands until then, and parts from what its faces reflect."""
    top = np.array([1.5, 0.0, 0.0])
    paths = follow(with_mirror(prism(glass())), *by_mirror(top))
    assert_ends(paths, REFLECTED, top, [through(n)[2] for n in INDICES])


def ball_in_light(dispersion, roughness=0.0, color=(1.0, 0.7, 0.4), power=4):
    """A ball in an environment that is of a color, and brighter above."""
    scene = Scene()
    scene.add(icosphere(1.0, 4), material=glass(dispersion, roughness=roughness), name="ball")
    rows = np.linspace(1.0, 0.0, 32)[:, None, None] ** power
    scene.environment = Environment(np.tile(f32(rows * color + 0.1), (1, 64, 1)))
    return scene


CAMERA = Camera.look_at((0, 0.5, 4), (0, 0, 0))


@pytest.mark.parametrize("roughness", [0.0, 0.3])
def test_three_bands_bring_what_one_path_brings(gpu, roughness):
    """With next to no dispersion a picture is as without."""
    pictures = [
        render(gpu, ball_in_light(dispersion, roughness), CAMERA, size=(64, 36))[0].radiance
        for dispersion in (0.0, 1e-6)
    ]
    np.testing.assert_allclose(pictures[1], pictures[0], rtol=1e-3, atol=1e-3)


def test_a_ball_parts_the_colors_of_its_surroundings_as_paths_do(gpu):
    """Of a white sky, brighter above: how much more red than blue the ball shows, over its green. In the mean
    over either half of it, within four standard errors of paths, by how their batches differ."""
    size, scene = (48, 27), ball_in_light(DISPERSION, color=(1.0, 1.0, 1.0), power=4)
    frame, _ = render(gpu, scene, CAMERA, size=size, antialias=False)
    ball = np.flatnonzero(frame.instance == frame.names.find("ball")[0])
    view = CameraView(size, CAMERA.pose, CAMERA.yfov, CAMERA.ymag)
    tracer, rays = Tracer(scene), view.pixel_rays(ball)
    batches = [range(first, first + 1000) for first in range(0, 8000, 1000)]
    paths = [path_light(tracer.tables, *rays, samples=batch, bounces=9, threads=2) for batch in batches]
    shown = frame.radiance.reshape(-1, 3)[ball]
    upper = ball // size[0] < size[1] // 2
    for part in (upper, ~upper):
        ours, *theirs = (light[part].mean(axis=0) @ (1, 0, -1) / light[part].mean(axis=0)[1]
                         for light in (shown, *paths))  # fmt: skip
        error = np.std(theirs, ddof=1) / math.sqrt(len(theirs))
        assert abs(np.mean(theirs)) > 6.0 * error
        assert abs(ours - np.mean(theirs)) < 4.0 * error


def test_the_light_below_a_prism_has_borders_of_a_color(gpu):
    """Within the light that each band throws on the wall its irradiance is even, and known: the mean of six
    pictures within five of its standard errors, and what the faces reflect within and send here."""
    size, camera = (96, 54), Camera.look_at((1.5, -4.0, 2.5), (1.5, WALL, 0.0), yfov=1.2)
    view = CameraView(size, camera.pose, camera.yfov, camera.ymag)
    origins, d = view.pixel_rays(np.arange(size[0] * size[1]))
    place = origins + ((WALL - origins[:, 1]) / d[:, 1])[:, None] * d
    x, z = place[:, 0], place[:, 2]
    expected, borders = [], []
    for n in INDICES:
        left, right = (on_wall(EDGE + np.array([along, 0.0, 0.0]), n)[0] for along in (0.0, SIZE))
        expected.append(math.cos(TURN) * through(n)[2] * SIZE / (right - left))
        borders.append((left, right))
    (red, green, blue), (last_red, last_green, last_blue) = zip(*borders, strict=True)
    areas = ((red, green), (1, 0, 0)), ((blue, last_red), (1, 1, 1)), ((last_green, last_blue), (0, 0, 1))
    lights = []
    for seed in range(6):
        frame, _ = render(gpu, with_sun(prism(glass())), camera, size=size, seed=seed, bounces=1,
                          photons=20_000, antialias=False)  # fmt: skip
        lights.append(frame.indirect.reshape(-1, 3) * math.pi / 0.5)
    for (low, high), lit in areas:
        part = (x > low + 0.1) & (x < high - 0.1) & (np.abs(z) < 1.5)  # farther than kernels reach
        found = np.array([light[part].mean(axis=0) for light in lights]) / expected
        error = found.std(axis=0, ddof=1) / math.sqrt(len(found))
        assert (np.abs(found.mean(axis=0) - lit) < 5.0 * error + 2e-3).all()
