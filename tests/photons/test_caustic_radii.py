"""Kernels of caustic photons are as wide as their neighbours lie apart, and no stray one shines out."""

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree
from test_density import photons_on_plane

from ispm.optics.records import PHOTON
from ispm.photons.density import Pixels, measure_caustic_radii
from ispm.photons.nearest import NearestTree

LIMITS = 1e-4, 0.5  # m, where the diagonal is 10 m


def crowded(count, seed=0):
    """Photons on a plane, some of them a thousand times as dense as others, some in one place."""
    random = np.random.default_rng(seed)
    photons = np.zeros(count, PHOTON)
    spread = 10.0 ** random.uniform(-4, 0, (count, 1))
    photons["position"] = spread * random.normal(size=(count, 3)) * (1, 0, 1)
    photons["position"][: count // 10] = photons["position"][0]
    photons["normal"], photons["flux"] = (0, 1, 0), 1.0
    return photons


def peak(photons):
    """Irradiance in the middle of each kernel."""
    return photons["flux"][:, 0] / photons["radius"].astype(float) ** 2


@pytest.mark.parametrize("count", [1, 3, 9, 64, 65, 5000])
@pytest.mark.parametrize("neighbors", [1, 8, 50])
def test_kernel_covers_half_the_disc_of_its_neighbors(count, neighbors):
    photons = crowded(count)
    measure_caustic_radii(photons, 10.0, neighbors=neighbors)
    place = photons["position"].astype(float)
    exact = cKDTree(place).query(place, k=[neighbors + 1])[0][:, 0]  # the first is the photon itself
    # a few roundings of float32
    assert photons["radius"] == pytest.approx(np.clip(exact / math.sqrt(2), *LIMITS), rel=1e-6)


def test_turned_surfaces_are_as_far_as_a_tenth_of_the_diagonal():
    photons = crowded(3000)
    random = np.random.default_rng(1)
    normal = np.array([0, 1, 0]) + random.normal(size=(3000, 3)) * 0.3
    photons["normal"] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    measure_caustic_radii(photons, 10.0)
    place = np.hstack([photons["position"], 1.0 * photons["normal"]]).astype(float)
    exact = cKDTree(place).query(place, k=[13])[0][:, 0]
    assert photons["radius"] == pytest.approx(np.clip(exact / math.sqrt(2), *LIMITS), rel=1e-5)


def test_bytes_are_the_same_for_any_threads():
    radii = []
    for threads in (1, 2, 5):
        photons = crowded(4000)
        measure_caustic_radii(photons, 10.0, threads=threads)
        radii.append(photons["radius"].copy())
    assert (radii[0] == radii[1]).all() and (radii[0] == radii[2]).all()


def test_radii_follow_unit_and_smoothing():
    here, there = crowded(2000), crowded(2000)
    there["position"] *= 128.0
    measure_caustic_radii(here, 10.0)
    measure_caustic_radii(there, 1280.0, smoothing=0.5)
    assert there["radius"] == pytest.approx(64.0 * here["radius"], rel=1e-5)


def test_no_kernel_is_narrower_than_a_pixel():
    """Their variances: r^2 / 8 = slant / 12 pixels, seen face on or aslant; no more than the widest."""
    plane = np.array([0.1, 0.0, 0.0, 0.02])  # m at x
    for direction, slant in (((0, 1, 0, 0), 1.0), ((0, 0.25, 1, 0), math.sqrt(17)), ((1, 0, 0, 0), 8.0)):
        photons = crowded(3000)
        measure_caustic_radii(photons, 10.0)
        small = photons["radius"].copy()
        measure_caustic_radii(photons, 10.0, pixels=Pixels(plane, np.array(direction)))
        least = (0.1 * photons["position"][:, 0] + 0.02) * math.sqrt(slant * 8.0 / 12.0)
        assert photons["radius"] == pytest.approx(np.clip(least, small, LIMITS[1]), rel=1e-5)


def test_kernels_stay_on_small_objects():
    photons = crowded(500)
    photons["position"] *= 100.0
    photons["instance"] = np.arange(500) % 2
    measure_caustic_radii(photons, 10.0, widths=np.array([0.4, np.inf], np.float32))
    assert photons["radius"][::2].max() == pytest.approx(0.1)
    assert photons["radius"][1::2].max() == pytest.approx(0.5)


def test_a_photon_far_from_others_is_dim():
    """Its light is spread over the widest kernel."""
    photons = np.concatenate([photons_on_plane(2000, size=0.1), photons_on_plane(1, size=0.0)])
    photons["flux"] = 1.0
    photons["position"][-1] = (3.0, 0, 0)
    measure_caustic_radii(photons, 10.0)
    assert photons["radius"][-1] == pytest.approx(0.5)
    assert peak(photons)[-1] < 1e-3 * np.median(peak(photons)[:-1])


@pytest.mark.parametrize("flux", [10.0, 300.0])
def test_a_brighter_photon_spreads_until_it_is_as_dim_as_its_neighbours(flux):
    photons = photons_on_plane(5000, seed=3)
    photons["flux"] = 1.0
    photons["flux"][7] = flux
    measure_caustic_radii(photons, 10.0)
    usual = np.median(peak(photons))
    # the twelfth distance squared of a Poisson pattern spreads by 1 / sqrt(12) = 29 %
    assert peak(photons)[7] < 2.5 * usual
    others = np.delete(peak(photons), 7)
    assert peak(photons)[7] < others.max()


def test_a_few_strays_in_one_place_do_not_shine_among_a_caustic():
    """Fewer than the neighbours wanted, however close, make no kernel small: at most as many times a
    lone photon's irradiance."""
    lone, clump = photons_on_plane(1, size=0.0), photons_on_plane(12, size=1e-4)
    for stray in (lone, clump):
        stray["flux"] = 1.0
        measure_caustic_radii(stray, 10.0)
    assert clump["radius"] == pytest.approx(lone["radius"][0])


@pytest.mark.parametrize("bulge", [0.2, 1.0])
def test_kernels_reach_down_to_a_curved_surface(bulge):
    """On a ball the disc of a kernel's radius sinks by r^2 / 2R at its rim."""
    photons = np.zeros(800, PHOTON)
    normal = np.random.default_rng(5).normal(size=(800, 3))
    photons["normal"] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    photons["position"] = bulge * photons["normal"]
    photons["flux"] = 1.0
    measure_caustic_radii(photons, 4.0)
    radius, height = photons["radius"].astype(float), photons["height"].astype(float)
    sunk = radius**2 / (2.0 * bulge)
    assert (height >= np.minimum(1.2 * sunk, radius)).all()
    assert (height <= np.maximum(1.6 * sunk, 0.25 * radius) + 1e-6).all()


def test_height_is_a_quarter_on_a_plane():
    photons = photons_on_plane(1000)
    measure_caustic_radii(photons, 4.0)
    assert photons["height"] == pytest.approx(0.25 * photons["radius"])


def test_odd_photons_are_no_trouble():
    measure_caustic_radii(np.zeros(0, PHOTON), 1.0)
    broken = crowded(200)
    broken["position"][3], broken["normal"][5], broken["flux"][7] = np.nan, np.nan, 0.0
    measure_caustic_radii(broken, 10.0)
    assert np.isfinite(np.delete(broken["radius"], [3, 5])).all()


def test_a_tree_has_all_points_in_its_boxes():
    points = np.random.default_rng(0).normal(size=(700, 6)).astype(np.float32)
    tree = NearestTree(points)
    assert len(tree.starts) == 4  # 88 blocks, 11 nodes, 2 and the top
    top = tree.nodes[tree.starts[-1] :].reshape(2, 6, 8)[:, :, :2]
    assert (top[0].min(axis=1) == points.min(axis=0)).all()
    assert (top[1].max(axis=1) == points.max(axis=0)).all()


def test_kernels_keep_clear_of_the_wall_behind_which_they_would_show():
    free, near = crowded(500), crowded(500)
    measure_caustic_radii(free, 10.0)
    clear = (free["radius"] * np.linspace(0, 2, 500)).astype(np.float32)
    measure_caustic_radii(near, 10.0, clear=clear)
    expected = np.clip(clear, 0.5 * free["radius"], free["radius"])
    np.testing.assert_array_equal(near["radius"], expected)
