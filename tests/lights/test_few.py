"""Many lights by few shadow rays: exact for up to three, and the mean of all for more."""

import math

import numpy as np
import pytest
from transport import Tracer, box_room

from ispm import Material
from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Scratch
from ispm.accel.surface import closest_surface, surface
from ispm.kernels.simd import alloca
from ispm.library.shapes import box
from ispm.lights.few import choose, light_of_few
from ispm.lights.nee import punctual_light
from ispm.optics.jit import jit
from ispm.optics.vector import scale
from ispm.scene.light import PointLight

f32, i64 = np.float32, np.int64


@jit
def both_ways(tables, start, d, picks, values, every, few, rays):
    """Direct light of what a ray meets, by all lights and by few, for as many random numbers as rows."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    _, hit = closest_surface(tables, start, d, f32(0.5), scratch)
    x = surface(tables, hit, d)
    wo = scale(f32(-1), d)
    for i in range(len(picks)):
        light, _ = punctual_light(tables, x, wo, scratch, f32(np.inf))
        drawn, traced = light_of_few(tables, x, wo, picks[i], scratch, values)
        rays[i] = traced
        for c in range(3):
            every[i, c], few[i, c] = light[c], drawn[c]


def found(lights, picks):
    """Light by all and by few at a glossy floor with a block on it, and the rays of the latter."""
    scene = box_room((-2, -2, -2), (2, 2, 2))
    scene.nodes[2].parts[0].material = Material((0.8, 0.6, 0.4), roughness=0.4)
    scene.add(box((-0.3, -2, -0.3), (0.3, -0.8, 0.3)))
    random = np.random.default_rng(5)
    for _ in range(lights):
        place = random.uniform((-1.8, -1, -1.8), (1.8, 1.8, 1.8))
        scene.add(PointLight(tuple(random.uniform(0.5, 6.0, 3))), translation=place)
    tracer = Tracer(scene)  # whose arrays the tables are addresses of
    every, few, rays = np.zeros((len(picks), 3)), np.zeros((len(picks), 3)), np.zeros(len(picks), np.int64)
    d = np.array((0.5, -1.7, 0.9)) / math.sqrt(0.25 + 2.89 + 0.81)
    start = tuple(map(f32, (-1.1, 0.0, -0.4)))
    values = np.empty(lights, f32)
    both_ways(tracer.tables, start, tuple(map(f32, d)), picks.astype(f32), values, every, few, rays)
    return every, few, rays


@pytest.mark.parametrize("lights", [0, 1, 2, 3])
def test_up_to_three_lights_are_all_asked(lights):
    every, few, _ = found(lights, np.linspace(0.0, 0.999, 7))
    np.testing.assert_allclose(few, every, rtol=1e-5, atol=1e-9)  # the order of a sum of three floats


def test_many_lights_are_met_in_the_mean_by_three_rays():
    every, few, rays = found(24, np.random.default_rng(7).random(40_000, np.float32))
    assert rays.max() <= 3 < 24
    error = few.std(axis=0, ddof=1) / math.sqrt(len(few))
    assert (
        np.abs(few.mean(axis=0) - every.mean(axis=0)) < 4.1 * error
    ).all()  # one in 8,000 of three is beyond
    assert few.std() > 0.0


def test_lights_that_bring_much_have_rays_of_their_own_and_others_share_one():
    values = np.array([1.0, 30.0, 0.0, 2.0, 40.0, 3.0], f32)
    picked = [choose(values, f32(pick)) for pick in (np.arange(600) + 0.5) / 600]
    assert {few[:2] for few in picked} == {(4, 1)}
    # picks side by side draw evenly, to one at each border
    assert [sum(few.drawn == k for few in picked) for k in (0, 3, 5)] == pytest.approx([100, 200, 300], abs=1)
    assert {(few.drawn, few.weight) for few in picked} == {(0, 6.0), (3, 3.0), (5, 2.0)}


def test_of_many_even_lights_none_has_a_ray_of_its_own():
    few = choose(np.ones(10, f32), f32(0.75))
    assert few == (-1, -1, 7, pytest.approx(10.0))


def test_lights_that_bring_nothing_are_never_drawn():
    values = np.array([0.0, 1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0], f32)
    drawn = {choose(values, f32(pick)).drawn for pick in (0.0, 0.1999, 0.2, 0.6, 0.8, 1.0 - 2.0**-24)}
    assert drawn <= {1, 3, 4, 5, 6}
    assert choose(np.zeros(4, f32), f32(0.5)) == (-1, -1, -1, 0.0)
