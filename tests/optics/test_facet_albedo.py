"""The table of what facets reflect, integrated anew."""

import numpy as np
import pytest

from ispm.optics.bsdf import Bsdf
from ispm.optics.facet_albedo import ALBEDO, albedo_gain, facet_albedo
from ispm.optics.facets import Anisotropy, shadowing_alpha

f32 = np.float32
STEPS, TURNS = 2000, 256


def integral(along, across, wo):
    """D V cos over the hemisphere, GGX with Smith's height-correlated shadowing, float64: over the facets'
    normals, whose squares of tangents are alpha^2 (1 - t^2) / t^2 with the density 2 t."""
    t = (np.arange(STEPS) + 0.5) / STEPS
    phi = 2.0 * np.pi * (np.arange(TURNS) + 0.5) / TURNS
    steep = (np.sqrt(1.0 - t * t) / t)[:, None]
    slopes = along * steep * np.cos(phi), across * steep * np.sin(phi)
    h = np.stack([*slopes, np.ones((STEPS, TURNS))], -1)
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    met = h @ wo
    wi = 2.0 * met[..., None] * h - wo

    def shadow(w):
        tangent = ((along * w[..., 0]) ** 2 + (across * w[..., 1]) ** 2) / w[..., 2] ** 2
        return (np.sqrt(1.0 + tangent) - 1.0) / 2.0

    seen = (met > 0.0) & (wi[..., 2] > 0.0)
    light = shadow(np.where(seen[..., None], wi, [0.0, 0.0, 1.0]))
    values = met / (h[..., 2] * wo[2]) / (1.0 + shadow(wo) + light)
    return (2.0 * t[:, None] * np.where(seen, values, 0.0)).mean()


def leaning(cosine, phi=0.0):
    r = np.sqrt(1.0 - cosine * cosine)
    return np.array([r * np.cos(phi), r * np.sin(phi), cosine])


@pytest.mark.parametrize("row", range(1, 11))
def test_the_table_is_the_integral(row):
    alpha = (0.1 * row) ** 2
    for column in range(1, 11):
        assert ALBEDO[row, column] == pytest.approx(integral(alpha, alpha, leaning(0.1 * column)), abs=6e-4)


def test_between_its_places_the_table_is_near_the_integral():
    """But for narrow lobes at grazing angles, where it is steep."""
    for alpha, cosine in ((0.125, 0.25), (0.225, 0.55), (0.07, 0.95), (0.18, 0.35), (0.6, 0.45), (0.9, 0.85)):
        expected = integral(alpha, alpha, leaning(cosine))
        assert facet_albedo(f32(alpha), f32(cosine)) == pytest.approx(expected, abs=6e-3)
    assert facet_albedo(f32(0.0), f32(0.4)) == 1.0
    assert facet_albedo(f32(4.0), f32(2.0)) == ALBEDO[-1, -1]


@pytest.mark.parametrize(("along", "across"), [(0.83, 0.09), (0.5, 0.02), (0.5, 0.25), (1.0, 0.6)])
def test_anisotropic_facets_lose_what_those_of_the_mean_square_do(along, across):
    none, zero = (f32(0),) * 3, f32(0)
    grain = Anisotropy(f32(along), (f32(1), f32(0), f32(0)))
    b = Bsdf(none, none, zero, f32(across), zero, zero, none, f32(1.5), zero, zero, grain)
    for cosine in (0.3, 0.6, 0.95):
        turned = [integral(along, across, leaning(cosine, phi)) for phi in (0.2, 0.6, 1.0, 1.4)]
        assert facet_albedo(shadowing_alpha(b), f32(cosine)) == pytest.approx(np.mean(turned), abs=0.03)


def test_what_counts_as_of_the_same_alpha_gains_nothing():
    assert albedo_gain(f32(0.2), f32(0.2), f32(0.5)) == 1.0
    assert albedo_gain(f32(0.0), f32(0.25), f32(1.0)) == pytest.approx(1.0 / ALBEDO[5, -1], rel=1e-6)
    assert albedo_gain(f32(0.64), f32(0.25), f32(0.5)) == pytest.approx(ALBEDO[8, 5] / ALBEDO[5, 5], rel=1e-5)
