"""Small scenes, each with one bias of photon density estimation at its strongest, and where it lives."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from transport import SIDES, box_room

from ispm.library.common import add_camera, lambert
from ispm.library.rooms import cornell_box, integrating_sphere
from ispm.library.shapes import box, icosphere, lathe, polygons
from ispm.scene.light import PointLight
from ispm.scene.material import Texture
from ispm.scene.scene import Scene

Triple = tuple[float, float, float]
Masks = dict[str, np.ndarray]

BOUNCES = 8
_ALBEDO = 0.7
_SUNK = 0.02  # m that a thing is below the floor it stands on
_NEAR_EDGE = 8  # pixels
_APART = 0.1  # m between neighbouring pixels' places, from which a surface ends there


@dataclass(frozen=True)
class Seen:
    """What pixels see: (h, w, 3) places in m and normals, world space."""

    position: np.ndarray
    normal: np.ndarray


@dataclass(frozen=True)
class Case:
    """A scene in which a bias is measured.

    title    of the bias
    treated  by what in the renderer, in a few words
    scene    builds it
    regions  where: masks by name from what is seen; the first has the bias, the rest is to compare with
    exact    radiance of indirect light by region, cd/m2, where it is known; elsewhere paths tell
    unit     cd/m2 that errors are shares of; None: the truth
    knobs    settings of its own
    finest   builds the scene whose truth its first region is compared with as well
    contrast the figure is not of the mean of a region but of its contrast
    flicker  its boiling is measured as well
    """

    title: str
    treated: str
    scene: Callable[[], Scene]
    regions: Callable[[Seen], Masks]
    exact: Mapping[str, float] = field(default_factory=dict)
    unit: float | None = None
    knobs: Mapping[str, Any] = field(default_factory=dict)
    finest: Callable[[], Scene] | None = None
    contrast: bool = False
    flicker: bool = False


def cases() -> dict[str, list[Case]]:
    """Return all by the name of their bias, in the page's order."""
    sphere_light = _ALBEDO * 100.0 / (4.0 * math.pi**2 * 2.0**2) * _later(_ALBEDO)
    balls = [
        Case(
            f"{20 * cuts**2:,} triangles", "shading normals; adjoint factor", partial(_ball, cuts), _on_ball,
            finest=None if cuts == _FINEST else partial(_ball, _FINEST),
        )
        for cuts in (2, 4, _FINEST)
    ]  # fmt: skip
    return {
        "edges": [Case("table, box", "rays; normalised filter", _table_room, near_edges, flicker=True)],
        "leaks": [
            Case(
                "wall between rooms", "rays; photons count from their side", _two_rooms, _by_partition,
                exact={"by the wall": 0.0, "rest": 0.0}, unit=_lit_rooms_mean(),
            ),
            Case("screen's foot, dark side", "rays", _screen, _behind_screen),
        ],
        "curves": [
            Case("columns", "rays; kernels a quarter as wide", _columns, _on_columns, flicker=True),
            Case(
                "inside of a sphere", "flat kernels' height", lambda: integrating_sphere(2.0, _ALBEDO, 100.0),
                _whole, exact={"whole": sphere_light},
            ),
        ],
        "normals": balls,
        "grazing": [Case("corridor", "rays", _corridor, _far_half, flicker=True)],
        "few": [
            Case(
                f"{count:,} photons", "kernels of 15; rays", cornell_box, near_edges,
                knobs={"photons": count}, flicker=count == 40_000,
            )
            for count in (1_000, 4_000, 40_000)
        ],
        "bumps": [
            Case(
                f"contrast, subsampling {k}", "fits to shading normals", _bumpy_room, _bumpy,
                knobs={"subsampling": k}, contrast=True,
            )
            for k in (4, 1)
        ],
    }  # fmt: skip


def _later(albedo: float) -> float:
    """Indirect light over direct light where every wall reflects as much, cut off as in the settings."""
    return sum(albedo**k for k in range(1, BOUNCES + 1))


# --- where in the picture


