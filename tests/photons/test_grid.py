"""The world-space grid of photons gives what brute force gives, at any points."""

import numpy as np
import pytest

from ispm.optics.records import CAUSTIC, INNER, PHOTON, RECEIVER
from ispm.photons.footprint import disc_kernels
from ispm.photons.grid import PhotonGrid
from ispm.reference.gather import gather


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def photons_in_box(count, seed, radius=(0.05, 0.4)):
    random = np.random.default_rng(seed)
    photons = np.zeros(count, PHOTON)
    photons["position"] = random.uniform(-1, 1, (count, 3)) * (1.0, 0.2, 3.0)
    photons["normal"] = unit(random.normal(size=(count, 3)))
    photons["wi"] = unit(photons["normal"] + 0.9 * unit(random.normal(size=(count, 3))))
    photons["flux"] = random.uniform(0.1, 2, (count, 3))
    photons["radius"] = random.uniform(*radius, count)
    photons["height"] = photons["radius"] * random.uniform(0.2, 1.0, count)
    return photons


def receivers_near(photons, count, seed):
    random = np.random.default_rng(seed)
    receivers = np.zeros(count, RECEIVER)
    chosen = photons[random.integers(0, len(photons), count)]
    receivers["position"] = chosen["position"] + random.normal(0, 0.1, (count, 3))
    receivers["ng"] = unit(chosen["normal"] + 0.3 * random.normal(size=(count, 3)))
    receivers["n"] = unit(receivers["ng"] + 0.2 * random.normal(size=(count, 3)))
    receivers["wo"] = unit(receivers["ng"] + 0.5 * random.normal(size=(count, 3)))
    receivers["alpha"] = random.choice([0.0, 0.25, 0.8], count)
    receivers["valid"] = random.random(count) < 0.9
    return receivers


@pytest.mark.parametrize("ellipses", [False, True])
@pytest.mark.parametrize("radius", [(0.05, 0.4), (1e-4, 1e-3), (2.0, 3.0)])
def test_grid_is_brute_force(radius, ellipses):
    photons = photons_in_box(700, 1, radius)
    receivers = receivers_near(photons, 400, 2)
    receivers["position"][:50] = photons["position"][:50]  # also where kernels are tiny
    photons["instance"][::2] |= INNER
    receivers["valid"][::3] |= INNER * receivers["valid"][::3]
    exact = gather(receivers, photons)
    found = PhotonGrid(photons, disc_kernels(photons) if ellipses else None).estimate(receivers, threads=2)
    # float32 sums of up to 700 terms against float64
    assert exact.any()
    assert found == pytest.approx(exact, rel=1e-4, abs=1e-6 * exact.max())


def test_grid_repeats_to_the_bit_for_any_threads():
    photons = photons_in_box(2000, 3)
    receivers = receivers_near(photons, 1000, 4)
    found = [PhotonGrid(photons).estimate(receivers, n).tobytes() for n in (1, 2, 3)]
    assert found[0] == found[1] == found[2]


def test_photons_are_finished_once_and_before_they_light_anything():
    photons = photons_in_box(2000, 3)
    receivers = receivers_near(photons, 60, 4)
    asked = []

    def finish(them, rows):
        asked.append(rows)
        them["flux"][rows] *= 2.0

    grid = PhotonGrid(photons.copy(), finish=finish)
    doubled = photons.copy()
    doubled["flux"] *= 2.0
    exact = PhotonGrid(doubled).estimate(receivers, 1)
    for some in (slice(0, 10), slice(0, 50), slice(10, 60)):
        assert (grid.estimate(receivers[some], 1) == exact[some]).all()
    rows = np.concatenate(asked)
    assert len(np.unique(rows)) == len(rows) < len(photons)


def test_points_outside_and_no_photons_get_no_light():
    photons = photons_in_box(100, 5)
    receivers = receivers_near(photons, 10, 6)
    assert not PhotonGrid(photons[:0]).estimate(receivers, 2).any()
    receivers["position"] = (1e6, -1e6, 0.0)
    assert not PhotonGrid(photons).estimate(receivers, 2).any()
    assert PhotonGrid(photons).estimate(receivers[:0], 2).shape == (0, 16)


def kernels_of(photons):
    """Equal ellipses about photons, as those of caustics."""
    kernels = np.zeros(len(photons), CAUSTIC)
    for name in ("position", "flux", "wi"):
        kernels[name] = photons[name]
    kernels["u"], kernels["v"] = (0.3, 0.0, 0.0), (0.0, 0.2, 0.1)
    kernels["height"] = 0.1
    return kernels


def test_few_points_get_the_same_light_without_lists():
    """To the bit, beside many that ask for lists; of photons with kernels of their own also."""
    photons = photons_in_box(2000, 7)
    receivers = receivers_near(photons, 400, 8)
    for shapes in (None, kernels_of(photons)):
        few = PhotonGrid(photons, shapes).estimate(receivers[:8], 2)
        assert few.any() and few.tobytes() == PhotonGrid(photons, shapes).estimate(receivers, 2)[:8].tobytes()


def test_what_each_photon_brings_is_what_all_of_them_bring():
    """Also of photons with kernels of their own, and of those that are finished first."""
    photons = photons_in_box(2000, 7)
    receivers = receivers_near(photons, 40, 8)
    receivers["valid"] = 1
    kernels = kernels_of(photons)

    def finish(them, rows):
        them["flux"][rows] *= 2.0

    for make in (
        lambda: PhotonGrid(photons),
        lambda: PhotonGrid(photons, kernels),
        lambda: PhotonGrid(photons.copy(), finish=finish),
    ):
        all_light, grid = make().estimate(receivers, 1), make()
        assert all_light[:, :3].any(axis=1).sum() > 10
        for k in range(len(receivers)):
            rows, brought = grid.each(receivers[k : k + 1])
            assert (brought > 0.0).any(axis=1).all() and len(np.unique(rows)) == len(rows)
            # float32 sums of hundreds of terms
            total = brought.sum(axis=0, dtype=float)
            np.testing.assert_allclose(total, all_light[k, :3], rtol=1e-5, atol=1e-5 * all_light.max())
    assert len(PhotonGrid(photons[:0]).each(receivers[:1])[0]) == 0


@pytest.mark.parametrize("scale", [2.0**-6, 2.0**5])
def test_kernels_of_any_size_light_alike(scale):
    """To the bit, scenes as large by a power of two, of kernels from under a meter to several."""
    photons = photons_in_box(500, 9)
    receivers, kernels = receivers_near(photons, 300, 10), kernels_of(photons)
    expected = PhotonGrid(photons, kernels).estimate(receivers, 2)
    expected[:, 3] /= scale**2  # photons per m2
    for each in (photons, receivers, kernels):
        each["position"] *= scale
    photons["radius"] *= scale
    photons["height"] *= scale
    for name in ("u", "v", "height"):
        kernels[name] *= scale
    for each in (photons, kernels):
        each["flux"] *= scale**2
    assert expected.any()
    assert PhotonGrid(photons, kernels).estimate(receivers, 2).tobytes() == expected.tobytes()


def test_discs_bring_the_same_light_as_kernels_that_a_wall_can_end():
    photons = photons_in_box(2000, 7)
    receivers = receivers_near(photons, 400, 8)
    light = PhotonGrid(photons).estimate(receivers, 2)
    found = PhotonGrid(photons, disc_kernels(photons)).estimate(receivers, 2)
    assert light.any()
    # at a kernel's rim its float32 distance, rounded otherwise, tells by 1e-6 of its middle
    np.testing.assert_allclose(found, light, rtol=2e-5, atol=1e-5 * light.max(axis=0).max())
