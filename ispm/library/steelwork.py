"""Steel of halls, in metres: beams, columns, trusses, catwalks, railings, stairs, ladders, sheet."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ispm.library.forms import pipe, placed, pose, prism
from ispm.library.shapes import box, merge, polygons
from ispm.scene.mesh import Mesh

RAIL = 1.1  # height of a railing
STEP = 0.17  # height of a step
GOING = 0.26  # depth of a step


def i_section(height: float, width: float, web: float, flange: float) -> list[tuple[float, float]]:
    """Return the outline of an I beam about the origin, upright in y; twelve points, m."""
    h, w, t = 0.5 * height, 0.5 * width, 0.5 * web
    right = [(w, -h), (w, flange - h), (t, flange - h), (t, h - flange), (w, h - flange), (w, h)]
    return [*right, *((-x, -y) for x, y in right)]


def beam(length: float, height: float, width: float, name: str = "") -> Mesh:
    """An I beam along z, about the origin, flanges above and below: 44 triangles."""
    outline = i_section(height, width, 0.07 * height, 0.09 * height)
    return prism(outline, -0.5 * length, 0.5 * length, name)


def channel(length: float, height: float, width: float, name: str = "") -> Mesh:
    """A C profile along z that opens towards +x, its back at x = 0, from y = 0 upwards: 28 triangles."""
    t = 0.12 * height
    outline = [(0, 0), (width, 0), (width, t), (t, t), (t, height - t), (width, height - t)]
    return prism([*outline, (width, height), (0, height)], -0.5 * length, 0.5 * length, name)


def bar(start: Sequence[float], end: Sequence[float], width: float, depth: float) -> Mesh:
    """A flat bar between two points: `depth` is upright as far as can be."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    length = float(np.linalg.norm(b - a))
    ahead = (b - a) / length
    up = np.array([0.0, 1.0, 0.0]) if abs(ahead[1]) < 0.99 else np.array([1.0, 0.0, 0.0])
    side = np.cross(up, ahead)
    side /= np.linalg.norm(side)
    place = np.eye(4)
    place[:3, 0], place[:3, 1], place[:3, 2] = side, np.cross(ahead, side), ahead
    place[:3, 3] = 0.5 * (a + b)
    half = np.array([0.5 * width, 0.5 * depth, 0.5 * length])
    return placed(box(list(-half), list(half)), place)


def bolts(points: Sequence[Sequence[float]] | np.ndarray, radius: float, direction: str = "y") -> Mesh:
    """Hexagonal heads that stand out of a surface along an axis, open beneath: 16 triangles each.

    direction  the way out: "x", "y" or "z", with "-" before for the other way
    """
    angle = np.pi / 3.0 * np.arange(6)
    ring = np.stack([radius * np.cos(angle), np.zeros(6), -radius * np.sin(angle)], axis=1)
    top = ring + np.array([0.0, 0.7 * radius, 0.0])
    faces = [top] + [np.stack([ring[k], ring[(k + 1) % 6], top[(k + 1) % 6], top[k]]) for k in range(6)]
    turn = {"y": pose(), "-y": pose(roll=180.0), "x": pose(roll=-90.0), "-x": pose(roll=90.0)}
    turn |= {"z": pose(pitch=90.0), "-z": pose(pitch=-90.0)}
    places = []
    for point in points:
        place = turn[direction].copy()
        place[:3, 3] = point
        places.append(place)
    return placed(polygons(faces), *places)


def column(height: float, side: float, name: str = "") -> Mesh:
    """An H column on y = 0 with a base plate, gussets and bolts; its flanges look along x."""
    h = 0.5 * side
    shaft = placed(
        prism(i_section(side, side, 0.08 * side, 0.09 * side), 0.0, height), pose(pitch=-90.0, yaw=90.0)
    )
    plate = box((-h - 0.15, -0.02, -h - 0.15), (h + 0.15, 0.04, h + 0.15))
    stiff = [
        box((-h + 0.03, y, 0.04 * side), (h - 0.03, y + 0.02, h - 0.005))
        for y in np.arange(1.2, height - 0.5, 1.2)
    ]
    both = [*stiff, *(placed(mesh, pose(yaw=180.0)) for mesh in stiff)]
    corner = h + 0.09
    heads = bolts([(x, 0.04, z) for x in (-corner, corner) for z in (-corner, 0.0, corner)], 0.035)
    gussets = prism([(h, 0.0), (h + 0.13, 0.0), (h, 0.28)], -0.012, 0.012)
    feet = placed(gussets, pose(), pose(yaw=180.0))
    return merge([shaft, plate, *both, feet, heads], name)