def near_edges(seen: Seen) -> Masks:
    """Pixels within eight of a concave edge, of the end of a surface, and the rest."""
    concave, ends = np.zeros((2, *seen.position.shape[:2]), np.bool_)
    for here, there in (
        (np.s_[:, :-1], np.s_[:, 1:]),
        (np.s_[:-1], np.s_[1:]),
    ):
        step = seen.position[there] - seen.position[here]
        above_here = (step * seen.normal[here]).sum(axis=-1)
        above_there = -(step * seen.normal[there]).sum(axis=-1)
        distance = np.linalg.norm(step, axis=-1)
        turned = (seen.normal[here] * seen.normal[there]).sum(axis=-1) < 0.9
        apart = (np.maximum(abs(above_here), abs(above_there)) > _APART) & (distance > _APART)
        inward = turned & ~apart & (above_here > 0.0) & (above_there > 0.0)
        for mask, found in ((concave, inward), (ends, apart)):
            mask[here] |= found
            mask[there] |= found
    shown = seen.normal.any(axis=-1)
    concave, ends = _widened(concave) & shown, _widened(ends) & shown
    return {"concave edges": concave, "silhouettes": ends & ~concave, "rest": shown & ~concave & ~ends}


def _widened(mask: np.ndarray) -> np.ndarray:
    for axis in (0, 1):
        pad = [(0, 0), (0, 0)]
        pad[axis] = (_NEAR_EDGE, _NEAR_EDGE)
        mask = sliding_window_view(np.pad(mask, pad), 2 * _NEAR_EDGE + 1, axis).any(axis=-1)
    return mask


def _whole(seen: Seen) -> Masks:
    return {"whole": seen.normal.any(axis=-1)}


def _parted(name: str, mask: np.ndarray, seen: Seen) -> Masks:
    return {name: mask, "rest": seen.normal.any(axis=-1) & ~mask}


def _by_partition(seen: Seen) -> Masks:
    return _parted("by the wall", seen.position[..., 2] < 0.25, seen)


def _behind_screen(seen: Seen) -> Masks:
    x, y, z = np.moveaxis(seen.position, -1, 0)
    foot = (y < 0.01) & (abs(x - 2.0) < 0.9) & (z < 2.0) & (z > 1.8)
    return _parted("its foot", foot, seen)


_COLUMNS = ((0.08, 1.0, 2.6), (0.2, 2.0, 2.9), (0.4, 3.1, 2.6))  # radius, x, z in a room 4 m wide


def _on_columns(seen: Seen) -> Masks:
    x, y, z = np.moveaxis(seen.position, -1, 0)
    on = {
        f"radius {radius / 4.0:.0%}": (np.hypot(x - cx, z - cz) < 1.01 * radius) & (y > 0.01)
        for radius, cx, cz in _COLUMNS
    }
    return {**on, "rest": seen.normal.any(axis=-1) & ~np.any(list(on.values()), axis=0)}


_BALL = np.array([2.0, 1.2, 2.2])
_BALL_RADIUS = 0.7
_FINEST = 32  # cuts along an edge


def _on_ball(seen: Seen) -> Masks:
    return _parted("ball", np.linalg.norm(seen.position - _BALL, axis=-1) < 1.01 * _BALL_RADIUS, seen)


def _far_half(seen: Seen) -> Masks:
    return _parted("beyond 5 m", seen.position[..., 0] > 5.0, seen)


def _bumpy(seen: Seen) -> Masks:
    x, y, z = np.moveaxis(seen.position, -1, 0)
    return {"wall": (abs(x - 2.0) < 0.4) & (abs(y - 1.2) < 0.4) & (z > 3.99)}


# --- the scenes


def _room(size: Triple) -> Scene:
    return box_room((0.0, 0.0, 0.0), size, _ALBEDO)


def _light(scene: Scene, place: Triple, intensity: float = 6.0) -> None:
    scene.add(PointLight((intensity,) * 3), name="light", translation=place)


def _block(scene: Scene, low: Triple, high: Triple) -> None:
    scene.add(box(low, high), material=lambert((_ALBEDO,) * 3))


def _table_room() -> Scene:
    scene = _room((4.0, 3.0, 4.0))
    _block(scene, (2.5, -_SUNK, 2.6), (3.3, 1.0, 3.4))
    _block(scene, (0.7, 0.7, 1.9), (1.9, 0.75, 2.7))
    for x in (0.75, 1.79):
        for z in (1.95, 2.59):
            _block(scene, (x, -_SUNK, z), (x + 0.06, 0.72, z + 0.06))
    _light(scene, (2.2, 2.6, 1.6))
    add_camera(scene, (2.1, 1.9, 0.15), (1.9, 0.8, 3.0), math.radians(60.0))
    return scene


