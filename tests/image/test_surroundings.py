"""Environments in pictures: behind them, in mirrors, in glass, and in the exposure."""

import math
import warnings

import numpy as np
import pytest
from rgbe import hdr, seen_along, texels_of

from ispm import Environment
from ispm.errors import SceneError
from ispm.library.shapes import box, icosphere, polygons
from ispm.renderer.converge import place_in_pixel
from ispm.renderer.renderer import Renderer
from ispm.scene.camera import Camera
from ispm.scene.light import PointLight
from ispm.scene.material import Material
from ispm.scene.scene import Scene
from ispm.scene.sky import Sky
from ispm.settings import Settings
from ispm.stages.camera import CameraView

SIZE = (64, 36)
EYE = Camera.look_at((0.0, 0.3, 4.0), (0.0, 0.0, 0.0), yfov=0.9)
MIRROR = Material((1.0,) * 3, metallic=1.0, roughness=0.0)
GLASS = Material(transmission=1.0, roughness=0.0, ior=1.5, thickness=1.0)
IMAGE = (np.random.default_rng(8).random((8, 16, 3)) * 90.0 + 10.0).astype(np.float32)
TURN = 0.8
# of 8 x 16 pixels up to 100: rays and places in float32, 1e-6 rad of slopes of 100 / (pi / 8)
CLOSE = {"atol": 2e-3}


def around(scene, **given):
    scene.environment = Environment(IMAGE, TURN, **given)
    return scene


def ball(material=MIRROR):
    scene = Scene(name="ball")
    scene.add(icosphere(0.8, 20), material=material, name="ball")
    return scene


def opened(gpu, scene, **settings):
    return Renderer(scene, Settings(size=SIZE, photons=1000, **settings), EYE, gpu=gpu)


def picture(gpu, scene, **settings):
    with opened(gpu, scene, **settings) as renderer:
        return renderer.render()


def rays(index=0):
    """Directions of a pass's pixels, (h, w, 3), and the eye."""
    view = CameraView(
        SIZE, EYE.pose, EYE.yfov, None, 1e-3, 100.0, jitter=place_in_pixel(index), pass_index=index
    )
    return view.rays()[1], EYE.pose[:3, 3]


def test_pixels_that_show_nothing_show_what_lies_behind_them(gpu):
    frame = picture(gpu, around(ball()), antialias=False)
    nothing = frame.instance < 0
    assert 0.3 < nothing.mean() < 0.95
    expected = seen_along(IMAGE, rays()[0], TURN)
    np.testing.assert_allclose(frame.radiance[nothing], expected[nothing], **CLOSE)
    assert (frame.radiance[nothing] == frame.emission[nothing]).all()
    assert (frame["environment"][~nothing] == 0.0).all()


def test_several_passes_have_the_mean_of_their_places(gpu):
    with opened(gpu, around(ball()), antialias=False) as renderer:
        *_, mean = renderer.converge(3)
    expected = np.mean([seen_along(IMAGE, rays(k)[0], TURN) for k in range(3)], axis=0)
    nothing = mean.alpha == 0.0
    assert nothing.mean() > 0.3
    np.testing.assert_allclose(mean.radiance[nothing], expected[nothing], **CLOSE)


def test_an_edge_shows_the_share_that_nothing_covers(gpu):
    frame = picture(gpu, around(ball(Material((0.0,) * 3, specular=0.0))))
    edges = (frame.alpha > 0.0) & (frame.alpha < 1.0)
    assert edges.sum() > 20
    expected = (1.0 - frame.alpha[..., None]) * seen_along(IMAGE, rays()[0], TURN)
    np.testing.assert_allclose(frame.radiance[edges], expected[edges], **CLOSE)


def reflected(d, n):
    return d - 2.0 * (d * n).sum(axis=-1, keepdims=True) * n


