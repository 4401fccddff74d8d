"""The clear sky: against published illuminances, a Monte Carlo of its own, and what holds of any sky."""

import math

import numpy as np
import pytest

from ispm.optics import atmosphere
from ispm.optics.atmosphere import horizontal_irradiance, sky_radiance, sun_direction, sun_irradiance
from ispm.optics.vector import LUMINANCE

Y = np.array(LUMINANCE)
DEGREE = math.pi / 180.0


def whiteness(rgb):
    """Least over greatest channel."""
    return rgb.min() / rgb.max()


def test_the_sun_has_its_illuminance_above_the_atmosphere():
    """133.3 klx (Darula, Kittler and Gueymard 2005); the fit of the matching curves is good to 1 %."""
    assert atmosphere._SUNLIGHT.sum(axis=0) @ Y == pytest.approx(133.3e3, rel=0.01)


@pytest.mark.parametrize("elevation", [10, 20, 35, 50, 70, 85])
def test_a_very_clear_sky_has_the_illuminance_of_measurements(elevation):
    """Means over many days (IES calculation procedures committee 1984, clear sky), whose sun is that of
    turbidity 2; single days differ by a third."""
    sine = math.sin(elevation * DEGREE)
    sun = sun_irradiance(elevation * DEGREE, 2.0) @ Y
    assert sun == pytest.approx(127.5e3 * math.exp(-0.21 / sine), rel=0.1)
    sky = horizontal_irradiance(sky_radiance(elevation * DEGREE, 0.0, 2.0, 0.2)) @ Y
    assert sky == pytest.approx(800.0 + 15_500.0 * math.sqrt(sine), rel=0.33)


def test_luminances_are_those_of_clear_skies():
    for turbidity in (2.0, 3.0):
        for elevation in (35, 45, 55):
            image = sky_radiance(elevation * DEGREE, 0.0, turbidity) @ Y
            assert 2_000 < image[0].mean() < 8_000
            assert 4_000 < image[127, 0] < 12_000  # the horizon away from the sun


# What Hillaire's approximation may be off: light scattered twice and more is taken for isotropic, and the
# ground sends back the sun's light alone.
@pytest.mark.parametrize(
    ("turbidity", "elevation", "albedo", "off"),
    [
        (1, 60, 0.0, 0.03),
        (1, 60, 0.8, 0.1),
        (1, 25, 0.3, 0.1),
        (3, 60, 0.3, 0.1),
        (3, 30, 0.3, 0.1),
        (8, 45, 0.3, 0.15),
    ],
)
def test_the_sky_gets_the_light_that_photons_bring(monkeypatch, turbidity, elevation, albedo, off):
    band = 8  # 550 nm
    monkeypatch.setattr(atmosphere, "_SUNLIGHT", np.eye(17)[:, [band] * 3])
    image = sky_radiance.__wrapped__(elevation * DEGREE, 0.0, turbidity, albedo, 64)
    direct, sky, deviation = brought(turbidity, elevation * DEGREE, albedo, band)
    sun = sun_irradiance(elevation * DEGREE, turbidity)[0] * math.sin(elevation * DEGREE)
    assert sun == pytest.approx(direct, rel=0.01)
    assert abs(horizontal_irradiance(image)[0] - sky) < off * sky + 3.0 * deviation


