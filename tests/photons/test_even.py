"""Where kernels of caustics may be wider than their beams: lattices of photons whose light is known."""

import math

import numpy as np
import pytest

from ispm.optics.records import PHOTON
from ispm.photons.even import WIDEST, room_to_widen
from ispm.photons.footprint import shape_kernels
from ispm.photons.walk import BEAM

_DIAGONAL = 20.0
_PLASTIC = 1.32471795724474602596  # x^3 = x + 1


def lattice(count: int, seed: float = 0.5) -> np.ndarray:
    """Points of the plastic number's lattice in [0, 1)^2, (count, 2)."""
    return (seed + np.arange(1, count + 1)[:, None] * [1.0 / _PLASTIC, 1.0 / _PLASTIC**2]) % 1.0


def landed(points, du, dv, wi=(0.0, 1.0, 0.0)):
    """(N,) PHOTON on y = 0, at (N, 2) points in x and z, and their beams, whose vectors along x and z are
    (N,) or one for all."""
    photons, beams = np.zeros(len(points), PHOTON), np.zeros((len(points), BEAM), np.float32)
    photons["position"][:, ::2], photons["normal"], photons["wi"] = points, (0.0, 1.0, 0.0), wi
    photons["flux"], photons["radius"], photons["height"] = 1.0 / len(points), 1e-3, 1e-3
    beams[:, 0], beams[:, 5], beams[:, 6:] = du, dv, (1.0, 0.0, 0.0)
    return photons, beams


def inner(points, margin=0.12) -> np.ndarray:
    return (np.abs(points - 0.5) < 0.5 - margin).all(axis=1)


def even(count=2000, wi=(0.0, 1.0, 0.0), seed=0.5):
    points = lattice(count, seed)
    return points, *landed(points, count**-0.5, count**-0.5, wi)


def room_of(photons, beams, *more):
    """The Room of all photons."""
    return room_to_widen(photons, beams, np.ones(len(photons), bool), _DIAGONAL, *more)


def test_even_light_has_all_room_and_its_border_none():
    points, photons, beams = even()
    room = room_of(photons, beams)
    assert (room.factor[inner(points)] > 0.99 * WIDEST).mean() > 0.95
    border = ~inner(points, 0.5 * 2000**-0.5)
    assert border.sum() > 20 and (room.factor[border] == 1.0).mean() > 0.95
    # a lattice of as many points within a disc
    assert np.median(room.within[inner(points)]) == pytest.approx(math.sqrt(24 / math.pi / 2000), rel=0.1)


def test_light_that_comes_another_way_takes_no_room():
    points, photons, beams = even()
    _, others, more = even(2000, (0.6, 0.8, 0.0), 0.1)
    both = np.concatenate([photons, others]), np.concatenate([beams, more])
    factor = room_of(*both).factor[:2000]
    assert np.median(factor[inner(points)]) > 0.9 * WIDEST


def test_slopes_of_light_have_room_and_folds_none():
    """Photons at x = u^2 of an even u: light of 1 / (2 u), infinite at the fold x = 0."""
    points = lattice(4000)
    u, z = points.T
    photons, beams = landed(np.stack([u * u, z], axis=1), 2.0 * u * 4000**-0.5, 4000**-0.5)
    factor = room_of(photons, beams).factor
    middle = np.abs(z - 0.5) < 0.4
    assert (factor[middle & (u * u < 2e-3)] < 1.05).all()
    assert np.median(factor[middle & (u * u > 0.3) & (u * u < 0.8)]) > 0.9 * WIDEST


@pytest.mark.parametrize("width", [0.02, 0.04])
def test_stripes_have_no_room(width):
    """As behind facets of a mirror: beams tell of even light, half of which is dark. The kernels of the beams
    themselves are .04 wide."""
    points, photons, beams = even(4000)
    lit = points[:, 0] % (2.0 * width) < width
    assert room_of(photons[lit], beams[lit]).factor.mean() < 1.1


def test_wider_kernels_leave_half_of_the_unevenness_and_all_light():
    points, photons, beams = even()
    clear = np.full(len(photons), np.inf, np.float32)
    grid = np.stack(np.meshgrid(*2 * [np.linspace(0.3, 0.7, 80)]), axis=-1).reshape(-1, 2)

    def light(room) -> np.ndarray:
        kernels = shape_kernels(photons, beams, clear, _DIAGONAL, 1.0, None, room)
        radius2 = (kernels["u"] ** 2).sum(axis=1)
        t2 = ((grid[:, None] - points) ** 2).sum(axis=2) / radius2
        return (np.maximum(1.0 - t2, 0.0) ** 2 * 3.0 / (math.pi * radius2) / len(points)).sum(axis=1)

    plain, wide = light(None), light(room_of(photons, beams))
    assert plain.mean() == pytest.approx(1.0, abs=0.02)
    assert wide.mean() == pytest.approx(1.0, abs=0.02)
    assert wide.std() < 0.5 * plain.std()


def test_any_number_of_threads_finds_the_same():
    _, photons, beams = even()
    one, four = (room_of(photons, beams, 0, threads) for threads in (1, 4))
    assert (one.factor == four.factor).all() and (one.within == four.within).all()


def test_passes_take_it_back():
    """What kernels gain in area falls with the root of the number of passes, here of 16."""
    points, photons, beams = even()
    factor = room_of(photons, beams, 15).factor
    assert np.median(factor[inner(points)]) == pytest.approx(
        math.sqrt(1.0 + (WIDEST**2 - 1.0) / 4.0), rel=1e-3
    )


def test_few_photons_have_none():
    _, photons, beams = even(20)
    assert (room_of(photons, beams).factor == 1.0).all()
    assert len(room_of(photons[:0], beams[:0]).factor) == 0


def test_those_that_are_not_wanted_have_none_and_are_neighbors():
    _, photons, beams = even()
    wanted = np.arange(len(photons)) % 3 > 0
    some, every = room_to_widen(photons, beams, wanted, _DIAGONAL), room_of(photons, beams)
    assert (some.factor[~wanted] == 1.0).all() and not some.within[~wanted].any()
    assert all(np.array_equal(one[wanted], other[wanted]) for one, other in zip(some, every, strict=True))
