"""The tone map against the published curve, and the exposure it is given."""

import numpy as np
import pytest

from ispm.stages.tonemap import MIDDLE_GREY, auto_exposure, neutral, tonemap

f32 = np.float32


def curve(*color):
    return np.array(neutral(*(f32(c) for c in color)), np.float64)


def encode(linear):
    """sRGB codes by the formula of IEC 61966-2-1, in float64."""
    linear = np.clip(linear, 0.0, 1.0)
    return 255.0 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def test_neutral_takes_off_the_offset_and_nothing_else_below_the_shoulder():
    # Specification: colors whose smallest channel is over 0.08 and largest under 0.8 lose 0.04, no more.
    for color in ((0.1, 0.1, 0.1), (0.08, 0.3, 0.79), (0.5, 0.6, 0.7)):
        np.testing.assert_allclose(curve(*color), np.array(color) - 0.04, atol=1e-7)


def test_neutral_offset_is_a_parabola_near_black():
    # x - 6.25 x^2 with x the smallest channel, so a color with a black channel is left as it is.
    np.testing.assert_allclose(curve(0.0, 0.3, 0.7), (0.0, 0.3, 0.7), atol=1e-7)
    np.testing.assert_allclose(curve(0.04, 0.04, 0.04), np.full(3, 6.25 * 0.04**2), atol=1e-7)


def test_neutral_compresses_the_peak_as_published():
    # A grey of 2: 1.96 after the offset, 1 - 0.24^2 / (1.96 + 0.24 - 0.76) = 0.96; grey stays grey.
    np.testing.assert_allclose(curve(2.0, 2.0, 2.0), np.full(3, 0.96), atol=1e-6)
    # Pure red of 1.76: peak' = 1 - 0.0576 / 1.24; white share g = 1 - 1 / (0.15 (1.76 - peak') + 1).
    peak = 1.0 - 0.0576 / 1.24
    white = 1.0 - 1.0 / (0.15 * (1.76 - peak) + 1.0)
    np.testing.assert_allclose(curve(1.76, 0.0, 0.0), (peak, peak * white, peak * white), atol=1e-6)


def test_neutral_rises_with_the_light_and_stays_below_one():
    greys = np.array([curve(x, x, x)[0] for x in np.geomspace(1e-4, 1e6, 400)])
    assert (np.diff(greys) >= 0.0).all()
    assert greys[-1] <= 1.0


def test_neutral_keeps_the_hue():
    # Hue: where the middle channel lies between the least and the greatest.
    for scale in (0.5, 1.0, 3.0, 30.0):
        low, middle, high = curve(0.2 * scale, 0.5 * scale, 1.0 * scale)
        assert (middle - low) / (high - low) == pytest.approx(0.3 / 0.8, abs=1e-5)


def test_tonemap_encodes_srgb_to_within_a_rounding():
    # A table of 2^14 steps: 0.1 of a code beside the 0.5 of rounding.
    values = np.linspace(0.0, 1.0, 3 * 4096, dtype=np.float32).reshape(64, 64, 3)
    codes = tonemap(values, 0.0, "none").astype(np.float64)
    assert np.abs(codes - encode(values.astype(np.float64))).max() <= 0.61


def test_tonemap_exposure_counts_stops():
    picture = np.full((2, 3, 3), 0.05, np.float32)
    np.testing.assert_array_equal(tonemap(picture, 2.0), tonemap(picture * 4.0, 0.0))


def test_tonemap_shows_nan_and_negative_as_black_and_infinite_as_white():
    picture = np.array([[[np.nan] * 3, [-1.0] * 3, [np.inf] * 3, [1e30] * 3]], np.float32)
    np.testing.assert_array_equal(tonemap(picture, 0.0)[0], [[0] * 3, [0] * 3, [255] * 3, [255] * 3])


@pytest.mark.parametrize("shape", [(1, 1, 3), (1, 5, 3), (7, 3, 3)])
def test_tonemap_is_the_same_for_any_number_of_threads(shape):
    picture = np.random.default_rng(1).random(shape, np.float32) * 2
    for threads in (1, 2, 5):
        np.testing.assert_array_equal(
            tonemap(picture, 0.3, threads=threads), tonemap(picture, 0.3, threads=1)
        )


def test_auto_exposure_shows_an_even_picture_as_middle_grey():
    for level in (1e-3, 0.18, 5e4):
        ev = auto_exposure(np.full((20, 30, 3), level, np.float32))
        assert level * 2.0**ev == pytest.approx(MIDDLE_GREY, rel=1e-5)


def test_auto_exposure_follows_the_light_stop_by_stop():
    picture = np.random.default_rng(2).random((40, 50, 3), np.float32)
    assert auto_exposure(picture * 8) == pytest.approx(auto_exposure(picture) - 3.0, abs=1e-5)


def test_auto_exposure_ignores_background_lamps_and_broken_pixels():
    picture = np.random.default_rng(3).random((100, 100, 3), np.float32) + 0.5
    expected = auto_exposure(picture)
    disturbed = picture.copy()
    disturbed[:3, :50] = 1e6  # 1.5 % of the pixels: a lamp
    disturbed[3, :50] = np.nan
    framed = np.zeros((200, 200, 3), np.float32)
    framed[50:150, 50:150] = disturbed
    assert auto_exposure(framed) == pytest.approx(expected, abs=0.05)


def test_auto_exposure_of_black_is_zero():
    assert auto_exposure(np.zeros((4, 4, 3), np.float32)) == 0.0
