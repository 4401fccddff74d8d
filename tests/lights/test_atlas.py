"""The plan of the shadow maps: who gets how many texels, and that nothing overlaps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ispm.library.shapes import box
from ispm.lights.atlas import (
    LEAST,
    Seen,
    ShadowAtlas,
    ShadowFace,
    pack_shelves,
    plan_atlas,
    shares,
    tile_sizes,
)
from ispm.lights.lightmap import light_maps
from ispm.scene.light import DirectionalLight, Light, PointLight, SpotLight
from ispm.scene.packed import Packed, pack
from ispm.scene.scene import Scene

DOWN = (-(0.5**0.5), 0.0, 0.0, 0.5**0.5)  # a rotation that turns -Z to -Y
EYE = np.array([0.0, 1.0, 6.0])


def packed_with(*lights: tuple[Light, tuple[float, float, float]]) -> Packed:
    scene = Scene()
    scene.add(box((-5.0, -0.1, -5.0), (5.0, 0.0, 5.0)))
    scene.add(box((-0.5, 0.0, -0.5), (0.5, 1.0, 0.5)))
    for light, place in lights:
        scene.add(light, translation=place, rotation=DOWN)
    return pack(scene)


def seen(points: np.ndarray, through: bool = False) -> Seen:
    """Points of the floor, a thousandth of their distance apart for the eye."""
    points = np.asarray(points, np.float32).reshape(-1, 3)
    widths = 1e-3 * np.linalg.norm(points - EYE, axis=1)
    return Seen(points, np.tile(np.float32((0.0, 1.0, 0.0)), (len(points), 1)), widths, 0.0 * widths, through)


def plan(
    packed: Packed, resolution: int = 256, limit: int = 8192, receivers: np.ndarray | None = None
) -> ShadowAtlas:
    boxes = np.array([[[-5.0, -0.1, -5.0], [5.0, 0.0, 5.0]], [[-0.5, 0.0, -0.5], [0.5, 1.0, 0.5]]])
    if receivers is None:
        x, z = np.meshgrid(np.linspace(-4.0, 4.0, 20), np.linspace(-4.0, 4.0, 20))
        receivers = np.stack([x.ravel(), 0.0 * x.ravel(), z.ravel()], axis=1)
    atlas = plan_atlas(packed.lights, light_maps(packed), boxes, seen(receivers), resolution, limit)
    assert atlas is not None
    return atlas


def square_face(wanted: float, finest: float = math.inf, width: float = 2.0) -> ShadowFace:
    window = np.array([[0.0, 0.0], [width, 2.0]])
    return ShadowFace(0, 0, np.zeros(3), np.eye(3), window, 0.0, math.inf, wanted, finest)


def test_tiles_do_not_overlap_and_lie_in_the_atlas() -> None:
    random = np.random.default_rng(1)
    sizes = random.choice([32, 64, 96, 160], (60, 2))
    sizes = sizes[np.argsort(-sizes[:, 1], kind="stable")]
    places, (width, height) = pack_shelves(sizes, 700)
    used = np.zeros((height, width), int)
    for (x, y), (across, down) in zip(places, sizes, strict=True):
        used[y : y + down, x : x + across] += 1
    assert used.max() == 1 and used.sum() == sizes.prod(axis=1).sum() and width <= 700
    assert used.sum() > 0.75 * width * height


@pytest.mark.parametrize("count", [1, 5, 60, 400])
def test_tile_sizes_keep_to_the_budget(count: int) -> None:
    wanted = np.random.default_rng(1).uniform(0.05, 1.0, count)
    budget = 12 * 1000**2
    sizes = tile_sizes([square_face(w) for w in wanted], 1000, budget)
    assert (sizes % 16 == 0).all() and sizes.min() >= LEAST and sizes.max() <= 1000
    assert sizes.prod(axis=1).sum() <= budget
    assert (np.diff(sizes[np.argsort(wanted), 0]) >= 0).all()  # more where more is wanted
    if count == 400:  # steps of 16 texels leave some of it
        assert sizes.prod(axis=1).sum() > 0.75 * budget


def test_tiles_are_no_finer_than_is_seen_and_as_long_as_their_windows() -> None:
    faces = [square_face(1.0, finest=100.0), square_face(0.5, finest=300.0, width=1.0), square_face(0.0)]
    sizes = tile_sizes(faces, 1024, 12 * 1024**2)
    assert sizes.tolist() == [[208, 208], [304, 608], [LEAST, LEAST]]  # 4 texels of guard, to whole 16s


def test_least_tiles_may_exceed_the_budget() -> None:
    assert (tile_sizes([square_face(1.0)] * 100, 32, 24 * 32**2) == LEAST).all()


def test_an_atlas_that_cannot_hold_all_lights_is_none() -> None:
    packed = packed_with(*[(PointLight(), (x, 2.0, 0.0)) for x in np.linspace(-4.0, 4.0, 30)])
    boxes = np.array([[[-5.0, -5.0, -5.0], [5.0, 5.0, 5.0]]])
    args = packed.lights, light_maps(packed), boxes, seen(np.zeros(3)), 256
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
        metres = tile.face.extent if tile.face.depth else tile.face.extent * 900.0
        assert tile.face.holds(corner).all() and sorted(metres) == pytest.approx([1.04, 2.08], rel=0.05)
        assert not tile.face.holds(np.array([[-1.0, 0.0, 0.0]], np.float32)).any()
        assert sees(tile.face, [[1.5, 50.0, 1.0], [1.6, 51.0, 1.1]])  # before it


def sees(face: ShadowFace, box: list[list[float]]) -> bool:
    low, high = np.array(box)[..., None]
    return bool(face.sees((low + high) / 2.0, (high - low) / 2.0)[0])


def test_windows_of_cubes_fit_what_is_lit() -> None:
    packed = packed_with((PointLight(), (0.0, 2.0, 0.0)))
    patch = np.array([[0.5, 0.0, 0.1], [1.5, 0.0, 1.1]], np.float32)
    below = [tile.face for tile in plan(packed, receivers=patch).tiles if tile.face.index == 3]
    (face,) = below
    assert face.holds(patch).all() and (face.extent <= 0.5 + 0.25).all()  # and up to an eighth at each side
    assert sees(face, [[0.4, 1.0, 0.2], [0.5, 1.1, 0.3]]) and not sees(
        face, [[-1.0, 0.5, -1.0], [-0.5, 1.0, 0.0]]
    )
    assert not sees(face, [[1.0, -2.1, 0.5], [1.1, -2.0, 0.6]])  # behind all that is lit
    assert face.sees(*boxes_about(patch)).all()


def boxes_about(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return points.T.astype(np.float64), np.full((3, len(points)), 1e-6)


def test_boxes_with_a_point_in_the_window_are_seen() -> None:
    """No box is left out that holds a place that the window shows; 4000 boxes, seed 3."""
    random = np.random.default_rng(3)
    frame = np.linalg.qr(random.normal(size=(3, 3)))[0]
    window = np.array([[-0.3, 0.1], [0.8, 0.9]])
    center, half = random.uniform(-4.0, 4.0, (3, 4000)), random.uniform(0.0, 0.6, (3, 4000))
    inner = (center + half * random.uniform(-1.0, 1.0, (3, 4000))).T
    for depth in (0.0, 5.0):
        face = ShadowFace(0, 0, np.array([0.2, 0.1, -0.3]), frame, window, depth, 3.0)
        held = face.holds(inner) & (np.linalg.norm(inner - face.origin, axis=1) < 3.0)
        assert face.sees(center, half)[held].all() and held.sum() > 20
        assert face.sees(center, half).mean() < 0.5


def test_texels_go_where_the_light_is_seen() -> None:
    """Of two equal lamps over the floor the one that lights what is near the eye gets finer texels in all."""
    packed = packed_with((PointLight(range=1.0), (-3.0, 0.5, 4.0)), (PointLight(range=1.0), (3.0, 0.5, -4.0)))
    x, z = np.meshgrid(np.linspace(-4.0, 4.0, 80), np.linspace(-4.5, 4.5, 90))
    floor = np.stack([x.ravel(), 0.0 * x.ravel(), z.ravel()], axis=1)
    finest = {t.face.light: t.face.finest for t in plan(packed, receivers=floor).tiles if t.face.index == 3}
    assert finest[0] > 1.5 * finest[1] > 0.0


def test_shares_are_those_of_the_lights() -> None:
    packed = packed_with(
        (PointLight((3.0, 2.0, 1.0), range=4.0), (0.0, 2.0, 0.0)),
        (DirectionalLight((5.0, 1.0, 1.0)), (0.0, 0.0, 0.0)),
        (SpotLight((1.0, 4.0, 1.0), inner_angle=0.2, outer_angle=0.4), (0.0, 2.0, 0.0)),
        (PointLight((9.0, 9.0, 9.0)), (0.0, -1.0, 0.0)),
    )  # fmt: skip
    points = np.array([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [2.0 * math.tan(0.3), 0.0, 0.0]])
    got = shares(packed.lights, seen(points))
    edge = (math.cos(0.3) - math.cos(0.4)) / (math.cos(0.2) - math.cos(0.4))
    distance = 2.0 / math.cos(0.3)
    lux = np.array([
        [0.75 * (1 - 2.0**-4), 0.0, 3.0 * (1 - (distance / 4.0) ** 4) / distance**2 * math.cos(0.3)],
        [5.0, 5.0, 5.0], [1.0, 0.0, edge**2 * math.cos(0.3) ** 3], [0.0, 0.0, 0.0],
    ])  # fmt: skip
    assert got == pytest.approx(lux / lux.sum(axis=0), rel=1e-4, abs=1e-7)
    assert (
        shares(packed.lights, seen(points, through=True))[3, [0, 2]] > 0.1
    ).all()  # what lies behind a sheet