@pytest.mark.parametrize("background", [True, False])
def test_a_flat_mirror_shows_what_lies_where_it_looks(gpu, background):
    """A square turned by 30 degrees about x and 20 about y: each of its pixels by the law of reflection."""
    scene = Scene()
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], float)
    a, b = math.radians(-30), math.radians(20)
    turn_x = np.array([(1, 0, 0), (0, math.cos(a), -math.sin(a)), (0, math.sin(a), math.cos(a))])
    turn_y = np.array([(math.cos(b), 0, math.sin(b)), (0, 1, 0), (-math.sin(b), 0, math.cos(b))])
    turn = turn_y @ turn_x
    scene.add(polygons([corners @ turn.T]), material=MIRROR)
    frame = picture(gpu, around(scene, background=background), antialias=False)
    shown = frame.instance >= 0
    assert 0.1 < shown.mean() < 0.9
    expected = seen_along(IMAGE, reflected(rays()[0], turn @ (0.0, 0.0, 1.0)), TURN)
    np.testing.assert_allclose(frame.radiance[shown], expected[shown], **CLOSE)
    assert (frame.radiance[~shown] > 0.0).any() == background


def test_a_mirror_ball_shows_the_whole_of_it(gpu):
    """Each pixel by the law of reflection at a sphere. The mesh is none: with edges half as long it is off by
    a quarter, by 2.6, 0.5 and 0.15 of 100 at worst with 8,000, 32,000 and 128,000 triangles."""
    scene = Scene()
    scene.add(icosphere(0.8, 40), material=MIRROR)
    frame = picture(gpu, around(scene), antialias=False)
    d, eye = rays()
    along = -(d @ eye)
    square = along**2 - (eye @ eye - 0.64)
    inner = square > (0.8 * math.cos(math.radians(65))) ** 2
    point = eye + (along - np.sqrt(np.maximum(square, 0.0)))[..., None] * d
    expected = seen_along(IMAGE, reflected(d, point / 0.8), TURN)
    assert inner.sum() > 120
    np.testing.assert_allclose(frame.radiance[inner], expected[inner], atol=1.0)


def test_a_thin_pane_shows_what_lies_behind_less_what_it_reflects(gpu):
    """Face on: two faces of F = 0.04 each, see `smooth_split`; what it mirrors comes from behind the eye."""
    scene = Scene()
    corners = np.array([(-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0)], float)
    scene.add(polygons([corners]), material=Material((1.0,) * 3, transmission=1.0, roughness=0.0))
    frame = picture(gpu, around(scene), antialias=False)
    d, _ = rays()
    passed, mirrored = (
        seen_along(IMAGE, d, TURN),
        seen_along(IMAGE, reflected(d, np.array([0, 0, 1.0])), TURN),
    )
    middle = slice(14, 22), slice(26, 38)
    share = (frame.radiance - mirrored)[middle] / (passed - mirrored)[middle]
    told = np.abs((passed - mirrored)[middle]) > 10.0
    assert 0.9 < np.median(share[told]) < 0.97
    light = np.median(share[told])
    expected = light * passed + (1.0 - light) * mirrored
    np.testing.assert_allclose(frame.radiance[middle], expected[middle], rtol=0.01)


def test_glass_under_an_even_sky_is_as_bright_as_the_sky(gpu):
    """Of what comes from everywhere alike, glass that absorbs nothing shows all, but for paths that are cut
    at 8 events or a weight of 1e-3: a few per cent, towards the rim."""
    scene = ball(GLASS)
    scene.environment = Environment(np.full((4, 8, 3), 50.0))
    frame = picture(gpu, scene)
    np.testing.assert_allclose(frame.radiance[17:20, 30:34], 50.0, rtol=2e-3)
    assert (frame.radiance < 50.0 * 1.002).all()
    assert frame.radiance[frame.alpha == 1.0].mean() > 0.97 * 50.0


@pytest.mark.parametrize("antialias", [True, False])
def test_a_mirror_under_an_even_sky_cannot_be_seen(gpu, antialias):
    scene = ball()
    scene.environment = Environment(np.full((4, 8, 3), 50.0))
    np.testing.assert_allclose(picture(gpu, scene, antialias=antialias).radiance, 50.0, rtol=1e-4)


