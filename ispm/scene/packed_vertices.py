"""The vertices and triangles of a mesh as records, cut into chunks that any adapter can bind."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ispm.optics import records
from ispm.scene.compact import compact
from ispm.scene.mesh import Mesh

# Every adapter binds 128 MiB (WebGPU, section 3.6.2); a few vertices less, for bindings begin at multiples of
# 256 bytes.
MOST_VERTICES = 128 * 2**20 // records.VERTEX.itemsize - 4


class Chunk(NamedTuple):
    """Consecutive triangles of a mesh, and where the vertices lie that they use: rows of its own arrays.

    A chunk has at most MOST_VERTICES vertices and a third as many triangles.
    """

    first_vertex: int
    vertex_count: int
    first_index: int
    index_count: int


@dataclass(frozen=True, eq=False)
class VertexLayout:
    """Which vertices a mesh gets when it is packed.

    take       of each the row of the mesh that it is a copy of, or a slice of all
    count      how many they are
    triangles  (T, 3) uint32, rows of these, in the mesh's order
    chunks     of all triangles, in order
    """

    take: np.ndarray | slice
    count: int
    triangles: np.ndarray
    chunks: list[Chunk]


def lay_out(mesh: Mesh) -> VertexLayout:
    """Return the vertices of a mesh as they are packed.

    Flat triangles that are to have tangents get vertices of their own; all others share those of the mesh.
    Where there are more than MOST_VERTICES, each chunk gets its own copies of those it uses.
    """
    take: np.ndarray | slice = slice(None)
    triangles, count = mesh.triangles, len(mesh.positions)
    if mesh.normals is None and mesh.uv0 is not None:
        take, count = triangles.ravel(), triangles.size
        triangles = np.arange(count, dtype=np.uint32).reshape(-1, 3)
    step = MOST_VERTICES // 3
    cuts = [triangles[first : first + step] for first in range(0, len(triangles), step)]
    chunks, first_index = [], 0
    if count <= MOST_VERTICES:
        for cut in cuts:
            chunks.append(Chunk(0, count, first_index, cut.size))
            first_index += cut.size
        return VertexLayout(take, count, triangles, chunks)
    copied, numbers, count = [], np.empty_like(triangles), 0
    for cut in cuts:
        local, used = compact(cut)
        chunks.append(Chunk(count, len(used), first_index, cut.size))
        np.add(local, np.uint32(count), out=numbers[first_index // 3 :][: len(cut)])
        copied.append(used)
        count, first_index = count + len(used), first_index + cut.size
    rows = np.concatenate(copied)
    return VertexLayout(rows if isinstance(take, slice) else take[rows], count, numbers, chunks)


def fill_vertices(rows: np.ndarray, mesh: Mesh, layout: VertexLayout) -> None:
    """Write the VERTEX rows of a mesh, (layout.count,) of zeros."""
    take, triangles = layout.take, layout.triangles
    rows["position"] = mesh.positions[take]
    tangents = mesh.tangents
    if mesh.normals is not None:
        normals = _unit(mesh.normals.astype(np.float64)).astype(np.float32)
        rows["normal"] = normals[take]
        if tangents is None and mesh.uv0 is not None:
            tangents = _tangents(mesh.positions, normals, mesh.uv0, mesh.triangles)
    elif mesh.uv0 is not None:
        corners = rows["position"].reshape(-1, 3, 3).astype(np.float64)
        flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        rows["normal"] = np.repeat(_unit(flat), 3, axis=0)
        if tangents is None:
            rows["tangent"] = _tangents(rows["position"], rows["normal"], mesh.uv0[take], triangles)
    rows["color"] = _pack_colors(mesh.colors, take, len(rows))
    for name, values in (("uv0", mesh.uv0), ("uv1", mesh.uv1), ("tangent", tangents)):
        if values is not None:
            rows[name] = values[take]


def _tangents(
    positions: np.ndarray, normals: np.ndarray, uv0: np.ndarray, triangles: np.ndarray
) -> np.ndarray:
    """(V, 4) tangents from uv0, area-weighted over each vertex's triangles."""
    p = positions[triangles].astype(np.float64)
    uv = uv0[triangles].astype(np.float64)
    e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    d1, d2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    det = d1[:, 0] * d2[:, 1] - d2[:, 0] * d1[:, 1]
    sign = np.sign(det)[:, None]
    tangent = (e1 * d2[:, 1:] - e2 * d1[:, 1:]) * sign
    bitangent = (e2 * d1[:, :1] - e1 * d2[:, :1]) * sign
    corners = triangles.T.ravel()
    sums = [
        np.stack([np.bincount(corners, np.tile(column, 3), len(positions)) for column in along.T], axis=1)
        for along in (tangent, bitangent)
    ]
    normal = normals.astype(np.float64)
    along = sums[0] - normal * np.einsum("ij,ij->i", normal, sums[0])[:, None]
    length = np.linalg.norm(along, axis=1)
    result = np.zeros((len(positions), 4), np.float32)
    good = length > 1e-20
    result[good, :3] = along[good] / length[good, None]
    side = np.einsum("ij,ij->i", np.cross(normal, along), sums[1])
    result[good, 3] = np.where(side[good] < 0.0, 1.0, -1.0)  # glTF's v points down
    return result


def _pack_colors(colors: np.ndarray | None, take: np.ndarray | slice, count: int) -> np.ndarray:
    if colors is None:
        return np.full(count, 0xFFFFFFFF, np.uint32)
    bytes_ = np.rint(np.clip(colors[take], 0.0, 1.0) * 255.0).astype(np.uint32)
    return np.asarray(bytes_[:, 0] | bytes_[:, 1] << 8 | bytes_[:, 2] << 16 | bytes_[:, 3] << 24)


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors; +Y where a vector has no length."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    good = np.isfinite(length) & (length > 0.0)
    return np.where(good, vectors / np.where(good, length, 1.0), (0.0, 1.0, 0.0))
