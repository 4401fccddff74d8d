"""Each path from a lamp with a surface to the eye counts once: pictures against the slow truth."""

import numpy as np
import pytest
from exact_light import blocks
from transport import Tracer, box_room

from ispm import Camera, Environment, Material, Renderer, Scene, Settings
from ispm.library.common import lambert
from ispm.library.shapes import box, polygons
from ispm.reference.paths import path_light
from ispm.stages.camera import CameraView

SIZE, SIDE = (64, 36), 6
PASSES, SEEDS = 16, 3
PATHS, RUNS = 12, 8  # of each run, through random places in the pixels
MIRROR = Material((0.9,) * 3, metallic=1.0, roughness=0.0)
PANE = Material((1.0,) * 3, transmission=1.0, roughness=0.0)
BLURRED = 0.03  # of a block's light, that kernels and filter carry past its borders at most
MISSED = 0.01  # of the picture's light, likewise


def room(pane=True, **floor):
    """A closed room with a panel on the ceiling, a mirror on a wall, a floor of its own, and maybe a pane."""
    scene = box_room((-1.5, -1, -1.5), (1.5, 1, 1.5), albedo=0.6)
    scene.nodes[2].parts[0].material = Material((0.7, 0.5, 0.4), **floor)
    glow = Material((0.1,) * 3, specular=0.0, emission=(9.0, 7.0, 5.0))
    panel = np.array([(-0.5, 0.98, -0.4), (0.5, 0.98, -0.4), (0.5, 0.98, 0.2), (-0.5, 0.98, 0.2)])
    scene.add(polygons([panel]), material=glow, name="panel")
    mirror = np.array([(-1.49, -0.5, -0.7), (-1.49, 0.7, -0.7), (-1.49, 0.7, 0.4), (-1.49, -0.5, 0.4)])
    scene.add(polygons([mirror]), material=MIRROR, name="mirror")
    if pane:
        corners = np.array([(0.3, -1, -0.6), (1.2, -1, -0.2), (1.2, 0.4, -0.2), (0.3, 0.4, -0.6)])
        scene.add(polygons([corners]), material=PANE, name="pane")
    scene.add(box((-0.6, -1, -0.5), (-0.1, -0.4, 0.0)), material=lambert((0.3, 0.6, 0.7)))
    scene.add(Camera.look_at((0.5, 0.2, 1.45), (-0.2, -0.25, -0.5), yfov=1.3))
    return scene


def passes(gpu, scene, bounces, **settings):
    """(SEEDS, h, w, 3) means of PASSES pictures, and whether pixels show no lamp, nor those around them."""
    found = []
    for seed in range(SEEDS):
        given = Settings(size=SIZE, bounces=bounces, photons=10_000, seed=seed, **settings)
        with Renderer(scene, given, threads=2, gpu=gpu) as renderer:
            *_, frame = renderer.converge(PASSES)
        found.append(frame.radiance.astype(float))
    lamps = [k for k in range(frame.instance.max() + 1) if frame.names[k].name == "panel"]
    lamp = np.pad(np.isin(frame.instance, lamps), SIDE)
    near = [np.roll(lamp, (y, x), (0, 1)) for y in range(-SIDE, SIDE + 1) for x in range(-SIDE, SIDE + 1)]
    return np.array(found), ~np.any(near, axis=0)[SIDE:-SIDE, SIDE:-SIDE]


def truth(scene, bounces):
    """(RUNS, h, w, 3) pictures of PATHS paths a pixel, each through a place of its own."""
    tracer, random = Tracer(scene), np.random.default_rng(3)
    camera = scene.default_camera(SIZE)
    view = CameraView(SIZE, camera.pose, camera.yfov, camera.ymag, 1e-3, 100.0)
    shape, pictures = (PATHS, SIZE[1], SIZE[0]), []
    for run in range(RUNS):
        x, y = np.arange(SIZE[0]) + random.random(shape), np.arange(SIZE[1])[:, None] + random.random(shape)
        rays = [a.reshape(-1, 3) for a in view.rays_through(x, y)]
        given = dict(samples=range(run, run + 1), bounces=bounces, threads=2, seed=run)
        pictures.append(path_light(tracer.tables, *rays, **given).reshape(*shape, 3).mean(axis=0))
    return np.array(pictures)