def test_a_hidden_one_lights_and_is_mirrored_but_not_seen(gpu):
    shown, hidden = (picture(gpu, around(ball(), background=b), antialias=False) for b in (True, False))
    nothing = shown.instance < 0
    assert (hidden.radiance[nothing] == 0.0).all() and "environment" not in hidden
    assert (hidden.radiance[~nothing] == shown.radiance[~nothing]).all()


@pytest.mark.parametrize("color", [(0.25, 0.5, 1.0), "transparent"])
def test_a_background_stands_in_its_place_but_not_in_mirrors_and_glass(gpu, color):
    for material in (MIRROR, GLASS):
        plain = picture(gpu, around(ball(material)), antialias=False)
        other = picture(gpu, around(ball(material)), antialias=False, background=color)
        nothing = plain.instance < 0
        assert (other.radiance[~nothing] == plain.radiance[~nothing]).all()
        expected = 0.0 if color == "transparent" else np.float32(color)
        assert (other.radiance[nothing] == expected).all()
        assert "environment" not in other


def test_it_is_not_metered_but_where_nothing_else_is(gpu):
    scene = Scene()
    scene.add(box((-1, -0.5, -0.5), (1, 0.5, 0.5)), material=Material((0.5,) * 3, emission=(7.0,) * 3))
    dark = scene.at_rest()
    scene.environment = Environment(IMAGE * 0.001)
    exposures = {}
    for name, background in (("seen", True), ("hidden", False)):
        scene.environment.background = background
        exposures[name] = picture(gpu, scene, antialias=False).exposure
    assert exposures["seen"] == pytest.approx(exposures["hidden"], abs=1e-4)
    dark.environment = Environment(IMAGE)
    aside = Camera.look_at((0, 0.3, 4), (0, 0.3, 9))
    with (
        Renderer(dark, Settings(size=SIZE, photons=1000), aside, gpu=gpu) as renderer,
        pytest.warns(match="the camera sees nothing but the environment"),
    ):
        frame = renderer.render()
    assert (frame.alpha == 0.0).all()
    # middle grey is 0.18, and the mean of the image's pixels about 50
    assert frame.exposure == pytest.approx(math.log2(0.18 / 50.0), abs=0.6)
    assert 40 < frame.image.mean() < 200


