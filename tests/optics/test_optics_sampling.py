"""Frames, hemispheres and octahedra are what they say."""

import math

import numpy as np
import pytest

from ispm.optics import rng, sampling
from ispm.photons.scatter import adjoint_factor

f32 = np.float32


def unit_vectors(count):
    v = np.random.default_rng(2).normal(size=(count, 3))
    v = np.vstack([v, np.eye(3), -np.eye(3), [[1e-8, 0, -1]]])
    return (v / np.linalg.norm(v, axis=1, keepdims=True)).astype(f32)


def test_basis_is_orthonormal_and_right_handed():
    for n in unit_vectors(200):
        t, b = sampling.orthonormal_basis(tuple(n))
        np.testing.assert_allclose(np.cross(t, b), n, atol=1e-6)
        assert abs(np.dot(t, b)) < 1e-6


def test_local_and_world_undo_each_other():
    directions = unit_vectors(200)
    for n, d in zip(directions, directions[::-1], strict=True):
        back = sampling.to_world(sampling.to_local(tuple(d), tuple(n)), tuple(n))
        np.testing.assert_allclose(back, d, atol=1e-6)


def test_octahedral_code_gives_the_normal_back():
    for n in unit_vectors(200):
        x, y = sampling.octahedral_encode(tuple(n))
        assert max(abs(x), abs(y)) <= 1
        np.testing.assert_allclose(sampling.octahedral_decode(f32(x), f32(y)), n, atol=1e-6)


def test_equal_area_octahedral_has_jacobian_pi():
    random, h = np.random.default_rng(3), 1e-3
    for u, v in random.uniform(-0.99, 0.99, (100, 2)):
        if min(abs(u), abs(v), abs(1 - abs(u) - abs(v))) < 2 * h:
            continue  # a fold of the map
        du, dv = (
            (np.array(sampling.equal_area_octahedral(f32(u + a), f32(v + b)), float)
             - np.array(sampling.equal_area_octahedral(f32(u - a), f32(v - b)), float)) / (2 * h)
            for a, b in ((h, 0), (0, h))
        )  # fmt: skip
        # float32 differences: 1e-7 / h = 1e-4 a component
        assert np.linalg.norm(np.cross(du, dv)) == pytest.approx(math.pi, rel=2e-3)


def test_cosine_hemisphere_has_mean_cosine_two_thirds():
    """Over a regular grid of u1 the mean of sqrt(1 - u1) is exactly 2/3 but for the rule's 1e-4."""
    u = (np.arange(1000) + 0.5) / 1000
    z = [sampling.cosine_hemisphere(f32(a), f32(0.25))[2] for a in u]
    assert np.mean(z) == pytest.approx(2 / 3, abs=1e-4)


def test_uniform_never_reaches_one():
    assert rng.uniform_float(2**32 - 1) < 1
    assert rng.uniform_float(0) == 0


def test_random_numbers_are_uniform_and_differ_by_every_argument():
    """N = 20,000 keys: mean within 4 sigma of 1/2 in each of four numbers."""
    u = np.array([rng.random4(k, 0, 0, 0) for k in range(20_000)])
    assert (np.abs(u.mean(axis=0) - 0.5) < 4 * math.sqrt(1 / 12 / len(u))).all()
    base = rng.random4(1, 2, 3, 4)
    for other in ((0, 2, 3, 4), (1, 0, 3, 4), (1, 2, 0, 4), (1, 2, 3, 0)):
        assert rng.random4(*other) != base


def test_adjoint_factor_is_one_without_normal_map_and_bounded():
    assert adjoint_factor(f32(0.3), f32(0.3), f32(0.8), f32(0.8)) == pytest.approx(1, rel=1e-6)
    assert adjoint_factor(f32(1), f32(1e-9), f32(0.5), f32(0.5)) == 10
    assert adjoint_factor(f32(1e-9), f32(1), f32(0.5), f32(0.5)) == f32(0.1)
