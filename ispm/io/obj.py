"""Wavefront OBJ files: objects and materials become nodes and parts.

Metres as written, Y up. Objects (`o`, else groups `g`) are nodes. Faces without normals are smooth within
their smoothing group and flat without one. Colors of vertices, if any, are taken as sRGB.
Source: Wavefront, "Object Files (.obj)", Advanced Visualizer manual, appendix B1; colors as MeshLab and
Blender write them.
"""

from __future__ import annotations

from functools import cached_property, partial
from pathlib import Path

import numpy as np

from ispm.io.arrays import wild
from ispm.io.budget import Budget
from ispm.io.folder import map_file
from ispm.io.mtl import Materials
from ispm.io.notes import Notes
from ispm.io.obj_text import FLAT, Group, ObjText, read_text
from ispm.io.polygons import triangulate
from ispm.io.surface_mesh import check_counts, check_range, make_mesh
from ispm.scene.color import linear
from ispm.scene.scene import Node, Part, Scene
from ispm.scene.smooth import angles_of
from ispm.settings import LoadLimits


def read_obj(path: Path, limits: LoadLimits) -> Scene:
    """Return the scene of an OBJ file and its MTL files. Raises SceneError where it cannot be used."""
    notes, budget = Notes(), Budget(limits)
    text = read_text(map_file(path, budget), notes)
    _check(text, notes, limits)
    points = text.positions[text.corners[:, 0]]
    triangles = {
        group: triangulate(np.array(faces.corners), np.array(faces.sizes), points, budget)
        for group, faces in text.groups.items()
    }
    normals, uvs, colors = _normals(text, list(triangles.values())), _uvs(text), _colors(text)
    solids = _Solids(text, triangles)
    materials = Materials(text.libraries, path.parent, notes, budget)
    nodes: dict[str, Node] = {}
    for group, corners in triangles.items():
        mesh = make_mesh(
            points,
            corners,
            notes,
            budget,
            group.object or group.material or "the mesh",
            normals=normals if group.smooth else None,
            uv0=uvs if uvs is not None and (text.corners[corners, 1] >= 0).any() else None,
            colors=colors,
        )
        if mesh is not None:
            node = nodes.setdefault(group.object, Node(group.object))
            material = materials.get(group.material, mesh, partial(solids.closed, group.material))
            node.parts.append(Part(mesh, material))
    if not nodes:
        notes.add("it has no faces, so there is nothing to draw")
    return Scene(list(nodes.values()), warnings=notes.lines())


def _check(text: ObjText, notes: Notes, limits: LoadLimits) -> None:
    """Raise SceneError where vertices are too many or missing; note where others are, and replace them."""
    placed = sum(len(faces.corners) - 2 * len(faces.sizes) for faces in text.groups.values())
    check_counts(limits, len(text.positions), placed, len({group.object for group in text.groups}))
    vertex, uv, normal = text.corners.T
    check_range(vertex, len(text.positions), first=1)
    no_uv, no_normal = (uv >= len(text.uvs)) & (uv >= 0), (normal >= len(text.normals)) & (normal >= 0)
    if no_uv.any():
        notes.add("texture coordinates that faces ask for are not there; 0, 0 is used")
        uv[no_uv] = -1
    for group, faces in text.groups.items():
        rows = np.array(faces.corners)
        normal[rows[group.smooth & (normal[rows] == FLAT)]] = FLAT - 1  # a face with normals at some corners
    if no_normal.any():
        notes.add("normals that faces ask for are not there; the mean of their faces' is used")
        normal[no_normal] = FLAT - 1


def _normals(text: ObjText, triangles: list[np.ndarray]) -> np.ndarray:
    """(C, 3) normals of all corners: as written, else the mean of their smoothing group.

    Weighted by angle, so that it is the same however polygons are cut (Thuermer and Wuethrich 1998).
    """
    result = np.zeros((len(text.corners), 3))
    asked = text.corners[:, 2]
    written = asked >= 0
    result[written] = text.normals[asked[written]]
    if triangles and (asked < FLAT).any():
        keys, group = np.unique(text.corners[:, [0, 2]], axis=0, return_inverse=True)
        sums = np.zeros((len(keys), 3))
        every = np.concatenate(triangles)
        corners = text.positions[text.corners[every, 0]]
        with np.errstate(invalid="ignore", over="ignore"):
            faces, angles = angles_of(corners)
        weighted = angles[:, :, None] * faces[:, None, :]
        weighted[wild(weighted).any(axis=(1, 2))] = 0.0
        np.add.at(sums, group.ravel()[every], weighted)
        result[~written] = sums[group.ravel()[~written]]
    return result


def _uvs(text: ObjText) -> np.ndarray | None:
    """(C, 2) texture coordinates of all corners, v downwards, 0 where there are none."""
    if not len(text.uvs):
        return None
    uv = text.corners[:, 1]
    return np.asarray(np.where(uv[:, None] >= 0, text.uvs[uv], 0.0) * (1.0, -1.0) + (0.0, 1.0))


def _colors(text: ObjText) -> np.ndarray | None:
    """(C, 4) linear colors of all corners."""
    if text.colors is None:
        return None
    colors = np.ones((len(text.corners), 4), np.float32)
    colors[:, :3] = linear(np.clip(text.colors, 0.0, 1.0))[text.corners[:, 0]]
    return colors


class _Solids:
    """Which materials' faces bound solids: every edge is met as often in one direction as in the other."""

    def __init__(self, text: ObjText, triangles: dict[Group, np.ndarray]) -> None:
        self._text = text
        self._triangles: dict[str, list[np.ndarray]] = {}
        for group, corners in triangles.items():
            self._triangles.setdefault(group.material, []).append(corners)

    def closed(self, material: str) -> bool:
        """Whether the faces of a material bound a solid."""
        corners = np.concatenate(self._triangles[material])
        rows = self._points[self._text.corners[corners, 0]]
        edges = np.concatenate([rows[:, [0, 1]], rows[:, [1, 2]], rows[:, [2, 0]]])
        forward, back = edges @ (len(self._points), 1), edges @ (1, len(self._points))
        return bool((np.sort(forward) == np.sort(back)).all())

    @cached_property
    def _points(self) -> np.ndarray:
        """(V,) numbers of vertices, the same for those at one point."""
        return np.asarray(np.unique(self._text.positions, axis=0, return_inverse=True)[1].ravel())
