"""What light must not get through."""

import pytest
from references.bias_scenes import cases
from transport import render

from ispm import Camera, PointLight, Scene, euler
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
