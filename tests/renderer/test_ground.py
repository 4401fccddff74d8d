"""The ground beneath a model: its shadows on what is behind, and nothing else."""

import math

import numpy as np
import pytest
from exact_light import polygon_irradiance
from rgbe import seen_along
from scipy import ndimage

from ispm import Camera, DirectionalLight, Environment, Material, RectLight, Renderer, Scene, Settings, shapes
from ispm.accel.emitters import EMITTER
from ispm.library.common import lambert
from ispm.renderer.ground import _triangle_light

SIZE = (96, 54)
EYE = Camera.look_at((0.0, 1.6, 3.0), (0.0, 0.2, 0.0), yfov=0.9)
DOWN = {"rotation": (-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))}
BEHIND = (0.2, 0.5, 0.8)
# Light and shares are float32: a dozen products and sums, a quotient and a unit vector on either side, of 2.5
# ulp at most each (WGSL, section 15.7.4), make under 2^5 roundings of 2^-24.
ROUNDED = 2.0**-19
# But the albedo that is seen is a half, 0.5 times a color that is interpolated: where that is less than 1 by
# a rounding, drivers may cut to the next half below, by 2^-10 of a value at most.
HALF = 2.0**-10 + ROUNDED
RADIUS = 2.0 * math.sqrt(2.0)  # m, of the ground: twice the diameter of the sphere around plate and box
# The ground lies 1e-4 of the diameter lower than `on_ground` has it, which at slopes of 1 in 4 moves a place
# by 6e-4 m; it fades by 1.5 times the way over half of its radius, 7e-4.
LOWER = 1e-3


def model(light=None, environment=None, **where):
    """A plate of 1 x 1 m that floats 0.5 m over what is beneath the scene, a small box."""
    scene = Scene(environment=environment)
    scene.add(shapes.plane(1.0, 1.0), material=lambert((0.5,) * 3), name="plate", translation=(0, 0.6, 0))
    scene.add(shapes.box(0.1), material=lambert((0.5,) * 3), name="foot", translation=(0.0, 0.05, 0.0))
    if light is not None:
        scene.add(light, **where)
    return scene


def picture(gpu, scene, camera=EYE, passes=1, **settings):
    settings = {"size": SIZE, "bounces": 0, "ground": True, **settings}
    with Renderer(scene, Settings(**settings), camera, threads=2, gpu=gpu) as renderer:
        *_, frame = renderer.converge(passes)
    return frame


def on_ground(frame):
    """Pixels of ground whose neighbors are ground too, and the places that they show, (n, 2) m of x and z."""
    ids = frame.instance
    mine = ids == ids.max()
    assert mine.any()
    inner = mine.copy()
    for shift in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        inner &= np.roll(mine, shift, (0, 1))
    inner[[0, -1]] = inner[:, [0, -1]] = False
    eye, height = frame.camera["pose"][:3, 3], 0.0
    pose = frame.camera["pose"]
    y, x = np.nonzero(inner)
    tangent = math.tan(0.45)
    across = (2 * (x + 0.5) / SIZE[0] - 1) * tangent * SIZE[0] / SIZE[1]
    up = (1 - 2 * (y + 0.5) / SIZE[1]) * tangent
    d = np.stack([across, up, -np.ones(len(x))], axis=1) @ pose[:3, :3].T
    points = eye + d * ((height - eye[1]) / d[:, 1])[:, None]
    return (y, x), points[:, ::2]


