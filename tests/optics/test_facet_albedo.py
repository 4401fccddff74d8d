"""The table of what facets reflect, integrated anew."""

import numpy as np
import pytest

from ispm.optics.facet_albedo import ALBEDO, facet_albedo, widening_gain

f32 = np.float32
STEPS = 1500


def integral(alpha, cosine):
    """D G2 / (4 n.wo) over the hemisphere of wi, GGX with Smith's height-correlated shadowing, in float64."""
    theta = (np.arange(STEPS) + 0.5) / STEPS * np.pi / 2
    phi = (np.arange(STEPS) + 0.5) / STEPS * np.pi
    wi = np.stack(
        [
            np.outer(np.sin(theta), np.cos(phi)),
            np.outer(np.sin(theta), np.sin(phi)),
            np.cos(theta)[:, None] + 0 * phi,
        ],
        -1,
    )
    h = wi + np.array([np.sqrt(1.0 - cosine**2), 0.0, cosine])
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    d = alpha**2 / (np.pi * (h[..., 2] ** 2 * (alpha**2 - 1.0) + 1.0) ** 2)

    def lambda_of(c):
        return (np.sqrt(1.0 + alpha**2 * (1.0 / c**2 - 1.0)) - 1.0) / 2.0

    g = 1.0 / (1.0 + lambda_of(cosine) + lambda_of(wi[..., 2]))
    over = 2.0 * d * g / (4.0 * cosine) * np.sin(theta)[:, None]
    return over.sum() * (np.pi / 2 / STEPS) * (np.pi / STEPS)


@pytest.mark.parametrize("row", range(1, 6))
def test_the_table_is_the_integral(row):
    for column in range(1, 11):
        assert ALBEDO[row, column] == pytest.approx(integral(0.05 * row, 0.1 * column), abs=6e-4)


def test_between_its_places_the_table_is_near_the_integral():
    """But for narrow lobes at grazing angles, where it is steep."""
    for alpha, cosine in ((0.125, 0.25), (0.225, 0.55), (0.07, 0.95), (0.18, 0.35)):
        assert facet_albedo(f32(alpha), f32(cosine)) == pytest.approx(integral(alpha, cosine), abs=6e-3)
    assert facet_albedo(f32(0.0), f32(0.4)) == 1.0
    assert facet_albedo(f32(0.4), f32(2.0)) == ALBEDO[-1, -1]


def test_what_is_no_wider_gains_nothing():
    assert widening_gain(f32(0.2), f32(0.2), f32(0.5)) == 1.0 == widening_gain(f32(0.2), f32(0.1), f32(0.5))
    assert widening_gain(f32(0.0), f32(0.25), f32(1.0)) == pytest.approx(1.0 / ALBEDO[-1, -1], rel=1e-6)
