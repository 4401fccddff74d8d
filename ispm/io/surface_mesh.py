"""What the readers of OBJ, PLY and STL share: a mesh of what can be used."""

from __future__ import annotations

from typing import Any

import numpy as np

from ispm.errors import SceneError
from ispm.io.arrays import compact, wild
from ispm.io.notes import Notes
from ispm.scene.mesh import Mesh
from ispm.settings import LoadLimits


def make_mesh(
    points: np.ndarray, triangles: np.ndarray, notes: Notes, name: str, **others: np.ndarray | None
) -> Mesh | None:
    """Return the mesh of `triangles`, less those with vertices that are not finite; None where none is left.

    points     (V, 3) float
    triangles  (T, 3) rows of `points` and of `others`, within range
    others     fields of Mesh, one row for each point; values that are not finite count as 0
    """
    lost = np.asarray(wild(points).any(axis=1))[triangles].any(axis=1)
    if lost.any():
        notes.add(f"{name}: triangles with vertices that are not finite: {lost.sum()} left out")
        triangles = triangles[~lost]
    if not len(triangles):
        return None
    triangles, rows = compact(triangles)
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


def check_counts(limits: LoadLimits, elements: int, triangles: int) -> None:
    """Raise SceneError where a file has more than it may."""
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
