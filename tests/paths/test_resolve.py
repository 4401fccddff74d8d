"""The filter of narrow lobes: what it leaves alone, what it averages, and that it loses no light."""

import numpy as np
import pytest

from ispm.paths import resolve
from ispm.paths.pixel_rays import Screen
from ispm.paths.resolve import resolve_lobes
from ispm.paths.shown import contact_rows, lonely_rows, shown
from ispm.paths.vertices import FIRST_VERTEX, SEVERAL

WIDE, HIGH = 120, 116
THREADS = 2
FROM_ABOVE = Screen(
    (0.0,) * 3, (0.0,) * 3, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0), np.int64(WIDE), True
)


def flat(blur=5.0, samples=1, where=slice(None), **fields):
    """A wall that fills the picture, a pixel a metre, with other `fields` of FIRST_VERTEX `where` given."""
    y, x = np.divmod(np.arange(WIDE * HIGH), WIDE)
    firsts = np.zeros(len(x), FIRST_VERTEX)
    firsts["n"] = firsts["ng"] = (0, 0, 1)
    firsts["alpha"], firsts["blur"], firsts["beyond"], firsts["samples"] = 0.1, blur, blur, samples
    firsts["reflectance"] = np.random.default_rng(1).uniform(0.1, 1.0, (len(x), 3))
    for field, value in fields.items():
        firsts[field][where] = value
    places = np.stack([x, y, np.zeros(len(x))], axis=1)
    return seen(np.arange(len(x)), firsts, places)


def seen(pixels, firsts, places, screen=FROM_ABOVE):
    """What some pixels show that look along -Z."""
    directions = np.tile(np.float32(screen.forward), (len(pixels), 1))
    return shown(pixels, screen, firsts, places, directions, np.ones(len(pixels), np.float32), THREADS)


def resolved(light, given, smoothing=1.0):
    out = light.astype(np.float32)
    resolve_lobes(out, given, smoothing, THREADS)
    return out


def test_even_light_stays_as_it_is_under_any_texture():
    given = flat()
    light = np.tile(given.firsts["reflectance"], (1, 3)) * 2.0
    assert resolved(light, given) == pytest.approx(light, rel=1e-5)


def test_nothing_is_blurred_at_contacts():
    given = flat(blur=1e-3)
    light = np.random.default_rng(2).random((WIDE * HIGH, 9))
    assert resolved(light, given) == pytest.approx(light, rel=1e-3, abs=1e-4)


