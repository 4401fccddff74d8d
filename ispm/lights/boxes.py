"""Boxes, turned any way: directions to random points in them, and what they show to a direction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.vector import add, dot, scale, sub, vec3

f32 = np.float32

_SLACK = f32(1e-5)  # of a box's size: what touches it, by rounding, meets it


class Boxes(NamedTuple):
    """k boxes: middles, (k, 3) float32 m; axes, (k, 3, 3), unit, in rows; half their lengths along these,
    (k, 3) m."""

    middles: np.ndarray
    axes: np.ndarray
    lengths: np.ndarray


NO_BOXES = Boxes(np.zeros((0, 3), f32), np.zeros((0, 3, 3), f32), np.zeros((0, 3), f32))


def upright_boxes(corners: np.ndarray) -> Boxes:
    """Return the Boxes along the axes of the world that have corners, (k, 2, 3) m."""
    low, high = corners[:, 0].astype(f32), corners[:, 1].astype(f32)
    axes = np.broadcast_to(np.eye(3, dtype=f32), (len(corners), 3, 3)).copy()
    return Boxes(f32(0.5) * (low + high), axes, f32(0.5) * (high - low))


def joined_boxes(some: Sequence[Boxes]) -> Boxes:
    """Return all Boxes, one after the other."""
    return Boxes(*(np.concatenate(each) for each in zip(*some, strict=True)))


@jit
def draw_in_box(boxes, k, u0, u1, u2):
    """Return a random point of box k, m, by u0, u1, u2 of [0, 1) along its axes."""
    p = vec3(boxes.middles[k])
    for axis, u in ((0, u0), (1, u1), (2, u2)):
        p = add(p, scale((f32(2) * u - f32(1)) * boxes.lengths[k, axis], vec3(boxes.axes[k, axis])))
    return p


@jit
def box_pdf(boxes, k, position, d):
    """Return the density, 1/sr, of the direction d, unit, from a position, m, to a random point of box k: the
    integral of r^2 along the ray in the box over its volume."""
    near, far = _span(boxes, k, position, d, f32(0))
    near = max(near, f32(0))
    if far <= near:
        return f32(0)
    volume = f32(8) * boxes.lengths[k, 0] * boxes.lengths[k, 1] * boxes.lengths[k, 2]
    return (far - near) * (far * far + far * near + near * near) / (f32(3) * volume)


@jit
def meets_box(boxes, k, point, d):
    """Return whether the line through a point, m, along d, unit, meets box k."""
    size = boxes.lengths[k, 0] + boxes.lengths[k, 1] + boxes.lengths[k, 2]
    near, far = _span(boxes, k, point, d, _SLACK * size)
    return near <= far


@jit
def meets_middle(boxes, k, point, d):
    """Return whether the line through a point, m, along d, unit, crosses box k halfway along its first axis,
    where, m, and the area, m2, that the box has there, as d sees it."""
    across, off = vec3(boxes.axes[k, 0]), sub(vec3(boxes.middles[k]), point)
    facing = dot(across, d)
    area = f32(4) * boxes.lengths[k, 1] * boxes.lengths[k, 2] * abs(facing)
    if abs(facing) < f32(1e-6):
        return False, point, area
    at = add(point, scale(dot(across, off) / facing, d))
    meets, off = True, sub(at, vec3(boxes.middles[k]))
    for axis in range(1, 3):
        reach = (f32(1) + _SLACK) * boxes.lengths[k, axis]
        meets = meets and abs(dot(vec3(boxes.axes[k, axis]), off)) <= reach
    return meets, at, area


@jit
def box_shadow(boxes, k, d):
    """Return the area, m2, that box k shows to a direction, unit."""
    a, b, c = _sides(boxes, k, d)
    return a + b + c


@jit
def draw_on_box(boxes, k, d, u, v, w):
    """Return a point, m, of the sides of box k that a direction sees, drawn evenly across it by u, v, w of
    [0, 1)."""
    a, b, c = _sides(boxes, k, d)
    w *= a + b + c
    side = 0 if w < a else (1 if w < a + b else 2)
    p = vec3(boxes.middles[k])
    for axis in range(3):
        along = vec3(boxes.axes[k, axis])
        if axis == side:
            at = f32(1) if dot(along, d) > f32(0) else f32(-1)
        else:
            at = f32(2) * (u if axis == (side + 1) % 3 else v) - f32(1)
        p = add(p, scale(at * boxes.lengths[k, axis], along))
    return p


@jit
def _sides(boxes, k, d):
    """Areas, m2, that the sides of box k across each of its axes show to a direction."""
    x, y, z = boxes.lengths[k, 0], boxes.lengths[k, 1], boxes.lengths[k, 2]
    a = f32(4) * y * z * abs(dot(vec3(boxes.axes[k, 0]), d))
    b = f32(4) * z * x * abs(dot(vec3(boxes.axes[k, 1]), d))
    return a, b, f32(4) * x * y * abs(dot(vec3(boxes.axes[k, 2]), d))


@jit
def _span(boxes, k, point, d, slack):
    """From where to where a line through a point along d is in box k, m along d; not at all: the second is
    less. slack: m, that the box is larger to each side."""
    near, far, off = f32(-1e30), f32(1e30), sub(point, vec3(boxes.middles[k]))
    for axis in range(3):
        along = vec3(boxes.axes[k, axis])
        at, step, half = dot(along, off), dot(along, d), boxes.lengths[k, axis] + slack
        if abs(step) < f32(1e-12):
            if abs(at) > half:
                return f32(1e30), f32(-1e30)
        else:
            middle, reach = -at / step, half / abs(step)
            near, far = max(near, middle - reach), min(far, middle + reach)
    return near, far
