"""The normalised filter: a weighted mean over one surface, no more and no less."""

import numpy as np
import pytest

from ispm.optics.records import RECEIVER
from ispm.stages.filter import MET, filter_estimate, filter_points, filter_some
from ispm.stages.lattice import DENSITY, lattice_of, normals_differ

SIZE = (40, 30)
CHANNELS = [c for c in range(16) if c != MET]


def floor(size=SIZE, pixel=0.1, alpha=0.3):
    """Receivers on y = 0, a pixel apart, seen from above; x to the right, z down."""
    receivers = np.zeros(size[0] * size[1], RECEIVER)
    x, z = np.meshgrid(np.arange(size[0]) * pixel, np.arange(size[1]) * pixel)
    receivers["position"][:, 0], receivers["position"][:, 2] = x.ravel(), z.ravel()
    receivers["ng"] = receivers["n"] = receivers["wo"] = (0, 1, 0)
    receivers["valid"], receivers["footprint"], receivers["slant"] = 1, pixel, 1.0
    receivers["alpha"] = alpha
    return receivers


def estimates(count, seed=0):
    """Random channels, with a density that asks for the widest filter."""
    estimate = np.random.default_rng(seed).uniform(0.5, 2.0, (count, 16)).astype(np.float32)
    estimate[:, DENSITY] = 1.0
    return estimate


def filtered(receivers, estimate, size=SIZE, diagonal=10.0, smoothing=1.0, threads=2):
    return filter_estimate(receivers, estimate, size, diagonal, smoothing, threads).light


@pytest.mark.parametrize("density", [0.0, 1.0, 1e3, 1e9])
@pytest.mark.parametrize("smoothing", [0.01, 1.0, 10.0])
def test_even_light_stays_as_it_is(density, smoothing):
    estimate = np.ones((1200, 16), np.float32) * np.arange(1, 17, dtype=np.float32)
    estimate[:, DENSITY] = density
    out = filtered(floor(), estimate, smoothing=smoothing)
    assert out[:, CHANNELS] == pytest.approx(estimate[:, CHANNELS], rel=1e-5)
    assert (out[:, MET] > 0.0).all()


def test_filter_is_linear_in_the_light():
    """Reach depends on density alone."""
    a, b = estimates(1200, 1), estimates(1200, 2)
    both = a + 3 * b
    both[:, DENSITY] = 1.0
    out = filtered(floor(), a) + 3 * filtered(floor(), b)
    light = [c for c in CHANNELS if c != DENSITY]
    assert filtered(floor(), both)[:, light] == pytest.approx(out[:, light], rel=1e-5)


def test_noise_falls_as_the_number_averaged():
    """White noise, reach 7.5 pixels: the filter's c_v / (pi reach^2) of it, at most, is left inside."""
    out = filtered(floor(), estimates(1200))[:, 0].reshape(30, 40)[9:-9, 9:-9]
    left = out.std() / (1.5 / np.sqrt(12))
    assert 0.3 * np.sqrt(1.8 / (np.pi * 7.5**2)) < left < np.sqrt(1.8 / (np.pi * 7.5**2))


def test_surfaces_keep_their_light_apart():
    """A step down, a wall, and a floor seen from the other side lie in the left half of the screen."""
    left = np.arange(1200) % 40 < 20
    for change in ("step", "wall", "back"):
        receivers = floor()
        if change == "step":
            receivers["position"][left, 1] = -0.3
        elif change == "wall":
            receivers["ng"][left] = receivers["n"][left] = (1, 0, 0)
        else:
            receivers["ng"][left] = receivers["n"][left] = (0, -1, 0)
        estimate = estimates(1200)
        estimate[left] = 0.0
        estimate[left, DENSITY] = 1e4  # many photons, all black
        out = filtered(receivers, estimate)
        assert not out[left, 0].any() and out[~left, 0].min() > 0.5
        # few photons: what else is near counts a hundredth, so that a whole surface stays dark
        estimate[left, DENSITY] = 1.0
        assert filtered(receivers, estimate)[left, 0].mean() < 0.02 * out[~left, 0].mean()