def compare(pictures, away_from_lamps, paths, blurred=BLURRED):
    """Whether blocks agree in all channels, and the whole, but those about lamps, whose edges 16 places in a
    pixel do not cover evenly: within 5 standard errors of both together, which are known from 3 and 8
    numbers, so that those of a block are at least the median's, and what is blurred. Some 150 numbers:
    beyond 5, once in 10,000 runs were they known; the whole within 4 of its own."""
    clear = blocks(np.repeat(away_from_lamps[..., None], 3, axis=2), SIDE)[..., 0] == 1.0
    assert clear.mean() > 0.5
    one, two = (np.array([blocks(a, SIDE)[clear] for a in each]) for each in (pictures, paths))
    square = [a.var(axis=0, ddof=1) / len(a) for a in (one, two)]
    error = np.sqrt(sum(np.maximum(s, np.median(s)) for s in square))
    light = two.mean(axis=0)
    away = np.abs(one.mean(axis=0) - light)
    whole = [a.mean(axis=1) for a in (one, two)]
    spread = np.sqrt(sum(a.var(axis=0, ddof=1) / len(a) for a in whole))
    mean = [a.mean(axis=0) for a in whole]
    assert (away < 5.0 * error + blurred * light).all()
    assert (np.abs(mean[0] - mean[1]) < 4.0 * spread + MISSED * mean[1]).all()


FLOORS = {
    "matt": {"specular": 0.0},
    "plastic": {"roughness": 0.35},
    "polished": {"roughness": 0.12},
    "metal": {"metallic": 1.0, "roughness": 0.25, "pane": False},
    "wide metal": {"metallic": 1.0, "roughness": 0.5},
}


@pytest.mark.parametrize("surrounded", [False, True])
def test_light_that_a_pane_lets_through_to_a_narrow_lobe_counts_once(gpu, surrounded):
    """By draws, whose shadow rays pass sheets, and by paths, which do as well; the pane's own reflection, a
    twelfth of the light of some pixels, is shared with what it lets through: 3 % of a block more. Hardly
    smoothed, as the far end of the floor gets darker by half from block to block."""
    sky = Environment(np.full((4, 8, 3), 2.0)) if surrounded else None
    scene = Scene(environment=sky)
    corners = np.array([(-2, 0, -2), (-2, 0, 2), (2, 0, 2), (2, 0, -2)], float)
    scene.add(polygons([corners]), material=Material((0.9,) * 3, metallic=1.0, roughness=0.45))
    if not surrounded:
        glow = Material((0.0,) * 3, specular=0.0, emission=(9.0, 7.0, 5.0))
        scene.add(polygons([0.4 * corners[::-1] + np.array([0, 1.2, 0])]), material=glow)
    scene.add(polygons([corners + np.array([0, 0.8, 0])]), material=PANE, name="pane")
    scene.add(Camera.look_at((0.0, 0.6, 1.9), (0.0, 0.0, -0.2), yfov=0.7))
    compare(*passes(gpu, scene, 5, smoothing=0.1), truth(scene, 5), blurred=2 * BLURRED)


CASES = [(floor, 5) for floor in FLOORS] + [(floor, b) for floor in ("matt", "wide metal") for b in (0, 1)]


@pytest.mark.parametrize(("floor", "bounces"), CASES)
def test_a_room_lit_by_a_panel_is_as_bright_as_paths_say(gpu, floor, bounces):
    """Narrow lobes, which eye paths follow as mirrors, are no scatter to them, but are to the truth: they are
    compared where later scatters count little. Of a pane such paths follow one of the two ways for both, so
    that a strong one would lack the lamp's image in it: there is none."""
    scene = room(**FLOORS[floor])
    compare(*passes(gpu, scene, bounces), truth(scene, bounces))
