"""PLY files: one mesh, with the normals, texture coordinates and colors of its vertices.

Metres and axes as written. Flat where there are no normals. Colors are taken as sRGB, as scanners and
modellers write them. A cloud of points has no surface.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ispm.errors import SceneError
from ispm.io.arrays import wild
from ispm.io.budget import Budget
from ispm.io.folder import map_file
from ispm.io.mtl import plain
from ispm.io.mtl_picture import Maps, MapUse
from ispm.io.notes import Notes
from ispm.io.ply_text import Table, read_tables
from ispm.io.polygons import triangulate
from ispm.io.surface_mesh import check_counts, check_range, make_mesh
from ispm.scene.color import linear
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Node, Part, Scene
from ispm.settings import LoadLimits

UV_NAMES = (("texture_u", "texture_v"), ("u", "v"), ("s", "t"))
COLOR_NAMES = (("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue"))


def read_ply(path: Path, limits: LoadLimits) -> Scene:
    """Return the scene of a PLY file. Raises SceneError where it cannot be used."""
    notes, budget = Notes(), Budget(limits)
    tables, comments = read_tables(map_file(path, budget), limits)
    vertices, faces = tables.get("vertex", Table()), tables.get("face", Table())
    points = _columns(vertices, ("x", "y", "z"))
    if points is None:
        raise SceneError("it has no vertices with x, y and z")
    triangles = _triangles(faces, points, notes, budget)
    mesh = _mesh(vertices, points, triangles, notes, budget, path.stem) if len(triangles) else None
    if mesh is None:
        what = f"a cloud of {len(points)} points" if not len(triangles) else "no whole triangle"
        notes.add(f"{what}: there is no surface to draw")
        return Scene(warnings=notes.lines())
    material = plain(mesh, path.stem)
    named = [c[11:].strip() for c in comments if c.lower().startswith("texturefile")]
    if named and mesh.uv0 is not None:
        maps, name = Maps(path.parent, notes, budget), named[0]
        pixels = maps.pixels(name, srgb=True)
        if pixels is not None:
            use = maps.use(MapUse(name), (name,), lambda: pixels, srgb=True)
            material.base_color_texture, material.base_color = use, (1.0, 1.0, 1.0)
    return Scene([Node(path.stem, parts=[Part(mesh, material)])], warnings=notes.lines())


def _columns(table: Table, names: tuple[str, ...]) -> np.ndarray | None:
    """(n, k) float64 columns; None where one is missing."""
    if not all(name in table.columns for name in names):
        return None
    return np.stack([table.columns[name].astype(np.float64) for name in names], axis=1)


def _triangles(faces: Table, points: np.ndarray, notes: Notes, budget: Budget) -> np.ndarray:
    """(T, 3) rows of `points`."""
    listed = faces.lists.get("vertex_indices") or faces.lists.get("vertex_index")
    if listed is None:
        return np.zeros((0, 3), np.int64)
    sizes, named = listed
    rows = named.astype(np.float64)
    corners = np.where(wild(rows), -1.0, rows).astype(np.int64)
    check_range(corners, len(points))
    few = sizes < 3
    notes.count(
        "face of fewer than three corners is left out",
        "faces of fewer than three corners are left out",
        int(few.sum()),
    )
    corners, sizes = corners[~np.repeat(few, sizes)], sizes[~few]
    check_counts(budget.limits, len(points), int((sizes - 2).sum()))
    return triangulate(corners, sizes, points, budget)


def _mesh(
    vertices: Table, points: np.ndarray, triangles: np.ndarray, notes: Notes, budget: Budget, name: str
) -> Mesh | None:
    uvs = next((uv for names in UV_NAMES if (uv := _columns(vertices, names)) is not None), None)
    return make_mesh(
        points,
        triangles,
        notes,
        budget,
        name,
        normals=_columns(vertices, ("nx", "ny", "nz")),
        uv0=None if uvs is None else uvs * (1.0, -1.0) + (0.0, 1.0),  # v points down in our coordinates
        colors=_colors(vertices),
    )


def _colors(vertices: Table) -> np.ndarray | None:
    """(V, 4) linear colors of the vertices; integers are fractions of their type's largest."""
    names = next((names for names in COLOR_NAMES if all(n in vertices.columns for n in names)), None)
    if names is None:
        return None
    columns = [vertices.columns[name] for name in names]
    result = np.ones((len(columns[0]), 4), np.float32)
    for k, values in enumerate(columns):
        result[:, k] = linear(np.clip(values / _largest(values), 0.0, 1.0))
    return result


def _largest(values: np.ndarray) -> float:
    return float(np.iinfo(values.dtype).max) if values.dtype.kind in "iu" else 1.0