def test_the_blur_is_as_wide_as_asked_and_less_in_later_passes():
    middle = WIDE * (HIGH // 2) + WIDE // 2
    for blur, smoothing in ((1.0, 1.0), (3.0, 1.0), (3.0, 0.5)):
        given = flat(blur, reflectance=1.0)
        light = np.ones((WIDE * HIGH, 3))
        light[middle] = 2.0  # not so much that it stands out
        out = resolved(light, given, smoothing)[:, 0].astype(float) - 1.0
        y, x = np.divmod(np.arange(WIDE * HIGH), WIDE) - np.array([[HIGH // 2], [WIDE // 2]])
        near = (np.abs(x) <= 16) & (np.abs(y) <= 16)  # farther off it is float32's rounding
        assert out[near].sum() == pytest.approx(1.0, rel=1e-3)
        variance = (out * x**2)[near].sum()
        assert variance == pytest.approx((blur * smoothing) ** 2, rel=0.03)


@pytest.mark.parametrize("degrees", [0, 20, 45, 80, 90, 135, 170])
@pytest.mark.parametrize("cosine", [0.9, 0.5, 0.2])
def test_what_grazing_lobes_reflect_is_averaged_along_what_they_draw_out(degrees, cosine):
    """Across it they are narrower by the cosine, for facets that turn out of the plane of incidence turn
    light by so much less; a filter with twice its square makes them a tenth wider. Aslant of pixels it may
    be averaged less along it, and never more across it."""
    blur, turn, middle = 6.0, np.radians(degrees), WIDE * (HIGH // 2) + WIDE // 2
    way = np.array([np.cos(turn), np.sin(turn)])
    given = flat(blur, reflectance=1.0)
    normal = np.append(np.sqrt(1.0 - cosine**2) * way, cosine)
    given.firsts["n"] = given.firsts["ng"] = normal
    places = given.lobes["position"].copy()
    places[:, 2] = -(places @ np.append(normal[:2], 0.0)) / cosine
    light = np.ones((WIDE * HIGH, 3))
    light[middle] = 2.0
    out = resolved(light, seen(given.pixels, given.firsts, places))[:, 0].astype(float) - 1.0
    y, x = np.divmod(np.arange(WIDE * HIGH), WIDE) - np.array([[HIGH // 2], [WIDE // 2]])
    near = (np.abs(x) <= 24) & (np.abs(y) <= 24)
    along, across = (out * (x * a + y * b) ** 2 for a, b in (way, (-way[1], way[0])))
    assert out[near].sum() == pytest.approx(1.0, rel=1e-3)
    assert across[near].sum() == pytest.approx(min(2.0 * cosine**2, 1.0) * blur**2, rel=0.05)
    if degrees % 45 == 0:
        assert along[near].sum() == pytest.approx(blur**2, rel=0.05)
    least = min(2.0 * np.sqrt(2.0) * cosine, 1.0)
    assert least * blur < np.sqrt(along[near].sum() * 1.05) < 1.05 * blur


def test_the_way_that_lobes_are_drawn_out_is_in_pixels_that_are_not_square():
    given = flat()
    given.firsts["n"] = (0.6, 0.6, np.sqrt(0.28))
    wide = FROM_ABOVE._replace(right=(3.0, 0.0, 0.0))
    drawn = seen(given.pixels, given.firsts, given.lobes["position"], wide).drawn
    assert drawn[0] == pytest.approx((1 / np.sqrt(10), 3 / np.sqrt(10), np.sqrt(0.28)), abs=1e-6)


def test_light_from_beyond_one_mirror_is_averaged_more_widely_than_that_of_edges():
    """All paths met the same wall close by, which is a mirror or a lobe itself; or one of two walls."""
    middle = WIDE * (HIGH // 2) + WIDE // 2
    either = np.random.default_rng(5).integers(0, 2, WIDE * HIGH)
    light = np.ones((WIDE * HIGH, 3))
    light[middle] = 2.0
    variances = []
    for met in (0, SEVERAL, either):
        out = resolved(light, flat(1.0, reflectance=1.0, beyond=6.0, met=met))[:, 0].astype(float) - 1.0
        x, y = np.arange(WIDE * HIGH) % WIDE - WIDE // 2, np.arange(WIDE * HIGH) // WIDE - HIGH // 2
        variances.append((out * x**2)[(np.abs(x) <= 20) & (np.abs(y) <= 20)].sum())
    assert variances[0] == pytest.approx(36.0, rel=0.03)
    assert variances[1] == pytest.approx(1.0, rel=0.03)
    assert variances[2] < 4.0  # half of the pixels count by edges: twice as wide as these allow


def test_what_stands_out_is_spread_and_not_lost():
    given = flat(2.0, reflectance=1.0)
    light = np.ones((WIDE * HIGH, 3))
    middle = WIDE * (HIGH // 2) + WIDE // 2
    light[middle] = 1000.0
    out = resolved(light, given)
    assert out.sum(dtype=float) == pytest.approx(light.sum(), rel=1e-4)
    assert out.max() < 10.0


def test_light_is_neither_gained_nor_lost_where_neighbors_want_different_blurs():
    """Beside a contact pixels want less and less; each then takes of others what it gives them."""
    random = np.random.default_rng(4)
    x = np.arange(WIDE * HIGH) % WIDE
    blur = random.uniform(0.2, 1.0, len(x)) * np.abs(x - WIDE // 2) / 8
    alpha = random.uniform(0.08, 0.12, len(x))
    normals = random.normal((0, 0, 1), 0.01, (len(x), 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    given = flat(blur, alpha=alpha, n=normals, ng=normals, reflectance=1.0)
    light = np.exp(random.normal(0.0, 1.0, (len(x), 3))) + 50.0 * (np.abs(x - WIDE // 2) < 2)[:, None]
    out = resolved(light, given)
    assert not np.allclose(out, light, rtol=0.1)
    assert out.sum(axis=0, dtype=float) == pytest.approx(light.sum(axis=0), rel=1e-4)


def test_other_surfaces_are_left_out():
    given = flat()
    left = np.arange(WIDE * HIGH) % WIDE < WIDE // 2
    light = np.where(left, 1.0, 5.0)[:, None] * np.tile(given.firsts["reflectance"], (1, 3))
    for field, value in (("instance", 7), ("n", (0.6, 0.0, 0.8)), ("alpha", 0.2)):
        given = flat(where=left, **{field: value})
        assert resolved(light, given) == pytest.approx(light, rel=1e-5)


def test_pixels_without_paths_get_their_neighbors_light_and_lonely_ones_are_found():
    y, x = np.divmod(np.arange(WIDE * HIGH), WIDE)
    own = (x % 2 == 1) & (y % 2 == 1)
    given = flat(samples=own)
    light = 3.0 * np.tile(given.firsts["reflectance"], (1, 3))
    assert resolved(np.where(own[:, None], light, 0.0), given) == pytest.approx(light, rel=1e-5)
    assert not len(lonely_rows(given))
    alone = WIDE * 4 + 6
    given = flat(samples=own, where=alone, instance=3)
    assert list(lonely_rows(given)) == [alone]


def test_contacts_are_found_by_the_paths_beside_them():
    """What a pixel's own path finds does not decide whether others take its place."""
    y, x = np.divmod(np.arange(WIDE * HIGH), WIDE)

    def found(blur, most=WIDE * HIGH, **fields):
        return contact_rows(flat(blur, **fields), most, THREADS)

    close = np.zeros(len(x), bool)
    close[found(np.where(x < WIDE // 2, 0.5, 5.0))] = True
    assert close[x < WIDE // 2 - 2].all() and not close[x > WIDE // 2 + 2].any()
    alone = (x == 50) & (y == 50)
    assert not np.isin(np.flatnonzero(alone), found(np.where(alone, 0.01, 5.0))).any()
    assert not len(found(0.5, samples=4))
    ball = (np.abs(x - 40) < 10) & (np.abs(y - 40) < 10)  # turns by alpha from pixel to pixel
    normals = np.stack(
        [np.where(ball, 0.1 * (x - 40), 0), np.where(ball, 0.1 * (y - 40), 0), np.ones(len(x))], axis=1
    )
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    strong = dict(n=normals, reflectance=0.5)
    curved = found(5.0, **strong)
    assert ball[curved].all() and len(curved) > 0.8 * ball.sum()
    assert not len(found(5.0, most=len(curved) - 1, **strong))
    assert not len(found(5.0, n=normals, reflectance=0.2))  # one path is what such lobes send out
    both = np.where(x >= WIDE - 3, 0.1, 5.0)
    near = found(both, **strong)
    assert set(curved) < set(near)
    assert set(found(both, most=len(near) - 1, **strong)) == set(near) - set(curved)


def test_pixels_between_paths_that_were_lost_are_not_black():
    """One of 2 x 2 pixels has a path, and those above and below one without were lost in the surface: their
    light is 0, which counts, and they tell no width."""
    y, x = np.divmod(np.arange(WIDE * HIGH), WIDE)
    paths = (x % 2 == 0) & (y % 2 == 0)
    lost = (x == WIDE // 2) & np.isin(y, (HIGH // 2, HIGH // 2 + 2))
    given = flat(np.where(paths & ~lost, 5.0, 0.0), samples=paths.astype(int), reflectance=1.0)
    light = np.tile((paths & ~lost)[:, None], (1, 3)).astype(float)
    out = resolved(light, given)[:, 0].reshape(HIGH, WIDE)
    near = out[HIGH // 2 - 4 : HIGH // 2 + 7, WIDE // 2 - 4 : WIDE // 2 + 5]
    assert near.min() > 0.9  # 2 of some 5^2 pi paths are lost


def test_what_is_no_lobe_is_not_touched():
    given = flat(reflectance=0.0)
    light = np.random.default_rng(3).random((WIDE * HIGH, 9)).astype(np.float32)
    assert (resolved(light, given) == light).all()


@pytest.mark.parametrize("pixels", [1, 5000, 9000])
def test_bands_change_no_bit(monkeypatch, pixels):
    """Nor at gaps of the picture, rows without lobes, or lights that stand out beside a band's end."""
    random = np.random.default_rng(7)
    whole = flat(random.uniform(0.0, 9.0, WIDE * HIGH), where=slice(None))
    kept = np.flatnonzero((random.random(WIDE * HIGH) < 0.8) & (whole.pixels // WIDE != 40))
    given = seen(kept, whole.firsts[kept], whole.lobes["position"][kept])
    light = random.random((len(kept), 9)) * np.where(random.random(len(kept)) < 0.01, 500.0, 1.0)[:, None]
    expected = resolved(light, given)
    monkeypatch.setattr(resolve, "_BAND", pixels)
    assert resolved(light, given).tobytes() == expected.tobytes()
