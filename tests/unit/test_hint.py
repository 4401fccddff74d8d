"""The talk's radius from a photon's path."""

import numpy as np
import pytest

from ispm.optics.records import PHOTON
from ispm.tracer.hint import hint_radii


def radii(bounces, **changes):
    photons = np.zeros(len(bounces), PHOTON)
    photons["bounce"] = bounces
    hint_radii(photons, **{"diagonal": 10.0, "photon_count": 20_356, **changes})
    assert np.allclose(photons["height"], 0.25 * photons["radius"])
    return photons["radius"]


def test_radii_are_those_of_the_authors_code_in_a_scene_of_ten_metres():
    # mirrors alone 2.6 cm, one diffuse scatter 38.8 cm, more of them towards 40 cm
    assert radii([0, 1, 2, 8]) == pytest.approx([0.0261, 0.3882, 0.3996, 0.4], abs=1e-4)


def test_radii_follow_the_scene_the_smoothing_and_the_sixth_root_of_the_photons():
    plain = radii([0, 1, 3])
    assert radii([0, 1, 3], diagonal=2.5) == pytest.approx(0.25 * plain)
    assert radii([0, 1, 3], smoothing=3.0) == pytest.approx(3.0 * plain)
    assert radii([0, 1, 3], photon_count=64 * 20_356) == pytest.approx(0.5 * plain)
