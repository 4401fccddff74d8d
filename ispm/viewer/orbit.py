"""Where the eye goes when the camera is dragged: orbit, pan, zoom, fly, look around, focus, frame all.

Metres, radians, world space; poses are (4, 4) camera-to-world, the camera looks along its -Z.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ispm.scene.camera import Camera
from ispm.scene.rotation import axis_angle, facing, rotation_matrix

Axis = Literal["x", "y", "z"]

AXES: dict[str, np.ndarray] = {"x": np.eye(3)[0], "y": np.eye(3)[1], "z": np.eye(3)[2]}
_POLE = math.radians(1.0)  # that the view stays off straight up and down, where left and right flip
_NEAREST = 1e-6  # m, from the eye to the point that it turns about
_FARTHEST = 1e12
_CLOSE = 0.05  # of the scene's diagonal: a middle that is nearer, or behind, is no point to turn about
_MARGIN = 1.1  # about what is framed


@dataclass(frozen=True, eq=False)
class Orbit:
    """A camera that turns about a point.

    camera    its lens; the pose in it is not used
    pose      (4, 4) camera-to-world
    distance  m, from the eye along the view to the point that it turns about
    up        the world's axis that stays upright
    """

    camera: Camera
    pose: np.ndarray
    distance: float
    up: Axis = "y"

    @property
    def eye(self) -> np.ndarray:
        """(3,) m, where the camera stands."""
        return np.asarray(self.pose[:3, 3])

    @property
    def back(self) -> np.ndarray:
        """(3,) unit, against the view."""
        return np.asarray(self.pose[:3, 2])

    @property
    def pivot(self) -> np.ndarray:
        """(3,) m, the point that it turns about."""
        return np.asarray(self.eye - self.distance * self.back)

    @property
    def placed(self) -> Camera:
        """The camera with its pose."""
        return replace(self.camera, pose=self.pose)

    @property
    def reach(self) -> float:
        """m at the pivot that the picture's height shows."""
        if self.camera.ymag is not None:
            return 2.0 * self.camera.ymag
        return 2.0 * self.distance * math.tan(0.5 * self.camera.yfov)

    def orbited(self, right: float, down: float) -> Orbit:
        """Turn about the pivot, radians: what is before it goes to the right and down in the picture."""
        turned = self._turned(right, down)
        return self._at(turned, self.pivot + self.distance * turned[:, 2])

    def looked(self, right: float, down: float) -> Orbit:
        """Turn the view where the eye stands, radians to the right and down."""
        return self._at(self._turned(right, down), self.eye)

    def _turned(self, right: float, down: float) -> np.ndarray:
        """The (3, 3) rotation whose view is turned to the right and down, but for the last of _POLE."""
        up = AXES[self.up]
        side = 1.0 if float(self.pose[:3, 1] @ up) >= 0.0 else -1.0  # -1: the picture stands on its head
        turn = rotation_matrix(np.array(axis_angle(up, -right * side))) @ self.pose[:3, :3]
        above = math.acos(float(np.clip(turn[:, 2] @ up, -1.0, 1.0)))  # from the upright axis to the back
        wanted = min(max(above - down * side, _POLE), math.pi - _POLE)
        level = np.cross(up, turn[:, 2])
        axis = level if float(np.linalg.norm(level)) > 1e-9 else turn[:, 0]
        return np.asarray(rotation_matrix(np.array(axis_angle(axis, wanted - above))) @ turn)

    def panned(self, right: float, up: float) -> Orbit:
        """Move what is seen by parts of the picture's height, at the pivot's depth."""
        step = self.pose[:3, 0] * right + self.pose[:3, 1] * up
        return self._at(self.pose[:3, :3], self.eye - self.reach * step)

    def zoomed(self, steps: float) -> Orbit:
        """Go nearer by powers of 2: 1 halves the distance to the pivot, or the view's height."""
        factor = 2.0**-steps
        if self.camera.ymag is not None:
            ymag = min(max(self.camera.ymag * factor, _NEAREST), _FARTHEST)
            return replace(self, camera=replace(self.camera, ymag=ymag))
        return self._away(self.distance * factor)

    def flown(self, right: float, up: float, ahead: float) -> Orbit:
        """Move the eye with its pivot, m: along the picture's axes, upwards along the upright one."""
        step = self.pose[:3, 0] * right - self.back * ahead + AXES[self.up] * up
        return self._at(self.pose[:3, :3], self.eye + step)

    def focused(self, point: np.ndarray) -> Orbit:
        """Look at a point, (3,) m, and turn about it from now on; the eye stays."""
        way = self.eye - point
        distance = float(np.linalg.norm(way))
        if not distance > _NEAREST:
            return self
        if self.camera.orthographic:  # the eye moves aside, for its rays are parallel
            depth = float(way @ self.back)
            return replace(
                self._at(self.pose[:3, :3], point + depth * self.back), distance=max(depth, _NEAREST)
            )
        return replace(self._at(facing(way, AXES[self.up]), self.eye), distance=distance)

    def framed(self, bounds: np.ndarray, aspect: float) -> Orbit:
        """See all of a box, (2, 3) m, from the direction of now. aspect: the picture's, width over height."""
        center = bounds.mean(axis=0)
        radius = max(0.5 * float(np.linalg.norm(bounds[1] - bounds[0])), _NEAREST) * _MARGIN
        if self.camera.ymag is not None:
            camera = replace(self.camera, ymag=radius / min(aspect, 1.0))
            distance = max(self.distance, 2.0 * radius)
        else:
            half = math.atan(math.tan(0.5 * self.camera.yfov) * min(aspect, 1.0))
            camera, distance = self.camera, radius / math.sin(half)
        made = replace(self, camera=camera, distance=distance)
        return made._at(self.pose[:3, :3], center + distance * self.back)

    def upright(self, up: Axis) -> Orbit:
        """Take another axis of the world as upright, and level the horizon; the view stays."""
        return replace(self._at(facing(self.back, AXES[up]), self.eye), up=up)

    def _away(self, distance: float) -> Orbit:
        """Stand at another distance from the same pivot."""
        distance = min(max(distance, _NEAREST), _FARTHEST)
        return replace(self._at(self.pose[:3, :3], self.pivot + distance * self.back), distance=distance)

    def _at(self, turn: np.ndarray, eye: np.ndarray) -> Orbit:
        """Stand at `eye`, turned as a (3, 3) rotation, which is made square so that errors do not add up."""
        right, _, back = turn.T
        right = right / np.linalg.norm(right)
        back = back - right * (right @ back)
        back = back / np.linalg.norm(back)
        pose = np.eye(4)
        pose[:3, 0], pose[:3, 1], pose[:3, 2] = right, np.cross(back, right), back
        pose[:3, 3] = np.clip(eye, -_FARTHEST, _FARTHEST)
        return replace(self, pose=pose)


def orbit_of(camera: Camera, bounds: np.ndarray) -> Orbit:
    """Return the orbit of a camera with a pose, about what of the scene's middle lies ahead.

    bounds  (2, 3) m of the scene
    """
    assert camera.pose is not None
    pose = np.asarray(camera.pose, np.float64)
    diagonal = max(float(np.linalg.norm(bounds[1] - bounds[0])), _NEAREST)
    ahead = float((pose[:3, 3] - bounds.mean(axis=0)) @ pose[:3, 2])
    return Orbit(camera, pose, ahead if ahead > _CLOSE * diagonal else 0.3 * diagonal)
