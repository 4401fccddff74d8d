"""Views aimed at what casts caustics: they hold it, are few, and narrow."""

import math
from itertools import pairwise

import numpy as np
import pytest

from ispm.library.shapes import box, icosphere
from ispm.lights.aim import aimed_maps, near_maps, seen_boxes, seen_maps
from ispm.lights.lightmap import LightMap, light_maps
from ispm.scene.extent import corners_of
from ispm.scene.light import DirectionalLight, Light, PointLight, SpotLight
from ispm.scene.material import Material
from ispm.scene.packed import Packed, pack
from ispm.scene.scene import Scene

ROOM = ((-10.0, 0.0, -10.0), (10.0, 8.0, 10.0))


def lit_room(light: Light, position: tuple[float, ...] = (0.0, 6.0, 0.0)) -> Packed:
    scene = Scene()
    scene.add(box(*ROOM))
    scene.add(light, translation=position, rotation=(-0.6, 0.15, 0.1, 0.78))
    return pack(scene)


def aimed(light: Light, boxes: np.ndarray, most: int = 8, **where: tuple[float, ...]) -> list[LightMap]:
    packed = lit_room(light, **where)
    return aimed_maps(light_maps(packed)[0], packed.lights[0], corners_of(boxes), most)


def boxes_at(centers: object, half: float = 0.3) -> np.ndarray:
    centers = np.asarray(centers, float)
    return np.stack([centers - half, centers + half], axis=1)


def sees(map: LightMap, boxes: np.ndarray) -> np.ndarray:
    """Which boxes a map holds altogether, (n,)."""
    s, t, axis = np.moveaxis((corners_of(boxes) - map.origin) @ map.axes[0].T, -1, 0)
    edge = np.ones_like(axis) if map.orthographic else axis
    return np.asarray((np.maximum(abs(s), abs(t)) <= edge).all(axis=1))


def grid(side: int, spacing: float) -> np.ndarray:
    x, z = np.meshgrid(*[(np.arange(side) - (side - 1) / 2) * spacing] * 2)
    return np.stack([x, np.full_like(x, 1.0), z], axis=-1).reshape(-1, 3)


@pytest.mark.parametrize("light", [PointLight(), DirectionalLight()])
@pytest.mark.parametrize(("side", "spacing"), [(1, 1.0), (2, 6.0), (5, 1.0), (16, 0.4)])
def test_every_box_is_seen_by_a_map(light, side, spacing):
    boxes = boxes_at(grid(side, spacing), min(0.3, 0.3 * spacing))
    maps = aimed(light, boxes)
    assert 1 <= len(maps) <= 8
    assert np.any([sees(map, boxes) for map in maps], axis=0).all()


def test_near_boxes_share_a_map_and_distant_ones_do_not():
    near = boxes_at([(-5.0, 1.0, 0.0), (-5.2, 1.0, 0.3), (-4.8, 1.2, 0.1)])
    far = boxes_at([(6.0, 1.0, 3.0), (6.0, 1.0, -6.0)])
    for light in (PointLight(), DirectionalLight()):
        maps = aimed(light, np.concatenate([near, far]))
        assert sorted(int(sees(map, near).sum()) for map in maps) == [0, 0, 3]
        one = aimed(light, far, most=1)
        assert len(one) <= 1


def test_a_box_behind_another_shares_its_map():
    """Seen from the light they overlap, however far apart they are."""
    light = np.array([0.0, 6.0, 0.0])
    way = np.array([0.5, -0.5, 0.7])
    assert len(aimed(PointLight(), boxes_at([light + 1.5 * way, light + 8.0 * way]))) == 1


def test_maps_are_narrow_and_take_little_of_their_light():
    boxes = boxes_at(grid(9, 2.2), 0.2)
    packed = lit_room(PointLight())
    for map in aimed_maps(light_maps(packed)[0], packed.lights[0], corners_of(boxes), 8):
        assert map.spread < math.tan(0.6) and map.measure < light_maps(packed)[0].measure / 3


