"""Parts of a building, in metres: columns, arches, balustrades, doors, drapes, urns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ispm.library.shapes import box, icosphere, lathe, merge, moved, paint, polygons, sheet, smooth
from ispm.scene.mesh import Mesh


def column(height: float, radius: float, base: float, segments: int, name: str) -> Mesh:
    """A round column with a base and a capital, standing on y = 0.

    height  m, to the top of the square abacus
    radius  m, of the shaft at the bottom; it tapers by a seventh
    base    m, width of the square plinth and abacus
    The shaft's ends are buried in plinth and abacus.
    """
    r, top, half = radius, height - 0.18, 0.5 * base
    profile = [
        (1.28 * r, 0.17), (1.38 * r, 0.22), (1.30 * r, 0.29), (1.10 * r, 0.33), (1.10 * r, 0.36),
        (1.17 * r, 0.40), (1.00 * r, 0.45), (0.97 * r, 0.33 * height), (0.86 * r, top - 0.52),
        (1.00 * r, top - 0.50), (1.00 * r, top - 0.45), (0.90 * r, top - 0.43),
        (0.95 * r, top - 0.26), (1.14 * r, top - 0.12), (1.50 * r, top + 0.01),
    ]  # fmt: skip
    plinth = box((-half * 0.9, -0.05, -half * 0.9), (half * 0.9, 0.18, half * 0.9))
    abacus = box((-half, top, -half), (half, height, half))
    return merge([lathe(profile, segments), plinth, abacus], name)


def pier(low: float, high: float, half: float, cap: float, name: str) -> Mesh:
    """A square pier from `low` to `high`, in m, with a wider base and a cap at the height `cap`."""
    shaft = box((-half, low - 0.05, -half), (half, high + 0.05, half))
    wide = half + 0.06
    base = box((-wide, low - 0.04, -wide), (wide, low + 0.4, wide))
    band = box((-wide, cap - 0.18, -wide), (wide, cap, wide))
    return merge([shaft, base, band], name)


def arch(
    width: float,
    height: float,
    depth: float,
    inner: float,
    outer: float,
    step: float,
    segments: int,
    name: str,
) -> tuple[Mesh, Mesh]:
    """A wall over a round arch, springing from y = 0 in the plane z = 0; together the two are closed.

    width, height, depth  of the wall, in m
    inner, outer          m, radii of the ring of stones round the opening
    step                  m, by which the ring stands out from both faces of the wall
    ->                    the wall, and the ring with its stones by turns in two shades
    """
    angle = np.linspace(np.pi, 0.0, segments + 1)
    turn = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    to_side = 0.5 * width / np.maximum(np.abs(turn[:, 0]), 1e-9)
    to_top = height / np.maximum(turn[:, 1], 1e-9)
    edge = turn * np.minimum(to_side, to_top)[:, None]
    for side in (-1.0, 1.0):
        corner = np.array([side * 0.5 * width, height, 0.0])
        edge[np.argmin(np.linalg.norm(edge - corner, axis=1))] = corner
    back, out = np.array([0.0, 0.0, -0.5 * depth]), np.array([0.0, 0.0, -0.5 * depth - step])
    ring_out, ring_in = outer * turn, inner * turn
    front = [edge - back, ring_out - back, ring_out - out, ring_in - out]
    stations = [*front, ring_in + out, ring_out + out, ring_out + back, edge + back]
    wall = [sheet(np.stack(pair)) for pair in (stations[:2], stations[6:])]
    feet = [_foot(np.array([curve[end] for curve in stations]), end) for end in (0, -1)]
    far, near = stations[7], stations[0]
    rim = [np.stack([far[k], near[k], near[k + 1], far[k + 1]]) for k in range(segments)]
    ring = [sheet(np.stack(stations[k : k + 2])) for k in range(1, 6)]
    shade = np.where(np.arange(segments)[:, None] % 2 == 0, (1.0, 1.0, 1.0), (0.78, 0.60, 0.50))
    painted = [paint(strip, np.repeat(shade, 2, axis=0)) for strip in ring]
    return merge([*wall, *feet, polygons(rim)], name), merge(painted, f"{name} ring")


def _foot(points: np.ndarray, end: int) -> Mesh:
    """The underside of an arch's end, a T of eight points."""
    fans = [[0, 1, 6], [0, 6, 7], [1, 2, 3], [1, 3, 6], [3, 4, 6], [4, 5, 6]]
    order = [fan[::-1] for fan in fans] if end == 0 else fans
    return polygons([points[fan] for fan in order])


