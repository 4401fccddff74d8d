"""The plan of the shadow maps: who gets how many texels, and that nothing overlaps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ispm.scene.atlas import (
    LEAST,
    ShadowAtlas,
    apparent_sizes,
    brightness,
    pack_shelves,
    plan_atlas,
    tile_sides,
)
from ispm.scene.light import DirectionalLight, Light, PointLight, SpotLight
from ispm.scene.packed import Packed, pack
from ispm.scene.scene import Scene
from ispm.scene.shapes import box

DOWN = (-(0.5**0.5), 0.0, 0.0, 0.5**0.5)  # a rotation that turns -Z to -Y
EYE = np.array([0.0, 1.0, 6.0, 1.0])


def packed_with(*lights: tuple[Light, tuple[float, float, float]]) -> Packed:
    scene = Scene()
    scene.add(box((-5.0, -0.1, -5.0), (5.0, 0.0, 5.0)))
    scene.add(box((-0.5, 0.0, -0.5), (0.5, 1.0, 0.5)))
    for light, place in lights:
        scene.add(light, translation=place, rotation=DOWN)
    return pack(scene)


def plan(
    packed: Packed, resolution: int = 256, limit: int = 8192, receivers: np.ndarray | None = None
) -> ShadowAtlas:
    boxes = np.array([[[-5.0, -0.1, -5.0], [5.0, 0.0, 5.0]], [[-0.5, 0.0, -0.5], [0.5, 1.0, 0.5]]])
    if receivers is None:
        x, z = np.meshgrid(np.linspace(-4.0, 4.0, 20), np.linspace(-4.0, 4.0, 20))
        receivers = np.stack([x.ravel(), 0.0 * x.ravel(), z.ravel()], axis=1).astype(np.float32)
    atlas = plan_atlas(packed.lights, packed.maps, boxes, receivers, EYE, resolution, limit)
    assert atlas is not None
    return atlas


def test_tiles_do_not_overlap_and_lie_in_the_atlas() -> None:
    sides = np.array([96] * 5 + [64] * 7 + [32] * 40)
    places, (width, height) = pack_shelves(sides, 400)
    used = np.zeros((height, width), int)
    for (x, y), side in zip(places, sides, strict=True):
        used[y : y + side, x : x + side] += 1
    assert used.max() == 1 and used.sum() == (sides**2).sum() and width <= 400
    assert (sides**2).sum() > 0.75 * width * height


@pytest.mark.parametrize("count", [1, 5, 60, 400])
def test_tile_sides_keep_to_the_budget(count: int) -> None:
    weights = np.random.default_rng(1).uniform(0.05, 1.0, count)
    sides = tile_sides(weights, 1000, 24 * 1000**2)
    assert (sides % 16 == 0).all() and sides.min() >= LEAST and sides.max() <= 1000
    assert (sides**2).sum() <= 24 * 1000**2
    order = np.argsort(weights)
    assert (np.diff(sides[order]) >= 0).all()  # more where more is seen
    if count == 400:  # a floor to 16 texels and the least sides leave some of it
        assert (sides**2).sum() > 0.75 * 24 * 1000**2


def test_least_tiles_may_exceed_the_budget() -> None:
    assert (tile_sides(np.full(100, 1.0), 32, 24 * 32**2) == LEAST).all()


def test_an_atlas_that_cannot_hold_all_lights_is_none() -> None:
    packed = packed_with(*[(PointLight(), (x, 2.0, 0.0)) for x in np.linspace(-4.0, 4.0, 30)])
    receivers = np.zeros((1, 3), np.float32)
    boxes = np.array([[[-5.0, -5.0, -5.0], [5.0, 5.0, 5.0]]])
    args = packed.lights, packed.maps, boxes, receivers, EYE, 256
    fits = plan_atlas(*args, 448)
    assert fits is not None and max(fits.size) <= 448 and len(fits.tiles) == 180
    assert plan_atlas(*args, 416) is None


def test_lights_ask_for_the_faces_that_they_need() -> None:
    lamps = [
        (PointLight(), (0.0, 2.0, 0.0)), (SpotLight(), (0.0, 2.0, 0.0)),
        (SpotLight(outer_angle=1.5), (0.0, 2.0, 0.0)), (DirectionalLight(), (0.0, 0.0, 0.0)),
        (PointLight(), (0.0, 900.0, 0.0)), (PointLight(range=1.0), (0.0, 5.0, 0.0)),
        (PointLight((0.0, 0.0, 0.0)), (0.0, 2.0, 0.0)),
    ]  # fmt: skip
    packed = packed_with(*lamps)
    faces = [[t.face.index for t in plan(packed).tiles if t.face.light == k] for k in range(len(lamps))]
    # +y sees nothing of what lies below; the box, 1 m high, is seen by the sides of a cube at 2 m
    assert sorted(faces[0]) == [0, 1, 3, 4, 5] and sorted(faces[2]) == [0, 1, 3, 4, 5]
    assert [len(f) for f in faces] == [5, 1, 5, 1, 1, 0, 0]


def test_windows_of_single_faces_fit_what_is_seen() -> None:
    packed = packed_with((DirectionalLight(), (0.0, 0.0, 0.0)), (PointLight(), (0.0, 900.0, 0.0)))
    corner = np.array([[1.0, 0.0, 1.0], [3.0, 0.0, 2.0]], np.float32)
    for tile in plan(packed, receivers=corner).tiles:
        inside = tile.face.holds(corner)[1]
        size = tile.face.window[1] - tile.face.window[0]
        metres = size if tile.face.depth else size * 900.0
        assert inside.all() and sorted(metres) == pytest.approx([1.04, 2.08], rel=0.05)
        assert tile.face.holds(np.array([[-1.0, 0.0, 0.0]], np.float32))[1][0] == np.False_
        assert tile.face.sees(np.array([[[1.5, 50.0, 1.0], [1.6, 51.0, 1.1]]])).all()  # before it


def test_texels_go_where_the_light_is_seen() -> None:
    packed = packed_with(
        (PointLight(range=0.5), (4.0, 0.2, -30.0)), (PointLight(), (0.0, 2.0, 3.0)),
    )  # fmt: skip
    irradiance = brightness(packed.lights, np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 1.0]]))
    sizes = apparent_sizes(packed.lights, irradiance, EYE)
    assert sizes[0] == pytest.approx(0.5 / math.dist((4.0, 0.2, -30.0), EYE[:3])) and sizes[1] == 1.0


def test_brightness_is_that_of_the_lights() -> None:
    packed = packed_with(
        (PointLight((3.0, 2.0, 1.0), range=4.0), (0.0, 2.0, 0.0)),
        (DirectionalLight((5.0, 1.0, 1.0)), (0.0, 0.0, 0.0)),
        (SpotLight((1.0, 4.0, 1.0), inner_angle=0.2, outer_angle=0.4), (0.0, 2.0, 0.0)),
    )  # fmt: skip
    point = np.array([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [2.0 * math.tan(0.3), 0.0, 0.0]])
    got = brightness(packed.lights, point)
    edge = (math.cos(0.3) - math.cos(0.4)) / (math.cos(0.2) - math.cos(0.4))
    assert got[0] == pytest.approx([0.75 * (1 - 2.0**-4), 0.0, got[0, 2]]) and (got[1] == 5.0).all()
    assert got[2] == pytest.approx([1.0, 0.0, edge**2 * math.cos(0.3) ** 2], rel=1e-5)
