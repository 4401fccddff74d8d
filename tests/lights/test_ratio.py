"""The environment's light by a ratio of means: known without shadows, near to the truth with them."""

import math

import numpy as np
import pytest
from transport import Tracer

import ispm
from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Scratch
from ispm.accel.surface import closest_surface, scene_tables, surface
from ispm.kernels.simd import alloca
from ispm.library.common import lambert
from ispm.library.shapes import polygons
from ispm.lights.nee import BY_NOTHING, area_light
from ispm.lights.openings import NO_OPENINGS
from ispm.lights.ratio import area_light_by_ratio, ratio_share
from ispm.optics.environment import environment_irradiance
from ispm.optics.jit import jit
from ispm.optics.vector import scale
from ispm.scene.material import Material
from ispm.scene.scene import Scene

f32, i64, u32 = np.float32, np.int64, np.uint32
ALBEDO = (0.6, 0.5, 0.4)
FLOOR = polygons([np.array([(-50, 0, -50), (-50, 0, 50), (50, 0, 50), (50, 0, -50)], float)])
WALL = polygons([np.array([(-0.5, 0, -50), (-0.5, 9, -50), (-0.5, 9, 50), (-0.5, 0, 50)], float)])


@jit
def look(tables, numbers, count, by_ratio, openings, known, out):
    """Light at the floor's middle, a row for each random number; known: irradiance without shadows."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    d = (f32(0), f32(-1), f32(0))
    _, hit = closest_surface(tables, (f32(0.01), f32(0.2), f32(0.02)), d, f32(0.5), scratch)
    x = surface(tables, hit, d)
    wo = scale(f32(-1), d)
    sunlight, others = environment_irradiance(tables.environment, x.n)
    for c in range(3):
        known[c] = sunlight[c] + others[c]
    for i in range(len(numbers)):
        if by_ratio:
            told = BY_NOTHING, count, u32(0), openings
            light, _ = area_light_by_ratio(tables, x, wo, numbers[i], scratch, *told)
        else:
            light, _ = area_light(tables, x, wo, numbers[i], scratch, f32(np.inf), BY_NOTHING, count)
        for c in range(3):
            out[i, c] = light[c]


def light_of(material, wall, count, by_ratio, draws=20_000, sun=None):
    """(3,) irradiance without shadows, and (draws, 3) light; sun: of pixels of a finer sky, past the wall."""
    scene = Scene()
    scene.add(FLOOR, material=material)
    if wall:
        scene.add(WALL, material=lambert((0.0,) * 3))
    random = np.random.default_rng(3)
    image = random.random((16, 32, 3)) ** 3
    if sun is not None:
        image = image.repeat(4, axis=0).repeat(4, axis=1)
        image[20:22, 31:33] = sun
    scene.environment = ispm.Environment(image)
    tracer = Tracer(scene)
    tables = scene_tables(tracer.packed, tracer.world, tracer.surfaces)
    known, out = np.zeros(3, f32), np.zeros((draws, 3), f32)
    look(tables, random.random(draws).astype(f32), i64(count), by_ratio, NO_OPENINGS, known, out)
    return known.astype(float), out.astype(float)


def test_without_shadows_a_matte_floor_has_what_is_known():
    """Any few rays say so, to the rounding of some twenty products."""
    known, found = light_of(lambert(ALBEDO), False, 4, True)
    expected = np.array(ALBEDO) / math.pi * known
    assert found == pytest.approx(np.broadcast_to(expected, found.shape), rel=20 * 2.0**-24)


@pytest.mark.parametrize("material", [lambert(ALBEDO), Material(ALBEDO, roughness=0.6)])
def test_in_shadow_the_mean_is_near_that_of_rays(material):
    """A wall hides near half of the sky. What is known is within 1 %; a ratio of 16 draws errs by a 16th of
    the variance of one; 5 standard errors of both means."""
    _, ratio = light_of(material, True, 16, True)
    _, rays = light_of(material, True, 16, False)
    error = 5 * np.hypot(ratio.std(axis=0), rays.std(axis=0)) / math.sqrt(len(rays))
    bias = 0.01 + (rays.std(axis=0) / rays.mean(axis=0)) ** 2
    assert (abs(ratio.mean(axis=0) - rays.mean(axis=0)) < error + bias * rays.mean(axis=0)).all()
    assert (ratio.std(axis=0) < 1.2 * rays.std(axis=0)).all()


def test_one_ray_has_no_ratio():
    """Which says how many rays pass, not how much light: what shades the sky's bright part left a sixth too
    little on walls that lobes show. 5 standard errors of both means."""
    _, ratio = light_of(lambert(ALBEDO), True, 1, True)
    _, rays = light_of(lambert(ALBEDO), True, 64, False)
    error = 5 * np.hypot(ratio.std(axis=0), rays.std(axis=0)) / math.sqrt(len(rays))
    assert (abs(ratio.mean(axis=0) - rays.mean(axis=0)) < error).all()


def test_a_hidden_sun_leaves_the_skys_light_as_even_as_it_is_without():
    """Four draws, whose ratio errs by the square of its deviation. By draws of both, the light was known by
    the share of those that found the sky, and was as bright as in the sun where none found that."""
    (_, without), (known, hidden) = (light_of(lambert(ALBEDO), True, 4, True, sun=v) for v in (0.3, 16_000.0))
    bias = 0.01 + (hidden.std(axis=0) / hidden.mean(axis=0)) ** 2
    assert (abs(hidden.mean(axis=0) / without.mean(axis=0) - 1.0) < bias).all()
    assert (hidden.std(axis=0) < 1.1 * without.std(axis=0)).all()
    assert (hidden.max(axis=0) < 0.2 * known / math.pi).all()


def test_later_passes_leave_the_ratio():
    shares = [ratio_share(u32(k)) for k in (0, 8, 56, 10**6)]
    assert shares == pytest.approx([1.0, 0.5, 0.125, 0.0], abs=1e-5)
