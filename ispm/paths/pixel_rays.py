"""Rays through pixels that show triangles, by one kernel: whole arrays of numpy's take many times as long."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.accel.meet import meet
from ispm.accel.rays import HIT
from ispm.accel.surface import SurfaceTable
from ispm.kernels.share import run_shared, shared_rows
from ispm.optics.jit import jit
from ispm.optics.vector import add, dot, scale

f32, f64, i64 = np.float32, np.float64, np.int64

Place = tuple[float, float, float]

_CHUNK = 256  # pixels a thread takes at a time


class Screen(NamedTuple):
    """The samples of a picture's pixels in space, float64, world space.

    eye                  (3,) m
    corner, right, down  (3,) m: that of column x and row y lies at eye + corner + x right + y down
    forward              (3,) unit, the direction of all rays of parallel views; others leave the eye
    columns              pixels in a row
    parallel             whether rays start at the samples
    """

    eye: Place
    corner: Place
    right: Place
    down: Place
    forward: Place
    columns: np.int64
    parallel: bool


class SeenRays(NamedTuple):
    """Rays through n pixels, of which each shows a triangle.

    origins, directions  (n, 3) float32, unit
    distances            (n,) float32 m to the triangle
    hits                 (n,) HIT there
    """

    origins: np.ndarray
    directions: np.ndarray
    distances: np.ndarray
    hits: np.ndarray


def rays_to_seen(seen: np.ndarray, screen: Screen, surfaces: SurfaceTable, threads: int) -> SeenRays:
    """Return the rays through (n,) pixels, fields `pixel`, `instance` and `primitive`, uint32."""
    count = len(seen)
    origins, directions = np.empty((2, count, 3), np.float32)
    rays = SeenRays(origins, directions, np.empty(count, np.float32), np.empty(count, HIT))
    run_shared(lambda counter: _rays_to_seen(seen, screen, surfaces.addresses, counter, rays), threads)
    return rays


@jit
def _rays_to_seen(seen, screen, table, counter, rays):
    """Write the SeenRays of as many pixels as a thread gets; table: a SurfaceTable's addresses."""
    for i in shared_rows(counter, _CHUNK, len(seen)):
        shown, hit = seen[i], rays.hits[i]
        row, column = divmod(i64(shown.pixel), screen.columns)
        across, along = scale(f64(column), screen.right), scale(f64(row), screen.down)
        place = add(screen.corner, add(across, along))
        origin, d = screen.eye, screen.forward
        if screen.parallel:
            origin = add(origin, place)
        else:
            d = scale(f64(1) / math.sqrt(dot(place, place)), place)
        u, v, t = meet(table, shown.instance, shown.primitive, origin, d, screen.parallel)
        hit.instance, hit.primitive = shown.instance, shown.primitive
        hit.u, hit.v, hit.t = f32(u), f32(v), f32(t)
        rays.distances[i] = f32(t)
        for c in range(3):
            rays.origins[i, c], rays.directions[i, c] = f32(origin[c]), f32(d[c])