def test_bumps_keep_their_light_apart():
    """A normal map turns each second column by 50 degrees left, the others right: they share a surface, but
    weigh each other by cos(100 degrees), none, and noise still falls among those turned alike."""
    receivers, light = floor(), estimates(1200)
    left = np.arange(1200) % 2 == 0
    for columns, side in ((left, -1), (~left, 1)):
        receivers["n"][columns] = side * np.sin(np.radians(50)), np.cos(np.radians(50)), 0
    light[:, DENSITY] = 1e3  # enough photons that strangers have no say
    light[left, :3] += 10.0
    out = filtered(receivers, light)[:, 0]
    assert out[left] == pytest.approx(11.25, abs=0.25) and out[~left] == pytest.approx(1.25, abs=0.25)


def bumpy(turn, seed=0, size=SIZE):
    """The floor with normals turned at random by up to `turn` radians, as by a fine normal map."""
    receivers, random = floor(size), np.random.default_rng(seed)
    angle = turn * np.sqrt(random.random(len(receivers)))
    about = random.uniform(0.0, 2.0 * np.pi, len(receivers))
    n = [np.sin(angle) * np.cos(about), np.cos(angle), np.sin(angle) * np.sin(about)]
    receivers["n"] = np.stack(n, axis=1)
    return receivers


def test_light_that_is_linear_in_the_normal_stays_as_it_is():
    """Slopes x and z of the light lie in the floor's plane, to first order that of the normals.

    A reach of 7.5 pixels holds effectively pi 7.5^2 / 1.8 = 98 receivers: a ridge of .1 / 98 beside the
    normals' variance, .25^2 / 4 in each axis, takes 6 % of what deviates from the mean, and second orders
    .25^2 / 2 = 3 %. Without a fit more than half is gone.
    """
    receivers, light = bumpy(0.25), np.ones((1200, 16), np.float32)
    light[:, DENSITY] = 2e2
    away = receivers["n"] @ np.array([[0.6, 0.0, -0.3], [0.0, 0.0, 0.0], [0.2, 0.9, 0.0]])
    light[:, :3] = 1.0 + away
    out = filtered(receivers, light)[:, :3]
    assert np.linalg.norm(out - light[:, :3]) < 0.09 * np.linalg.norm(away)
    mean = filter_some(np.arange(1200), receivers, light, SIZE, 10.0, 1.0, 2)[:, :3]
    assert np.linalg.norm(mean - light[:, :3]) > 0.5 * np.linalg.norm(away)


def test_light_may_be_followed_to_other_normals():
    """The gradient is that of the field, but for the ridge's share."""
    receivers, light = bumpy(0.25), np.ones((1200, 16), np.float32)
    light[:, DENSITY] = 2e2
    slopes = np.array([[0.6, 0.0, -0.3], [0.0, 0.0, 0.0], [0.2, 0.9, 0.0]])
    light[:, :3] = 1.0 + receivers["n"] @ slopes
    gradient = filter_estimate(receivers, light, SIZE, 10.0, 1.0, 2).gradient
    assert gradient is not None
    found = gradient.reshape(-1, 3, 4)[:, :, :3].reshape(30, 40, 3, 3)[9:-9, 9:-9].mean(axis=(0, 1))
    assert found[::2] == pytest.approx(slopes[::2], abs=0.1)


@pytest.mark.parametrize("turn", [0.0, 0.005, 0.02, 0.05])
def test_slight_bumps_let_little_noise_through(turn):
    """White noise of variance s^2, N = 98 receivers: their mean has s^2 / N, and following a slope by d adds
    s^2 / N d^2 C / (C + r)^2, with C = turn^2 / 4 the normals' variance, d^2 = 2 C, and the ridge r = .1 / N.

    12 x 22 pixels hold three discs of N: of 4 pictures the root of the mean square is known to some 6 %.
    """
    added = []
    for seed in range(4):
        noise = estimates(1200, seed)
        noise[:, DENSITY] = 2e2
        pictures = (filtered(each, noise)[:, :3].reshape(30, 40, 3) for each in (floor(), bumpy(turn, seed)))
        flat, bumps = (each[9:-9, 9:-9] for each in pictures)
        added.append(((bumps - flat) ** 2).mean())
        assert turn or (bumps == flat).all()
    number, variance = np.pi * 7.5**2 / 1.8, turn**2 / 4.0
    growth = 2.0 * (variance / (variance + 0.1 / number)) ** 2
    assert np.mean(added) <= 1.2**2 * growth * (1.5**2 / 12.0) / number


