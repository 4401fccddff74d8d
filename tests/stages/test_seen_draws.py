"""Instances that the eye does not see are not drawn, and the picture is the same."""

from collections.abc import Callable

import numpy as np
import pytest

from ispm import Camera, Material, PointLight, Renderer, Settings, shapes
from ispm.frame import GpuScene
from ispm.gpu import Gpu
from ispm.scene.camera import look_at_pose
from ispm.scene.packed import Draw, pack
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView
from ispm.stages.upload import Upload

_EYE, _TARGET = (0.0, 1.0, 0.0), (0.0, 0.5, -5.0)
_SIZE = 96, 54
_RED = Material((0.8, 0.3, 0.2))


def place(kind: str, k: int) -> tuple[float, float, float]:
    """Where ball `k` stands: before the eye, behind it, beside what it sees, or half in the picture."""
    return {
        "before": (-2.0 + k, 0.5, -5.0 - 0.5 * k),
        "behind": (-2.0 + k, 0.5, 3.0 + k),
        "beside": (9.0 + 1.5 * k, 0.5, -3.0),
        "cut": (-3.5 + 0.3 * k, 0.2 * k, -3.0),
    }[kind]


def hall(*kinds: str) -> Scene:
    """A floor under a lamp, and of each kind five balls of one mesh, in this order."""
    scene, ball = Scene(), shapes.sphere(0.4)
    scene.add(shapes.plane(30.0, 30.0))
    scene.add(PointLight((90.0, 90.0, 90.0)), translation=(0.0, 4.0, -3.0))
    for kind in kinds:
        for k in range(5):
            scene.add(ball, material=_RED, translation=place(kind, k))
    return scene


def balls_drawn(gpu: Gpu, scene: Scene) -> tuple[list[Draw], list[Draw]]:
    """The draws of balls that are seen, and all."""
    packed = pack(scene)
    view = CameraView(_SIZE, look_at_pose(np.array(_EYE), np.array(_TARGET)), yfov=0.8)
    loaded = Upload(gpu)(packed)
    ball = packed.instances[-1]["mesh"]
    seen, every = (
        [draw for draw in draws if draw.mesh == ball] for draws in (loaded.seen_by(view.sees), loaded.draws)
    )
    return seen, every


def test_runs_of_seen_instances_are_drawn(gpu: Gpu) -> None:
    """Each run, and of what is seen nothing twice or left out."""
    seen, every = balls_drawn(gpu, hall("before", "behind", "cut", "beside"))
    assert [draw.instance_count for draw in every] == [20]
    rows = [k for draw in seen for k in range(draw.first_instance, draw.first_instance + draw.instance_count)]
    first = every[0].first_instance
    assert rows[:5] == [first + k for k in range(5)]
    assert set(rows[5:]) <= {first + k for k in range(10, 15)}
    assert len(seen) == 2
    assert rows == sorted(set(rows))


def test_none_are_drawn_where_none_is_seen(gpu: Gpu) -> None:
    assert balls_drawn(gpu, hall("behind", "beside"))[0] == []


@pytest.mark.parametrize("kinds", [("behind", "before", "beside"), ("cut", "behind", "cut"), ("behind",)])
def test_the_picture_is_the_same(gpu: Gpu, kinds: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    """Bit for bit, edges included."""

    def every(scene: GpuScene, sees: Callable[[np.ndarray], np.ndarray]) -> list[Draw]:
        return scene.draws

    pictures = []
    for patched in (False, True):
        if patched:
            monkeypatch.setattr(GpuScene, "seen_by", every)
        eye = Camera.look_at(_EYE, _TARGET, yfov=0.8)
        with Renderer(hall(*kinds), Settings(size=_SIZE, photons=1000), eye, gpu=gpu) as renderer:
            frame = renderer.render()
            pictures.append([frame.radiance, frame.direct, frame.instance, frame.normal, frame.depth])
    for ours, whole in zip(*pictures, strict=True):
        assert np.array_equal(ours, whole, equal_nan=True)
