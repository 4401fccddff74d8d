"""Gather rays go where photons came from, and their weights make up for it."""

from itertools import pairwise

import numpy as np
import pytest
from scipy import stats

from ispm.optics.jit import jit
from ispm.optics.records import PHOTON, RECEIVER
from ispm.optics.sampling import cosine_hemisphere
from ispm.paths.guide import Guide, guided, square_blocks
from ispm.photons.cells import BITS, sort_by_cell

UP = (0.0, 0.0, 1.0)


@jit
def move(densities, u, out):
    for i in range(len(u)):
        out[i] = guided(densities, 0, u[i, 0], u[i, 1])


def moved(densities, count, seed=0):
    u = np.random.default_rng(seed).random((count, 2), np.float32)
    out = np.empty((count, 3), np.float32)
    move(densities, u, out)
    return out


def some_densities():
    densities = np.random.default_rng(5).gamma(0.5, size=(1, 6, 13)).astype(np.float32) + np.float32(0.3)
    densities[0, :, :12] /= densities[0, :, :12].mean()
    densities[0, :, 12] = densities[0, :, :12].mean(axis=1)
    return densities


def test_points_are_as_dense_as_they_are_said_to_be():
    """Chi-square of 72 parts, 99.9 %."""
    densities = some_densities()
    points = moved(densities, 200_000)
    ring, sector = (points[:, 0] * 6).astype(int), (points[:, 1] * 12).astype(int)
    assert points[:, :2].min() >= 0.0 and points[:, :2].max() < 1.0
    assert points[:, 2] == pytest.approx(densities[0, ring, sector])
    counts = np.bincount(12 * ring + sector, minlength=72)
    expected = densities[0, :, :12].ravel().astype(float)
    assert stats.chisquare(counts, expected * len(points) / expected.sum()).pvalue > 1e-3


def test_weights_keep_integrals():
    """The mean of f over the square from moved points, f / density: 4 standard errors."""
    points = moved(some_densities(), 200_000, 1)
    terms = np.exp(points[:, 0] - 2.0 * points[:, 1]) / points[:, 2]
    expected = (np.e - 1.0) * (1.0 - np.exp(-2.0)) / 2.0
    assert abs(terms.mean() - expected) < 4.0 * terms.std() / np.sqrt(len(terms))


def photons_from(origins, positions, normal=UP):
    photons = np.zeros(len(positions), PHOTON)
    way = origins - positions
    photons["height"] = np.linalg.norm(way, axis=1)
    photons["wi"], photons["flux"] = way / photons["height"][:, None], 1.0
    photons["position"], photons["normal"] = positions, normal
    return photons


def receivers(positions, normal=UP):
    points = np.zeros(len(positions), RECEIVER)
    points["position"], points["n"], points["ng"], points["valid"] = positions, normal, normal, 1
    return points


def plain(count, seed):
    positions = np.random.default_rng(seed).uniform(-1.0, 1.0, (count, 3)).astype(np.float32)
    positions[:, 2] = 0.0
    return positions


def test_rays_go_to_where_photons_came_from_seen_from_their_own_place():
    """A spot above the plain: of even rays 1 in 72 is in its part or less, of guided ones over a third.

    60 % are guided, spread over the four parts about the spot.
    """
    spot = np.array([0.4, -0.3, 0.8], np.float32)
    photons = photons_from(np.tile(spot, (4000, 1)), plain(4000, 1))
    points = receivers(plain(64, 2))
    guide = Guide(photons, np.ones(4000, bool), np.full(3, -1.0), 3.5)
    densities, rows = guide.densities(points, square_blocks((64, 1)), 2)
    u = np.random.default_rng(3).random((500, 2), np.float32)
    for point, row in zip(
        points[::4], rows[::4], strict=True
    ):  # the first of a block: its histogram is its own
        out = np.empty((500, 3), np.float32)
        move(densities[row : row + 1], u, out)
        d = np.array([cosine_hemisphere(*each) for each in out[:, :2]])
        way = spot - point["position"]
        near = d @ (way / np.linalg.norm(way)) > 0.7
        even = np.array([cosine_hemisphere(*each) for each in u]) @ (way / np.linalg.norm(way)) > 0.7
        assert near.mean() > 0.35 + 0.4 * even.mean()


def test_receivers_take_photons_that_face_as_they_do():
    """The floor's photons come from the left, the ceiling's from the right."""
    positions = plain(2000, 1)
    left, right = (positions + np.array(way) for way in ((-3.0, 0.0, 0.3), (3.0, 0.0, -0.3)))
    photons = np.concatenate([
        photons_from(left.astype(np.float32), positions),
        photons_from(right.astype(np.float32), positions, (0.0, 0.0, -1.0)),
    ])  # fmt: skip
    guide = Guide(photons, np.ones(4000, bool), np.full(3, -1.0), 3.5)
    for normal, side in ((UP, -1.0), ((0.0, 0.0, -1.0), 1.0)):
        densities, rows = guide.densities(receivers(np.zeros((1, 3)), normal), square_blocks((1, 1)), 1)
        ring, sector = np.unravel_index(densities[rows[0], :, :12].argmax(), (6, 12))
        assert ring == 5
        x = np.cos(2.0 * np.pi * (sector + 0.5) / 12)  # both normals have the x axis as their first tangent
        assert x * side > 0.8


def test_photons_from_behind_tell_nothing():
    """As on the dark side of a wall without thickness, where the nearest photons lit its other side."""
    positions = plain(2000, 1)
    photons = photons_from(positions - np.array((0.0, 0.0, 1.0), np.float32), positions)
    guide = Guide(photons, np.ones(2000, bool), np.full(3, -1.0), 3.5)
    densities, rows = guide.densities(receivers(np.zeros((1, 3))), square_blocks((1, 1)), 1)
    assert (densities[rows] == 1.0).all()


def test_few_photons_and_none_tell_nothing():
    for count in (0, 95):
        photons = photons_from(plain(count, 1) + np.float32(1.0), plain(count, 1))
        guide = Guide(photons, np.ones(count, bool), np.full(3, -1.0), 3.5)
        densities, rows = guide.densities(receivers(plain(8, 2)), square_blocks((4, 2)), 1)
        assert (densities[rows] == 1.0).all()


def test_points_by_cell_are_together_at_all_sizes():
    positions = np.random.default_rng(4).uniform(-1.0, 1.0, (5000, 3)).astype(np.float32)
    normals = np.random.default_rng(5).normal(size=(5000, 3)).astype(np.float32)
    photons = photons_from(positions + np.float32(1.0), positions, normals)
    keys, order = sort_by_cell(photons, np.full(3, -1.0), 2.0 / (1 << BITS))
    assert sorted(order) == list(range(5000)) and (np.diff(keys.astype(np.int64)) >= 0).all()
    side = np.abs(normals).argmax(axis=1) * 2 + (np.take_along_axis(
        normals, np.abs(normals).argmax(axis=1)[:, None], axis=1)[:, 0] <= 0)  # fmt: skip
    for level in range(BITS + 1):
        cells = np.floor((positions + 1.0) / (2.0 / (1 << BITS) * (1 << level))).astype(int)
        seen = [tuple(each) for each in np.column_stack([side, cells])[order]]
        changes = sum(a != b for a, b in pairwise(seen)) + 1
        assert changes == len(set(seen))
