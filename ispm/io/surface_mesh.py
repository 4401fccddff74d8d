"""What the readers of OBJ, PLY and STL share: a mesh of what can be used."""

from __future__ import annotations

from typing import Any

import numpy as np

from ispm.errors import SceneError
from ispm.io.arrays import wild
from ispm.io.budget import MESH, Budget
from ispm.io.notes import Notes
from ispm.scene.compact import compact
from ispm.scene.mesh import Mesh
from ispm.scene.values import FARTHEST
from ispm.settings import LoadLimits


def make_mesh(
    points: np.ndarray,
    triangles: np.ndarray,
    notes: Notes,
    budget: Budget,
    name: str,
    **others: np.ndarray | None,
) -> Mesh | None:
    """Return the mesh of `triangles`, less those with wild vertices; None where none is left.

    The time it takes is that of the triangles, whatever the number of points.

    points     (V, 3) float
    triangles  (T, 3) rows of `points` and of `others`, within range
    others     fields of Mesh, one row for each point; values that are not finite count as 0
    """
    if not len(triangles):
        return None
    budget.take(name, work=MESH)
    triangles, rows = compact(triangles)
    far = np.asarray(wild(points[rows]).any(axis=1))
    if far.any():
        lost = far[triangles].any(axis=1)
        notes.add(
            f"{name}: triangles with vertices beyond {FARTHEST:g} m or not finite: {lost.sum()} left out"
        )
        triangles, kept = compact(triangles[~lost])
        rows = rows[kept]
    if not len(triangles):
        return None
    width = 3 + sum(values.shape[1] for values in others.values() if values is not None)
    budget.take(name, memory=4 * (width * len(rows) + triangles.size))
    chosen: dict[str, Any] = {}
    for field, values in others.items():
        if values is not None:
            kept = values[rows]
            strays = wild(kept)
            if strays.any():
                notes.add(f"{name}: {field} that are not finite count as 0")
                kept = np.where(strays, 0.0, kept)
            chosen[field] = kept
    return Mesh(points[rows], triangles, name=name, **chosen)


def check_counts(limits: LoadLimits, elements: int, triangles: int, nodes: int = 1) -> None:
    """Raise SceneError where a file has more than it may."""
    if nodes > limits.max_nodes:
        raise SceneError(f"{nodes} objects are more than max_nodes={limits.max_nodes} allows")
    if elements > limits.max_elements:
        raise SceneError(f"{elements} elements are more than max_elements={limits.max_elements} allows")
    if triangles > limits.max_triangles:
        raise SceneError(f"{triangles} triangles are more than max_triangles={limits.max_triangles} allows")


def check_range(rows: np.ndarray, count: int, first: int = 0) -> None:
    """Raise SceneError where a face asks for a vertex that is not there.

    first  the number that the file gives to the first vertex
    """
    if rows.size and (int(rows.min()) < 0 or int(rows.max()) >= count):
        wrong = int(rows.min()) if int(rows.min()) < 0 else int(rows.max())
        raise SceneError(
            f"a face asks for vertex {wrong + first} of {count}; the file is broken, export it again"
        )
