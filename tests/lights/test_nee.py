"""Direct light by rays: all lights, or one drawn among them."""

import numpy as np
import pytest
from transport import Tracer, box_room

from ispm import euler
from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Scratch
from ispm.accel.surface import closest_surface, scene_tables, surface
from ispm.kernels.simd import alloca
from ispm.library.shapes import box
from ispm.lights.nee import direct_light, light_from_one
from ispm.lights.openings import NO_OPENINGS
from ispm.optics.jit import jit
from ispm.optics.vector import scale
from ispm.scene.light import DirectionalLight, PointLight

f32 = np.float32


@jit
def both_ways(tables, start, d, picks, limit, out):
    """Direct light of what a ray meets: of all lights to out[0], of one for each pick to the rows below."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    _, hit = closest_surface(tables, start, d, f32(0.5), scratch)
    x = surface(tables, hit, d)
    wo = scale(f32(-1), d)
    light, _ = direct_light(tables, x, wo, f32(0.5), scratch, limit)
    for c in range(3):
        out[0, c] = light[c]
    for i in range(len(picks)):
        light = light_from_one(tables, x, wo, f32(0.5), picks[i], scratch, limit, NO_OPENINGS)
        for c in range(3):
            out[i + 1, c] = light[c]


@pytest.mark.parametrize("limit", [np.inf, 2.0])
def test_one_light_drawn_is_all_lights_in_the_mean(limit):
    """Picks are even: each light is drawn as often as it should, to one in 10,000."""
    scene = box_room((-2, -2, -2), (2, 2, 2))
    scene.add(box((-0.3, -1.2, -0.3), (0.3, -1, 0.3)))  # hides the last but one
    for k, place in enumerate([(1, 1, 0), (-1, 0.5, 0.5), (1.5, -1, -1), (0, 1.5, 0), (-1, -1.8, 1)]):
        scene.add(PointLight((k + 1.0, 2.0, 5.0 - k)), translation=place)
    tracer = Tracer(scene)
    tables = scene_tables(tracer.packed, tracer.world, tracer.surfaces)
    picks = ((np.arange(10_000) + 0.5) / 10_000).astype(f32)
    out = np.zeros((len(picks) + 1, 3), f32)
    start, d = (f32(0.5), f32(0), f32(0.5)), np.array([-0.5, -2, -0.5], f32)
    both_ways(tables, start, tuple(d / np.linalg.norm(d)), picks, f32(limit), out)
    exact, drawn = out[0].astype(float), out[1:].astype(float)
    assert (exact > 0).all() and len(np.unique(drawn[:, 0].round(4))) >= 3
    # each border between two lights is off by at most one pick
    assert drawn.mean(axis=0) == pytest.approx(exact, abs=5 * drawn.max() / len(picks))


def test_a_sun_that_does_not_shine_in_takes_no_draws_from_a_lamp():
    """Suns have rays of their own, so one lamp in a closed room is known by each draw; float32: 1e-6."""
    scene = box_room((-2, -2, -2), (2, 2, 2))
    scene.add(PointLight((4.0, 3.0, 2.0)), translation=(1, 1, 0))
    scene.add(DirectionalLight((1e5,) * 3), rotation=euler(-90, 0, 0, degrees=True))
    tracer = Tracer(scene)
    tables = scene_tables(tracer.packed, tracer.world, tracer.surfaces)
    picks = ((np.arange(100) + 0.5) / 100).astype(f32)
    out = np.zeros((len(picks) + 1, 3), f32)
    start, d = (f32(0.5), f32(0), f32(0.5)), np.array([-0.5, -2, -0.5], f32)
    both_ways(tables, start, tuple(d / np.linalg.norm(d)), picks, f32(np.inf), out)
    assert (out[0] > 0).all()
    assert np.abs(out[1:] / out[0] - 1).max() < 1e-6