def test_no_map_for_a_box_round_the_light_or_close_to_it():
    assert aimed(PointLight(), boxes_at([(0.0, 6.0, 0.0)])) == []
    assert aimed(PointLight(), boxes_at([(0.0, 5.5, 0.1)], 0.4)) == []
    assert aimed(PointLight(), np.zeros((0, 2, 3))) == []
    both = aimed(PointLight(), boxes_at([(0.0, 6.0, 0.0), (4.0, 1.0, 0.0)]))
    assert len(both) == 1 and sees(both[0], boxes_at([(4.0, 1.0, 0.0)])).all()


def test_no_map_where_a_spot_does_not_shine():
    packed = lit_room(SpotLight(outer_angle=0.3))
    ahead = packed.lights["direction"][0].astype(float)
    for way, count in ((ahead, 1), (-ahead, 0), (np.cross(ahead, (0.3, 0.9, 0.1)), 0)):
        boxes = boxes_at([light_maps(packed)[0].origin + 5.0 * way], 0.2)
        assert len(aimed_maps(light_maps(packed)[0], packed.lights[0], corners_of(boxes), 8)) == count


def test_thousands_of_boxes_are_grouped():
    boxes = boxes_at(np.random.default_rng(0).uniform((-9, 0, -9), (9, 2, 9), (3000, 3)), 0.02)
    assert len(aimed(DirectionalLight(), boxes)) <= 8


def test_a_ball_fills_its_view():
    scene = Scene()
    scene.add(box(*ROOM))
    mirror = Material(metallic=1.0, roughness=0.0)
    ball = scene.add(icosphere(1.0, 8), material=mirror, translation=(3, 0, 2))
    scene.add(PointLight(), translation=(0, 4, 0))
    packed = pack(scene)
    far = float(np.linalg.norm(np.subtract(ball.translation, (0, 4, 0))))
    (map,) = aimed_maps(light_maps(packed)[0], packed.lights[0], packed.caustic_hulls, 8)
    exact = 1.0 / math.sqrt(far * far - 1.0)  # tangent of half the angle under which a ball is seen
    assert 0.97 * exact < map.spread < 1.06 * exact


def plain_seen(side: float, light: Light, spread: float = 1.0) -> tuple[list[LightMap], Packed, np.ndarray]:
    """Maps of a square plain of which the eye sees places about (2, 0, 3)."""
    scene = Scene()
    scene.add(box((-side / 2, -1.0, -side / 2), (side / 2, 0.0, side / 2)))
    scene.add(light, rotation=(-0.5, 0.3, 0.0, 0.8), translation=(0.0, 5.0, 0.0))
    packed = pack(scene)
    seen = np.random.default_rng(0).normal((2.0, 0.0, 3.0), (spread, 0.0, spread), (1000, 3))
    return seen_maps(light_maps(packed)[0], seen), packed, seen


@pytest.mark.parametrize("side", [100.0, 1e4])
def test_the_sun_looks_at_what_the_eye_sees(side):
    """Not at all of the plain, however large it is."""
    maps, packed, seen = plain_seen(side, DirectionalLight())
    sizes = [light_maps(packed)[0].measure, *(map.measure for map in maps)]
    assert len(maps) >= 1 and all(small < large / 3.0 for large, small in pairwise(sizes))
    close = [map for map in maps if map.measure < 200.0]  # m2: places within some 6 m, a quarter about them
    points = np.stack([seen - 0.01, seen + 0.01], axis=1)
    assert sees(close[0], points).mean() > 0.98


@pytest.mark.parametrize("side", [100.0, 1e4])
def test_photons_of_a_sun_thin_out_with_the_distance(side):
    """Each map is at most three times as wide as the next, up to all of the plain: were there one step from
    all to what is seen, the few photons from beyond would carry a thousand times the light of others."""
    maps, packed, _ = plain_seen(side, DirectionalLight())
    outer = [light_maps(packed)[0].measure, *(map.measure for map in maps if map.measure > 200.0)]
    inner = [map.measure for map in maps]
    # the plain's own map stands askew to them: up to twice its area
    assert all(large < 2.0 * 9.0 * small for large, small in zip(outer, inner, strict=False))


