"""Environments: what is seen along a direction, and directions drawn in proportion to it."""

import math

import numpy as np
import pytest
from exact_light import sky_irradiance
from rgbe import direction_of, seen_along
from scipy import stats

from ispm.optics import rng
from ispm.optics.environment import (
    NO_ENVIRONMENT,
    environment_irradiance,
    environment_pdf,
    environment_radiance,
    has_environment,
    image_place,
    sample_environment,
    sample_suns,
    world_direction,
)
from ispm.optics.environment_table import (
    environment_power,
    environment_table,
    is_one_sun,
    placed_environment,
    row_weights,
)
from ispm.optics.jit import jit
from ispm.optics.vector import LUMINANCE, luminance

f32 = np.float32
DRAWN = 200_000


def noise(height, width, seed=1):
    return np.random.default_rng(seed).random((height, width, 3)) ** 4


def spot(height, width, row, column, value=5.0, others=0.0):
    image = np.full((height, width, 3), others)
    image[row, column] = value, 0.5 * value, 0.25 * value
    return image


CASES = {
    "noise": (noise(8, 16), 0.0),
    "turned": (noise(8, 16, 2), 2.1),
    "one pixel": (spot(8, 16, 3, 0), -0.4),
    "at a pole": (spot(8, 16, 7, 5), 0.0),
    "sun": (spot(32, 64, 9, 20, 1e6, 0.5), 0.3),
    "one color": (np.full((1, 1, 3), 0.25), 0.0),
    "odd": (noise(5, 3), 0.0),
    "dark": (np.zeros((4, 8, 3)), 0.0),
}


def table_of(name):
    image, rotation = CASES[name]
    return placed_environment(environment_table(image), rotation, 1.0)


@jit
def draw(table, seed, wi, light, pdf, again, seen):
    """Draw len(pdf) directions; `again` and `seen`: their densities and radiance as asked for afterwards."""
    for i in range(len(pdf)):
        u1, u2, _, _ = rng.random4(np.uint32(i), np.uint32(0), np.uint32(0), seed)
        d, radiance, density = sample_environment(table, u1, u2)
        shown = environment_radiance(table, d)
        pdf[i], again[i] = density, environment_pdf(table, d)
        for c in range(3):
            wi[i, c], light[i, c], seen[i, c] = d[c], radiance[c], shown[c]


@jit
def look(table, directions, light, pdf, back):
    """Radiance and density along directions, and these again by way of the image."""
    for i in range(len(directions)):
        d = (directions[i, 0], directions[i, 1], directions[i, 2])
        radiance, place = environment_radiance(table, d), image_place(table, d)
        there = world_direction(table, place[0], place[1])
        pdf[i] = environment_pdf(table, d)
        for c in range(3):
            light[i, c], back[i, c] = radiance[c], there[c]


def samples(table, seed=5, count=DRAWN):
    wi, light, seen = np.zeros((3, count, 3), f32)
    pdf, again = np.zeros((2, count), f32)
    draw(table, np.uint32(seed), wi, light, pdf, again, seen)
    return wi, light, pdf, again, seen


def looked(table, directions):
    light, back = np.zeros((2, len(directions), 3), f32)
    pdf = np.zeros(len(directions), f32)
    look(table, np.ascontiguousarray(directions, f32), light, pdf, back)
    return light, pdf, back


def turned(directions, angle):
    """Turned about +Y, counterclockwise seen from above."""
    x, y, z = directions.T
    c, s = math.cos(angle), math.sin(angle)
    return np.stack([c * x + s * z, y, c * z - s * x], axis=1)


