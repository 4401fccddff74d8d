"""A scene's instances as the records that kernels and shaders read, with their bounds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ispm.optics import records
from ispm.scene.extent import enclosing_diameter
from ispm.scene.lamp import lamp_place
from ispm.scene.layout import Layout
from ispm.scene.pose import shape_places

if TYPE_CHECKING:
    from ispm.scene.packed import Geometry


@dataclass
class Draw:
    """Consecutive instances of one mesh with one material."""

    mesh: int
    material: int
    first_instance: int
    instance_count: int
    mirrored: bool


@dataclass(frozen=True, eq=False)
class Placed:
    """All instances at their places; fields as of `Packed`, and what they are made of.

    places  (I, 4, 4) float64 matrices to world space, in the order of the layout
    """

    layout: Layout
    geometry: Geometry
    places: np.ndarray
    instances: np.ndarray
    draws: list[Draw]
    ids: np.ndarray
    widths: np.ndarray
    lengths: np.ndarray
    boxes: np.ndarray
    bounds: np.ndarray
    diagonal: float


def place_instances(
    layout: Layout, worlds: np.ndarray, geometry: Geometry, before: Placed | None = None
) -> Placed:
    """Return the instances of a layout whose nodes stand at these places: `before` itself if all is as then.

    worlds  (n, 4, 4) float64 node-to-world matrices
    """
    places = _places(layout, worlds)
    known = before is not None and before.layout is layout and before.geometry is geometry
    if known and before is not None and before.places.tobytes() == places.tobytes():
        return before
    if not len(places):
        ids, extents, bounds = np.zeros(0, np.int64), np.zeros(0, np.float32), np.zeros((2, 3))
        none = ids, extents, extents, np.zeros((0, 2, 3)), bounds
        return Placed(layout, geometry, places, np.zeros(0, records.INSTANCE), [], *none, 1.0)
    rows = np.ascontiguousarray(np.moveaxis(places[:, :3], 0, -1))  # (3, 4, I): one number of all together
    cofactors, mirrored = _cofactors(rows)
    mesh, material, node = (np.repeat(n, layout.copies) for n in (layout.mesh, layout.material, layout.node))
    order = np.lexsort((node, mirrored, material, mesh))
    mesh, material, node, mirrored = mesh[order], material[order], node[order], mirrored[order]
    rows, cofactors = rows[..., order], cofactors[..., order]
    instances = np.zeros(len(order), records.INSTANCE)
    for k in range(3):
        instances[f"world{k}"] = rows[k].T
        instances[f"normal{k}"][:, :3] = cofactors[k].T
    instances["first_index"] = np.array([r.first_index for r in geometry.ranges])[mesh]
    instances["triangle_count"] = np.array([r.triangle_count for r in geometry.ranges])[mesh]
    instances["material"], instances["node"], instances["mesh"] = material, node, mesh
    instances["flags"] = np.where(mirrored, records.INSTANCE_MIRRORED, 0)
    ends = np.moveaxis(np.stack([kept.box for kept in geometry.ranges])[mesh], 0, -1)
    corners = _corners(rows, ends)
    boxes = np.ascontiguousarray(np.moveaxis(np.stack([corners.min(axis=0), corners.max(axis=0)]), -1, 0))
    a, b, c = (ends[1] - ends[0]) * np.sqrt((rows[:, :3] ** 2).sum(axis=0))
    widths = np.maximum(np.minimum(a, b), np.minimum(np.maximum(a, b), c))  # the middle one
    return Placed(
        layout,
        geometry,
        places,
        instances,
        _draws(mesh, material, mirrored),
        order,
        widths.astype(np.float32),
        np.maximum(np.maximum(a, b), c).astype(np.float32),
        boxes,
        np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)]),
        enclosing_diameter(np.moveaxis(corners, -1, 0).reshape(-1, 3)) or 1.0,
    )


def _places(layout: Layout, worlds: np.ndarray) -> np.ndarray:
    """(I, 4, 4) where the copies of each row of the layout stand, one after the other."""
    places: np.ndarray = worlds[np.repeat(layout.node, layout.copies)]
    first = np.cumsum(layout.copies) - layout.copies
    for row in layout.instanced:
        index = layout.node[row]
        here = slice(first[row], first[row] + layout.copies[row])
        places[here] = layout.nodes[index].places(worlds[index])
    for posed in layout.posed:
        node = layout.nodes[layout.node[posed.row]]
        here = slice(first[posed.row], first[posed.row] + layout.copies[posed.row])
        places[here] = shape_places(node, posed.shape, worlds[layout.node[posed.row]])
    for row in layout.lamps:
        places[first[row]] = lamp_place(layout.lamp(row), places[first[row]])
    return places


def _corners(rows: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """(8, 3, I) corners in world space of boxes in object space, turned with them.

    rows  (3, 4, I) of matrices to world space;  ends  (2, 3, I) low and high corner
    """
    moved = rows[:, :3] * ends[:, None]  # (2, 3, 3, I): end, row, column
    (x0, y0, z0), (x1, y1, z1) = (np.moveaxis(part, 1, 0) for part in moved)
    sums: list[np.ndarray] = [x + z + y + rows[:, 3] for z in (z0, z1) for y in (y0, y1) for x in (x0, x1)]
    return np.stack(sums)


def _draws(mesh: np.ndarray, material: np.ndarray, mirrored: np.ndarray) -> list[Draw]:
    """Runs of instances of the same mesh and material, turned the same direction."""
    new = np.ones(len(mesh), bool)
    new[1:] = (np.diff(mesh) != 0) | (np.diff(material) != 0) | (mirrored[1:] != mirrored[:-1])
    first = np.flatnonzero(new)
    counts = np.diff(np.append(first, len(mesh)))
    columns = (mesh[first], material[first], first, counts, mirrored[first])
    return list(map(Draw, *(column.tolist() for column in columns)))


def _cofactors(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(3, 3, I) cofactors of (3, 4, I) matrices, and which of these mirror, (I,) bool.

    They take normals to world space even where there is no inverse.
    """
    x, y, z = rows[:, :3]
    cofactors = np.stack([_cross(y, z), _cross(z, x), _cross(x, y)])
    mirrored = (cofactors[0] * x).sum(axis=0) < 0.0
    return np.where(mirrored, -cofactors, cofactors), mirrored


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of (3, n) vectors."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
