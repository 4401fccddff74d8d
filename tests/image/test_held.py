"""A renderer holds camera, light and exposure; a background changes nothing that stands before it."""

import numpy as np
import pytest

from ispm.errors import IspmError
from ispm.library.shapes import box, icosphere
from ispm.renderer.renderer import Renderer
from ispm.scene.camera import Camera
from ispm.scene.light import PointLight
from ispm.scene.material import Material
from ispm.scene.scene import Scene
from ispm.settings import Settings

SIZE = (96, 54)
WHITE = (1.0, 1.0, 1.0)


def scene_of(*balls, lamp=True):
    """A floor with balls of some materials in a row, seen from the front with nothing behind."""
    scene = Scene(name="row")
    scene.add(box((-3, -0.1, -1), (3, 0, 1)), material=Material((0.5, 0.4, 0.3)), name="floor")
    for k, material in enumerate(balls):
        x = 0.8 * (k - (len(balls) - 1) / 2)
        scene.add(icosphere(0.35, 12), material=material, name=f"ball {k}", translation=(x, 0.6, 0))
    if lamp:
        scene.add(PointLight((40.0, 40.0, 40.0)), name="lamp", translation=(1.0, 3.0, 3.0))
    return scene


EYE = Camera.look_at((0.0, 0.8, 4.5), (0.0, 0.5, 0.0), yfov=0.6)
CLAY = Material((0.7, 0.3, 0.2))


def opened(gpu, scene, camera=EYE, **settings):
    return Renderer(scene, Settings(size=SIZE, photons=2000, **settings), camera, gpu=gpu)


def picture(gpu, scene, **settings):
    with opened(gpu, scene, **settings) as renderer:
        return renderer.render()


def test_a_renderer_holds_the_camera_that_it_made(gpu):
    scene = scene_of(CLAY)
    with opened(gpu, scene, None, bounces=0) as renderer:
        camera = renderer.camera
        assert (renderer.render().camera["pose"] == camera.pose).all()
        scene["ball 0"].translation = (0.0, 9.0, 0.0)
        assert (renderer.render().camera["pose"] == camera.pose).all()
        renderer.camera = None
        assert renderer.camera.pose[2, 3] > camera.pose[2, 3]
        renderer.camera = EYE
        assert (renderer.render().camera["pose"] == EYE.pose).all()
        renderer.settings = renderer.settings.replace(size=(54, 96))
        renderer.camera = None
        upright = renderer.camera
        renderer.settings = renderer.settings.replace(size=(108, 192))
        assert (renderer.camera.pose == upright.pose).all()
    with pytest.raises(IspmError, match="closed"):
        renderer.camera  # noqa: B018  # to read it is what is tested


def test_a_renderer_holds_the_light_that_it_made(gpu):
    """The floor far from a ball that moves keeps its light, though the scene's bounds do not."""
    scene, told = scene_of(CLAY, lamp=False), dict(bounces=0, antialias=False, light="lamp")
    with opened(gpu, scene, **told) as renderer, pytest.warns(UserWarning, match="light"):
        first = renderer.render()
        scene["ball 0"].translation = (0.0, 30.0, 0.0)
        later = renderer.render()
    floor = first["instance"] == 0
    floor[:, 30:] = False
    assert floor.sum() > 100 and first.direct[floor].min() > 0.0
    assert later.direct[floor] == pytest.approx(first.direct[floor], rel=1e-3)  # shadow maps are fitted anew


def test_exposure_is_held_where_it_is_asked_for(gpu):
    scene = scene_of(CLAY)
    with opened(gpu, scene, exposure="hold", bounces=0) as renderer:
        found = renderer.exposure
        first = renderer.render()
        assert first.exposure == found == first.exposure
        scene["lamp"].light.intensity = (320.0, 320.0, 320.0)
        second = renderer.render()
        assert second.exposure == found == renderer.exposure
        assert second.image.mean() > first.image.mean() + 20
        renderer.settings = renderer.settings.replace(tonemap="agx")
        assert renderer.render().exposure == found
        renderer.exposure = "hold"
        assert renderer.render().exposure == pytest.approx(found - 3.0, abs=1e-3)
        renderer.exposure = 0.5
        assert renderer.render().exposure == renderer.exposure == 0.5
        renderer.exposure = "auto"
        assert renderer.render().exposure == renderer.exposure == pytest.approx(found - 3.0, abs=1e-3)


def test_auto_exposure_is_each_picture_s_own(gpu):
    scene = scene_of(CLAY)
    with opened(gpu, scene, bounces=0) as renderer:
        first = renderer.render()
        scene["lamp"].light.intensity = (320.0, 320.0, 320.0)
        second = renderer.render()
    assert second.exposure == pytest.approx(first.exposure - 3.0, abs=1e-3)
    assert np.abs(second.image.astype(int) - first.image).max() <= 1


