"""Pipes, vessels and their fittings, in metres: flanges, valves, ducts, tanks, cables, drums."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ispm.library.forms import pipe, placed, pose, rounded
from ispm.library.shapes import box, lathe, merge, tube
from ispm.library.steelwork import bar, bolts
from ispm.scene.mesh import Mesh

Points = Sequence[Sequence[float]]


def flange(radius: float, sides: int) -> Mesh:
    """A pair of flanges on a pipe along y, about the origin, with their bolts: 6 S + 128 triangles or so."""
    outer = 1.55 * radius
    thick = 0.22 * radius
    profile = [(0.98 * radius, -thick), (outer, -thick), (outer, -0.1 * thick), (0.94 * outer, -0.1 * thick)]
    profile += [(0.94 * outer, 0.1 * thick), (outer, 0.1 * thick), (outer, thick), (0.98 * radius, thick)]
    angle = 2.0 * np.pi * (np.arange(8) + 0.5) / 8
    ring = 1.3 * radius * np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], axis=1)
    heads = [
        bolts(ring + np.array([0.0, y, 0.0]), 0.14 * radius, way) for y, way in ((thick, "y"), (-thick, "-y"))
    ]
    return merge([lathe(profile, sides), *heads])


def towards(direction: Sequence[float]) -> np.ndarray:
    """Return a (4, 4) rotation that takes +y to a direction."""
    ahead = np.asarray(direction, float) / np.linalg.norm(direction)
    side = np.eye(3)[np.argmin(np.abs(ahead))]
    side = np.cross(ahead, side)
    side /= np.linalg.norm(side)
    result = np.eye(4)
    result[:3, 0], result[:3, 1], result[:3, 2] = side, ahead, np.cross(side, ahead)
    return result


def flanged(points: Points, radius: float, sides: int, bend: float, spacing: float) -> Mesh:
    """A pipe with rounded bends, and flanges every `spacing` metres of its straight runs."""
    path = np.asarray(points, float)
    parts = [pipe(path, radius, sides, bend)]
    joint = flange(radius, sides)
    for a, b in pairwise(path):
        length = float(np.linalg.norm(b - a))
        turn = towards(b - a)
        free = length - 2.0 * bend - 0.5
        places = []
        for k in range(max(1, int(free / spacing))) if free > 0.0 else []:
            place = turn.copy()
            place[:3, 3] = (
                a + (b - a) * (bend + 0.25 + (k + 0.5) * free / max(1, int(free / spacing))) / length
            )
            places.append(place)
        if places:
            parts.append(placed(joint, *places))
    return merge(parts)


def valve(radius: float, sides: int = 16) -> tuple[Mesh, Mesh]:
    """A gate valve on a pipe along x about the origin, its stem upwards: the body, and the hand wheel."""
    r = radius
    profile = [(0.0, 0.0), (1.5 * r, 0.0), (1.5 * r, 0.3 * r), (1.15 * r, 0.4 * r), (1.35 * r, 1.0 * r)]
    profile += [
        (1.5 * r, 1.7 * r),
        (1.35 * r, 2.4 * r),
        (1.15 * r, 3.0 * r),
        (1.5 * r, 3.1 * r),
        (1.5 * r, 3.4 * r),
        (0.0, 3.4 * r),
    ]
    belly = placed(lathe(profile, sides), pose(roll=-90.0, x=-1.7 * r))
    bonnet = lathe(
        [
            (0.0, 0.6 * r),
            (0.95 * r, 0.6 * r),
            (0.85 * r, 1.7 * r),
            (1.1 * r, 1.75 * r),
            (1.1 * r, 1.95 * r),
            (0.5 * r, 2.05 * r),
            (0.35 * r, 3.0 * r),
            (0.16 * r, 3.05 * r),
            (0.16 * r, 3.9 * r),
            (0.0, 3.9 * r),
        ],
        sides,
    )
    angle = 2.0 * np.pi * np.arange(24) / 24
    rim = tube(
        np.stack([1.5 * r * np.cos(angle), 0 * angle + 3.6 * r, -1.5 * r * np.sin(angle)], axis=1),
        0.13 * r,
        8,
    )
    spoke = pipe([(0.1 * r, 3.6 * r, 0.0), (1.5 * r, 3.6 * r, 0.0)], 0.1 * r, 6)
    return merge([belly, bonnet]), merge([rim, placed(spoke, *(pose(yaw=72.0 * k) for k in range(5)))])


def clamp(radius: float, drop: float) -> Mesh:
    """A hanger of a pipe along x about the origin, up to `drop` above it."""
    band = lathe([(radius, -0.03), (radius + 0.015, -0.03), (radius + 0.015, 0.03), (radius, 0.03)], 12)
    return merge([placed(band, pose(roll=90.0)), bar((0.0, radius, 0.0), (0.0, drop, 0.0), 0.02, 0.02)])


def vessel(radius: float, height: float, sides: int = 40) -> Mesh:
    """An upright tank with domed ends on four legs, hoops round it, a manhole in front (+z)."""
    angle = np.linspace(0.0, 0.5 * np.pi, 8)
    cap = 0.35 * radius
    low, high = 0.7 + cap, height - cap
    bottom = [(radius * np.sin(a), low - cap * np.cos(a)) for a in angle]
    top = [(radius * np.cos(a), high + cap * np.sin(a)) for a in angle]
    profile = [*bottom, *top]
    profile[0], profile[-1] = (0.0, low - cap), (0.0, high + cap)
    body = lathe([(float(r), float(y)) for r, y in profile], sides)
    hoop = lathe(
        [(radius - 0.01, -0.05), (radius + 0.03, -0.05), (radius + 0.03, 0.05), (radius - 0.01, 0.05)], sides
    )
    hoops = placed(hoop, *(pose(y=float(y)) for y in np.linspace(low + 0.1, high - 0.1, 4)))
    legs = [
        box((x - 0.08, 0.0, z - 0.08), (x + 0.08, low + 0.15, z + 0.08))
        for x in (-0.66 * radius, 0.66 * radius)
        for z in (-0.66 * radius, 0.66 * radius)
    ]
    lid = placed(
        lathe([(0.0, 0.0), (0.30, 0.0), (0.30, 0.22), (0.36, 0.22), (0.36, 0.28), (0.0, 0.30)], 24),
        pose(y=low + 0.8, z=radius - 0.12, pitch=90.0),
    )
    return merge([body, hoops, *legs, lid])


def duct(points: Points, width: float, height: float) -> Mesh:
    """A square air duct along straight legs of x, y or z, its joints with collars."""
    path = np.asarray(points, float)
    parts = []
    for a, b in pairwise(path):
        low, high = np.minimum(a, b), np.maximum(a, b)
        axis = int(np.argmax(high - low))
        half = np.array([0.5 * width, 0.5 * height, 0.5 * width])
        parts.append(box(low - half, high + half))
        for s in np.arange(low[axis] + 1.2, high[axis] - 0.3, 1.2):
            ring_low, ring_high = low - half - 0.03, high + half + 0.03
            ring_low[axis], ring_high[axis] = s - 0.03, s + 0.03
            parts.append(box(ring_low, ring_high))
    return merge(parts)


def cable(
    start: Sequence[float], end: Sequence[float], sag: float, radius: float, steps: int, sides: int = 6
) -> Mesh:
    """A cable that hangs between two points, `sag` deep."""
    t = np.linspace(0.0, 1.0, steps + 1)[:, None]
    path = (1.0 - t) * np.asarray(start, float) + t * np.asarray(end, float)
    path[:, 1] -= 4.0 * sag * (t * (1.0 - t))[:, 0]
    return pipe(path, radius, sides)


def drum(sides: int = 20) -> Mesh:
    """An oil drum, 0.58 m wide and 0.88 m high, with two hoops and a sunk lid."""
    r = 0.285
    profile = [
        (0.0, 0.0),
        (r, 0.0),
        (r + 0.008, 0.012),
        (r, 0.025),
        (r, 0.28),
        (r + 0.014, 0.30),
        (r, 0.32),
        (r, 0.57),
        (r + 0.014, 0.59),
        (r, 0.61),
        (r, 0.85),
        (r + 0.008, 0.865),
        (r, 0.88),
        (r - 0.018, 0.88),
        (r - 0.022, 0.855),
        (0.0, 0.855),
    ]
    return lathe(profile, sides)


def coil(radius: float, width: float, sides: int = 48) -> Mesh:
    """A coil of sheet steel that lies along x on y = 0, with windings at its faces."""
    inner, half = 0.34 * radius, 0.5 * width
    faces = np.linspace(inner, radius, 12)
    out = [(float(r), half + (0.012 if k % 2 else -0.004)) for k, r in enumerate(faces)]
    profile = [*((r, -y) for r, y in out), *reversed(out), (float(faces[0]), -half + 0.004)]
    return placed(lathe(profile, sides), pose(y=radius, roll=90.0))


def hose(points: Points, radius: float, sides: int = 8) -> Mesh:
    """A hose whose corners are rounded widely."""
    return pipe(rounded(points, 0.4), radius, sides)
