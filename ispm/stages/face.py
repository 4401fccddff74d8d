"""The faces of a light's maps as cameras, and which boxes they may see."""

from __future__ import annotations

import numpy as np

from ispm import wgsl
from ispm.lights.lightmap import LightMap
from ispm.scene.extent import corners_of

FACE = wgsl.load("stages/face.wgsl").dtype("Face")


def face_uniforms(
    map: LightMap,
    index: int,
    near: float,
    shift: tuple[float, float] = (0.0, 0.0),
    pass_index: int = 0,
) -> np.ndarray:
    """Return the (F,) FACE records of a map's faces.

    index  of the map; the chance by which it sees blended surfaces depends on it
    near   m along a face's axis; what is nearer than that to a light is not seen
    shift  of the samples, in halves of a face
    """
    faces = np.zeros(len(map.axes), FACE)
    faces["position"], faces["near"], faces["pass_index"] = map.origin, near, pass_index
    faces["s"], faces["t"], faces["axis"] = np.moveaxis(map.axes, 1, 0)
    faces["index"] = 6 * index + np.arange(len(faces))
    faces["shift"], faces["orthographic"] = shift, map.orthographic
    return faces


def seen_by_faces(boxes: np.ndarray, map: LightMap) -> np.ndarray:
    """Return (F, n) whether a face of a map may see a box within the light's range.

    boxes  (n, 2, 3) world space
    An orthographic face sees along its whole axis, also before its near and beyond its far plane.
    """
    corners = corners_of(boxes) - map.origin
    s, t, axis = (corners @ row.T for row in np.moveaxis(map.axes, 1, 0))  # (n, 8, F) each
    edge = np.ones_like(axis) if map.orthographic else axis
    outside = [(side > edge).all(axis=1) for side in (s, -s, t, -t)]
    nearest = np.clip(map.origin, boxes[:, 0], boxes[:, 1]) - map.origin
    return np.asarray(~np.any(outside, axis=0).T & (np.linalg.norm(nearest, axis=1) <= map.range))
