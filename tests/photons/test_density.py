"""Kernel radii follow the density of the photons."""

import math

import numpy as np
import pytest

from ispm.optics.records import PHOTON
from ispm.photons.density import NEIGHBORS, Pixels, is_crowded, measure_radii


def photons_on_plane(count, size=1.0, normal=(0.0, 1.0, 0.0), seed=0):
    """Photons spread evenly over a square through the origin, across `normal`."""
    n = np.asarray(normal, float) / np.linalg.norm(normal)
    t = np.cross(n, (0.3, 0.5, 0.8))
    t /= np.linalg.norm(t)
    u, v = np.random.default_rng(seed).random((2, count, 1)) - 0.5
    photons = np.zeros(count, PHOTON)
    photons["position"] = size * (u * t + v * np.cross(n, t))
    photons["normal"] = n
    return photons


@pytest.mark.parametrize(("normal", "least"), [((0, 1, 0), 0.9), ((1, 1, 0), 0.65), ((1, -2, 3), 0.65)])
@pytest.mark.parametrize("count", [5000, 50_000])
def test_kernels_hold_the_wanted_number_of_photons(normal, least, count):
    """Median of N pi r^2 / A.

    Of an oblique plane most photons lie in the cells that it cuts through the middle: they look denser,
    by 3/2 where the cut's area is spread evenly from nothing to its largest.
    """
    photons = photons_on_plane(count, normal=normal)
    measure_radii(photons, diagonal=4.0)
    held = count * math.pi * np.median(photons["radius"].astype(float)) ** 2
    assert least * NEIGHBORS < held < 1.1 * NEIGHBORS
    spread = np.std(np.log(photons["radius"]))
    assert spread < 0.25  # 18 % noise in density is 9 % in radius; the rest is the edge


@pytest.mark.parametrize("count", [1000, 200_000])
def test_as_much_of_a_scene_is_crowded_however_many_photons_show_it(count):
    """A hundred times as dense in a patch as around it; cells straddle its rim."""
    dense, sparse = photons_on_plane(count, size=1.0), photons_on_plane(count, size=10.0, seed=1)
    dense["position"] += (12.0, 0.0, 0.0)
    crowded = is_crowded(np.concatenate([dense, sparse]), diagonal=10.0)
    assert crowded[:count].mean() > 0.95 and crowded[count:].mean() < 0.05


def test_density_follows_place():
    """A hundred times the photons in one place: a tenth of the radius there, and no change elsewhere."""
    dense, sparse = photons_on_plane(5000, size=1.0), photons_on_plane(5000, size=10.0, seed=1)
    dense["position"] += (12.0, 0.0, 0.0)
    both = np.concatenate([dense, sparse])
    measure_radii(both, diagonal=8.0)
    radii = np.median(both["radius"][:5000]), np.median(both["radius"][5000:])
    assert radii[1] / radii[0] == pytest.approx(10, rel=0.25)


def test_a_photon_of_more_flux_spreads_over_as_much_more_area():
    """One of 1,000 lm among those of 1 lm; its cells hold at least 32."""
    photons = photons_on_plane(5000)
    photons["flux"] = 1.0 / 3.0
    measure_radii(photons, diagonal=4.0)
    even = photons["radius"].copy()
    middle = np.argmin(np.linalg.norm(photons["position"], axis=1))
    photons["flux"][middle] *= 1000.0
    measure_radii(photons, diagonal=4.0)
    area = (photons["radius"] / even) ** 2
    assert 32 * 1000 / 1031 <= area[middle] <= 1000 and (np.delete(area, middle) == 1.0).all()


def test_the_other_side_of_a_wall_is_not_counted():
    front, back = photons_on_plane(5000), photons_on_plane(5000, seed=1)
    back["normal"] *= -1
    alone, both = front.copy(), np.concatenate([front, back])
    measure_radii(alone, diagonal=4.0)
    measure_radii(both, diagonal=4.0)
    assert np.median(both["radius"]) == pytest.approx(np.median(alone["radius"]), rel=0.05)


def test_radii_stay_within_bounds_and_follow_smoothing():
    lonely, crowd = photons_on_plane(3, size=10.0), photons_on_plane(20_000, size=1e-3)
    for smoothing in (1.0, 0.5, 2.0):
        for photons, share in ((lonely, 0.1), (crowd, 0.002)):
            measure_radii(photons, diagonal=10.0, smoothing=smoothing)
            assert photons["radius"] == pytest.approx(share * 10.0 * smoothing, rel=1e-5)
            assert photons["height"] == pytest.approx(0.25 * photons["radius"])


def test_photons_are_no_smaller_than_what_a_receiver_stands_for():
    """Where kernels are narrower than the receivers are apart, most photons would light none."""
    photons = photons_on_plane(50_000)
    measure_radii(photons, diagonal=4.0)
    small = photons["radius"].copy()
    pixel = np.array([0.1, 0.0, 0.0, 0.0])  # 0.1 m at x = 1, nothing behind x = 0
    measure_radii(photons, 4.0, 1.0, Pixels(pixel, np.zeros(4)))
    assert photons["radius"] == pytest.approx(np.maximum(small, 0.075 * photons["position"][:, 0]))
    measure_radii(photons, 4.0, 1.0, Pixels(1e3 * pixel, np.zeros(4)))
    assert photons["radius"].max() == pytest.approx(0.4)


def test_measuring_is_the_same_anywhere_and_in_any_unit():
    here = photons_on_plane(3000)
    there = here.copy()
    there["position"] = here["position"] * 128.0
    measure_radii(here, 4.0)
    measure_radii(there, 4.0 * 128.0)
    assert there["radius"] == pytest.approx(128.0 * here["radius"], rel=1e-5)


def test_no_photons_are_no_trouble():
    measure_radii(np.zeros(0, PHOTON), 1.0)
    one = np.zeros(1, PHOTON)
    one["normal"] = (0, 0, 1)
    measure_radii(one, 1.0)
    assert one["radius"][0] == pytest.approx(0.1)
    same = np.repeat(one, 1000)
    measure_radii(same, 1.0)
    assert np.isfinite(same["radius"]).all() and same["radius"].min() >= 0.002 * 0.999
