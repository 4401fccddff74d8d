"""The settings of one pass of several."""

import pytest

from ispm import Settings
from ispm.renderer.converge import of_pass, shrunk


@pytest.mark.parametrize("smoothing", [0.01, 0.02, 1.0, 100.0])
def test_kernels_of_later_passes_shrink_within_what_settings_take(smoothing):
    """By the product of roots of (k + 2/3) / (k + 1); the least that users may give is not an error later."""
    given = Settings(smoothing=smoothing)
    assert of_pass(given, 0) is given
    for index in (1, 5, 10_000):
        found = of_pass(given, index).smoothing
        assert found == pytest.approx(max(smoothing * shrunk(index), 0.01))