def balustrade(length: float, count: int, segments: int, name: str) -> Mesh:
    """A balustrade along x on y = 0, `length` in m: two rails with turned balusters between them."""
    profile = [
        (0.075, 0.10), (0.070, 0.19), (0.045, 0.23), (0.085, 0.35), (0.075, 0.46),
        (0.042, 0.64), (0.065, 0.70), (0.065, 0.80),
    ]  # fmt: skip
    half = 0.5 * length
    rails = [box((-half, -0.04, -0.14), (half, 0.12, 0.14)), box((-half, 0.78, -0.16), (half, 0.94, 0.16))]
    spots = (np.arange(count) + 0.5) / count * (length - 0.3) - half + 0.15
    return merge([*rails, *(moved(lathe(profile, segments), x=float(x)) for x in spots)], name)


def drape(
    width: float, height: float, columns: int, rows: int, folds: float, waist: float, seed: int, name: str
) -> Mesh:
    """A cloth that hangs in folds from y = 0 along x; a sheet to be seen from both sides.

    columns, rows  of quads
    folds          number of folds across
    waist          share of the width it is drawn aside by, two thirds down, as by a cord; 0 hangs straight
    """
    random = np.random.default_rng(seed)
    u, v = np.meshgrid(np.linspace(0.0, 1.0, columns + 1), np.linspace(0.0, 1.0, rows + 1))
    phase = 2.0 * np.pi * folds * (u + 0.02 * np.sin(2.0 * np.pi * (v + random.random())))
    swell = 0.35 + 0.65 * np.sqrt(v)
    above, below = np.sin(0.5 * np.pi * v / 0.66) ** 2, np.exp(-(((v - 0.66) / 0.25) ** 2))
    drawn = 1.0 - waist * np.where(v < 0.66, above, below)
    slow = np.sin(2.0 * np.pi * (1.3 * u + 0.4 * v + random.random()))
    z = (0.20 * width / folds * np.sin(phase) + 0.05 * slow) * swell
    x = width * (u * drawn - 0.5)
    y = -height * v * (1.0 - 0.02 * np.cos(phase) * v)
    return sheet(np.stack([x, y, z], axis=-1), name)


def pole(length: float, reach: float, name: str) -> Mesh:
    """A pole along x, 6 cm thick; unless `reach` is 0, brackets hold it that far in front of a wall at -z."""
    half = 0.5 * length
    upright = lathe([(0.0, -half), (0.03, -half), (0.03, half), (0.0, half)], 6)
    assert upright.normals is not None  # lathe makes them
    turned = [values[:, [1, 0, 2]] * (1.0, -1.0, 1.0) for values in (upright.positions, upright.normals)]
    parts = [Mesh(turned[0], upright.triangles, turned[1])]
    if reach:
        parts += [box((x - 0.03, -0.04, -reach), (x + 0.03, 0.04, 0.02)) for x in (0.05 - half, half - 0.05)]
    return merge(parts, name)


