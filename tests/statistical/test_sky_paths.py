"""Paths that leave the scene bring what its environment sends: those of the eye, and of the slow truth."""

import math

import numpy as np
import pytest
from rgbe import seen_along
from transport import Tracer

from ispm import Environment
from ispm.library.shapes import icosphere, polygons
from ispm.optics.records import PHOTON
from ispm.paths.eye import trace_eye
from ispm.paths.eye_paths import EyeRays
from ispm.reference.eye import eye_light
from ispm.reference.paths import path_light
from ispm.scene.material import Material
from ispm.scene.scene import Scene

IMAGE = np.random.default_rng(8).random((4, 8, 3)) * 9.0 + 1.0
MIRROR = Material((1.0,) * 3, metallic=1.0, roughness=0.0)
GLASS = Material(transmission=1.0, roughness=0.0, ior=1.5, thickness=1.0)
EVEN = np.full((2, 4, 3), 5.0)


def traced(material, image, mesh=None):
    scene = Scene(environment=Environment(image, 0.3))
    scene.add(icosphere(1.0, 24) if mesh is None else mesh, material=material)
    return Tracer(scene)


def rays_at(tracer, count=2000, radius=0.8):
    """Parallel rays down -Z to a disc about the middle, which meet the scene."""
    random = np.random.default_rng(5)
    r, phi = radius * np.sqrt(random.random(count)), 2 * np.pi * random.random(count)
    origins = np.stack([r * np.cos(phi), r * np.sin(phi), np.full(count, 4.0)], axis=1).astype(np.float32)
    directions = np.tile(np.float32([0, 0, -1]), (count, 1))
    hits = tracer.world.trace(origins, directions)
    assert np.isfinite(hits["t"]).all()
    keys = np.arange(count, dtype=np.uint32)
    return EyeRays(origins, directions, hits["t"].copy(), keys, (1e-3, 0.0), hits=hits)


def by_eye(tracer, rays):
    paths = trace_eye(tracer.packed, tracer.world, tracer.surfaces, rays, 0, 0)
    assert not paths.through.any() and not paths.direct.any()
    return paths.emission.astype(float)


def by_truth(tracer, rays, samples):
    given = dict(samples=range(samples), bounces=0, threads=2)
    return path_light(tracer.tables, rays.origins, rays.directions, **given)


def test_paths_that_meet_nothing_see_the_environment_not_the_background():
    tracer = traced(MIRROR, IMAGE)
    d = np.random.default_rng(1).normal(size=(500, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    origins = 3.0 * d  # outwards
    given = dict(samples=range(1), bounces=0, threads=2, background=(7.0, 7.0, 7.0))
    found = path_light(tracer.tables, origins, d, **given)
    np.testing.assert_allclose(found, seen_along(IMAGE, d, 0.3), atol=2e-4)


def test_a_flat_mirror_by_both():
    corners = np.array([(-2, -1, 1), (2, -1, 1), (2, 1, -1), (-2, 1, -1)], float)  # 45 degrees: to +Y
    tracer = traced(MIRROR, IMAGE, polygons([corners]))
    rays = rays_at(tracer, 200, 0.7)
    n = np.array([0.0, 1.0, 1.0]) / math.sqrt(2.0)
    d = np.array([0.0, 0.0, -1.0])
    expected = seen_along(IMAGE, (d - 2 * (d @ n) * n)[None], 0.3)
    for found in (by_eye(tracer, rays), by_truth(tracer, rays, 1)):
        np.testing.assert_allclose(found, np.tile(expected, (200, 1)), rtol=1e-3)


@pytest.mark.parametrize("samples", [4])
def test_glass_that_absorbs_nothing_shows_an_even_sky_as_it_is(samples):
    """Each path of the truth has weight 1 and ends in the sky, but for those of 256 events; eye paths are cut
    at 8 events or a weight of 1e-3."""
    tracer = traced(GLASS, EVEN)
    rays = rays_at(tracer)
    np.testing.assert_allclose(by_truth(tracer, rays, samples), 5.0, rtol=1e-4)
    found = by_eye(tracer, rays)
    assert found.max() < 5.0 * 1.0001 and found.min() > 5.0 * 0.98
    whole = eye_light(
        tracer.packed, tracer.world, tracer.surfaces, rays, np.zeros(0, PHOTON), samples=16, neighbors=1
    )
    np.testing.assert_allclose(whole, 5.0, rtol=1e-4)


def test_a_mirror_ball_by_both():
    """One path each, and the same: to rounding, which a ball magnifies."""
    tracer = traced(MIRROR, IMAGE)
    rays = rays_at(tracer)
    np.testing.assert_allclose(by_eye(tracer, rays), by_truth(tracer, rays, 1), rtol=5e-3)


def test_a_glass_ball_by_both():
    """The mean over 0.8 of the ball's radius, 256 paths of 2000 rays: within 3.5 standard errors of the truth
    and the 0.5 % that eye paths may lack, where one of them serves for two directions."""
    tracer = traced(GLASS, IMAGE)
    rays = rays_at(tracer)
    given = tracer.tables, rays.origins, rays.directions
    runs = np.stack(
        [path_light(*given, samples=range(k, k + 16), bounces=0, threads=2) for k in range(0, 256, 16)]
    )
    each = runs.mean(axis=1)
    true, error = each.mean(axis=0), each.std(axis=0, ddof=1) / math.sqrt(len(each))
    found = by_eye(tracer, rays).mean(axis=0)
    print(found / true, error / true)
    assert (np.abs(found - true) < 3.5 * error + 0.005 * true).all()


def test_a_ray_beside_all_surfaces_shows_the_environment_only_where_it_is_seen():
    """As the samples of a pixel at an edge do."""
    tracer = traced(MIRROR, IMAGE)
    rays = rays_at(tracer, 8)
    aside = np.float32([0, 3.0, 0])
    for shows in (True, False):
        stray = EyeRays(
            rays.origins + aside,
            rays.directions,
            rays.distances,
            rays.keys,
            rays.width,
            shows_environment=shows,
        )
        paths = trace_eye(tracer.packed, tracer.world, tracer.surfaces, stray, 0, 0)
        expected = seen_along(IMAGE, np.array([[0.0, 0.0, -1.0]]), 0.3) * shows
        np.testing.assert_allclose(paths.emission, np.tile(expected, (8, 1)), rtol=1e-4)
        assert (paths.through == 1.0 - shows).all()
