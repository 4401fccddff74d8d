"""Exact light of polygons and skies, and means over blocks of pixels."""

from __future__ import annotations

import math

import numpy as np
from rgbe import seen_along


def unit(a):
    return a / np.linalg.norm(a, axis=-1, keepdims=True)


def polygon_irradiance(corners, p, n):
    """Irradiance at p, on a surface of normal n, of a polygon (k, 3) of radiance 1 that is seen whole:
    Lambert's formula, cut at the horizon."""
    v = corners - p
    height = v @ n
    kept = []
    for k in range(len(v)):
        j = (k + 1) % len(v)
        if height[k] >= 0.0:
            kept.append(v[k])
        if (height[k] >= 0.0) != (height[j] >= 0.0):
            kept.append(v[k] + height[k] / (height[k] - height[j]) * (v[j] - v[k]))
    if len(kept) < 3:
        return 0.0
    total, v = 0.0, unit(np.array(kept))
    for a, b in zip(v, np.roll(v, -1, axis=0), strict=True):
        across = np.cross(a, b)
        sine = np.linalg.norm(across)
        if sine > 0.0:
            total += math.atan2(sine, a @ b) * (across / sine) @ n
    return abs(total) / 2.0


def solid_angle(corners, p):
    """sr of a triangle, (3, 3) corners, from p: the excess of its angles (Girard)."""
    a, b, c = unit(corners - p)

    def corner(x, y, z):
        one, two = unit(np.cross(x, y)), unit(np.cross(x, z))
        return math.atan2(np.linalg.norm(np.cross(one, two)), one @ two)

    return corner(a, b, c) + corner(b, c, a) + corner(c, a, b) - math.pi


def sky_irradiance(image, rotation, n, rows=512):
    """Irradiance, (3,) lx, of an environment's image, (h, w, 3), on a surface of normal n, by the midpoints
    of rows x 2 rows places."""
    theta = (np.arange(rows) + 0.5) * math.pi / rows
    phi = (np.arange(2 * rows) + 0.5) * math.pi / rows
    t, p = np.meshgrid(theta, phi, indexing="ij")
    d = np.stack([np.sin(t) * np.cos(p), np.cos(t), np.sin(t) * np.sin(p)], axis=-1).reshape(-1, 3)
    weight = np.maximum(d @ n, 0.0) * np.sin(t).ravel() * (math.pi / rows) ** 2
    lit = weight > 0.0
    return weight[lit] @ seen_along(image, d[lit], rotation)


def blocks(picture, side):
    """Means of (h, w, 3) over blocks of `side` pixels, what is left over at the borders cut."""
    h, w = (n // side for n in picture.shape[:2])
    return picture[: h * side, : w * side].reshape(h, side, w, side, 3).mean(axis=(1, 3), dtype=float)