def sphere(count, seed=3):
    d = np.random.default_rng(seed).normal(size=(count, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def grid(size, rotation, fine):
    """Directions at the middles of fine x fine equal solid angles of each pixel, and a pixel's in sr."""
    width, height = size
    x = (np.arange(width * fine) + 0.5) / fine
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    within = (np.arange(fine) + 0.5) / fine
    y = np.arccos(edges[:-1, None] + np.diff(edges)[:, None] * within).ravel() * height / np.pi
    shape = (height * fine, width * fine)
    d = direction_of(np.broadcast_to(x, shape), np.broadcast_to(y[:, None], shape), size)
    angles = -np.diff(edges) * 2.0 * np.pi / width
    return turned(d.reshape(-1, 3), rotation), angles


def test_the_center_lies_along_minus_z_right_of_it_plus_x_and_the_top_above():
    """By hand: of 9 x 3 pixels, column 4 has longitude 0, column 6 has 80 degrees; row 1 the horizon."""
    for column, row, d in (
        (4, 1, (0.0, 0.0, -1.0)),
        (6, 1, (math.sin(math.radians(80)), 0.0, -math.cos(math.radians(80)))),
        (4, 0, (0.0, math.cos(math.pi / 6), -0.5)),
        (8, 1, (math.sin(math.radians(160)), 0.0, -math.cos(math.radians(160)))),
    ):
        table = environment_table(spot(3, 9, row, column, 8.0))
        direction = tuple(map(f32, d))
        np.testing.assert_allclose(environment_radiance(table, direction), (8, 4, 2), rtol=1e-5)
        opposite = tuple(-c for c in direction)
        np.testing.assert_allclose(environment_radiance(table, opposite), 0, atol=1e-5)


def test_a_turned_environment_has_its_center_on_the_left():
    """A quarter counterclockwise, seen from above, brings -Z to -X."""
    table = placed_environment(environment_table(spot(3, 9, 1, 4, 8.0)), math.pi / 2, 0.5)
    np.testing.assert_allclose(environment_radiance(table, (f32(-1), f32(0), f32(0))), (4, 2, 1), rtol=1e-5)
    assert environment_radiance(table, (f32(0), f32(0), f32(-1))) == (0, 0, 0)


@pytest.mark.parametrize("name", CASES)
def test_radiance_is_bilinear_between_pixel_centers(name):
    image, rotation = CASES[name]
    poles = np.array([(0, 1, 0), (0, -1, 0), (0, 0, 1), (1e-4, 0, 1), (-1e-4, 0, 1)], float)
    directions = np.concatenate([sphere(5000), poles])
    light, _, back = looked(table_of(name), directions)
    # places in float32 are off by 64 * 2^-23 pixels, and pole by pole by some; slopes are at most the peak
    np.testing.assert_allclose(
        light, seen_along(image, directions, rotation), atol=3e-5 * max(image.max(), 1e-30)
    )
    np.testing.assert_allclose(back, directions, atol=1e-5)


@pytest.mark.parametrize("name", CASES)
def test_directions_come_as_often_as_their_density_says(name):
    """Chi-square, N = 200,000, seed 5, alpha = 0.01 over all cases (Sidak). Bins are the pixels: expected is
    what `environment_pdf` integrates to in each, found by midpoints."""
    image, rotation = CASES[name]
    table, (height, width) = table_of(name), image.shape[:2]
    wi, *_ = samples(table)
    np.testing.assert_allclose(np.linalg.norm(wi, axis=1), 1.0, atol=1e-6)
    own = turned(wi.astype(float), -rotation)
    column = np.floor((np.arctan2(own[:, 0], -own[:, 2]) / (2 * np.pi) + 0.5) * width).astype(int) % width
    row = np.floor(np.arctan2(np.hypot(own[:, 0], own[:, 2]), own[:, 1]) / np.pi * height).astype(int)
    observed = np.bincount(np.minimum(row, height - 1) * width + column, minlength=width * height)
    directions, angles = grid((width, height), rotation, 2)
    _, pdf, _ = looked(table, directions)
    mean = pdf.reshape(height, 2, width, 2).mean(axis=(1, 3), dtype=float)
    expected = DRAWN * (mean * angles[:, None]).ravel()
    assert observed[expected == 0.0].sum() <= 2  # on an edge
    few = expected < 5.0
    observed = np.append(observed[~few], observed[few].sum())
    expected = np.append(expected[~few], expected[few].sum())
    observed, expected = observed[expected > 0.0], expected[expected > 0.0]
    assert expected.sum() == pytest.approx(DRAWN, rel=1e-5)
    if len(expected) > 1:
        _, p = stats.chisquare(observed, expected * observed.sum() / expected.sum())
        assert p > 1 - 0.99 ** (1 / len(CASES))


@pytest.mark.parametrize("name", CASES)
def test_the_density_integrates_to_one(name):
    image, rotation = CASES[name]
    directions, angles = grid(image.shape[1::-1], rotation, 3)
    _, pdf, _ = looked(table_of(name), directions)
    mean = pdf.reshape(len(angles), 3, image.shape[1], 3).mean(axis=(1, 3), dtype=float)
    assert (mean * angles[:, None]).sum() == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("name", CASES)
def test_a_sample_says_what_is_found_along_it(name):
    """But where rounding takes it over the edge of a pixel: 64 * 2^-23 of the samples, and some."""
    wi, light, pdf, again, seen = samples(table_of(name))
    assert (np.abs(again / pdf - 1.0) > 1e-4).mean() < 1e-4
    np.testing.assert_allclose(light, seen, atol=3e-5 * max(CASES[name][0].max(), 1e-30))
    assert (pdf > 0.0).all() and np.isfinite(wi).all()


@pytest.mark.parametrize("name", CASES)
def test_samples_have_the_power_of_the_whole(name):
    """Mean of luminance over density, N = 200,000, seed 7: within 3.5 standard errors, once in 2000 runs; and
    of each channel likewise, by quadrature."""
    image, _ = CASES[name]
    table, weights = table_of(name), row_weights(len(image))
    _, light, pdf, *_ = samples(table, 7)
    found = light.astype(float) / pdf[:, None]
    exact = (image.mean(axis=1) * weights[:, None]).sum(axis=0)
    error = found.std(axis=0) / math.sqrt(DRAWN)
    assert (np.abs(found.mean(axis=0) - exact) <= 3.5 * error + 1e-5 * exact).all()
    assert environment_power(table) == pytest.approx(float(exact @ LUMINANCE), rel=1e-6)


NORMALS = np.random.default_rng(4).normal(size=(20, 3))
NORMALS /= np.linalg.norm(NORMALS, axis=1, keepdims=True)


def irradiance_of(table, n):
    """(2, 3) lx of a normal: by sunlight, and by the rest."""
    return np.array(environment_irradiance(table, tuple(f32(x) for x in n)), float)


@pytest.mark.parametrize("name", CASES)
def test_irradiance_is_the_integral_of_what_is_seen(name):
    """By 512 x 1,024 places. Between normals it is interpolated over 3 degrees, in which a sun's cosine bends
    at the horizon: by .05^2 / 8 of what it is at most, .03 %, and there by .05 / 4."""
    image, rotation = CASES[name]
    found = np.array([irradiance_of(table_of(name), n).sum(axis=0) for n in NORMALS])
    exact = np.array([sky_irradiance(image, rotation, n) for n in NORMALS])
    np.testing.assert_allclose(found, exact, rtol=5e-3, atol=0.0125 * exact.max())


@jit
def draw_suns(table, normals, light):
    """Irradiance of normals by directions brighter than the rest, (n, m, 3) lx: n draws of m normals."""
    for i in range(len(light)):
        u1, u2, _, _ = rng.random4(np.uint32(i), np.uint32(0), np.uint32(0), np.uint32(9))
        d, radiance, density = sample_suns(table, u1, u2)
        if luminance(radiance) <= table.brightest:
            continue
        for k in range(len(normals)):
            n = normals[k]
            cosine = max(n[0] * d[0] + n[1] * d[1] + n[2] * d[2], f32(0))
            for c in range(3):
                light[i, k, c] = cosine * radiance[c] * table.sun_share / density


@pytest.mark.parametrize("name", ["sun", "one pixel", "at a pole"])
def test_draws_from_suns_bring_the_sunlight(name):
    """N = 40,000: within four standard errors, once in 16,000, and the table's .5 % of 1.25 % of the most."""
    table, light = table_of(name), np.zeros((40_000, len(NORMALS), 3), f32)
    draw_suns(table, NORMALS.astype(f32), light)
    found, error = light.mean(axis=0, dtype=float), light.std(axis=0, dtype=float) / math.sqrt(len(light))
    known = np.array([irradiance_of(table, n)[0] for n in NORMALS])
    assert (np.abs(found - known) <= 4.0 * error + 5e-3 * known + 0.0125 * known.max()).all()
    assert known.max() > 0.3 * irradiance_of(table, NORMALS[known.max(axis=1).argmax()]).sum()


@pytest.mark.parametrize("name", ["noise", "one color", "dark"])
def test_where_no_direction_is_much_brighter_there_is_no_sunlight(name):
    table = table_of(name)
    assert not len(table.sunlight) and table.sun_share == 0.0
    dark = placed_environment(table_of("sun"), 0.0, 0.0)
    assert not len(dark.sunlight) and dark.brightest == np.inf


def suns(*places):
    """A gray image of 128 rows with bright pixels, (row, column)."""
    image = np.full((128, 256, 3), 0.5)
    for row, column in places:
        image[row, column] = 1e6
    return environment_table(image)


@pytest.mark.parametrize(
    "places", [[(40, 70)], [(40, 70), (40, 71), (41, 70)], [(40, 0), (40, 255)], [(0, 9)]]
)
def test_neighboring_pixels_are_one_sun(places):
    assert is_one_sun(suns(*places))


@pytest.mark.parametrize("places", [[(40, 70), (40, 90)], [(40, 70), (60, 70)], [(40, 70), (43, 74)], []])
def test_pixels_apart_are_several_suns(places):
    assert not is_one_sun(suns(*places))


def test_a_bright_window_is_no_sun():
    assert not is_one_sun(suns(*np.ndindex(20, 10)))
    assert not is_one_sun(NO_ENVIRONMENT)


def test_power_is_the_integral_of_what_is_seen():
    """Against midpoints, 64 x 64 to a pixel: within h^2 / 24 of the slopes, below 1e-4."""
    image = noise(4, 8)
    directions, angles = grid((8, 4), 0.0, 64)
    mean = seen_along(image, directions).reshape(4, 64, 8, 64, 3).mean(axis=(1, 3))
    exact = (mean * angles[:, None, None]).sum(axis=(0, 1)) @ LUMINANCE
    assert environment_power(environment_table(image)) == pytest.approx(exact, rel=1e-4)
    assert environment_power(NO_ENVIRONMENT) == 0.0
    assert row_weights(7).sum() == pytest.approx(4 * math.pi)


@pytest.mark.parametrize("size", [(64, 32), (4096, 2048)])
def test_what_is_dim_beside_a_sun_can_still_be_drawn(size):
    """1e9 beside 1e-3: each pixel that has light, or lies beside one that has, has a probability."""
    width, height = size
    image = np.zeros((height, width, 3), f32)
    image[: height // 2] = 1e-3
    image[height // 4, width // 3] = 1e9
    table = environment_table(image)
    last = height // 2 + 1  # the row below is seen beside the last one that has light
    assert (np.diff(table.rows)[:last] > 0.0).all() and (np.diff(table.rows)[last:] == 0.0).all()
    assert (np.diff(table.columns, axis=1)[:last] > 0.0).all()
    assert table.rows[0] == 0.0 and table.rows[-1] == 1.0 and (table.columns[:, -1] == 1.0).all()


@pytest.mark.parametrize("name", CASES)
def test_the_ends_of_the_unit_interval_are_drawn_like_others(name):
    table, last = table_of(name), f32(1 - 2.0**-24)
    for u1 in (f32(0), last):
        for u2 in (f32(0), last):
            wi, light, pdf = sample_environment(table, u1, u2)
            assert np.isfinite([*wi, *light]).all() and 0.0 < pdf < np.inf
            assert np.linalg.norm(wi) == pytest.approx(1.0, abs=1e-6)


def test_a_scene_without_one_has_none():
    assert not has_environment(NO_ENVIRONMENT)
    assert has_environment(table_of("dark"))
