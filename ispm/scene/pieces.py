"""Meshes in pieces, so that a view draws what it may see of them and not all of each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ispm.scene.packed import PIECE, Draw, Packed, to_world


class DrawRange(NamedTuple):
    """Consecutive indices of a draw, from row `first` of the geometry's on."""

    draw: Draw
    first: int
    length: int


@dataclass(frozen=True, eq=False)
class Pieces:
    """The draws of a scene, those of one instance cut into pieces; those of many stay whole.

    draws  the scene's
    row    (n,) of the draws, ascending
    first  (n,) row of the geometry's indices;  count  (n,) rows
    boxes  (n, 2, 3) float64 bounds, world space
    """

    draws: list[Draw]
    row: np.ndarray
    first: np.ndarray
    count: np.ndarray
    boxes: np.ndarray

    @classmethod
    def of(cls, packed: Packed, boxes: np.ndarray) -> Pieces:
        """Cut a scene whose draws have these bounds, (draws, 2, 3) world space."""
        none = np.zeros(0, np.int64)
        parts = [(none, none, none, np.zeros((0, 2, 3)))]
        parts += [_cut(packed, row, box) for row, box in enumerate(boxes)]
        return cls(packed.draws, *(np.concatenate(part) for part in zip(*parts, strict=True)))

    def runs(self, pieces: np.ndarray) -> Iterator[DrawRange]:
        """Yield what shows these rows of pieces, (k,) int64 ascending; neighbours at once."""
        if not len(pieces):
            return
        new = (np.diff(pieces, prepend=-2) != 1) | (np.diff(self.row[pieces], prepend=-1) != 0)
        begins = np.flatnonzero(new)
        counts, heads = np.add.reduceat(self.count[pieces], begins), pieces[begins]
        for row, first, count in zip(
            self.row[heads].tolist(), self.first[heads].tolist(), counts.tolist(), strict=True
        ):
            yield DrawRange(self.draws[row], first, count)


def _cut(packed: Packed, row: int, box: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The rows of `Pieces` that show draw `row`, which has this box."""
    draw = packed.draws[row]
    mesh = packed.geometry.ranges[draw.mesh]
    count = 3 * mesh.triangle_count
    if draw.instance_count > 1 or mesh.triangle_count <= PIECE:
        return np.array([row]), np.array([mesh.first_index]), np.array([count]), box[None]
    first = np.arange(0, count, 3 * PIECE)
    boxes = _placed(mesh.piece_boxes, packed.instances[draw.first_instance])
    return np.full(len(first), row), mesh.first_index + first, np.minimum(count - first, 3 * PIECE), boxes


def _placed(boxes: np.ndarray, instance: np.void) -> np.ndarray:
    """Bounds in world space of (n, 2, 3) boxes of an instance's mesh."""
    matrix = to_world(instance).astype(np.float64)
    center = boxes.mean(axis=1) @ matrix[:, :3].T + matrix[:, 3]
    extent = np.ptp(boxes, axis=1) / 2.0 @ np.abs(matrix[:, :3]).T
    return np.stack([center - extent, center + extent], axis=1)
