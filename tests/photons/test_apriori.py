"""The talk's radius from a photon's path."""

import numpy as np
import pytest
from transport import render

from ispm.library.builtin import builtin
from ispm.optics.records import PHOTON
from ispm.photons.apriori import class_radii, hint_radii


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


def test_class_radii_hold_a_hundred_photons_that_lie_evenly():
    photons = np.zeros(1500, PHOTON)
    photons["bounce"][:1000] = 1
    photons["bounce"][1000:1400] = 2
    beams = np.zeros((100, 9), np.float32)
    beams[:, 0], beams[:, 4] = 0.02, 0.03
    class_radii(photons, beams, area=12.0, diagonal=40.0)
    n, r = np.array([1000, 400]), photons["radius"][[0, 1000]].astype(float)
    assert n / 12.0 * np.pi * r**2 == pytest.approx(100.0)
    assert np.pi * photons["radius"][-1].astype(float) ** 2 == pytest.approx(20 * 0.02 * 0.03)
    class_radii(photons, beams, area=12.0, diagonal=2.0, smoothing=0.5)
    assert photons["radius"].max() == pytest.approx(0.1)  # a tenth of the diagonal, halved


def test_class_kernels_light_a_room_and_lose_some_light_at_edges(gpu):
    """Density estimation with so wide kernels is 7 % dark in a Cornell box; noise of the mean 1 %."""
    plain, default = (render(gpu, builtin("cornell-box"), kernel=kernel)[0] for kernel in ("class", "auto"))
    assert plain.stats.kernel == "class" and default.stats.kernel == "footprint"
    assert 0.85 < plain["indirect"].mean() / default["indirect"].mean() < 1.0
