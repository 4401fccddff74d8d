"""Meshes of simple solids: `ispm.shapes.sphere(0.5)`.

Each stands about the origin, its axis along +Y, with default measures of 1 m across. Fronts, and the normals
of vertices, look outwards. Texture coordinates `uv0` lie in 0 to 1, with v downwards as in glTF: a picture
stands upright and is not mirrored, seen from outside. All lengths are in metres.
Raises SceneError for measures that make no solid.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.errors import SceneError
from ispm.scene.mesh import Mesh
from ispm.scene.values import FARTHEST, LEAST, Point, require

__all__ = ["box", "cone", "cylinder", "plane", "sphere", "torus"]

_MAX_SEGMENTS = 4096  # segments


def plane(width: float = 1.0, depth: float = 1.0, *, name: str = "plane") -> Mesh:
    """Return a rectangle on the floor that faces +Y: 2 triangles.

    width, depth  along X and Z, metres
    A picture has its left at -X and its top at -Z.
    """
    _require("plane", "width", width)
    _require("plane", "depth", depth)
    return _joined([_rectangle((width, 0.0, 0.0), (0.0, 0.0, -depth), (0.0, 0.0, 0.0))], name)


def box(size: float | Point = 1.0, *, name: str = "box") -> Mesh:
    """Return a closed box: 12 triangles, sharp edges.

    size  its edge, or (3,) its edges along X, Y and Z, metres
    Each face has the whole picture; that on top has its top at -Z, that below at +Z.
    """
    if isinstance(size, int | float | np.integer | np.floating):
        _require("box", "size", size)
        size = (float(size),) * 3
    require("box: size", size, LEAST, FARTHEST, 3)
    x, y, z = np.diag(np.asarray(size, float))
    sides = [(x, y, z), (-z, y, x), (-x, y, -z), (z, y, -x), (x, -z, y), (x, z, -y)]
    return _joined([_rectangle(right, up, out / 2.0) for right, up, out in sides], name)


def sphere(radius: float = 0.5, *, segments: int = 64, rings: int = 32, name: str = "sphere") -> Mesh:
    """Return a closed sphere, smooth: 2 segments (rings - 1) triangles between meridians and parallels.

    radius    metres
    segments  round the equator
    rings     from pole to pole
    A picture goes once round it: its middle looks to +Z, its top is the pole at +Y, as of maps of the earth.
    """
    _require("sphere", "radius", radius)
    _count("sphere", "segments", segments, 3)
    _count("sphere", "rings", rings, 2)
    angle = np.linspace(0.0, math.pi, rings + 1)
    out = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    out[[0, -1], 0] = 0.0  # on the axis exactly
    return _joined([_turned(radius * out, out, segments, np.linspace(0.0, 1.0, rings + 1))], name)


def cylinder(
    radius: float = 0.5, height: float = 1.0, *, segments: int = 64, caps: bool = True, name: str = "cylinder"
) -> Mesh:
    """Return a cylinder, smooth round its axis, with sharp rims: 4 segments triangles, 2 without caps.

    radius, height  metres
    segments        round the axis
    caps            whether its ends are closed
    A picture goes once round the side, its middle at +Z; each cap shows the disc cut out of one.
    """
    _require("cylinder", "radius", radius)
    _require("cylinder", "height", height)
    _count("cylinder", "segments", segments, 3)
    half = 0.5 * height
    side = np.array([[radius, half], [radius, -half]])
    parts = [_turned(side, np.array([[1.0, 0.0], [1.0, 0.0]]), segments, np.array([0.0, 1.0]))]
    if caps:
        parts += [_disc(radius, half, segments), _disc(radius, -half, segments)]
    return _joined(parts, name)


def cone(
    radius: float = 0.5, height: float = 1.0, *, segments: int = 64, caps: bool = True, name: str = "cone"
) -> Mesh:
    """Return a cone with its tip at +Y, half the height above the origin: 2 segments triangles.

    radius, height  of its base and from there to the tip, metres
    segments        round the axis
    caps            whether its base is closed: without, segments triangles
    A picture goes once round the side, its middle at +Z, its top at the tip.
    """
    _require("cone", "radius", radius)
    _require("cone", "height", height)
    _count("cone", "segments", segments, 3)
    half = 0.5 * height
    out = np.array([[height, radius], [height, radius]]) / math.hypot(radius, height)
    side = np.array([[0.0, half], [radius, -half]])
    parts = [_turned(side, out, segments, np.array([0.0, 1.0]))]
    if caps:
        parts.append(_disc(radius, -half, segments))
    return _joined(parts, name)


def torus(
    radius: float = 0.375, tube: float = 0.125, *, segments: int = 64, sides: int = 32, name: str = "torus"
) -> Mesh:
    """Return a closed ring that lies on the XZ plane, smooth: 2 segments sides triangles.

    radius    from the axis to the middle of the tube, metres
    tube      its own radius, less than the other
    segments  round the axis
    sides     round the tube
    A picture goes once round the axis, its middle at +Z, and once round the tube, its top and bottom inside.
    """
    _require("torus", "radius", radius)
    require("torus: tube, less than the radius,", tube, LEAST, math.nextafter(radius, 0.0))
    _count("torus", "segments", segments, 3)
    _count("torus", "sides", sides, 3)
    angle = np.linspace(math.pi, -math.pi, sides + 1)  # from inside, over the top, outside, below
    out = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    out[-1] = out[0]
    profile = np.array([radius, 0.0]) + tube * out
    return _joined([_turned(profile, out, segments, np.linspace(0.0, 1.0, sides + 1))], name)


class _Piece(NamedTuple):
    """A part of a mesh: (V, 3) positions in m and normals, (V, 2) uv, (T, 3) triangles."""

    positions: np.ndarray
    normals: np.ndarray
    uv: np.ndarray
    triangles: np.ndarray


def _rectangle(right: Point, up: Point, middle: Point) -> _Piece:
    """A rectangle that shows a picture, with its edges along `right` and `up`."""
    along, across = np.asarray(right, float), np.asarray(up, float)
    uv = np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]])
    points = np.asarray(middle, float) + (uv[:, :1] - 0.5) * along + (0.5 - uv[:, 1:]) * across
    normal = np.cross(along, across)
    normals = np.tile(normal / np.linalg.norm(normal), (4, 1))
    return _Piece(points, normals, uv, np.array([[0, 1, 2], [0, 2, 3]]))


def _turned(profile: np.ndarray, out: np.ndarray, segments: int, v: np.ndarray) -> _Piece:
    """A profile turned about Y; rows on the axis get a vertex for each segment, in the middle of it.

    profile, out  (k, 2) radius and y of the points from top to bottom, and of their unit normals
    v             (k,) down the picture
    """
    u = np.tile(np.arange(segments + 1) / segments, (len(profile), 1))
    pole = np.equal(profile[:, 0], 0.0)
    u[0] += 0.5 / segments * pole[0]
    u[-1] -= 0.5 / segments * pole[-1]
    angle = 2.0 * math.pi * (u - 0.5)
    turn = np.stack([np.sin(angle), np.ones_like(angle), np.cos(angle)], axis=-1)
    positions = turn * profile[:, None, [0, 1, 0]]
    normals = turn * out[:, None, [0, 1, 0]]
    round_ = ~pole  # where the seam closes exactly
    positions[round_, -1], normals[round_, -1] = positions[round_, 0], normals[round_, 0]
    k = np.arange(len(profile) * (segments + 1)).reshape(len(profile), segments + 1)
    a, b, c, d = k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]
    lower, upper = ~pole[1:], ~pole[:-1]
    halves = np.stack([a, b, c], axis=-1)[lower], np.stack([a, c, d], axis=-1)[upper]
    triangles = np.concatenate([half.reshape(-1, 3) for half in halves])
    uv = np.stack([u, np.broadcast_to(v[:, None], u.shape)], axis=-1)
    return _Piece(positions.reshape(-1, 3), normals.reshape(-1, 3), uv.reshape(-1, 2), triangles)


def _disc(radius: float, y: float, segments: int) -> _Piece:
    """A disc across the axis at `y`, that faces away from the origin."""
    up = math.copysign(1.0, y)
    angle = 2.0 * math.pi * (np.arange(segments) / segments - 0.5)  # as of the side, so that rims meet
    rim = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    flat = np.concatenate([rim, np.zeros((1, 2))])
    positions = np.stack([radius * flat[:, 0], np.full(len(flat), y), radius * flat[:, 1]], axis=1)
    here, there = np.arange(segments), (np.arange(segments) + 1) % segments
    edge = (here, there) if up > 0.0 else (there, here)
    triangles = np.stack([np.full(segments, segments), *edge], axis=1)
    uv = 0.5 + 0.5 * flat * (1.0, up)
    return _Piece(positions, np.tile((0.0, up, 0.0), (len(flat), 1)), uv, triangles)


def _joined(pieces: list[_Piece], name: str) -> Mesh:
    """One mesh of pieces, without vertices that no triangle uses."""
    firsts = np.cumsum([0, *(len(piece.positions) for piece in pieces)])
    corners = np.concatenate([p.triangles + first for p, first in zip(pieces, firsts, strict=False)])
    used, triangles = np.unique(corners, return_inverse=True)
    *vertices, _ = zip(*pieces, strict=True)
    positions, normals, uv = (np.concatenate(each)[used] for each in vertices)
    return Mesh(positions, triangles.reshape(-1, 3), normals, uv0=uv, name=name)


def _require(shape: str, what: str, value: object) -> None:
    require(f"{shape}: {what}, in metres,", value, LEAST, FARTHEST)


def _count(shape: str, what: str, value: object, least: int) -> None:
    require(f"{shape}: {what}", value, least, _MAX_SEGMENTS)
    if value != int(value):  # type: ignore[call-overload]  # a number, as was just required
        raise SceneError(f"{shape}: {what} must be a whole number, not {value}")