def fade(places):
    """How much of the ground is there at (n, 2) m: all within half of its radius, then a cubic down to 0."""
    x = np.clip(2.0 * (1.0 - np.linalg.norm(places, axis=1) / RADIUS), 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


def test_a_sun_from_above_leaves_the_background_and_a_black_square(gpu):
    """Without bounces: what the plate shades is black, all else is what it would be without ground."""
    frame = picture(gpu, model(DirectionalLight((3.0,) * 3), **DOWN), background=BEHIND)
    at, places = on_ground(frame)
    away = np.abs(places).max(axis=1)
    np.testing.assert_allclose(
        frame.radiance[at][away > 0.6], np.tile(BEHIND, ((away > 0.6).sum(), 1)), rtol=HALF
    )
    assert frame.radiance[at][away < 0.4].max() < 1e-6
    assert (away > 0.6).sum() > 500 and (away < 0.4).sum() > 20


@pytest.mark.parametrize("passes", [1, 3])
def test_an_environment_is_seen_unchanged_where_nothing_shades_it(gpu, passes):
    """As without ground, to the share of the sky that plate and box hide from there; under the plate, where
    they hide most of it, it is dark. Beyond the ground nothing changes, and no seam shows where it ends: what
    is hidden there takes no more than the share of the ground that is there."""
    image = np.random.default_rng(3).random((8, 16, 3)) + 0.2
    scene = model(environment=Environment(image))
    with_ground = picture(gpu, scene, passes=passes, antialias=False)
    without = picture(gpu, scene, passes=passes, antialias=False, ground=False)
    at, places = on_ground(with_ground)
    ratio = with_ground.radiance[at] / without.radiance[at]
    away = np.linalg.norm(places, axis=1)
    # a plate seen edge on hides cos A / (pi d^2) of the light at most: 2.5 m away 1.2 %, of up to 2.5 times
    # the mean radiance
    assert np.abs(ratio[away > 2.5].mean() - 1.0) < 0.03 and (away > 2.5).sum() > 50
    # .543 in the mean of 200 passes; .597 in the first, whose filter brings light from aside, deviating by
    # .051 from seed to seed, of which 4 lie below its bound
    assert ratio[away < 0.3].mean() < (0.8 if passes == 1 else 0.6)
    beyond = with_ground.instance < 0
    if passes > 1:  # later ones see the ground in pixels beside those where the first does
        beyond = ~ndimage.binary_dilation(~beyond, np.ones((3, 3)))
    np.testing.assert_allclose(with_ground.radiance[beyond], without.radiance[beyond], rtol=ROUNDED)
    if passes == 1:  # the light of later ones is the mean of draws, which may bring more than all
        assert ratio.max() < 1.0 + HALF
        assert (ratio.min(axis=1) > 1.0 - fade(places) - LOWER).all() and fade(places).min() < 0.1


def hidden(places, d):
    """(n, m) bool, whether plate or box hides directions (m, 3) from places (n, 2) of the ground."""
    over = places[:, None] + 0.6 / np.maximum(d[:, 1], 1e-9)[:, None] * d[:, ::2]
    plate = (np.abs(over) < 0.5).all(axis=-1)
    from_below = np.insert(places, 1, 0.0, axis=1)[:, None]
    sides = (np.array([[[-0.05, 0.0, -0.05]], [[0.05, 0.1, 0.05]]])[:, None] - from_below) / d
    enters, leaves = sides.min(axis=0).max(axis=-1), sides.max(axis=0).min(axis=-1)
    return plate | (leaves > np.maximum(enters, 0.0))


def test_under_a_plate_the_background_keeps_the_share_of_the_sky_that_is_seen(gpu):
    """64 passes beside sums over 64 x 256 directions: a mean of 200 deviates by .0013 from seed to seed, that
    of 64 by .0023, and lies within 4.5 of these."""
    image = np.random.default_rng(3).random((8, 16, 3)) + 0.2
    scene = model(environment=Environment(image))
    with_ground = picture(gpu, scene, passes=64, antialias=False)
    without = picture(gpu, scene, antialias=False, ground=False)
    at, places = on_ground(with_ground)
    away = np.linalg.norm(places, axis=1)
    near = away < 0.3
    found = with_ground.radiance[at][near] / without.radiance[at][near]
    theta, phi = (np.arange(64) + 0.5) * math.pi / 128, (np.arange(256) + 0.5) * math.pi / 128
    t, p = (a.ravel() for a in np.meshgrid(theta, phi, indexing="ij"))
    d = np.stack([np.sin(t) * np.cos(p), np.cos(t), np.sin(t) * np.sin(p)], axis=1)
    weight = (np.cos(t) * np.sin(t))[:, None] * seen_along(image, d)
    exact = (~hidden(places[near], d)).astype(float) @ weight / weight.sum(axis=0)
    assert found.mean() == pytest.approx(exact.mean(), abs=4.5 * 0.0023)


def test_a_transparent_background_gets_the_shadow_as_its_opacity(gpu):
    frame = picture(gpu, model(DirectionalLight((3.0,) * 3), **DOWN), background="transparent")
    at, places = on_ground(frame)
    away = np.abs(places).max(axis=1)
    assert frame.alpha[at][away > 0.6].max() <= HALF and frame.alpha[at][away < 0.4].min() > 1.0 - HALF
    assert (frame.radiance[at] == 0.0).all()
    assert frame.image.shape[-1] == 4


def test_on_black_the_ground_is_seen_and_fades_out(gpu):
    """Albedo 0.5 over pi times 3 lx within half of its radius, as much less beyond as it has faded."""
    far = Camera.look_at((0.0, 4.0, 9.0), (0.0, 0.0, 0.0), yfov=0.9)
    frame = picture(gpu, model(DirectionalLight((3.0,) * 3), **DOWN), far)
    at, places = on_ground(frame)
    found = frame.radiance[at][:, 0]
    assert found.max() == pytest.approx(0.5 / math.pi * 3.0, rel=HALF)
    away = np.abs(places).max(axis=1) > 1.0  # from the plate's shadow
    assert found[away] / found.max() == pytest.approx(fade(places[away]), abs=LOWER)
    assert fade(places).min() < 0.1
    assert not frame.radiance[frame.alpha == 0.0].any()


def test_lamps_with_a_surface_leave_the_background_too(gpu):
    """Soft shadows of a lamp of 0.5 x 0.5 m, 16 passes: beyond 1.5 m no part of it is hidden."""
    scene = model(RectLight((20.0,) * 3, 0.5, 0.5), translation=(0.0, 2.0, 0.0), **DOWN)
    frame = picture(gpu, scene, background=BEHIND, passes=4)
    at, places = on_ground(frame)
    shares = frame.radiance[at] / BEHIND
    away = np.abs(places).max(axis=1)
    # beneath the plate's edge the penumbra ends at 0.5 + (0.5 + 0.25) 0.6 / 1.4 = 0.82 m; the grid, whose
    # cells are 0.1 m, is right to a percent
    assert np.abs(shares[away > 1.0] - 1.0).max() < 0.02
    assert shares[away < 0.3].max() < 0.02


def test_light_of_triangles_is_that_of_polygons():
    random = np.random.default_rng(1)
    rows = np.zeros(5, EMITTER)
    for name in ("corner", "edge1", "edge2"):
        rows[name] = random.normal(size=(5, 3)) * 0.5
    rows["corner"][:, 1] += 3.0
    rows["radiance"], rows["two_sided"] = random.random((5, 3)), 1
    points = random.normal(size=(20, 3)) * (2.0, 0.0, 2.0)
    exact = np.zeros((20, 3))
    for row in rows:
        corners = row["corner"] + np.array([np.zeros(3), row["edge1"], row["edge2"]], float)
        for k, point in enumerate(points):
            exact[k] += polygon_irradiance(corners, point, np.array([0.0, 1.0, 0.0])) * row["radiance"]
    np.testing.assert_allclose(_triangle_light(rows, points), exact, rtol=1e-6)


def test_the_camera_is_the_same_and_a_moving_model_keeps_its_ground(gpu):
    scene = model(DirectionalLight((3.0,) * 3), **DOWN)
    plain, stood = (picture(gpu, scene, None, ground=on) for on in (False, True))
    np.testing.assert_array_equal(plain.camera["pose"], stood.camera["pose"])
    settings = Settings(size=SIZE, bounces=0, ground=True, background=BEHIND)
    with Renderer(scene, settings, EYE, gpu=gpu) as renderer:
        renderer.render()
        before = renderer._last.made.packed.boxes[-1].copy()
        scene["plate"].translation = (1.0, 0.6, 0.0)
        renderer.render()
        assert (renderer._last.made.packed.boxes == before).all(axis=(1, 2)).any()


def test_a_mirror_shows_the_ground_gray(gpu):
    """A ball that reflects: what it shows below is the lit ground, not the background."""
    scene = Scene()
    scene.add(shapes.sphere(0.4), material=Material(metallic=1.0, roughness=0.0), translation=(0, 0.4, 0))
    scene.add(DirectionalLight((3.0,) * 3), **DOWN)
    frame = picture(gpu, scene, background=(0.0, 0.0, 1.0))
    ball = frame.instance == 0
    assert ball.any() and (frame.radiance[ball][:, 0] > 0.1).any()
