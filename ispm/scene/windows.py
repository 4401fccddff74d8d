"""Windows onto a scene's vertices and indices: as much as an adapter binds at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from ispm.optics.records import VERTEX
from ispm.scene.packed import MeshRange

_ALIGNMENT = 256  # bytes between which bindings may begin, of every adapter
_VERTICES, _INDICES = _ALIGNMENT // VERTEX.itemsize, _ALIGNMENT // 4


@dataclass
class Window:
    """Rows of a geometry's arrays, which begin where a binding may, and the triangles that lie within.

    first_vertex, end_vertex, first_index, end_index  rows
    first_shown  the row of the indices where the triangles begin
    corners  of each mesh that has triangles in it, by row: the first corner, counted through all of its
             triangles, and how many there are
    """

    first_vertex: int = 0
    end_vertex: int = 0
    first_index: int = 0
    first_shown: int = 0
    end_index: int = 0
    corners: dict[int, tuple[int, int]] = field(default_factory=dict)


def cut_windows(ranges: Sequence[MeshRange], most: int) -> list[Window]:
    """Return the windows that show all triangles of the meshes, one at least.

    most  bytes of each array in a window; each chunk of a mesh fits
    """
    windows = [Window()]
    for mesh, part in enumerate(ranges):
        for chunk in part.chunks:
            first_vertex = part.first_vertex + chunk.first_vertex
            first_index = part.first_index + chunk.first_index
            end_vertex, end_index = first_vertex + chunk.vertex_count, first_index + chunk.index_count
            last = windows[-1]
            vertices, indices = end_vertex - last.first_vertex, end_index - last.first_index
            if max(VERTEX.itemsize * vertices, 4 * indices) > most:
                aligned = first_vertex // _VERTICES * _VERTICES, first_index // _INDICES * _INDICES
                last = Window(aligned[0], 0, aligned[1], first_index)
                windows.append(last)
            last.end_vertex, last.end_index = end_vertex, end_index
            first, count = last.corners.get(mesh, (chunk.first_index, 0))
            last.corners[mesh] = first, count + chunk.index_count
    return windows
