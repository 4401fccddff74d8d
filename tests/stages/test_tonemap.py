"""The tone map against the published curve, and the exposure it is given."""

import numpy as np
import pytest

from ispm.settings import Settings, knob_of
from ispm.stages.tonemap import MIDDLE_GREY, agx, auto_exposure, neutral, tonemap

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


def test_auto_exposure_shows_a_room_whose_lamps_fill_a_fifth_of_the_picture():
    """Half of them are within the eight tenths whose mean the middle is: an eighth of log2(1000), some
    1.25 stops. With all of them below white it was 10 stops darker."""
    picture = np.random.default_rng(3).random((100, 100, 3), np.float32) + 0.5
    expected = auto_exposure(picture)
    picture[:20], emission = 1e3, np.zeros_like(picture)
    emission[:20] = 1e3
    assert expected - 1.5 < auto_exposure(picture, emission) <= expected


def test_auto_exposure_keeps_a_bright_thing_below_white_that_does_not_glow():
    """As snow or a lit table before a dark room, whatever they fill of the picture from a tenth on."""
    picture = np.full((100, 100, 3), 0.002, np.float32)
    picture[:40] = 1.0
    assert auto_exposure(picture, np.zeros_like(picture)) == pytest.approx(0.0, abs=1e-6)


def test_auto_exposure_of_black_is_zero():
    assert auto_exposure(np.zeros((4, 4, 3), np.float32)) == 0.0


def agx_curve(*color):
    return np.array(agx(*(f32(c) for c in color)), np.float64)


def agx_exact(color):
    """AgX in float64, by the equations of Sobotka's AgX-S2O3 and the matrices of AgX_LUT_Gen."""
    to_2020 = [[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]]
    inset = [
        [0.856627153315983, 0.0951212405381588, 0.0482516061458583],
        [0.137318972929847, 0.761241990602591, 0.101439036467562],
        [0.11189821299995, 0.0767994186031903, 0.811302368396859],
    ]
    outset = [  # published inverted, by columns
        [1.1271005818144368, -0.11060664309660323, -0.016493938717834573],
        [-0.1413297634984383, 1.157823702216272, -0.016493938717834257],
        [-0.14132976349843826, -0.11060664309660294, 1.2519364065950405],
    ]
    from_2020 = [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]]
    x = np.asarray(inset) @ to_2020 @ np.asarray(color, float)
    x = (np.clip(np.log2(np.maximum(x, 1e-10) / 0.18), -10.0, 6.5) + 10.0) / 16.5
    pivot, middle, slope = 10.0 / 16.5, 0.5, 2.0
    side = np.where(x >= pivot, 1.0 - pivot, pivot)
    power = np.where(x >= pivot, 3.25, 3.0)
    scale = ((slope * side) ** -power * ((slope * side / middle) ** power - 1.0)) ** (-1.0 / power)
    scale = np.where(x >= pivot, scale, -scale)
    term = slope * (x - pivot) / scale
    y = scale * term / (1.0 + term**power) ** (1.0 / power) + middle
    return np.maximum(np.asarray(from_2020) @ np.maximum(np.asarray(outset) @ y, 0.0) ** 2.2, 0.0)


def test_agx_follows_its_equations():
    # Published matrices are rounded to 4 digits where the code has 6, hence the tolerance.
    random = np.random.default_rng(8)
    for color in 2.0 ** random.uniform(-12.0, 7.0, (300, 3)):
        np.testing.assert_allclose(agx_curve(*color), agx_exact(color), atol=1e-3)


def test_agx_rises_with_the_light_from_black_to_white():
    greys = np.array([agx_curve(x, x, x) for x in np.geomspace(1e-5, 1e4, 600)])
    assert (np.diff(greys, axis=0) >= -1e-6).all()
    assert greys[0].max() == 0.0 and greys[-1] == pytest.approx(1.0, abs=1e-4)
    assert np.ptp(greys, axis=1).max() < 1e-3  # grey stays grey
    assert agx_curve(0.0, 0.0, 0.0).max() == 0.0
    assert agx_curve(0.18, 0.18, 0.18) == pytest.approx(0.5**2.2, abs=1e-3)  # the middle of its range


@pytest.mark.parametrize("color", [(1.0, 0.1, 0.05), (0.1, 1.0, 0.1), (0.1, 0.2, 1.0)])
def test_agx_keeps_the_order_of_channels_and_fades_to_white(color):
    shown = np.array([agx_curve(*(np.array(color) * 2.0**stop)) for stop in range(-4, 14)])
    order = np.argsort(color, kind="stable")
    shown = np.minimum(shown, 1.0)
    for row in shown:
        assert row[order[2]] >= row.max() - 1e-5
    spread = np.ptp(shown, axis=1) / np.maximum(shown.max(axis=1), 1e-6)
    assert (np.diff(spread[4:]) <= 1e-6).all()  # less and less saturated from 0 stops on
    assert shown[-1] == pytest.approx(1.0, abs=0.02)


def test_tonemap_has_every_mode_of_the_settings():
    picture = np.full((1, 1, 3), 0.5, np.float32)
    for mode in knob_of(Settings, "tonemap").metadata["choices"]:
        assert 0 < tonemap(picture, 0.0, mode)[0, 0, 0] < 255


@pytest.mark.parametrize("mode", ["none", "neutral", "agx"])
def test_16_bits_say_the_same_as_8_and_more(mode):
    picture = np.random.default_rng(5).random((40, 50, 3), np.float32) ** 3
    fine, coarse = tonemap(picture, 0.0, mode, bits=16), tonemap(picture, 0.0, mode)
    assert fine.dtype == np.uint16
    assert np.abs(fine / 257.0 - coarse).max() <= 0.61  # a rounding, and the table's 0.1
    assert len(np.unique(fine)) > 10 * len(np.unique(coarse))


def test_16_bits_encode_srgb_to_within_a_rounding():
    values = (np.geomspace(1e-5, 1.0, 3 * 4096, dtype=np.float32)).reshape(64, 64, 3)
    codes = tonemap(values, 0.0, "none", bits=16).astype(np.float64)
    assert np.abs(codes - 257.0 * encode(values.astype(np.float64))).max() <= 0.61
