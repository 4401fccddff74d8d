"""The cube of directions about a point: its faces as cameras, its texels and what they cover."""

from __future__ import annotations

import math

import numpy as np

from ispm import wgsl

FACE = wgsl.load("stages/cube.wgsl").dtype("Face")

# s (right), t (down) and axis of each face in the order of cube maps; WebGPU, section 23.2.
_AXES = np.array(
    [
        [(0, 0, -1), (0, -1, 0), (1, 0, 0)],
        [(0, 0, 1), (0, -1, 0), (-1, 0, 0)],
        [(1, 0, 0), (0, 0, 1), (0, 1, 0)],
        [(1, 0, 0), (0, 0, -1), (0, -1, 0)],
        [(1, 0, 0), (0, -1, 0), (0, 0, 1)],
        [(-1, 0, 0), (0, -1, 0), (0, 0, -1)],
    ],
    np.float64,
)


def cube_direction(
    face: np.ndarray | int,
    x: np.ndarray | int,
    y: np.ndarray | int,
    width: int,
    shift: tuple[float, float] = (0.0, 0.0),
) -> np.ndarray:
    """Return the (..., 3) unit direction that texel (x, y) of a face samples.

    shift  texels, in [-0.5, 0.5], right of and below the texel's centre
    """
    s = (2.0 * (np.asarray(x) + 0.5 + shift[0]) / width - 1.0)[..., None]
    t = (2.0 * (np.asarray(y) + 0.5 + shift[1]) / width - 1.0)[..., None]
    right, down, axis = np.moveaxis(_AXES[face], -2, 0)
    direction = axis + s * right + t * down
    return np.asarray(direction / np.linalg.norm(direction, axis=-1, keepdims=True))


def cube_texel_solid_angles(
    width: int, shift: tuple[float, float] = (0.0, 0.0), spread: float = 1.0
) -> np.ndarray:
    """Return the (width, width) float64 solid angles in sr that a face's texels stand for.

    spread  tangent of half the face's angle: 1 for a cube

    They follow ds dt / l^3 at the shifted samples, scaled so that six faces sum to 4 pi. Over all
    shifts the unscaled measure is unbiased, as the exact angle of the texel is not: that belongs to
    its whole area, the light found to one point of it. The scale makes each single map carry the
    light's whole flux, and is 1 + O(width^-2), so that its own bias is of fourth order.
    """
    square = spread * spread
    s, t = (square * (2.0 * (np.arange(width) + 0.5 + k) / width - 1.0) ** 2 for k in shift)
    density = (1.0 + s + t[:, None]) ** -1.5
    face = 4.0 * math.atan2(square, math.sqrt(1.0 + 2.0 * square))
    return np.asarray(density * (face / density.sum()))


def face_uniforms(
    light: np.void,
    index: int,
    near: float,
    shift: tuple[float, float] = (0.0, 0.0),
    pass_index: int = 0,
) -> np.ndarray:
    """Return the FACE records of the faces in use of row `index` of the lights.

    shift  of the samples, in halves of a face
    """
    faces = np.zeros(int(light["faces"]), FACE)
    used = faces_in_use(light)
    axes = _AXES[used] @ _map_matrix(light)
    faces["position"], faces["near"], faces["pass_index"] = light["position"], near, pass_index
    faces["range"] = light["range"] if light["range"] > 0.0 else np.finfo(np.float32).max
    faces["s"], faces["t"], faces["axis"] = np.moveaxis(axes, 1, 0)
    faces["index"] = 6 * index + used
    faces["shift"] = shift
    return faces


def seen_by_faces(boxes: np.ndarray, light: np.void) -> np.ndarray:
    """Return (faces, n) whether a face in use of a light's cube may see a box within the light's range.

    boxes  (n, 2, 3) world space
    """
    position = light["position"].astype(np.float64)
    picks = np.array([[i & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)])
    corners = boxes[:, picks, [0, 1, 2]] - position
    axes = _AXES[faces_in_use(light)] @ _map_matrix(light)
    s, t, axis = (corners @ row.T for row in np.moveaxis(axes, 1, 0))  # (n, 8, faces) each
    outside = [(side > axis).all(axis=1) for side in (s, -s, t, -t)]
    seen = ~np.any(outside, axis=0).T
    if light["range"] > 0.0:
        nearest = np.clip(position, boxes[:, 0], boxes[:, 1]) - position
        seen &= np.linalg.norm(nearest, axis=1) <= light["range"]
    return np.asarray(seen)


def faces_in_use(light: np.void) -> np.ndarray:
    """Return the indices of the faces that a light's maps have: all six, or +z alone."""
    return np.arange(6) if light["faces"] == 6 else np.array([4])


def _map_matrix(light: np.void) -> np.ndarray:
    """(3, 3) from directions about the light to its cube."""
    return np.stack([light["map_x"], light["map_y"], light["map_z"]]).astype(np.float64)