@pytest.mark.filterwarnings("error::ispm.SceneWarning")
@pytest.mark.parametrize("light", [Environment(IMAGE), Sky()], ids=["image", "sky"])
def test_an_environment_alone_is_seen_as_behind_a_scene(gpu, light):
    """Pixel for pixel as with a surface that the camera does not see."""
    camera = Camera.look_at((0, 0, 0), (0.3, 0.2, 1.0))
    alone, behind = Scene(environment=light), Scene(environment=light)
    settings = Settings(size=SIZE, photons=1000)
    with Renderer(alone, settings, camera, gpu=gpu) as renderer:
        found = renderer.render()
        renderer.camera = None  # of its own choice, for there is nothing to frame
        assert renderer.render().radiance.min() > 0.0
    behind.add(box((-1, -1, -9), (1, 1, -8)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that the box is not seen
        with Renderer(behind, settings, camera, gpu=gpu) as renderer:
            expected = renderer.render()
    assert np.array_equal(found.radiance, expected.radiance)
    assert found.radiance.min() > 0.0 and (found.alpha == 0.0).all() and (found.instance == -1).all()


def test_a_scene_of_neither_surface_nor_environment_is_refused(gpu):
    nothing = Scene(name="void")
    nothing.add(PointLight())
    with (
        Renderer(nothing, Settings(size=SIZE), Camera.look_at((0, 0, 0), (0, 0, 1)), gpu=gpu) as renderer,
        pytest.raises(SceneError, match=r"^void: has no surface to render; add a mesh"),
    ):
        renderer.render()


def test_a_scene_with_an_environment_gets_no_lamp(gpu, recwarn):
    frame = picture(gpu, around(ball()))
    assert frame.stats.emitters == 0
    assert not [w for w in recwarn if "no light" in str(w.message)]


def test_frames_follow_what_becomes_of_it(gpu):
    """A renderer that goes on shows what a new one would, after each change."""
    scene = ball()
    scene.add(PointLight((9.0,) * 3), translation=(2.0, 3.0, 3.0))
    changes = [
        lambda: around(scene),
        lambda: setattr(scene.environment, "rotation", 2.0),
        lambda: setattr(scene.environment, "intensity", 0.5),
        lambda: scene.environment.image.__setitem__((slice(None), 3), 200.0) or scene.environment.touch(),
        lambda: setattr(scene.environment, "background", False),
        lambda: setattr(scene, "environment", None),
    ]
    with opened(gpu, scene) as renderer:
        last = renderer.render().radiance
        for change in changes:
            change()
            frame = renderer.render()
            assert (frame.radiance != last).any()
            last = frame.radiance
            assert (last == picture(gpu, scene).radiance).all()
            scene.environment and setattr(scene.environment, "image", scene.environment.image.copy())


def test_live_frames_notice_a_change_and_rest_where_there_is_none(gpu):
    scene = around(ball())
    scene.add(PointLight((9.0,) * 3), translation=(2.0, 3.0, 3.0))
    with opened(gpu, scene, preset="live", antialias=False) as renderer:
        frames = [renderer.render() for _ in range(3)]
        scene.environment.rotation += 1.0
        turned = renderer.render()
    nothing = turned.alpha == 0.0
    expected = seen_along(IMAGE, rays()[0], TURN + 1.0)
    np.testing.assert_allclose(turned.radiance[nothing], expected[nothing], **CLOSE)
    assert "environment" in frames[-1]


def test_passes_of_another_environment_are_not_continued(gpu, tmp_path):
    scene = around(ball())
    with opened(gpu, scene) as renderer:
        next(renderer.converge(2))
        kept = renderer.save_progress(tmp_path / "kept.npz")
    with opened(gpu, scene) as renderer:
        *_, mean = renderer.converge(2, resume=kept)
    with opened(gpu, scene) as renderer:
        *_, whole = renderer.converge(2)
    assert (mean.radiance == whole.radiance).all() and (mean["environment"] == whole["environment"]).all()
    scene.environment.intensity = 2.0
    with opened(gpu, scene) as renderer, pytest.raises(ValueError, match="other environment"):
        next(renderer.converge(2, resume=kept))


def test_a_file_is_shown_as_its_array(gpu, tmp_path):
    path = tmp_path / "sky.hdr"
    texels = texels_of(IMAGE.astype(float))
    path.write_bytes(hdr(texels, "new"))
    scene = ball()
    scene.environment = Environment(path)
    assert (scene.environment.image == (texels[..., :3] * 2.0 ** (texels[..., 3:] - 136.0))).all()
    frame = picture(gpu, scene, antialias=False)
    nothing = frame.instance < 0
    expected = seen_along(scene.environment.image, rays()[0])
    np.testing.assert_allclose(frame.radiance[nothing], expected[nothing], **CLOSE)


def test_a_value_that_goes_bad_is_refused(gpu):
    scene = around(ball())
    scene.environment.intensity = math.nan
    with pytest.raises(SceneError, match="intensity must be a number"):
        picture(gpu, scene)


def test_parallel_rays_all_see_one_place(gpu):
    scene = around(ball())
    camera = Camera.look_at((0.0, 0.3, 4.0), (0.0, 0.0, 0.0))
    camera.ymag, camera.yfov = 1.5, 1.0
    with Renderer(scene, Settings(size=SIZE, photons=1000, antialias=False), camera, gpu=gpu) as renderer:
        frame = renderer.render()
    nothing = frame.instance < 0
    expected = seen_along(IMAGE, np.array([[0.0, -0.3, -4.0]]), TURN)
    assert nothing.any()
    np.testing.assert_allclose(frame.radiance[nothing], np.tile(expected, (nothing.sum(), 1)), **CLOSE)
