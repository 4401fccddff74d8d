"""A thin lamp beside rough metal: its reflection is as bright as paths find it, however it is smoothed."""

import math

import numpy as np
import pytest
from transport import Tracer

from ispm.library.shapes import box, polygons
from ispm.reference.paths import path_light
from ispm.renderer.renderer import Renderer
from ispm.scene.camera import Camera
from ispm.scene.material import Material
from ispm.scene.scene import Scene
from ispm.settings import Settings
from ispm.stages.camera import CameraView

SIZE = 96, 64
EYE = Camera.look_at((3, 0, 1), (0.35, 0, 0), yfov=0.08)  # the rod is left of the picture
SEEDS, PASSES, PARTS, PATHS = 4, 4, 6, 48


def lamp_by_wall(roughness, away):
    """A glowing rod, 1 m long and 2 cm wide, `away` m before a wall of metal; nothing else."""
    scene = Scene()
    wall = [[(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)]]
    scene.add(
        polygons(wall), name="wall", material=Material((0.9, 0.8, 0.7), metallic=1.0, roughness=roughness)
    )
    glow = Material((0, 0, 0), emission=(20.0, 10.0, 40.0))
    scene.add(box((-0.01, -0.5, away), (0.01, 0.5, away + 0.02)), name="rod", material=glow)
    return scene


def _mean(values):
    """Mean and standard error."""
    return np.mean(values, axis=0), np.std(values, axis=0, ddof=1) / math.sqrt(len(values))


@pytest.mark.parametrize(("roughness", "away"), [(0.35, 0.08), (0.35, 0.3), (0.2, 0.08), (0.5, 0.1)])
def test_metal_beside_a_thin_lamp_is_as_bright_as_paths_find_it(gpu, roughness, away):
    """Within 2 % and 3.5 standard errors. Four passes, as one has all its paths at the same corner of 2 x 2
    pixels, and a rod's edges are narrower than that."""
    scene, pictures = lamp_by_wall(roughness, away), []
    for seed in range(SEEDS):
        settings = Settings(size=SIZE, passes=PASSES, seed=seed, photons=2000, antialias=False)
        with Renderer(scene, settings, EYE, gpu=gpu) as renderer:
            *_, frame = renderer.converge()
        assert np.isin(frame.instance, frame.names.find("wall")).all()
        pictures.append(frame.radiance.mean(axis=(0, 1)))
    ours, our_error = _mean(pictures)
    tracer, view = Tracer(scene), CameraView(SIZE, EYE.pose, EYE.yfov, None)
    rays = [np.ascontiguousarray(each.reshape(-1, 3)) for each in view.rays()]
    parts = [range(k * PATHS, (k + 1) * PATHS) for k in range(PARTS)]
    paths = [path_light(tracer.tables, *rays, samples=part, bounces=8, threads=2) for part in parts]
    truth, error = _mean([each.mean(axis=0) for each in paths])
    assert (error < 0.01 * truth).all()
    assert (np.abs(ours - truth) < 0.02 * truth + 3.5 * np.hypot(error, our_error)).all()
