"""Rotations: unit quaternions x, y, z, w, as glTF and SciPy write them. Angles are in radians."""

from __future__ import annotations

import math

import numpy as np

from ispm.errors import IspmError, SceneError, warn_caller
from ispm.scene.values import FARTHEST, Point, require, strict_call

Quaternion = tuple[float, float, float, float]

_MIN_LENGTH = 1e-9  # of an axis, below which it has no direction
_TWO_TURNS = 4.0 * math.pi
_PARALLEL = 0.9999  # cosine between `up` and the view from which the top of the picture is undefined


@strict_call
def axis_angle(axis: Point, angle: float, *, degrees: bool = False) -> Quaternion:
    """Return the rotation by `angle` about `axis`, as a quaternion x, y, z, w for `Node.rotation`.

    axis     three numbers, of any length but 0
    angle    radians, counter-clockwise where the axis points at the viewer
    degrees  whether the angle is in degrees instead
    Raises SceneError where one of them cannot be used; warns of radians that look like degrees.
    """
    require("axis_angle: axis", axis, -FARTHEST, FARTHEST, 3)
    return _turn(axis, _radians("axis_angle: angle", angle, degrees))


@strict_call
def euler(
    x: float = 0.0, y: float = 0.0, z: float = 0.0, order: str = "xyz", *, degrees: bool = False
) -> Quaternion:
    """Return three rotations, one after the other, as a quaternion x, y, z, w for `Node.rotation`.

    x, y, z  radians about the axis of that name
    order    the axes in the order of the rotations, as in SciPy: "xyz" about the parent's axes, which stand
             still; "XYZ" about the node's own, which turn with it. Blender's XYZ is "xyz" here.
    degrees  whether the angles are in degrees instead
    Raises SceneError where one of them cannot be used; warns of radians that look like degrees.
    """
    given = {"x": x, "y": y, "z": z}
    angles = {name: _radians(f"euler: {name}", angle, degrees) for name, angle in given.items()}
    if (
        not isinstance(order, str)
        or sorted(order.lower()) != ["x", "y", "z"]
        or not (order.islower() or order.isupper())
    ):
        raise SceneError(f"euler: order must be x, y and z in some order, as 'xyz' or 'ZYX', not {order!r}")
    turns = [_turn(np.eye(3)["xyz".index(axis)], angles[axis]) for axis in order.lower()]
    first, second, third = turns if order.islower() else turns[::-1]
    return multiply(third, multiply(second, first))


def _turn(axis: Point, angle: float) -> Quaternion:
    """The rotation by radians about an axis."""
    x, y, z = (float(value) for value in axis)
    length = math.hypot(x, y, z)
    if not length > _MIN_LENGTH:
        raise SceneError("axis_angle: axis must not be 0, 0, 0")
    scale = math.sin(0.5 * angle) / length
    return x * scale, y * scale, z * scale, math.cos(0.5 * angle)


def _radians(what: str, angle: float, degrees: bool) -> float:
    """An angle in radians. Whole numbers of more than two turns are hardly meant as such: a warning."""
    require(f"{what}, in {'degrees' if degrees else 'radians'},", angle)
    if degrees:
        return math.radians(angle)
    if abs(angle) > _TWO_TURNS and float(angle).is_integer():
        warn_caller(f"{what} is {angle:g} radians, more than two turns; for degrees say degrees=True")
    return float(angle)


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the rotation that turns by b, then by a."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def rotation_matrix(quaternion: np.ndarray) -> np.ndarray:
    """Return the (3, 3) matrix of a quaternion x, y, z, w; it need not be unit."""
    return np.asarray(rotation_matrices(quaternion[None])[0])


def rotation_matrices(quaternions: np.ndarray) -> np.ndarray:
    """Return the (n, 3, 3) matrices of (n, 4) quaternions x, y, z, w; they need not be unit."""
    x, y, z, w = np.moveaxis(quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True), 1, 0)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.moveaxis(np.array(rows), 2, 0)


def place_matrices(translations: np.ndarray, rotations: np.ndarray, scales: np.ndarray) -> np.ndarray:
    """Return the (n, 4, 4) matrices that scale, then turn, then move.

    translations, scales  (n, 3);  rotations  (n, 4) quaternions x, y, z, w of any length but 0
    """
    result = np.zeros((len(rotations), 4, 4))
    with np.errstate(invalid="ignore"):  # what is not finite is found, and named, by who asked
        result[:, :3, :3] = rotation_matrices(rotations) * scales[:, None]
    result[:, :3, 3] = translations
    result[:, 3, 3] = 1.0
    return result


def quaternion(rotation: np.ndarray) -> Quaternion:
    """Return the unit quaternion x, y, z, w of a (3, 3) rotation matrix."""
    x, y, z, w = quaternions(np.asarray(rotation)[None])[0].tolist()
    return x, y, z, w


def quaternions(rotations: np.ndarray) -> np.ndarray:
    """Return the unit quaternions x, y, z, w of (n, 3, 3) rotation matrices, (n, 4)."""
    # the eigenvector of the largest eigenvalue (Bar-Itzhack 2000): sound for every rotation
    (a, b, c), (d, e, f), (g, h, i) = np.moveaxis(rotations, 0, -1)
    k = np.array(
        [
            [a - e - i, b + d, c + g, h - f],
            [b + d, e - a - i, f + h, c - g],
            [c + g, f + h, i - a - e, d - b],
            [h - f, c - g, d - b, a + e + i],
        ]
    )
    largest: np.ndarray = np.linalg.eigh(np.moveaxis(k, -1, 0))[1][:, :, 3]
    return largest * np.where(largest[:, 3:] < 0.0, -1.0, 1.0)


def facing(back: np.ndarray, up: np.ndarray, error: type[IspmError] = SceneError) -> np.ndarray:
    """Return the (3, 3) rotation whose +Z lies along `back` and whose +Y as near to `up` as can be.

    Where the two are parallel, -Z stands in for `up`, and where `back` lies along that, +Y.
    Raises `error` where one has no length.
    """
    for what, vector in (("the place and the point looked at are the same", back), ("up is 0, 0, 0", up)):
        if not float(np.linalg.norm(vector)) > 0.0:
            raise error(f"look_at: {what}")
    back, up = back / np.linalg.norm(back), up / np.linalg.norm(up)
    for other in ((0.0, 0.0, -1.0), (0.0, 1.0, 0.0)):
        if abs(float(back @ up)) >= _PARALLEL:
            up = np.array(other)
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(back, right), back], axis=1)