def truss(span: float, rise: float, depth: float, panels: int, name: str = "") -> Mesh:
    """A roof truss along x, its lower chord at y = 0: `depth` at the ends, `rise` more midway.

    panels  of each half
    """
    half = 0.5 * span
    x = np.linspace(-half, half, 2 * panels + 1)
    top = depth + rise * (1.0 - np.abs(x) / half)
    low = [(float(a), 0.0, 0.0) for a in x]
    high = [(float(a), float(b), 0.0) for a, b in zip(x, top, strict=True)]
    members = [bar(low[0], low[-1], 0.16, 0.16), bar(high[0], high[panels], 0.2, 0.16)]
    members.append(bar(high[panels], high[-1], 0.2, 0.16))
    for k in range(2 * panels + 1):
        members.append(bar(low[k], high[k], 0.08, 0.09))
    for k in range(panels):
        other = 2 * panels - k
        members += [bar(high[k], low[k + 1], 0.07, 0.08), bar(high[other], low[other - 1], 0.07, 0.08)]
    plates = [
        box((a - 0.16, b - 0.16, -0.05), (a + 0.16, b + 0.14, 0.05))
        for a, b, _ in (*low[1:-1:2], *high[1:-1:2])
    ]
    return merge([*members, *plates], name)


def grating(length: float, width: float, pitch: float = 0.085) -> Mesh:
    """Bars across a walk along x, on y = 0, `width` along z, with rods that tie them."""
    count = int(length / pitch)
    x = (np.arange(count) + 0.5) * length / count - 0.5 * length
    low = box((-0.006, -0.03, -0.5 * width), (0.006, 0.0, 0.5 * width))
    bars = placed(low, *(pose(x=float(a)) for a in x))
    rods = [
        box((-0.5 * length, -0.012, z - 0.005), (0.5 * length, -0.004, z + 0.005))
        for z in np.linspace(-0.5 * width, 0.5 * width, int(width / 0.2) + 1)[1:-1]
    ]
    return merge([bars, *rods])


def railing(length: float, sides: int = 6, name: str = "") -> Mesh:
    """A railing along x on y = 0, 1.1 m high: posts, two rails and a board at the foot."""
    half = 0.5 * length
    count = max(1, round(length / 1.5))
    posts = placed(
        pipe([(0, -0.05, 0), (0, RAIL - 0.01, 0)], 0.021, sides),
        *(pose(x=float(x)) for x in np.linspace(0.03 - half, half - 0.03, count + 1)),
    )
    rails = [pipe([(-half, y, 0.0), (half, y, 0.0)], r, sides) for y, r in ((RAIL, 0.025), (0.55, 0.019))]
    return merge([posts, *rails, box((-half, 0.0, 0.022), (half, 0.12, 0.03))], name)


def stairs(rise: float, width: float, name: str = "") -> tuple[Mesh, Mesh]:
    """Stairs that climb along +x from the origin to y = `rise`: their steps, and stringers with railings."""
    steps = round(rise / STEP)
    height = rise / steps
    length = GOING * steps
    tread = merge(
        [
            box((-0.13, -0.03, -0.5 * width), (0.15, 0.0, 0.5 * width)),
            box((0.12, -0.035, -0.5 * width), (0.15, 0.004, 0.5 * width)),
        ]
    )
    treads = placed(tread, *(pose(x=GOING * (k + 0.5), y=height * (k + 1)) for k in range(steps)))
    parts = []
    for z in (-0.5 * width, 0.5 * width):
        out = 0.03 if z > 0.0 else -0.03
        parts.append(bar((0.0, 0.02, z + out), (length, rise + 0.02, z + out), 0.04, 0.26))
        parts.append(pipe([(0.05, 1.0, z + out), (length, rise + 1.0 - 0.02, z + out)], 0.024, 6))
        parts.append(pipe([(0.05, 0.52, z + out), (length, rise + 0.5, z + out)], 0.018, 6))
        for s in np.linspace(0.03, 0.985, max(2, round(length / 1.3))):
            x, y = float(s) * length, float(s) * rise
            parts.append(pipe([(x, y, z + out), (x, y + 1.0, z + out)], 0.02, 6))
    return treads, merge(parts, name)


