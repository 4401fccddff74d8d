"""Cameras: where the picture is taken from."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ispm.errors import SettingsError
from ispm.scene.rotation import facing
from ispm.scene.values import FARTHEST, LEAST, Point, Strict, array_of, as_code, require

Convention = Literal["opencv", "opengl"]

_AXES = {"opencv": np.array([1.0, -1.0, -1.0, 1.0]), "opengl": np.ones(4)}  # signs of a pose's columns
_WIDEST = math.nextafter(math.pi, 0.0)
_SQUARE = 1e-4  # what the axes of a pose may be off being at right angles and unit


@dataclass
class Camera(Strict):
    """A camera looks along -Z of its node, +Y up, +X to the right (glTF).

    yfov       vertical angle of view in radians; used where `ymag` is None (perspective)
    ymag       half the height of the view in metres (orthographic), else None
    pose       (4, 4) camera-to-world matrix; None: the pose of the node that holds the camera
    aspect     width over height of the view; None: that of the picture, so that pixels are square
    principal  where the axis of the view meets the picture: 0, 0 the middle, 1, 1 its top right corner
    """

    yfov: float = math.radians(50.0)
    ymag: float | None = None
    pose: np.ndarray | None = None
    aspect: float | None = None
    principal: tuple[float, float] = (0.0, 0.0)
    name: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        self.check()

    def __repr__(self) -> str:
        return as_code(self)

    def check(self) -> None:
        """Raise SettingsError for a value that shows nothing."""
        _require("yfov, in radians,", self.yfov, LEAST, _WIDEST)
        if self.ymag is not None:
            _require("ymag, a height in metres,", self.ymag, LEAST)
        if self.aspect is not None:
            _require("aspect, width over height,", self.aspect, LEAST)
        _require("principal, a place in the picture,", self.principal, -FARTHEST, FARTHEST, 2)
        if self.pose is not None:
            self.pose = _pose(self.pose)

    @property
    def orthographic(self) -> bool:
        """Whether rays are parallel."""
        return self.ymag is not None

    @classmethod
    def look_at(
        cls,
        eye: Point,
        target: Point,
        yfov: float = math.radians(50.0),
        up: Point = (0.0, 1.0, 0.0),
    ) -> Camera:
        """Return a perspective camera at `eye` that looks at `target`.

        eye, target  (3,) metres, world space
        yfov         vertical angle of view, radians
        up           (3,) direction that points up in the picture; 0, 0, 1 where +Z is up
        Raises SettingsError where the two points are the same, or none.
        """
        for name, place in (("eye", eye), ("target", target), ("up", up)):
            _require(name, place, -FARTHEST, FARTHEST, 3)
        return cls(yfov=yfov, pose=look_at_pose(*(np.asarray(v, float) for v in (eye, target, up))))

    @classmethod
    def from_intrinsics(
        cls,
        K: np.ndarray | Sequence[Sequence[float]],
        size: tuple[int, int],
        pose: np.ndarray,
        convention: Convention = "opencv",
    ) -> Camera:
        """Return the camera that projects as K [R | t] does, for pictures of any size.

        K           (3, 3) focal lengths and principal point in pixels of a picture of `size`, measured from
                    its top left corner: the first pixel's centre is at 0.5, 0.5. Where it is at 0, 0, as
                    in OpenCV's functions, add 0.5 to the principal point.
        size        width and height; a picture of another size shows the same view
        pose        (4, 4) camera-to-world, a rotation and a translation in metres
        convention  the pose's axes: `opencv` +Y down and +Z ahead, `opengl` +Y up and -Z ahead
        Raises SettingsError where one of them makes no sense, or K has skew.
        """
        k = array_of("camera: K", K, (3, 3), error=SettingsError).astype(np.float64)
        if min(k[0, 0], k[1, 1]) <= 0.0:
            raise SettingsError("camera: K must have focal lengths above 0, in pixels")
        if abs(k[0, 1]) > 1e-9 * k[0, 0] or k[1, 0] or (k[-1] != (0.0, 0.0, 1.0)).any():
            raise SettingsError("camera: K must be fx 0 cx; 0 fy cy; 0 0 1: skew is not supported")
        width, height = _size(size)
        return cls(
            yfov=2.0 * math.atan(height / (2.0 * k[1, 1])),
            pose=_pose(pose) * _axes(convention),
            aspect=float((width / k[0, 0]) / (height / k[1, 1])),
            principal=(float(2.0 * k[0, 2] / width - 1.0), float(1.0 - 2.0 * k[1, 2] / height)),
        )

    def intrinsics(self, size: tuple[int, int]) -> np.ndarray:
        """Return K, (3, 3) float64: fx 0 cx; 0 fy cy; 0 0 1 in pixels of a picture of `size`.

        Measured from the top left corner, as `from_intrinsics` takes it: the first pixel's centre is at 0.5,
        0.5. For functions of OpenCV, where it is at 0, 0, take 0.5 off the principal point.
        Raises SettingsError for an orthographic camera.
        """
        if self.orthographic:
            raise SettingsError("camera: an orthographic camera has no K: its rays are parallel")
        width, height = _size(size)
        fy = height / (2.0 * math.tan(0.5 * self.yfov))
        fx = fy if self.aspect is None else fy * width / (height * self.aspect)
        x, y = self.principal
        return np.array(
            [[fx, 0.0, 0.5 * width * (1.0 + x)], [0.0, fy, 0.5 * height * (1.0 - y)], [0.0, 0.0, 1.0]]
        )

    def extrinsics(self, convention: Convention = "opencv") -> np.ndarray:
        """Return the pose, (4, 4) camera-to-world, with the axes of a convention, as `from_intrinsics`.

        Its inverse is the [R | t] that goes with K. A node's camera has no pose of its own: take
        `scene.default_camera()` or `renderer.camera`, which have.
        Raises SettingsError where there is none.
        """
        if self.pose is None:
            raise SettingsError("camera: it has no pose of its own; take renderer.camera, which has")
        return np.asarray(_pose(self.pose) * _axes(convention))


def _require(name: str, value: object, low: float, high: float = FARTHEST, *counts: int) -> None:
    require(f"camera: {name}", value, low, high, *counts, error=SettingsError)


def _size(size: object) -> tuple[float, float]:
    _require("size, width and height in pixels,", size, 1, FARTHEST, 2)
    width, height = np.asarray(size).tolist()
    return width, height


def _axes(convention: str) -> np.ndarray:
    if convention not in tuple(_AXES):
        raise SettingsError(f"camera: the convention '{convention}' is not one of {', '.join(_AXES)}")
    return _AXES[convention]


def _pose(values: object) -> np.ndarray:
    """A pose that turns and moves, and neither scales nor mirrors. Raises SettingsError for another."""
    pose = np.asarray(array_of("camera: the pose", values, (4, 4), error=SettingsError), np.float64)
    turn = pose[:3, :3]
    square = np.abs(turn @ turn.T - np.eye(3)).max() < _SQUARE and pose[3].tolist() == [0.0, 0.0, 0.0, 1.0]
    if not square or np.linalg.det(turn) < 0.0:
        raise SettingsError(
            "camera: the pose must be (4, 4) camera-to-world: a rotation and a translation, last row 0 0 0 1"
        )
    return pose


def look_at_pose(eye: np.ndarray, target: np.ndarray, up: np.ndarray | None = None) -> np.ndarray:
    """Return the (4, 4) camera-to-world matrix of a camera at `eye` looking at `target`, +Y up."""
    pose = np.eye(4)
    upwards = np.array([0.0, 1.0, 0.0]) if up is None else up
    pose[:3, :3], pose[:3, 3] = facing(eye - target, upwards, SettingsError), eye
    return pose