def door(name: str) -> tuple[Mesh, Mesh]:
    """A round-headed door 1.5 m wide that leans on a wall at z = 0 and looks along +z: stone, and wood."""
    head, ring = arch(2.2, 1.25, 0.5, 0.75, 0.95, 0.05, 11, "head")
    jambs = [box((-1.1, -0.05, -0.25), (-0.75, 2.42, 0.26)), box((0.75, -0.05, -0.25), (1.1, 2.42, 0.26))]
    leaves = [
        box((-0.8, -0.05, -0.2), (0.8, 3.2, 0.06)),
        *(box((x - 0.27, y, 0.0), (x + 0.27, y + h, 0.11)) for x in (-0.36, 0.36) for y, h in _PANELS),
    ]
    return merge([moved(head, y=2.4), moved(ring, y=2.4), *jambs], name), merge(leaves, f"{name} leaves")


_PANELS = ((0.2, 0.9), (1.25, 0.95))


def urn(segments: int, name: str) -> Mesh:
    """A potter's urn 0.9 m high, with a rim and earth in it."""
    profile = [
        (0.0, -0.02), (0.21, 0.0), (0.22, 0.05), (0.15, 0.09), (0.15, 0.12), (0.27, 0.27), (0.33, 0.46),
        (0.34, 0.57), (0.28, 0.69), (0.26, 0.74), (0.32, 0.81), (0.33, 0.85), (0.30, 0.88), (0.27, 0.84),
        (0.25, 0.76), (0.0, 0.77),
    ]  # fmt: skip
    return lathe(profile, segments, name)


def bush(radius: float, segments: int, seed: int, name: str) -> Mesh:
    """A clipped shrub: a closed ball with lumps, round the origin; radius in m."""
    ball = icosphere(radius, segments)
    random = np.random.default_rng(seed)
    waves = random.normal(size=(9, 3)) * 4.0 / radius
    phases = random.uniform(0.0, 2.0 * np.pi, 9)
    lumps = 1.0 + 0.035 * np.sin(ball.positions @ waves.T + phases).sum(axis=1)
    return smooth(Mesh(ball.positions * lumps[:, None], ball.triangles, name=name))


def fountain(segments: int, name: str) -> Mesh:
    """A basin with a bowl on a stem, dry, 2.4 m high; closed on the axis above and below."""
    profile = [
        (0.0, -0.05), (1.9, -0.04), (1.9, 0.14), (1.6, 0.16), (1.55, 0.45), (1.72, 0.55), (1.72, 0.66),
        (1.45, 0.66), (1.38, 0.30), (0.45, 0.26), (0.34, 0.40), (0.20, 0.62), (0.17, 1.05), (0.26, 1.14),
        (0.62, 1.28), (0.88, 1.50), (0.90, 1.58), (0.80, 1.58), (0.50, 1.42), (0.16, 1.36), (0.12, 1.60),
        (0.20, 1.78), (0.16, 1.96), (0.0, 2.10),
    ]  # fmt: skip
    return lathe(profile, segments, name)


def tiles(xs: np.ndarray, zs: np.ndarray, shade: np.ndarray, name: str) -> Mesh:
    """A floor of flat tiles at y = 0, seen from above, between the grid lines xs and zs.

    shade  (len(xs) - 1, len(zs) - 1, 3) linear colour of each tile
    """
    grid = np.zeros((len(xs), len(zs), 3))
    grid[:, :, 0], grid[:, :, 2] = xs[:, None], zs[None, :]
    # rows run along z, so that (next row) x (next column) points up
    floor = sheet(grid.transpose(1, 0, 2), name)
    return paint(floor, np.repeat(shade.transpose(1, 0, 2).reshape(-1, 3), 2, axis=0))


def lantern(segments: int, name: str) -> Mesh:
    """A paper lantern about 1 m across, closed: 30 triangles for each segment."""
    angle = np.radians([-72, -58, -44, -30, -15, 0, 15, 30, 44, 58, 72])
    body: Sequence[tuple[float, float]] = [(0.52 * np.cos(a), 0.62 * np.sin(a)) for a in angle]
    foot = [(0.0, -0.72), (0.13, -0.72), (0.13, -0.60)]
    crown = [(0.13, 0.60), (0.13, 0.72), (0.0, 0.72)]
    return lathe([*foot, *body, *crown], segments, name)
