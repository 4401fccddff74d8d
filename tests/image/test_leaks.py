"""What light must not get through."""

import pytest
from references.bias_scenes import cases
from transport import render


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("preset", ["default", "fast"])
def test_a_room_behind_a_wall_without_thickness_is_dark(gpu, preset, seed):
    """But for kernels that reach under the wall, as wide as a few of these coarse pixels.

    Six seeds: 0.8 % by rays, 1.2 % by photons alone, 0.2 % of either at 640x360; rays sent along the
    wall brought 10.
    """
    rooms = cases()["leaks"][0]
    frame, _ = render(gpu, rooms.scene(), size=(160, 90), preset=preset, seed=seed)
    assert frame.indirect.mean() < 0.02 * rooms.unit