def test_no_fit_makes_light_negative():
    receivers, light = bumpy(0.9), estimates(1200, 6)
    light[:, DENSITY] = 2e2
    light[:, :3] = np.where(light[:, :3] > 1.8, 100.0, 0.0)  # specks
    out = filter_estimate(receivers, light, SIZE, 10.0, 1.0, 2)
    assert out.gradient is not None
    assert (
        (out.light[:, :3] >= 0.0).all() and np.isfinite(out.light).all() and np.isfinite(out.gradient).all()
    )


def test_a_surface_that_itself_turns_is_trusted_less():
    """A column of radius 2 m under light from one side: its slope is a small part of the true one, 1, as
    geometric normals turn along. Where a flat floor has such normals it is nearly all."""
    receivers, light = floor(), np.ones((1200, 16), np.float32)
    angle = (receivers["position"][:, 0] - 2.0) / 2.0
    receivers["n"] = np.stack([np.sin(angle), np.cos(angle), np.zeros(1200)], axis=1)
    light[:, DENSITY] = 2e2
    light[:, :3] = (1.0 + np.sin(angle))[:, None]
    slopes = []
    for ng in (receivers["n"].copy(), receivers["ng"].copy()):
        receivers["ng"] = ng
        gradient = filter_estimate(receivers, light, SIZE, 10.0, 1.0, 2).gradient
        assert gradient is not None
        slopes.append(float(gradient[abs(angle) < 0.2, 0].mean()))
    assert slopes[0] < 0.3 and slopes[1] > 0.8


def test_gloss_is_mixed_among_surfaces_of_like_roughness_only():
    left = np.arange(1200) % 40 < 20
    receivers = floor()
    receivers["alpha"] = np.where(left, 0.0, 0.5)
    estimate = np.ones((1200, 16), np.float32)
    estimate[left, 8:] = 100.0  # a surface without gloss has none to give
    out = filtered(receivers, estimate)
    assert out[~left, 8:] == pytest.approx(1.0, rel=1e-5)
    assert not out[left, 8:].any()
    assert out[:, 0] == pytest.approx(1.0, rel=1e-5)


def test_empty_pixels_give_and_get_nothing():
    receivers = floor()
    empty = np.random.default_rng(5).random(1200) < 0.4
    receivers[empty] = np.zeros((), RECEIVER)
    estimate = np.ones((1200, 16), np.float32)
    estimate[empty] = np.nan
    out = filtered(receivers, estimate)
    assert out[~empty][:, CHANNELS] == pytest.approx(1.0, rel=1e-5)
    assert not out[empty].any()


def test_filter_repeats_to_the_bit_for_any_threads():
    out = [filtered(floor(), estimates(1200), threads=n).tobytes() for n in (1, 2, 3)]
    assert out[0] == out[1] == out[2]


def test_tiny_pictures_are_filtered():
    assert filtered(floor((1, 1)), estimates(1), (1, 1))[0, 0] == pytest.approx(estimates(1)[0, 0])
    assert np.isfinite(filtered(floor((7, 1)), estimates(7), (7, 1))).all()


def test_points_between_receivers_are_lit_alike():
    """A ramp of light at points half a pixel off: the mean there is the ramp's value."""
    receivers, estimate = floor(), np.ones((1200, 16), np.float32)
    estimate[:, 0] = receivers["position"][:, 0]
    pixels = np.array([20 + 40 * 15, 25 + 40 * 14])
    points = receivers[pixels].copy()
    points["position"][:, 0] += 0.05
    light = filter_points(points, pixels, receivers, estimate, SIZE, 10.0, 1.0, 2)
    assert light[:, 0] == pytest.approx(points["position"][:, 0], rel=0.02)
    points["ng"] = points["n"] = (1, 0, 0)
    assert not filter_points(points, pixels, receivers, estimate, SIZE, 10.0, 1.0, 2)[:, MET].any()