_ROOMS = 4.0, 3.0, 4.0  # m, of each of the two
_ROOMS_LIGHT = 6.0


def _two_rooms() -> Scene:
    """Two rooms and one wall without thickness at z = 0, the lamp before it, the eye behind."""
    x, y, z = _ROOMS
    scene = box_room((0.0, 0.0, -z), (x, y, z), _ALBEDO)
    corners = np.array(
        [[-0.1, -0.1, 0], [x + 0.1, -0.1, 0], [x + 0.1, y + 0.1, 0], [-0.1, y + 0.1, 0]], float
    )
    scene.add(polygons([corners], "wall"), material=lambert((_ALBEDO,) * 3, double_sided=True))
    _light(scene, (1.4, 2.4, -1.6), _ROOMS_LIGHT)
    add_camera(scene, (2.8, 1.8, 3.7), (1.8, 1.2, 0.0), math.radians(60.0))
    return scene


def _lit_rooms_mean() -> float:
    """Mean radiance of indirect light in the room that is lit: closed, and all surfaces reflect as much."""
    x, y, z = _ROOMS
    flux, area = 4.0 * math.pi * _ROOMS_LIGHT * _later(_ALBEDO), 2.0 * (x * y + y * z + z * x)
    return _ALBEDO / math.pi * flux / area


def _screen() -> Scene:
    """A sheet 2 m wide that stands on a floor, the lamp behind it."""
    scene = _room((4.0, 3.0, 4.0))
    corners = np.array([[1, -_SUNK, 2], [3, -_SUNK, 2], [3, 1.5, 2], [1, 1.5, 2]], float)
    scene.add(polygons([corners], "screen"), material=lambert((_ALBEDO,) * 3, double_sided=True))
    _light(scene, (2.0, 1.2, 3.2))
    add_camera(scene, (2.6, 1.9, 0.15), (2.0, 0.3, 2.0), math.radians(60.0))
    return scene


def _columns() -> Scene:
    scene = _room((4.0, 3.0, 4.0))
    for radius, x, z in _COLUMNS:
        column = lathe([(radius, -_SUNK), (radius, 3.0 + _SUNK)], 64, "column")
        scene.add(column, material=lambert((_ALBEDO,) * 3), translation=(x, 0.0, z))
    _light(scene, (2.4, 2.4, 1.4))
    add_camera(scene, (2.0, 1.6, 0.15), (2.0, 1.4, 3.0), math.radians(60.0))
    return scene


def _ball(cuts: int) -> Scene:
    scene = _room((4.0, 3.0, 4.0))
    scene.add(icosphere(_BALL_RADIUS, cuts, "ball"), material=lambert((_ALBEDO,) * 3), translation=_BALL)
    _light(scene, (0.8, 2.5, 1.6))
    add_camera(scene, (2.2, 1.6, 0.15), (2.0, 1.2, 3.0), math.radians(55.0))
    return scene


def _corridor() -> Scene:
    scene = _room((20.0, 1.0, 1.5))
    _light(scene, (0.4, 0.6, 0.7))
    add_camera(scene, (0.2, 0.75, 0.9), (20.0, 0.4, 0.7), math.radians(50.0))
    return scene


def _bumpy_room() -> Scene:
    """A wall of bumps a tenth of a metre wide, whose indirect light comes from the left above all."""
    scene = _room((4.0, 3.0, 4.0))
    x, y = np.meshgrid(*[2.0 * np.pi * (np.arange(64) + 0.5) / 64] * 2)
    slope = np.stack([-np.cos(x), np.cos(y), np.ones_like(x)], axis=-1)
    slope /= np.linalg.norm(slope, axis=-1, keepdims=True)
    texels = np.concatenate([0.5 + 0.5 * slope, np.ones((64, 64, 1))], axis=-1)
    bumps = Texture(np.rint(255.0 * texels).astype(np.uint8), srgb=False)
    part = scene[SIDES[5]].parts[0]
    part.mesh.uv0 = 10.0 * part.mesh.positions[:, :2].astype(np.float32)
    part.material = replace(part.material, normal_texture=bumps)
    _light(scene, (0.8, 1.2, 2.2))
    add_camera(scene, (2.0, 1.3, 2.6), (2.0, 1.2, 4.0), math.radians(60.0))
    return scene
