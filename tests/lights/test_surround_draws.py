"""Directions of the environment are drawn so that no single one brings many times the light that there is."""

import numpy as np
import pytest
from transport import Tracer

from ispm import Environment
from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Scratch
from ispm.accel.surface import closest_surface, surface
from ispm.kernels.simd import alloca
from ispm.library.shapes import icosphere
from ispm.lights.nee import light_from_one
from ispm.lights.openings import NO_OPENINGS
from ispm.optics.jit import jit
from ispm.optics.vector import scale, vec3
from ispm.reference.paths import path_light
from ispm.scene.material import Material
from ispm.scene.scene import Scene

f32 = np.float32


@jit
def from_one(tables, origins, directions, numbers, out):
    """Write what `light_from_one` brings along each of the rays, by numbers of its own."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for i in range(len(origins)):
        d = vec3(directions[i])
        found, hit = closest_surface(tables, vec3(origins[i]), d, f32(0), scratch)
        if found:
            x = surface(tables, hit, d)
            wo = scale(f32(-1), d)
            light = light_from_one(
                tables, x, wo, numbers[i, 0], numbers[i, 1], scratch, f32(np.inf), NO_OPENINGS
            )
            for c in range(3):
                out[i, c] = light[c]


def brought(image, alpha, count=40_000):
    """(n, 3) from draws at places of a white metal ball, seen along -Z; and likewise by paths."""
    scene = Scene(environment=Environment(image))
    metal = Material((1.0,) * 3, metallic=1.0, roughness=alpha**0.5)
    scene.add(icosphere(1.0, 24), material=metal)
    tracer, random = Tracer(scene), np.random.default_rng(4)
    r, phi = 0.7 * np.sqrt(random.random(count)), 2 * np.pi * random.random(count)
    origins = np.float32(np.stack([r * np.cos(phi), r * np.sin(phi), np.full(count, 4.0)], axis=1))
    directions = np.tile(np.float32([0, 0, -1]), (count, 1))
    out = np.zeros((count, 3), np.float32)
    from_one(tracer.tables, origins, directions, np.float32(random.random((count, 2))), out)
    truth = path_light(tracer.tables, origins, directions, samples=range(1), bounces=1)
    return out, truth


@pytest.mark.parametrize("alpha", [0.01, 0.05, 0.2, 0.5])
def test_no_draw_at_a_metal_brings_more_than_an_even_surround_has(alpha):
    """Drawn by its lobe, f cos over the density is F G2 / G1 <= 1; by the cosine, an alpha of .05 brings up
    to 100. The means differ by their errors: of n values from 0 to 5 one is 2.5 / sqrt(n) at most."""
    found, truth = brought(np.full((2, 4, 3), 5.0), alpha)
    assert found.max() < 5.0 * 1.01
    assert abs(found.mean() - truth.mean()) < 4.0 * np.hypot(2.5, 2.5) / np.sqrt(len(found))
