"""The errors that `compare` reports, against numbers worked out by hand."""

import numpy as np
import pytest

from ispm.bench.metrics import compare, difference_picture
from ispm.errors import OutputError


def flat(value, shape=(4, 6)):
    return np.full((*shape, 3), value, np.float32)


def test_a_picture_against_itself_has_no_error():
    picture = np.random.default_rng(1).random((5, 7, 3))
    result = compare(picture, picture)
    assert (result.bias, result.relmse, result.mean_relative_error, result.pixels) == (0.0, 0.0, 0.0, 35)


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
    assert masked == cut
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
