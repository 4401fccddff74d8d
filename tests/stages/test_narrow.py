"""The filter's radius, where the light of photons changes within it."""

import numpy as np
import pytest
from test_filter import floor

from ispm.optics.incident import channels, no_light
from ispm.renderer.narrow import mean_flux, narrow_radius
from ispm.stages.filter import filter_estimate
from ispm.stages.lattice import radius_of, set_radius

SIZE, PIXEL, DIAGONAL = (96, 72), 0.1, 40.0
FLUX = 2e-5  # lm
RADIUS = 2.0  # m


def lit(irradiance, seed=0):
    """Light at receivers of as many photons as bring (h, w) lx, drawn for each of them by itself."""
    count = irradiance * PIXEL**2 / FLUX
    drawn = np.random.default_rng(seed).poisson(count.ravel())
    light = no_light(drawn.size)
    channels(light)["irradiance"] = (drawn * FLUX / PIXEL**2)[:, None]
    set_radius(light, np.full(drawn.size, RADIUS), 1.0)
    return light


def narrowed(light, of_photons=None, **others):
    """The radii, (h, w) m, that are left."""
    points = floor(SIZE, PIXEL)
    light = light.copy()
    of_photons = light.copy() if of_photons is None else of_photons
    narrow_radius(light, of_photons, FLUX, points, SIZE, DIAGONAL, 1.0, 2, **others)
    return radius_of(light, points, DIAGONAL, 1.0).reshape(SIZE[::-1]), light


def error(light, exact):
    found = filter_estimate(floor(SIZE, PIXEL), light, SIZE, DIAGONAL, 1.0, 2).light
    return float(((found[:, 0] / exact.ravel() - 1.0) ** 2).mean())


def test_even_light_keeps_its_radius():
    """Its noise alone passes three standard errors here and there, once in 370 were it independent."""
    radii, _ = narrowed(lit(np.full(SIZE[::-1], 1e-2)))
    assert (radii < 0.999 * RADIUS).mean() < 0.02


def spot(width):
    """(h, w) lx: a spot forty times as bright as what is around it."""
    x, y = np.meshgrid(np.arange(SIZE[0]) * PIXEL, np.arange(SIZE[1]) * PIXEL)
    away = (x - 4.8) ** 2 + (y - 3.6) ** 2
    return 5e-2 * (1.0 + 40.0 * np.exp(-away / (2.0 * width**2)))


def test_a_bright_spot_is_not_spread():
    """A fifth of the error, though noise grows: the wide radius spreads the spot over four times its area."""
    exact = spot(0.7)
    light = lit(exact)
    radii, narrow = narrowed(light)
    assert radii.min() < 0.5 * RADIUS
    assert error(narrow, exact) < 0.2 * error(light, exact)


def test_what_photons_hardly_bring_changes_nothing():
    """The same spot, beside a hundred times as much of other light."""
    of_photons = lit(spot(0.7))
    light = of_photons.copy()
    channels(light)["irradiance"] += 100.0 * of_photons[:, 0].mean()
    radii, _ = narrowed(light, of_photons, others=0.01)
    assert radii == pytest.approx(np.full(SIZE[::-1], RADIUS), rel=1e-3)


def test_more_passes_are_filtered_less():
    """By the sixth root of their number, within the bounds, once the bias is known."""
    light = lit(spot(0.7))
    one, many = (narrowed(light, passes=passes)[0] for passes in (1, 4))
    free = (one < 0.99 * RADIUS) & (many > 0.26 * RADIUS)
    assert free.any()
    assert (one / many)[free] == pytest.approx(4.0 ** (1.0 / 6.0), rel=1e-3)


def test_no_photons_no_change():
    light = no_light(SIZE[0] * SIZE[1])
    set_radius(light, np.full(len(light), RADIUS), 1.0)
    assert narrowed(light)[0] == pytest.approx(np.full(SIZE[::-1], RADIUS), rel=1e-3)


def test_the_flux_of_a_photon_is_weighted_by_itself():
    """One of 3 lm and three of 1 lm bring half each: (9 + 3) / 6."""
    flux = np.tile(np.array([[3.0], [1.0], [1.0], [1.0]], np.float32), 3)
    assert mean_flux(flux) == pytest.approx(2.0)
    assert mean_flux(flux[:0]) == 0.0
