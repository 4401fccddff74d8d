"""One light drawn among points, a lamp with a surface and an environment: the mean of all."""

import math

import numpy as np
import pytest
from transport import Tracer, box_room

from ispm import Environment, Material, RectLight
from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Scratch
from ispm.accel.surface import closest_surface, surface
from ispm.kernels.simd import alloca
from ispm.library.shapes import box, icosphere
from ispm.lights.nee import direct_light, light_from_one
from ispm.lights.openings import NO_OPENINGS
from ispm.optics.jit import jit
from ispm.optics.rng import random4
from ispm.optics.vector import scale
from ispm.scene.light import PointLight

f32, u32 = np.float32, np.uint32


@jit
def both_ways(tables, start, d, limit, all_of_them, one):
    """Direct light of what a ray meets, by all lights and by one, of as many random numbers as rows."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    _, hit = closest_surface(tables, start, d, f32(0.5), scratch)
    x = surface(tables, hit, d)
    wo = scale(f32(-1), d)
    for i in range(len(one)):
        u, v, pick, _ = random4(u32(i), u32(3), u32(0), u32(1))
        light, _ = direct_light(tables, x, wo, u, scratch, limit)
        drawn = light_from_one(tables, x, wo, v, pick, scratch, limit, NO_OPENINGS)
        for c in range(3):
            all_of_them[i, c], one[i, c] = light[c], drawn[c]


def open_room(kinds, environment):
    """A room without ceiling, with a block that hides some light, and lights of some kinds."""
    scene = box_room((-2, -2, -2), (2, 2, 2))
    scene.roots.pop(3)
    scene.nodes[2].parts[0].material = Material((0.8, 0.6, 0.4), roughness=0.5)
    scene.add(box((-0.3, -1.4, -0.3), (0.3, -1, 0.3)))
    if "points" in kinds:
        scene.add(PointLight((1.0, 2.0, 5.0)), translation=(1, 1, 0))
        scene.add(PointLight((4.0, 2.0, 1.0)), translation=(-1, 0.5, 0.5))
    if "lamps" in kinds:
        scene.add(RectLight((5.0, 4.0, 3.0), 0.8, 0.5), translation=(-0.4, 1, 0)).look_at((-0.4, -2, 0.1))
        glow = Material((0.0,) * 3, specular=0.0, emission=(2.0, 3.0, 9.0))
        scene.add(icosphere(0.2, 3), material=glow, translation=(-1.5, -1.2, -1.0))
    if environment:
        scene.environment = Environment(np.random.default_rng(2).random((8, 16, 3)) ** 3 * 4.0, 0.4)
    return Tracer(scene)


@pytest.mark.parametrize("limit", [np.inf, 6.0])
@pytest.mark.parametrize(
    ("kinds", "environment"),
    [(("lamps",), False), ((), True), (("lamps",), True), (("points", "lamps"), True), (("points",), True)],
)
def test_one_light_drawn_has_the_mean_of_all(kinds, environment, limit):
    """200,000 draws each way at two points of the floor: within 4.5 standard errors of the difference, of
    which 60 are beyond once in 2,500 runs; float32: 1e-4."""
    tracer, count = open_room(kinds, environment), 200_000
    for target in ((0.5, -2.0, 0.4), (-0.9, -2.0, 0.1)):
        start = (f32(0), f32(0.5), f32(0.9))
        d = np.array(target) - start
        every, one = np.zeros((2, count, 3), f32)
        both_ways(tracer.tables, start, tuple(map(f32, d / np.linalg.norm(d))), f32(limit), every, one)
        expected, found = every.mean(axis=0, dtype=float), one.mean(axis=0, dtype=float)
        error = np.sqrt((every.var(axis=0, dtype=float) + one.var(axis=0, dtype=float)) / count)
        assert (np.abs(found - expected) < 4.5 * error + 1e-4 * expected).all()
        if limit == math.inf:
            assert (expected > 20 * error).all()
