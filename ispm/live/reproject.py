"""Reprojection: what a frame's receivers show, found among the receivers of the frame before.

Receivers lie anywhere in their blocks, so that those of two frames are matched where they really are: taken
as centers of blocks, history drifts even at rest.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ispm.accel.normals import unit
from ispm.frame import Receivers
from ispm.kernels.share import run_shared, shared_rows
from ispm.optics.jit import jit
from ispm.optics.records import INNER
from ispm.optics.vector import Vector, dot, sub, vec3
from ispm.scene.layout import Layout
from ispm.scene.packed_instance import Placed
from ispm.stages.camera import CameraView

f32, i64, u32 = np.float32, np.int64, np.uint32

_RADIUS2 = 2.25  # square of low-resolution pixels: receivers farther off count for nothing
_SHARP2 = 0.02  # likewise: nearer ones count alike. To .5 nothing changes; less blurs least
_THICKNESS = 1.3  # low-resolution pixels on the surface that one may lie off another's tangent plane
_SLANT_MAX = 10.0  # of surfaces seen aslant
_LEAST_WEIGHT = 0.003  # of all together: below it the history is of another surface
_CHUNK = 256  # receivers a thread takes at a time
NOWHERE = -1  # row of an instance that was not there


class Moves(NamedTuple):
    """Where the instances of a frame were in the frame before.

    rows     (I,) int64, their rows then; NOWHERE: they were not there
    places   (I, 3, 4) float32: world space now to then
    normals  (I, 3, 3) float32: likewise of normals, not of unit length
    """

    rows: np.ndarray
    places: np.ndarray
    normals: np.ndarray


class Seen(NamedTuple):
    """The receivers of a frame and what is kept at each.

    points   (n,) RECEIVER, row by row; `valid`: instance row + 1
    pixels   (n, 2) float32, where each lies, low-resolution pixels right and down
    shape    (w, h) receivers;  size  of the picture in blocks, which need not be whole
    clip     (4, 4) float32, clip from world space
    kept     (n, k) float32
    """

    points: np.ndarray
    pixels: np.ndarray
    shape: tuple[int, int]
    size: tuple[np.float32, np.float32]
    clip: np.ndarray
    kept: np.ndarray


def seen(image: Receivers, view: CameraView, block: int, kept: np.ndarray) -> Seen:
    """Return what `reproject` looks in.

    image  the receivers of blocks of block x block pixels of what a view sees
    kept   (n, k) float32
    """
    clip, (width, height) = view.clip_from_world, view.size
    size = f32(width / block), f32(height / block)
    places = image.points["position"].astype(np.float64) @ clip[:, :3].T + clip[:, 3]
    w = np.where(places[:, 3] > 0.0, places[:, 3], 1.0)
    right, down = size[0] * (0.5 + 0.5 * places[:, 0] / w), size[1] * (0.5 - 0.5 * places[:, 1] / w)
    pixels = np.stack([right, down], axis=1).astype(np.float32)
    return Seen(image.points, pixels, image.size, size, clip.astype(np.float32), kept)


def moves(now: Placed, before: Placed) -> Moves:
    """Return where instances were. The same part of the same node is the same instance, whatever its mesh."""
    rows = np.full(len(now.ids), NOWHERE, np.int64)
    places = np.tile(np.eye(3, 4, dtype=np.float32), (len(rows), 1, 1))
    normals = np.tile(np.eye(3, dtype=np.float32), (len(rows), 1, 1))
    ids = _ids_before(now.layout, before.layout)[now.ids]
    stay = np.flatnonzero(ids >= 0)
    row_of = np.empty(len(before.ids), np.int64)
    row_of[before.ids] = np.arange(len(before.ids))
    rows[stay] = row_of[ids[stay]]
    here, there = now.places[now.ids[stay]], before.places[ids[stay]]
    other = np.flatnonzero((here != there).any(axis=(1, 2)))
    flat = np.abs(np.linalg.det(here[other, :3, :3])) < 1e-30  # of no volume: there is no way back
    rows[stay[other[flat]]] = NOWHERE
    other = other[~flat]
    back = there[other] @ np.linalg.inv(here[other])
    places[stay[other]] = back[:, :3]
    normals[stay[other]] = np.linalg.inv(back[:, :3, :3]).transpose(0, 2, 1)
    return Moves(rows, places, normals)


def _ids_before(now: Layout, before: Layout) -> np.ndarray:
    """The id in the frame before of each id of this one, (n,) int64; NOWHERE."""
    count = int(now.copies.sum())
    if now is before:
        return np.arange(count)
    known = dict(_parts(before))
    found = np.full(count, NOWHERE, np.int64)
    for key, ids in _parts(now):
        then = known.get(key, range(0))
        both = min(len(ids), len(then))
        found[ids.start : ids.start + both] = np.arange(then.start, then.start + both)
    return found


def _parts(layout: Layout) -> Iterator[tuple[tuple[int, int, int], range]]:
    """Each part with the ids of its copies: by its node, its number there, and how often the node was met
    before, as one may hang in several places."""
    met, first = Counter[tuple[int, int]](), 0
    for run in layout.names.runs:
        part = id(layout.nodes[run.node]), run.part
        yield (*part, met[part]), range(first, first + run.copies)
        met[part] += 1
        first += run.copies


def reproject(points: np.ndarray, moves: Moves, before: Seen, threads: int) -> np.ndarray:
    """Return what is kept at (n,) RECEIVER points of this frame, (n, k) float32; 0 where there is nothing.

    A point p and its normals go to where its instance was, then to the picture of then. Of the receivers in
    the 3 x 3 pixels about it, on the same instance, the mean is taken, by weights (1 - e^2 / 2.25)^2
    s / (e^2 + s) (1 - z^2 / r^2)^2 (ng.ng')^8 (n.n')^8; e is the distance in the picture, z that from the
    tangent plane.
    """
    out = np.zeros((len(points), before.kept.shape[1]), np.float32)
    run_shared(lambda counter: _reproject(counter, points, moves, before, out), threads)
    return out


@jit
def _reproject(counter, points, moves, before, out):
    """Fill as many rows of `out` as a thread gets."""
    for i in shared_rows(counter, _CHUNK, len(points)):
        if points[i].valid == u32(0):
            continue
        instance = i64(points[i].valid & ~u32(INNER)) - i64(1)
        if moves.rows[instance] >= i64(0):
            m, k = moves.places[instance], moves.normals[instance]
            x, ng, n = vec3(points[i].position), vec3(points[i].ng), vec3(points[i].n)
            here = _Here(_placed(m, x), _turned(k, ng), _turned(k, n))
            _mean_near(here, moves.rows[instance] + i64(1), before, out[i])


class _Here(NamedTuple):
    """A point of this frame as it was in the one before, m, and its unit normals."""

    x: Vector
    ng: Vector
    n: Vector


@jit
def _placed(m, x):
    """The point x by a (3, 4) matrix."""
    return (
        m[0, 0] * x[0] + m[0, 1] * x[1] + m[0, 2] * x[2] + m[0, 3],
        m[1, 0] * x[0] + m[1, 1] * x[1] + m[1, 2] * x[2] + m[1, 3],
        m[2, 0] * x[0] + m[2, 1] * x[1] + m[2, 2] * x[2] + m[2, 3],
    )


@jit
def _turned(k, n):
    """The normal n by a (3, 3) matrix, of unit length."""
    return unit(
        (
            k[0, 0] * n[0] + k[0, 1] * n[1] + k[0, 2] * n[2],
            k[1, 0] * n[0] + k[1, 1] * n[1] + k[1, 2] * n[2],
            k[2, 0] * n[0] + k[2, 1] * n[1] + k[2, 2] * n[2],
        )
    )


@jit
def _mean_near(here, valid, before, out):
    """Write the weighted mean of what is kept about a _Here, on the instance of `valid`; k zeros else."""
    clip, (width, height), x = before.clip, before.size, here.x
    columns, rows = before.shape
    w = clip[3, 0] * x[0] + clip[3, 1] * x[1] + clip[3, 2] * x[2] + clip[3, 3]
    if not w > f32(0):
        return
    across = clip[0, 0] * x[0] + clip[0, 1] * x[1] + clip[0, 2] * x[2] + clip[0, 3]
    up = clip[1, 0] * x[0] + clip[1, 1] * x[1] + clip[1, 2] * x[2] + clip[1, 3]
    right, down = width * (f32(0.5) + f32(0.5) * across / w), height * (f32(0.5) - f32(0.5) * up / w)
    if not (right > f32(-1) and down > f32(-1) and right < width + f32(1) and down < height + f32(1)):
        return
    column, row = i64(np.floor(right)), i64(np.floor(down))
    total = f32(0)
    for q in range(9):
        c, r = column + i64(q % 3) - i64(1), row + i64(q // 3) - i64(1)
        if c < i64(0) or r < i64(0) or c >= columns or r >= rows:
            continue
        j = r * columns + c
        weight = _likeness(here, right, down, valid, before, j)
        if weight > f32(0):
            total += weight
            for k in range(len(out)):
                out[k] += weight * before.kept[j, k]
    scale = f32(1) / total if total >= f32(_LEAST_WEIGHT) else f32(0)
    for k in range(len(out)):
        out[k] *= scale


@jit
def _likeness(here, right, down, valid, before, j):
    """The weight of receiver `j` for a _Here that lies `right` and `down` in its picture."""
    other = before.points[j]
    if i64(other.valid & ~u32(INNER)) != valid:
        return f32(0)
    ex, ey = before.pixels[j, 0] - right, before.pixels[j, 1] - down
    e2 = ex * ex + ey * ey
    z = dot(here.ng, sub(vec3(other.position), here.x))
    reach = f32(_THICKNESS) * other.footprint * min(other.slant, f32(_SLANT_MAX))
    flat = f32(1) - z * z / (reach * reach)
    facing, bump = dot(here.ng, vec3(other.ng)), dot(here.n, vec3(other.n))
    if e2 >= f32(_RADIUS2) or flat <= f32(0) or facing <= f32(0) or bump <= f32(0):
        return f32(0)
    near = f32(1) - e2 * f32(1 / _RADIUS2)
    alike = facing * bump
    alike *= alike
    alike *= alike
    alike *= alike
    return near * near * f32(_SHARP2) / (e2 + f32(_SHARP2)) * flat * flat * alike