def aslant(size=(120, 60)):
    """Receivers on y = 0 seen at a slant of 10: the next row is as far as ten columns."""
    receivers = floor(size)
    receivers["position"][:, 2] *= 10.0
    receivers["wo"], receivers["slant"] = (0.0, 0.1, 0.99**0.5), 10.0
    return receivers


def test_rows_of_a_surface_seen_aslant_share_their_light():
    """h is 4 rows: the mean of two rows side by side is nearly of the same receivers. With strides as long
    down as across, each row had its own, and ceilings had stripes."""
    size, h = (120, 60), 4.0
    light = estimates(size[0] * size[1])
    light[:, DENSITY] = 1600.0 / (np.pi * h * h)
    out = filtered(aslant(size), light, size, diagonal=100.0)[:, 0].reshape(60, 120)[8:-8]
    rows = out.mean(axis=1)  # noise of the columns aside
    assert np.std(np.diff(out, axis=0)) < 0.6 * np.std(out) * 2.0**0.5
    assert np.abs(np.diff(rows)).max() < 0.05


def test_taps_lie_next_to_points_on_what_is_narrower_than_strides():
    """A leaning strip in a wall: of how many receivers of its own a mean is, is not left to chance."""
    size = (80, 60)
    receivers = floor(size)
    y, x = np.divmod(np.arange(size[0] * size[1]), size[0])
    strip = np.abs(x - 40 - y // 3) < 1.5
    receivers["position"][strip, 1] = 3.0
    light = estimates(len(receivers))
    light[:, DENSITY] = 1600.0 / (np.pi * 3.0**2)
    out = filtered(receivers, light, size, diagonal=100.0)
    inner = strip & (y > 8) & (y < 52)
    assert out[inner, MET].min() >= 1.0


@pytest.mark.parametrize(
    ("reach", "enough"), [(1.5, True), (2.0, False), (3.0, False), (5.0, False), (7.0, True)]
)
def test_a_line_of_receivers_is_enough_from_twelve_on(reach, enough):
    """A strip a receiver wide holds 2 h - 1 of its own, 3 where h is 1.5; the floor beside it has enough at
    any reach, though 9 where h is 2."""
    size = (40, 60)
    receivers = floor(size, pixel=1.0)
    strip = receivers["position"][:, 0] == 20.0
    receivers["position"][strip, 1] = 50.0
    light = estimates(len(receivers))
    light[:, DENSITY] = 1600.0 / (np.pi * reach * reach)
    met = filtered(receivers, light, size, diagonal=1e3)[:, MET].reshape(60, 40)
    assert (met[10:-10, 20] >= 1.0).all() == enough
    assert (met[10:-10, 3:17] >= 1.0).all()


def test_the_lattice_covers_the_reach_with_no_more_taps_than_it_may():
    for wide in (1.5, 3.0, 8.0, 20.0, 96.0):
        for high in (0.1, 1.5, 7.9, 30.0, 96.0):
            strides, taps = lattice_of(np.float32(wide), np.float32(high))
            assert (2 * taps[0] + 1) * (2 * taps[1] + 1) <= 17 * 17
            for extent, stride, count in zip((wide, high), strides, taps, strict=True):
                assert extent - stride <= stride * count <= max(extent, 1.0)


@pytest.mark.parametrize(("lag", "found"), [(1, True), (8, True), (5, False)])
@pytest.mark.parametrize("axis", [0, 1])
def test_normals_that_differ_are_found_beside_and_as_far_as_taps_go(lag, found, axis):
    """Of two receivers alone, in a plane, whose normals are 20 degrees apart."""
    receivers = floor()
    keep = np.array([0, lag * (1 if axis == 0 else SIZE[0])])
    receivers["n"] = 0.0
    receivers["n"][keep[0]], receivers["n"][keep[1]] = (0, 1, 0), (0, np.cos(0.35), np.sin(0.35))
    assert normals_differ(receivers, SIZE) == found
    receivers["n"][keep[1]] = (0, 1, 0)  # the same
    assert not normals_differ(receivers, SIZE)
    receivers["n"][keep[1]] = (0, np.cos(0.35), np.sin(0.35))
    receivers["position"][keep[1], 1] = 2.0 * lag * receivers["footprint"][0]  # on another plane
    assert not normals_differ(receivers, SIZE)