def brought(turbidity, elevation, albedo, band, count=100_000):
    """What photons bring to a flat ground where the sun's irradiance is 1: straight and scattered, with the
    standard deviation of that. Woodcock tracking in flat layers, with the phase functions themselves."""
    rng = np.random.default_rng(5)
    air = atmosphere._air(turbidity)
    extinction = air.extinction[:, band]
    most = extinction[:2].sum() + extinction[2]
    height, scattered = np.full(count, 60e3), np.zeros(count, bool)
    going = np.tile(-sun_direction(elevation, 0.0), (count, 1))
    weight = np.full(count, math.sin(elevation) / count)
    direct, sky = 0.0, np.zeros(count)
    alive = np.arange(count)
    while len(alive):
        height[alive] += going[alive, 1] * -np.log(1.0 - rng.random(len(alive))) / most
        landed = alive[height[alive] <= 0.0]
        direct += weight[landed[~scattered[landed]]].sum()
        again = landed[scattered[landed]]
        sky[again] += weight[again]
        weight[landed] *= albedo
        height[landed] = 0.0
        scattered[landed] = True
        going[landed] = lambert(rng, len(landed))
        met = alive[(height[alive] > 0.0) & (height[alive] < 60e3)]
        here = atmosphere._densities(height[met]) * extinction
        u = rng.random(len(met)) * most
        kind = (u[:, None] > np.cumsum(here, axis=1)).sum(axis=1)  # 3: none
        weight[met[kind == 2]] = 0.0
        weight[met[kind == 1]] *= atmosphere._MIE_ALBEDO
        for k, phase in ((0, atmosphere._rayleigh_phase), (1, atmosphere._mie_phase)):
            turned = met[kind == k]
            scattered[turned] = True
            going[turned] = turn(rng, going[turned], phase)
        alive = alive[(height[alive] < 60e3) & (weight[alive] > 1e-4 / count)]
    return direct, sky.sum(), sky.std() * math.sqrt(count)


def lambert(rng, count):
    u, phi = rng.random(count), 2.0 * math.pi * rng.random(count)
    flat = np.sqrt(u)
    return np.stack([flat * np.cos(phi), np.sqrt(1.0 - u), flat * np.sin(phi)], axis=1)