def test_boxes_about_what_is_seen_lie_in_each_other():
    bounds = np.array([(-500.0, -1.0, -500.0), (500.0, 30.0, 500.0)])
    seen = np.random.default_rng(0).normal((2.0, 0.0, 3.0), (1.0, 0.0, 1.0), (1000, 3))
    boxes = [bounds, *seen_boxes(bounds, seen)]
    for large, small in pairwise(boxes):
        assert (large[0] <= small[0]).all() and (small[1] <= large[1]).all()
        assert np.ptp(small, axis=0)[0] >= np.ptp(large, axis=0)[0] / 9.0
    inside = ((seen >= boxes[-1][0]) & (seen <= boxes[-1][1])).all(axis=1)
    assert inside.mean() > 0.25 and np.ptp(boxes[-1], axis=0).max() < 4.0
    assert seen_boxes(bounds, np.zeros((0, 3))) == []
    assert seen_boxes(bounds, np.random.default_rng(1).uniform(*bounds, (1000, 3))) == []


def test_the_sun_looks_closer_where_places_are_close():
    """Half the places within 1 m, the others within 300 m: a map of all, and one of the middle."""
    _, packed, near = plain_seen(1e4, DirectionalLight(), 0.3)
    far = np.random.default_rng(1).normal((2.0, 0.0, 3.0), (100.0, 0.0, 100.0), (500, 3))
    wide, *_, narrow = seen_maps(light_maps(packed)[0], np.concatenate([near, far]))
    assert narrow.measure < 0.01 * wide.measure


def test_the_sun_looks_at_ground_that_lights_a_room_in_the_shade():
    """Places that the sun shines on decide where most are 20 m beside what is seen, not where few are."""
    _, packed, seen = plain_seen(1e3, DirectionalLight(), 0.3)
    base, beside = light_maps(packed)[0], seen + np.array((20.0, 0.0, 0.0))
    alike = np.concatenate([seen, beside[::2]])
    for lit, aimed in ((None, seen), (beside, beside), (alike, seen), (beside[:3], seen)):
        for one, other in zip(near_maps(base, seen, lit), seen_maps(base, aimed), strict=True):
            np.testing.assert_array_equal(one.origin, other.origin)


def test_nothing_is_gained_by_looking_at_all_or_from_a_point():
    _, packed, _ = plain_seen(6.0, DirectionalLight())
    everywhere = np.random.default_rng(0).uniform((-3.0, 0.0, -3.0), (3.0, 0.0, 3.0), (1000, 3))
    assert seen_maps(light_maps(packed)[0], everywhere) == []
    assert plain_seen(100.0, PointLight())[0] == []
    _, packed, _ = plain_seen(100.0, DirectionalLight())
    assert seen_maps(light_maps(packed)[0], np.zeros((0, 3))) == []


def test_hulls_of_caustic_instances_are_packed():
    scene = Scene()
    unit = box((-1, -1, -1), (1, 1, 1))
    scene.add(unit, material=Material())
    mirror = Material(metallic=1.0, roughness=0.0)
    scene.add(unit, material=mirror, translation=(5, 0, 0), scale=(1, 2, 3))
    packed = pack(scene)
    assert packed.boxes.shape == (2, 2, 3)
    (hull,) = packed.caustic_hulls
    assert hull.min(axis=0) == pytest.approx((4, -2, -3)) and hull.max(axis=0) == pytest.approx((6, 2, 3))


def test_what_is_round_the_light_or_fills_its_map_takes_none_from_the_others():
    """A globe of glass about a lamp and a pane just below it have no map, and small things keep theirs."""
    light, small = PointLight(), boxes_at([(-5.0, 1.0, 0.0), (4.0, 1.0, 3.0)])
    globe, pane = boxes_at([(0.0, 6.0, 0.0)], 0.2), boxes_at([(0.0, 2.9, 0.0)], 3.0)
    alone, beside = aimed(light, small), aimed(light, np.concatenate([globe, small, pane]))
    assert len(beside) == len(alone) == 2
    assert np.any([sees(map, small) for map in beside], axis=0).all()
    assert not aimed(light, globe) and not aimed(light, pane)
