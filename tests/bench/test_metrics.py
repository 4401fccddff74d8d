"""The errors that `compare` reports, against numbers worked out by hand."""

import numpy as np
import pytest

from ispm.bench.flip import flip
from ispm.bench.metrics import compare, difference_picture
from ispm.errors import OutputError


def flat(value, shape=(4, 6)):
    return np.full((*shape, 3), value, np.float32)


def test_a_picture_against_itself_has_no_error():
    picture = np.random.default_rng(1).random((5, 7, 3))
    result = compare(picture, picture)
    assert (result.bias, result.relmse, result.mean_relative_error) == (0.0, 0.0, 0.0)
    assert (result.flip, result.pixels) == (0.0, 35)


def test_errors_of_an_even_offset_are_those_of_the_formula():
    # A = 1.1 B, B = 2: (0.2)^2 / (4 + 1e-3 * 4) and its root.
    result = compare(flat(2.2).astype(np.float64), flat(2.0).astype(np.float64))
    assert result.bias == pytest.approx(0.1, rel=1e-6)
    assert result.relmse == pytest.approx(0.01 / 1.001, rel=1e-5)
    assert result.mean_relative_error == pytest.approx(0.1 / 1.001**0.5, rel=1e-5)


def test_noise_without_bias_has_error_but_no_bias():
    # N = 120 000 values of sd 0.3 about 1, seed 4: the mean is within 4 sd / sqrt(N) = 0.0035.
    noise = 1.0 + 0.3 * np.random.default_rng(4).standard_normal((200, 200, 3))
    result = compare(noise, np.ones((200, 200, 3)))
    assert abs(result.bias) < 0.0035
    assert result.relmse == pytest.approx(0.09 / 1.001, rel=0.03)


def test_regulariser_is_the_mean_over_the_mask():
    # Outside the mask the reference is very bright; eps must not know of it.
    reference, picture = flat(1.0), flat(1.5)
    reference[0], picture[0] = 1e4, 0.0
    mask = np.ones((4, 6))
    mask[0] = 0
    masked, cut = compare(picture, reference, mask), compare(picture[1:], reference[1:])
    assert masked.bias == cut.bias
    assert masked.mean_relative_error == cut.mean_relative_error
    assert masked.relmse == pytest.approx(0.25 / 1.001, rel=1e-5)


def test_reference_error_is_taken_off():
    assert compare(flat(1.1), flat(1.0), reference_error=0.004).relmse == pytest.approx(
        compare(flat(1.1), flat(1.0)).relmse - 0.004
    )


@pytest.mark.parametrize(
    ("a", "b", "mask", "says"),
    [
        (flat(1.0), flat(1.0, (5, 6)), None, "6 x 4 and 6 x 5"),
        (flat(1.0), flat(1.0), np.ones((2, 2)), "the mask is 2 x 2"),
        (flat(1.0), flat(1.0), np.zeros((4, 6)), "picks no pixel"),
        (flat(np.nan), flat(1.0), None, "picture has 24 pixels that are not finite"),
        (flat(1.0), flat(0.0), None, "reference is black"),
    ],
)
def test_pictures_that_cannot_be_compared_are_refused(a, b, mask, says):
    with pytest.raises(OutputError, match=says):
        compare(a, b, mask)


def test_difference_picture_is_red_where_brighter_and_blue_where_darker():
    a, b = flat(1.0), flat(1.0)
    a[0, 0], a[1, 1] = 3.0, 0.2
    picture = difference_picture(a, b)
    assert picture[0, 0].tolist() == [255, 0, 0]
    assert picture[1, 1, 2] > 200
    assert picture[1, 1, 0] == 0
    assert not picture[2:].any()


def linear(srgb):
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def test_flip_gives_the_numbers_of_its_authors_program():
    # Computed with the authors' flip-evaluator 1.7, LDR, at its default of 67.02 pixels per degree.
    spot, grey = np.zeros((5, 7, 3)), np.full((5, 7, 3), 0.25)
    spot[2, 3] = 1.0
    assert flip(linear(spot), linear(grey)).mean() == pytest.approx(0.45463473, abs=1e-6)
    noise = np.random.default_rng(7).integers(0, 256, (24, 32, 3)) / 255
    wave = np.clip(noise + 0.2 * np.sin(np.arange(32) / 3)[None, :, None], 0.0, 1.0)
    result = flip(linear(noise), linear(wave))
    assert result.mean() == pytest.approx(0.42796972, abs=1e-5)
    assert result[5, 9] == pytest.approx(0.31834492, abs=1e-5)
    assert result[20, 30] == pytest.approx(0.44488662, abs=1e-5)


def test_flip_is_one_between_the_colors_that_differ_most():
    # Pure green and blue, even pictures: no features, and the largest color difference there is.
    green, blue = np.zeros((30, 30, 3)), np.zeros((30, 30, 3))
    green[..., 1] = blue[..., 2] = 1.0
    np.testing.assert_allclose(flip(green, blue), 1.0, atol=1e-9)


def test_flip_of_linear_pictures_does_not_depend_on_their_scale():
    picture = np.random.default_rng(5).random((20, 20, 3), np.float32)
    dimmer = picture * np.float32(0.7)
    assert compare(dimmer * 64, picture * 64).flip == compare(dimmer, picture).flip > 0.01


def test_flip_of_displayed_pictures_takes_them_as_they_are():
    picture = np.random.default_rng(6).random((20, 20, 3), np.float32)
    result = compare(picture * 0.7, picture, displayed=True)
    assert result.flip == pytest.approx(flip(picture * 0.7, picture).mean())
