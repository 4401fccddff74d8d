"""What clear coats and sheen send on of a lamp's light: where their lobes reflect it, not all around."""

import math

import numpy as np
import pytest
from transport import Tracer, render

from ispm import shapes
from ispm.reference.paths import path_light
from ispm.scene.camera import Camera
from ispm.scene.light import DirectionalLight, RectLight
from ispm.scene.material import Material
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView

SIZE, SEEDS, PARTS, PATHS = (320, 180), 4, 8, 100
WINDOW = np.s_[84:108, 144:176]  # of the card, above where it stands


COAT = dict(clearcoat=1.0, clearcoat_roughness=0.04)
SHEEN = dict(sheen_color=(1.0, 1.0, 1.0), sheen_roughness=0.3)


def card_on_floor(light, layer):
    """A white card on a dark floor below a layer, before a light, whose mirror image is behind the card."""
    scene = Scene()
    scene.add(shapes.plane(3, 3), material=Material((0.03, 0.03, 0.03), roughness=0.5, **layer))
    scene.add(shapes.box((0.3, 0.3, 0.02)), material=Material((0.8, 0.8, 0.8)), translation=(0, 0.151, 0))
    scene.add(light, translation=(0.25, 1.0, -0.3)).look_at((0, 0, 0))
    return scene, Camera.look_at((0.05, 0.3, 1.2), (0, 0.15, 0), yfov=math.radians(30))


def beside_paths(gpu, light, layer):
    """The card's front: its radiance over that of paths, and a standard error of that."""
    scene, camera = card_on_floor(light, layer)
    frames = [render(gpu, scene, camera, size=SIZE, antialias=False, seed=s)[0] for s in range(SEEDS)]
    tracer, view = Tracer(scene), CameraView(SIZE, camera.pose, camera.yfov, None)
    origins, directions = (
        np.ascontiguousarray(each.reshape(*SIZE[::-1], 3)[WINDOW].reshape(-1, 3)) for each in view.rays()
    )
    parts = [range(first, first + PATHS) for first in range(0, PARTS * PATHS, PATHS)]
    paths = [
        path_light(tracer.tables, origins, directions, samples=part, bounces=32, threads=2).mean()
        for part in parts
    ]
    ours, ours_error = _mean([frame.radiance[WINDOW].mean() for frame in frames])
    truth, error = _mean(paths)
    return ours / truth, ours / truth * math.hypot(ours_error / ours, error / truth)


def _mean(values):
    return np.mean(values), np.std(values, ddof=1) / math.sqrt(len(values))


@pytest.mark.parametrize("layer", [COAT, SHEEN], ids=["coat", "sheen"])
@pytest.mark.parametrize("light", [RectLight((900.0,) * 3, 0.6, 0.6), DirectionalLight((400.0,) * 3)])
def test_a_layer_lights_nothing_that_it_does_not_reflect_a_lamp_to(gpu, light, layer):
    """The card's front, which hardly more than the floor's Lambert lobe lights, is as near to paths before a
    floor below a layer as before a bare one, within 4 standard errors and 4 %. Kernels reach past the card's
    foot before either. A coat that counts as matte at rays' ends makes several times the light of it."""
    layered, error = beside_paths(gpu, light, layer)
    bare, bare_error = beside_paths(gpu, light, {})
    assert abs(layered - bare) < 0.04 + 4.0 * math.hypot(error, bare_error)
    assert max(error, bare_error) < 0.04
