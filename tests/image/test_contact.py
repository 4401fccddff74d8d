"""Indirect light in the narrow gap between a chest and a wall, in one pass."""

import numpy as np
from transport import Tracer

from ispm import Camera, PointLight, Renderer, Settings
from ispm.library.common import lambert
from ispm.library.shapes import box
from ispm.reference.paths import path_light
from ispm.scene.scene import Scene

EYE = np.array([-1.2, 1.0, 2.5])
SEEDS = 3


def chest_by_wall():
    """A closed room of 4 m; a chest stands 10 cm from its left wall, and a lamp hangs on the other side."""
    scene, white = Scene(), lambert((0.7,) * 3)
    for low, high in (
        ((-2.2, -0.2, -2.2), (2.2, 0, 3.2)),
        ((-2.2, 2.6, -2.2), (2.2, 2.8, 3.2)),
        ((-2.2, -0.1, -2.2), (-2, 2.7, 3.2)),
        ((2, -0.1, -2.2), (2.2, 2.7, 3.2)),
        ((-2.1, -0.1, -2.2), (2.1, 2.7, -2)),
        ((-2.1, -0.1, 3), (2.1, 2.7, 3.2)),
    ):
        scene.add(box(low, high), material=white)
    scene.add(box((-1.9, 0, -0.5), (-1.2, 0.7, 0.5)), material=lambert((0.1, 0.3, 0.15)))
    scene.add(PointLight((200.0,) * 3), translation=(1.2, 2.2, 0.5))
    return scene


def test_light_does_not_reach_into_a_gap(gpu):
    """One pass has few rays, and the filter had given the wall of the gap 3.5 times the light that is there,
    from beside the chest. With more rays where light changes over less than the filter's reach it is 2.3
    times, 1.9 with 36 everywhere: receivers are 4 pixels wide, as the gap is. Paths tell it within 2 %."""
    scene, camera = chest_by_wall(), Camera.look_at(EYE, (-2.0, 0.5, 0.3), yfov=0.9)
    places = np.random.default_rng(1).uniform((-2.0, 0.15, 0.26), (-2.0, 0.5, 0.4), (2000, 3))
    away = places - EYE
    directions = away / np.linalg.norm(away, axis=1, keepdims=True)
    tracer = Tracer(scene)
    told = tracer.tables, np.broadcast_to(EYE, away.shape), directions
    light, direct = (
        path_light(*told, samples=range(64), bounces=bounces, threads=2).mean() for bounces in (16, 0)
    )
    seen = away @ camera.pose[:3, :3]
    size = np.array([320, 180])
    offsets = seen[:, :2] / -seen[:, 2:] * [1, -1] * (size[1] / 2 / np.tan(0.45))
    x, y = np.floor(size / 2 + offsets).astype(int).T
    found = []
    for seed in range(SEEDS):
        settings = Settings(size=tuple(size.tolist()), seed=seed, antialias=False)
        with Renderer(scene, settings, camera, gpu=gpu) as renderer:
            found.append(renderer.render().indirect[y, x].mean())
    assert np.mean(found) < 2.8 * (light - direct)
