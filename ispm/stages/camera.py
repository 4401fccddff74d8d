"""The eye of one picture: its matrices, its rays and the uniform that shaders read."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ispm import wgsl
from ispm.paths.pixel_rays import Screen
from ispm.scene.extent import corners_of

i64 = np.int64

CAMERA = wgsl.load("stages/camera.wgsl").dtype("Camera")


@dataclass(frozen=True, eq=False)
class CameraView:
    """A camera with a pose and a picture's size. Matrices are float64, columns on the right.

    size        width and height in pixels
    pose        (4, 4) camera-to-world, orthonormal; it looks along -Z with +Y up
    yfov        vertical angle of view, radians; unused where `ymag` is given
    ymag        half the height of an orthographic view in m, else None
    near, far   m along the view axis; `far` bounds orthographic views only
    jitter      pixels that samples lie right of and below the pixels' centres
    pass_index  selects the random numbers of stochastic masks
    aspect      width over height of the view; None: that of `size`, so that pixels are square
    principal   where the view axis meets the picture: 0, 0 its middle, 1, 1 its top right corner
    """

    size: tuple[int, int]
    pose: np.ndarray
    yfov: float = math.radians(50.0)
    ymag: float | None = None
    near: float = 1e-3
    far: float = 1e3
    jitter: tuple[float, float] = (0.0, 0.0)
    pass_index: int = 0
    aspect: float | None = None
    principal: tuple[float, float] = (0.0, 0.0)
    clip_from_world: np.ndarray = field(init=False, repr=False)
    world_from_clip: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        matrix = self._clip_from_view() @ np.linalg.inv(np.asarray(self.pose, np.float64))
        object.__setattr__(self, "clip_from_world", matrix)
        object.__setattr__(self, "world_from_clip", np.linalg.inv(matrix))

    @property
    def eye(self) -> np.ndarray:
        """Return (3,) m, where the camera stands, world space."""
        return np.asarray(self.pose, np.float64)[:3, 3]

    @property
    def eye_or_direction(self) -> np.ndarray:
        """Where the camera stands and 1; orthographic: the direction towards it and 0. (4,)"""
        return np.append(self.eye, 1.0) if self.ymag is None else np.append(-self.forward, 0.0)

    @property
    def forward(self) -> np.ndarray:
        """The unit direction it looks along, world space."""
        return -np.asarray(self.pose, np.float64)[:3, 2]

    @property
    def footprint(self) -> float:
        """A pixel's side in m: at 1 m of depth, or at any (orthographic); that of a square of a pixel's
        area where pixels are not square."""
        width, height = self._extents()
        return 2.0 * math.sqrt(width * height / (self.size[0] * self.size[1]))

    def pixel_widths(self, points: np.ndarray) -> np.ndarray:
        """Return (n,) float32 m: a pixel's side at (n, 3) world-space points, seen face on; above 0."""
        *ahead, offset = self.clip_from_world[-1]
        widths = self.footprint * (points @ np.array(ahead, np.float32) + np.float32(offset))
        return np.maximum(np.asarray(widths, np.float32), np.float32(1e-30))

    def sees(self, boxes: np.ndarray) -> np.ndarray:
        """Return (n,) whether each of (n, 2, 3) world-space boxes may be in the picture."""
        corners = np.ones((len(boxes), 8, 4))
        corners[..., :3] = corners_of(boxes)
        x, y, _, w = np.moveaxis(corners @ self.clip_from_world.T, -1, 0)
        return np.asarray(~np.any([(side > w).all(axis=1) for side in (x, -x, y, -y)], axis=0))

    def uniform(self) -> np.ndarray:
        """Return the CAMERA record."""
        record = np.zeros((), CAMERA)
        record["clip_from_world"] = self.clip_from_world.T  # WGSL stores columns
        record["world_from_clip"] = self.world_from_clip.T
        record["eye"], record["forward"] = self.eye, self.forward
        record["orthographic"] = self.ymag is not None
        record["near"], record["far"] = self.near, self.far
        record["size"], record["jitter"] = self.size, self.jitter
        record["footprint"], record["pass_index"] = self.footprint, self.pass_index
        return record

    def rays(self) -> tuple[np.ndarray, np.ndarray]:
        """Return origins and unit directions, (height, width, 3) float64, of the pixels' samples."""
        width, height = self.size
        return self.rays_through(np.arange(width) + 0.5, np.arange(height)[:, None] + 0.5)

    def rays_through(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return origins and unit directions, (..., 3) float64, of rays through points of the picture.

        x, y  pixels right and down, centres at .5, of shapes that broadcast
        """
        (wide, high), (shift_x, shift_y) = self._extents(), self._shift()
        across = (2.0 * x / self.size[0] - 1.0 - shift_x) * wide
        up = (1.0 - 2.0 * y / self.size[1] - shift_y) * high
        pose = np.asarray(self.pose, np.float64)
        ahead = 1.0 if self.ymag is None else self.near
        places = np.empty((*np.broadcast_shapes(across.shape, up.shape), 3))
        places[..., 0], places[..., 1], places[..., 2] = across, up, -ahead
        places = places @ pose[:3, :3].T
        if self.ymag is not None:
            return self.eye + places, np.broadcast_to(self.forward, places.shape)
        places /= np.sqrt(np.einsum("...k,...k->...", places, places))[..., None]
        return np.broadcast_to(self.eye, places.shape), places

    def screen(self) -> Screen:
        """Return where the samples of pixels lie that `rays` go through."""
        (wide, high), (shift_x, shift_y) = self._extents(), self._shift()
        width, height = self.size
        ahead = 1.0 if self.ymag is None else self.near
        corner = (1.0 / width - 1.0 - shift_x) * wide, (1.0 - 1.0 / height - shift_y) * high, -ahead
        turn = np.asarray(self.pose, np.float64)[:3, :3]
        steps = turn @ corner, turn[:, 0] * (2.0 * wide / width), turn[:, 1] * (-2.0 * high / height)
        eye, corner, right, down, forward = (
            (float(a[0]), float(a[1]), float(a[2])) for a in (self.eye, *steps, self.forward)
        )
        return Screen(eye, corner, right, down, forward, i64(width), self.ymag is not None)

    def pixel_rays(self, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return origins and unit directions, (n, 3) float64, of (n,) pixels numbered y width + x."""
        return self.rays_through(pixels % self.size[0] + 0.5, pixels // self.size[0] + 0.5)

    def _extents(self) -> tuple[float, float]:
        """Half the width and height of the view in m: at 1 m of depth, or at any (orthographic)."""
        height = math.tan(self.yfov / 2.0) if self.ymag is None else self.ymag
        return height * (self.aspect or self.size[0] / self.size[1]), height

    def _clip_from_view(self) -> np.ndarray:
        """Reversed depth: near / distance, or linear from near to far (orthographic)."""
        matrix = np.zeros((4, 4))
        matrix[0, 0], matrix[1, 1] = (1.0 / extent for extent in self._extents())
        if self.ymag is None:
            matrix[2, 3], matrix[3, 2] = self.near, -1.0
        else:
            span = self.far - self.near
            matrix[2, 2], matrix[2, 3], matrix[3, 3] = 1.0 / span, self.far / span, 1.0
        shift = np.eye(4)
        shift[:2, 3] = self._shift()
        return shift @ matrix

    def _shift(self) -> tuple[float, float]:
        """Where the view axis meets the picture, -1 to 1 right and up, the samples' jitter taken off."""
        (x, y), (right, down), (width, height) = self.principal, self.jitter, self.size
        return x - 2.0 * right / width, y + 2.0 * down / height