def turn(rng, going, phase):
    """Directions after a scatter: cosines drawn from a fine table of the phase function."""
    edges = np.linspace(-1.0, 1.0, 20_001)
    share = np.concatenate([[0.0], np.cumsum(phase(0.5 * (edges[1:] + edges[:-1])))])
    cosine = np.interp(rng.random(len(going)), share / share[-1], edges)
    phi = 2.0 * math.pi * rng.random(len(going))
    other = np.where(np.abs(going[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    a = np.cross(going, other)
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    b = np.cross(going, a)
    sine = np.sqrt(1.0 - cosine**2)
    return cosine[:, None] * going + (sine * np.cos(phi))[:, None] * a + (sine * np.sin(phi))[:, None] * b


@pytest.mark.parametrize("turbidity", [1.0, 3.0, 10.0])
@pytest.mark.parametrize("elevation", [2, 20, 90])
def test_no_more_light_comes_down_than_the_sun_sends(turbidity, elevation):
    sine = math.sin(elevation * DEGREE)
    sky = horizontal_irradiance(sky_radiance(elevation * DEGREE, 0.0, turbidity, 0.0, 64)) @ Y
    sun = sun_irradiance(elevation * DEGREE, turbidity) @ Y * sine
    assert 0.0 < sky + sun < atmosphere._SUNLIGHT.sum(axis=0) @ Y * sine


def test_haze_makes_the_sky_brighter_and_whiter_and_the_sun_redder():
    skies = [sky_radiance(0.7, 0.0, turbidity, 0.3, 64) for turbidity in (1.0, 2.0, 4.0, 8.0)]
    assert (np.diff([horizontal_irradiance(image) @ Y for image in skies]) > 0.0).all()
    assert (np.diff([whiteness(image[0].mean(axis=0)) for image in skies]) > 0.05).all()
    suns = [sun_irradiance(0.7, turbidity) for turbidity in (1.0, 2.0, 4.0, 8.0)]
    assert (np.diff([sun[2] / sun[0] for sun in suns]) < -0.05).all()


def test_the_zenith_is_blue_and_the_horizon_pale():
    image = sky_radiance(0.7, 0.0, 2.0, 0.3, 64)
    zenith, horizon = image[0].mean(axis=0), image[31, 0]
    assert zenith[2] > 1.5 * zenith[1] > 1.5 * zenith[0]
    assert whiteness(horizon) > 1.5 * whiteness(zenith) and horizon @ Y > 2.0 * zenith @ Y


def test_a_low_sun_is_red_and_so_is_the_sky_below_it():
    ratios = [(light := sun_irradiance(angle * DEGREE, 2.0))[0] / light[1] for angle in (60, 20, 8, 3)]
    assert (np.diff(ratios) > 0.05).all()
    image = sky_radiance(2 * DEGREE, 0.0, 2.0, 0.3, 64)
    below, zenith = image[31, 64], image[0].mean(axis=0)
    assert below[0] > 2.0 * below[2] and zenith[2] > zenith[0]


@pytest.mark.parametrize("elevation", [-4, 0, 10, 50, 90])
def test_the_sky_is_the_same_on_both_sides_of_the_sun(elevation):
    image = sky_radiance(elevation * DEGREE, 0.0, 3.0, 0.3, 64)
    assert image == pytest.approx(image[:, ::-1], rel=1e-4)
    turned = sky_radiance(elevation * DEGREE, 5 / 64 * math.pi, 3.0, 0.3, 64)
    assert turned == pytest.approx(np.roll(image, 5, axis=1), rel=1e-4)


@pytest.mark.parametrize("azimuth", [0.0, 0.5 * math.pi, -2.0])
def test_the_sky_is_brightest_at_the_sun(azimuth):
    image = sky_radiance(0.6, azimuth, 3.0, 0.3, 128)
    row, column = np.unravel_index((image @ Y).argmax(), image.shape[:2])
    theta, phi = math.pi * (row + 0.5) / 128, math.pi * ((column + 0.5) / 128 - 1.0)
    there = math.sin(theta) * math.sin(phi), math.cos(theta), -math.sin(theta) * math.cos(phi)
    assert np.dot(there, sun_direction(0.6, azimuth)) > math.cos(1.5 * math.pi / 128)  # pixels


def test_the_ground_sends_back_its_share_of_sun_and_sky():
    elevation, albedo = 0.5, 0.6
    image = sky_radiance(elevation, 1.0, 3.0, albedo, 64)
    down = horizontal_irradiance(image) + math.sin(elevation) * sun_irradiance(elevation, 3.0)
    assert image[32:] == pytest.approx(np.broadcast_to(albedo / math.pi * down, (32, 128, 3)), rel=1e-4)
    over_white, over_black = (horizontal_irradiance(sky_radiance(0.5, 0.0, 3.0, a, 64)) @ Y for a in (1, 0))
    assert over_white > 1.02 * over_black  # the sky gets some of it


def test_the_horizontal_irradiance_of_an_even_sky_is_pi():
    assert horizontal_irradiance(np.ones((6, 12, 3))) == pytest.approx(math.pi)


def test_the_sun_sets_gradually():
    lights = [sun_irradiance(angle, 1.0) @ Y for angle in np.linspace(0.02, -0.006, 40)]
    assert (np.diff(lights) <= 0.0).all() and lights[0] > 100.0 and lights[-1] == 0.0
    assert -np.diff(lights).min() < 0.15 * lights[0]
    assert (sun_irradiance(0.0, 1.0) @ Y) > 0.0  # half of it is up


@pytest.mark.parametrize("turbidity", [1.0, 4.0, 10.0])
@pytest.mark.parametrize("elevation", [-6, -1, 0, 0.1, 45, 90])
@pytest.mark.parametrize("albedo", [0.0, 1.0])
def test_all_skies_are_finite_and_positive(turbidity, elevation, albedo):
    image = sky_radiance(elevation * DEGREE, 0.3, turbidity, albedo, 16)
    assert np.isfinite(image).all() and (image >= 0.0).all() and (image[:8] @ Y > 0.0).all()
    assert not image.flags.writeable
