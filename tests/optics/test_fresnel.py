"""Reflection and refraction at a boundary, against the textbook."""

import math

import numpy as np
import pytest

from ispm.optics import bsdf

f32 = np.float32
N = f32(0), f32(0), f32(1)


@pytest.mark.parametrize("n", [1.0, 1.33, 1.5, 2.4])
def test_reflectance_along_the_normal(n):
    for eta in (n, 1 / n):
        assert bsdf.fresnel_dielectric(f32(1), f32(eta)) == pytest.approx(((n - 1) / (n + 1)) ** 2, abs=1e-7)


def test_reflectance_at_brewsters_angle_is_half_that_of_one_polarisation():
    n = 1.5
    angle = math.atan(n)
    other = math.asin(math.sin(angle) / n)
    s = (math.cos(angle) - n * math.cos(other)) / (math.cos(angle) + n * math.cos(other))
    assert bsdf.fresnel_dielectric(f32(math.cos(angle)), f32(n)) == pytest.approx(s * s / 2, rel=1e-5)


def test_reflectance_is_the_same_from_both_sides_and_total_beyond_the_critical_angle():
    n = 1.5
    for angle in np.linspace(0.0, 1.5, 30):
        within = math.asin(math.sin(angle) / n)
        outside = bsdf.fresnel_dielectric(f32(math.cos(angle)), f32(n))
        # near grazing the cosine, rounded to 2^-24, is squared, and its square's error divided by it
        assert bsdf.fresnel_dielectric(f32(math.cos(within)), f32(1 / n)) == pytest.approx(outside, rel=1e-4)
    critical = math.asin(1 / n)
    for angle in np.linspace(critical + 1e-3, math.pi / 2, 20):
        assert bsdf.fresnel_dielectric(f32(math.cos(angle)), f32(1 / n)) == 1.0
        assert not bsdf.refract((f32(math.sin(angle)), f32(0), f32(math.cos(angle))), N, f32(1 / n))[0]


@pytest.mark.parametrize("eta", [1.0, 1.33, 2.0, 1 / 1.33])
def test_refraction_follows_snells_law(eta):
    for angle in np.linspace(0.0, min(1.5, 0.95 * math.asin(min(eta, 1.0))), 20):
        through, wi = bsdf.refract((f32(math.sin(angle)), f32(0), f32(math.cos(angle))), N, f32(eta))
        assert through
        sine = math.sin(angle) / eta
        assert wi == pytest.approx((-sine, 0.0, -math.sqrt(1 - sine * sine)), abs=2e-6)


def test_smooth_surfaces_have_an_alpha_of_zero():
    white = (f32(1),) * 3

    def alpha(roughness, transmission=0.0, ior=1.5, thin=False):
        dielectric = bsdf.Dielectric(f32(0.04), white, f32(1), f32(ior), thin)
        return bsdf.surface_bsdf(white, f32(0), f32(roughness), f32(transmission), dielectric, True).alpha

    assert alpha(0.0) == 0 and alpha(0.031) == 0 and alpha(0.032) == pytest.approx(0.032**2)
    # facets of a solid that bends nothing scatter nothing either; a sheet's do
    assert (
        alpha(0.5, 1.0, 1.0) == 0 and alpha(0.5, 1.0, 1.0, thin=True) == 0.25 and alpha(0.5, 0.0, 1.0) == 0.25
    )