def ladder(height: float, name: str = "") -> Mesh:
    """A ladder from y = 0 to `height` in the plane z = 0, with a cage in front of it from 2.2 m."""
    rungs = placed(
        pipe([(-0.22, 0, 0), (0.22, 0, 0)], 0.014, 6),
        *(pose(y=float(y)) for y in np.arange(0.3, height, 0.28)),
    )
    stiles = [box((x - 0.012, 0.0, -0.03), (x + 0.012, height + 1.0, 0.03)) for x in (-0.232, 0.232)]
    angle = np.linspace(0.0, np.pi, 9)
    hoop = pipe(np.stack([0.36 * np.cos(angle), 0 * angle, 0.02 + 0.62 * np.sin(angle)], axis=1), 0.014, 4)
    hoops = (
        [placed(hoop, *(pose(y=float(y)) for y in np.arange(2.2, height + 0.9, 0.8)))] if height > 2.4 else []
    )
    strips = [
        bar((x, 2.2, z), (x, height + 0.8, z), 0.02, 0.03)
        for x, z in ((-0.26, 0.46), (0.0, 0.64), (0.26, 0.46))
        if height > 2.4
    ]
    return merge([rungs, *stiles, *hoops, *strips], name)


def corrugated(width: float, height: float, pitch: float, depth: float, name: str = "") -> Mesh:
    """A corrugated sheet in the plane z = 0, upright from y = 0, that faces +z: 8 triangles a wave.

    pitch, depth  of a wave; it stands out towards +z
    """
    count = max(1, round(width / pitch))
    pitch = width / count
    wave = np.array([0.0, 0.35, 0.5, 0.85]) * pitch
    x = np.append((np.arange(count)[:, None] * pitch + wave).ravel(), width) - 0.5 * width
    z = np.append(np.tile([0.0, 0.0, depth, depth], count), 0.0)
    low = np.stack([x, 0.0 * x, z], axis=1)
    k = 2 * np.arange(len(x) - 1)[:, None]
    positions = np.stack([low, low + np.array([0.0, height, 0.0])], axis=1).reshape(-1, 3)
    return Mesh(positions, np.concatenate([k + np.array(fan) for fan in ((0, 2, 3), (0, 3, 1))]), name=name)


def catwalk(length: float, width: float, name: str = "") -> tuple[Mesh, Mesh]:
    """A walk along x on y = 0: its grating, and channels along its sides with the joists that carry it."""
    half = 0.5 * width
    edge = channel(length, 0.2, 0.06)
    sides = [placed(edge, pose(y=-0.2, z=half, yaw=90.0)), placed(edge, pose(y=-0.2, z=-half, yaw=-90.0))]
    joists = placed(
        beam(width, 0.12, 0.07),
        *(pose(x=float(x), y=-0.11) for x in np.arange(0.5 - 0.5 * length, 0.5 * length, 1.0)),
    )
    return grating(length, width - 0.02), merge([*sides, joists], name)


def brace(reach: float, drop: float) -> Mesh:
    """A bracket in the plane z = 0 that carries something `reach` in front of a wall at x = 0."""
    return merge(
        [
            bar((0.0, -0.06, 0.0), (reach, -0.06, 0.0), 0.08, 0.12),
            bar((0.0, -drop, 0.0), (reach - 0.06, -0.12, 0.0), 0.07, 0.08),
            box((-0.01, -drop - 0.12, -0.08), (0.015, 0.0, 0.08)),
        ]
    )


def slope(rise: float, run: float) -> float:
    """Return the pitch in degrees of what rises `rise` over `run`."""
    return math.degrees(math.atan2(rise, run))
