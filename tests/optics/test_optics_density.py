"""The density kernel spreads a photon's flux without loss."""

import math

import numpy as np
import pytest

from ispm.optics import density, sampling
from ispm.optics.jit import jit

f32 = np.float32


@jit
def evaluate(offsets, normal, radius, height, out):
    for i in range(len(offsets)):
        out[i] = density.density_kernel((offsets[i, 0], offsets[i, 1], offsets[i, 2]), normal, radius, height)


def kernel(offsets, normal, radius, height):
    out = np.zeros(len(offsets), f32)
    evaluate(offsets.astype(f32), tuple(f32(c) for c in normal), f32(radius), f32(height), out)
    return out.astype(np.float64)


def plane(normal, half, n=801):
    """Midpoints of an n x n grid over a square of 2 half across `normal`, and the area of a cell."""
    t, b = (np.array(a, float) for a in sampling.orthonormal_basis(tuple(f32(c) for c in normal)))
    steps = (np.arange(n) + 0.5) / n * 2 * half - half
    u, v = np.meshgrid(steps, steps)
    return u.reshape(-1, 1) * t + v.reshape(-1, 1) * b, (2 * half / n) ** 2


def test_kernel_integrates_to_one_over_its_plane():
    normal = np.array([0.36, 0.48, 0.8])
    points, area = plane(normal, 0.3)
    # midpoint rule of a C1 function: error about (cell / radius)^2 = 1e-5
    assert kernel(points, normal, 0.3, 0.1).sum() * area == pytest.approx(1, abs=1e-4)


@pytest.mark.parametrize("tilt", [0.2, 0.7, 1.2])
def test_kernel_on_a_tilted_plane_integrates_to_the_ellipse_it_cuts(tilt):
    radius, height = 0.3, 0.1
    points, area = plane((0, math.sin(tilt), math.cos(tilt)), radius)
    # the cut through the centre is an ellipse with half axes r and 1 / sqrt(cos^2 / r^2 + sin^2 / h^2)
    short = 1 / math.hypot(math.cos(tilt) / radius, math.sin(tilt) / height)
    assert kernel(points, (0, 0, 1), radius, height).sum() * area == pytest.approx(short / radius, abs=1e-4)


@pytest.mark.parametrize("radius", [0.1, 0.8, 2.0])
def test_round_kernel_on_a_sphere_integrates_to_exactly_one(radius):
    """A cap reached by a chord c has the area pi c^2, whatever the sphere's radius (1 here), c <= 2."""
    n = 4000
    z = 1 - (np.arange(n) + 0.5) / n * 2  # equal areas
    points = np.stack([np.sqrt(1 - z * z), 0 * z, z - 1], axis=1)
    total = kernel(points, (0, 0, 1), radius, radius).sum() * 4 * math.pi / n
    # midpoint rule along z, (radius^2 / 2) / (2 / n) steps inside the kernel
    assert total == pytest.approx(1, abs=max(1e-4, 4 / (radius**2 * n) ** 2 * 10))


def test_kernel_is_zero_outside_its_ellipsoid():
    points = np.array([[0.301, 0, 0], [0, 0, 0.101], [0.25, 0, 0.08]])
    assert (kernel(points, (0, 0, 1), 0.3, 0.1) == 0).all()


def test_photons_count_on_their_own_side_and_surface_only():
    for inner in (False, True):
        assert density.photon_counts(f32(0.1), f32(0.9), inner, inner)
        assert not density.photon_counts(f32(-0.1), f32(0.9), inner, inner)
        assert not density.photon_counts(f32(0.1), f32(0.5), inner, inner)
        assert not density.photon_counts(f32(0.1), f32(0.9), inner, not inner)


def test_cosine_ratio_is_one_without_normal_map_and_bounded():
    assert density.cosine_ratio(f32(0.3), f32(0.3)) == 1
    assert density.cosine_ratio(f32(-0.3), f32(0.3)) == 0
    assert density.cosine_ratio(f32(1), f32(1e-6)) == 10