def test_passes_are_shown_alike_where_exposure_is_held(gpu, tmp_path):
    scene = scene_of(CLAY)
    with opened(gpu, scene, exposure="hold", background=WHITE) as renderer:
        frames = list(renderer.converge(passes=3))
        renderer.save_progress(tmp_path / "passes.npz")
    assert len({frame.exposure for frame in frames}) == 1
    assert frames[-1].image[0].min() == 255
    with opened(gpu, scene, background=WHITE) as renderer:
        *_, last = renderer.converge(passes=3, resume=tmp_path / "passes.npz")
    assert last.image[0].min() == 255 and last.radiance.tobytes() == frames[-1].radiance.tobytes()


@pytest.mark.parametrize("exposure", ["auto", -3.0, 2.0])
@pytest.mark.parametrize("passes", [1, 2])
def test_a_background_is_shown_as_it_is_and_leaves_objects_as_they_were(gpu, exposure, passes):
    scene, knobs = scene_of(CLAY, Material((0.9, 0.9, 0.9))), dict(exposure=exposure, passes=passes)
    black = picture(gpu, scene, **knobs)
    there, empty = black["alpha"] == 1.0, black["alpha"] == 0.0
    assert min(there.mean(), empty.mean()) > 0.2
    for color, code in ((WHITE, (255, 255, 255)), ((0.0, 0.2140, 1.0), (0, 127, 255))):
        frame = picture(gpu, scene, background=color, **knobs)
        assert frame.exposure == pytest.approx(black.exposure, abs=1e-5)
        assert (frame.image[empty] == code).all()
        assert np.abs(frame.image[there].astype(int) - black.image[there]).max() <= 1  # a rounding
        assert (frame["alpha"] == black["alpha"]).all()
        expected = black.radiance + (1.0 - black["alpha"][..., None]) * np.float32(color)
        assert frame.radiance == pytest.approx(expected, abs=1e-5)
        assert (frame.view("split")[:, -20:] == frame.image[:, -20:]).all()


ROUGH = (0.0, 0.02, 0.031, 0.032, 0.05, 0.1, 0.3)


@pytest.mark.parametrize("metallic", [0.0, 1.0])
def test_no_roughness_reflects_the_background(gpu, metallic):
    """Between mirrors, which eye paths serve, and what is rougher there is no tear."""
    scene = scene_of(*(Material((0.8, 0.8, 0.8), metallic, roughness) for roughness in ROUGH))
    black, white = (picture(gpu, scene, background=color) for color in ((0.0, 0.0, 0.0), WHITE))
    there = black["alpha"] == 1.0
    for k in range(len(ROUGH)):
        ball = there & np.isin(black.instance, black.names.find(f"ball {k}"))
        assert ball.sum() > 20 and (white.radiance[ball] == black.radiance[ball]).all()
    assert np.abs(white.image[there].astype(int) - black.image[there]).max() <= 1


@pytest.mark.parametrize("exposure", ["auto", -4.0])
def test_glass_shows_the_background_as_bright_as_it_is(gpu, exposure):
    """Clear glass 0.96 and less of it, green glass its color; neither is metered."""
    clear = Material(WHITE, roughness=0.0, transmission=1.0, thickness=0.7)
    green = Material((0.1, 0.6, 0.1), roughness=0.0, transmission=1.0)
    frosted = Material(WHITE, roughness=0.3, transmission=1.0, thickness=0.7)
    scene = scene_of(clear, green, frosted, CLAY)
    black, white = (picture(gpu, scene, background=c, exposure=exposure) for c in ((0.0, 0.0, 0.0), WHITE))
    assert white.exposure == pytest.approx(black.exposure, abs=1e-5)
    added = (white.radiance - black.radiance)[white["alpha"] == 1.0]
    assert added.min() > -1e-6 and added.max() < 0.97
    ids = [white.names.find(f"ball {k}") for k in range(4)]
    weights = [_weight(np.isin(white.instance, each)) for each in ids]
    middle = [np.unravel_index(ball.argmax(), ball.shape) for ball in weights]
    through = [(white.radiance - black.radiance)[place] for place in middle]
    assert through[0] == pytest.approx([0.96] * 3, abs=0.01)
    assert through[1] == pytest.approx(0.96**2 * np.array([0.1, 0.6, 0.1]) ** 2, abs=0.01)
    assert 0.5 < through[2].min() < 0.97
    assert not through[3].any()
    assert white.image[middle[0]].min() > 245  # sRGB of 0.96 is 250


def _weight(ball):
    """How far within a ball's pixels each pixel lies."""
    ys, xs = np.nonzero(ball)
    y, x = np.mgrid[: ball.shape[0], : ball.shape[1]]
    return ball / (1.0 + (y - ys.mean()) ** 2 + (x - xs.mean()) ** 2)
