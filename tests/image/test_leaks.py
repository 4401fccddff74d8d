"""What light must not get through, or reach."""

import math

import numpy as np
import pytest
from references.bias_scenes import cases
from transport import render

from ispm import AlphaMode, Camera, DirectionalLight, Material, PointLight, Scene, Texture, euler, shapes
from ispm.library.common import lambert
from ispm.library.shapes import box


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("preset", ["default", "fast"])
def test_a_room_behind_a_wall_without_thickness_is_dark(gpu, preset, seed):
    """But for kernels that reach under the wall, as wide as a few of these coarse pixels where photons light
    them, and with rays in the corners of two walls.

    Four seeds: .03 to .05 % by rays, .8 where kernels do not end at walls; 1.2 % by photons alone; rays sent
    along the wall brought 10.
    """
    rooms = cases()["leaks"][0]
    frame, _ = render(gpu, rooms.scene(), size=(160, 90), preset=preset, seed=seed)
    assert frame.indirect.mean() < (0.002 if preset == "default" else 0.02) * rooms.unit


def _rooms(turned):
    """A closed house of two white rooms, 4 m wide; the wall between, 10 cm thick, turned by so many degrees.
    A lamp is in the far room."""
    scene, white = Scene(), lambert((0.7,) * 3)
    for low, high in (
        ((-0.2, -0.2, -0.2), (4.2, 0, 8.2)),
        ((-0.2, 2.6, -0.2), (4.2, 2.8, 8.2)),
        ((-0.2, -0.1, -0.2), (0, 2.7, 8.2)),
        ((4, -0.1, -0.2), (4.2, 2.7, 8.2)),
        ((-0.1, -0.1, -0.2), (4.1, 2.7, 0)),
        ((-0.1, -0.1, 8), (4.1, 2.7, 8.2)),
    ):
        scene.add(box(low, high), material=white)
    wall = box((-4, -0.05, -0.05), (4, 2.65, 0.05))
    scene.add(wall, material=white, translation=(2, 0, 4), rotation=euler(0, turned, 0, degrees=True))
    scene.add(PointLight((200.0,) * 3), translation=(3.2, 2, 1.2))
    return scene


@pytest.mark.parametrize("turned", [0, 20, 40])
def test_a_dark_room_gets_no_light_through_its_wall(gpu, turned):
    """But for kernels in the corners of two walls, which end at one of them: .02 to .05 % of the light in the
    lit room, three seeds; kernels that do not end bring .7."""
    scene = _rooms(turned)
    views = ((3.5, 1.6, 7.8), (1.3, 1.0, 4.2)), ((3.5, 1.6, 0.3), (1.3, 1.0, 3.8))
    dark, lit = (
        render(gpu, scene, size=(160, 90), camera=Camera.look_at(*view))[0].indirect.mean() for view in views
    )
    assert dark < 0.0015 * lit


@pytest.mark.parametrize("clear", ["glass", "mirror"])
def test_a_bar_before_a_pane_takes_none_of_its_light(gpu, clear):
    """A lamp lights the upper side of a bar that holds a pane. From there light reaches the pane, which shows
    none of it, while the bar's front sees a black wall alone. Where both were averaged the front had .0013
    and .0016 of what the lamp brings to the upper side."""
    scene = Scene()
    material = Material(transmission=1.0, roughness=0.0)
    if clear == "mirror":
        material = Material((1.0,) * 3, metallic=1.0, roughness=0.0)
    scene.add(box((-1, -0.02, -0.02), (1, 0.02, 0.02)), material=lambert((0.8,) * 3), name="bar")
    scene.add(box((-1, -0.5, -0.002), (1, 0.5, 0.002)), material=material, name="pane")
    scene.add(box((-2, -2, 2), (2, 2, 2.1)), material=lambert((0.0,) * 3))
    z = -0.3 if clear == "glass" else 0.3
    scene.add(PointLight((100.0,) * 3), translation=(0, 0.6, z))
    camera = Camera.look_at((0, 0.0, 1.6), (0, 0, 0), yfov=0.35)
    frame, _ = render(gpu, scene, size=(160, 90), camera=camera, antialias=False)
    front = frame.instance == frame.names.find("bar")
    assert front.sum() > 300
    assert frame.indirect[front].mean() < 1e-4 * 100.0 / 0.6**2


@pytest.mark.parametrize("opaque", [0.35, 0.65])
def test_leaves_finer_than_texels_of_a_shadow_map_shade_as_rays_say(gpu, opaque):
    """Crossed strips 2 and 5 cm wide, in a map of a sun whose texels are wider. Means of the mask over these
    are on one side of its cutoff everywhere, and 9 and 7 % of pixels were wrong. Single points differ from
    texel to texel, so that rays decide."""
    period, scene = 0.12, Scene()
    at = (np.arange(1024) + 0.5) / 1024 * 8.0 / period % 1.0
    strips = (at < 1.0 - math.sqrt(1.0 - opaque)).astype(np.float32)
    picture = np.ones((1024, 1024, 4), np.float32)
    picture[..., 3] = np.maximum(strips[:, None], strips)
    mask = Material(base_color_texture=Texture(picture), alpha_mode=AlphaMode.MASK, double_sided=True)
    scene.add(shapes.plane(60, 60), material=lambert((0.5,) * 3))
    scene.add(shapes.plane(8, 8), material=mask, translation=(0, 2, 0))
    scene.add(DirectionalLight((3.0,) * 3), rotation=euler(-90, 0, 0, degrees=True))
    camera = Camera.look_at((0, 1.9, 5), (0, 0.8, 0), yfov=0.9)
    maps, rays = (
        render(gpu, scene, size=(320, 180), camera=camera, bounces=0, shadows=shadows, antialias=False)[0]
        for shadows in ("map", "rays")
    )
    wrong = np.abs(maps.direct - rays.direct)[..., 0] > 0.1 * rays.direct.max()
    assert wrong.mean() < 0.01
