"""Pixels on edges of what mirrors and glass show, which want more rays than one."""

from __future__ import annotations

import numpy as np

from ispm.lights.nee import greatest
from ispm.optics.jit import jit
from ispm.optics.vector import dot
from ispm.paths.branch import REFLECTED, TRANSMITTED
from ispm.paths.eye_paths import EyePaths

f32, i64, u32 = np.float32, np.int64, np.uint32

_SAME_SURFACE = f32(0.9)  # cosine of two normals
_FAINT = f32(0.05)  # weight of what is seen, below which its edges do not matter


def edge_rows(paths: EyePaths, lonely: np.ndarray, pixels: np.ndarray, width: int) -> np.ndarray:
    """Return the rows of the rays beside which a path ends on another surface, sorted.

    lonely  rows from which no path went out, nor from any beside them
    pixels  (n,) numbers y width + x of the rays' pixels, sorted
    Compared are pixels side by side that show the same mirror or glass; where it is rough nothing has edges,
    nor where a pixel has the light of paths beside it.
    """
    marked = np.zeros(len(pixels), np.bool_)
    for lane in (REFLECTED, TRANSMITTED):
        _mark(paths.firsts, paths.ends, paths.points, u32(lane), pixels.astype(np.int64), i64(width), marked)
    firsts = paths.firsts
    given = (firsts["samples"] == 0) & (firsts["reflectance"][:, 0] > 0.0)
    given[lonely] = False
    return np.flatnonzero(marked & (firsts["blur"] == 0.0) & ~given)


@jit(allocates=True)
def _mark(firsts, ends, points, lane, pixels, width, marked):
    """Mark the rays whose paths of a lane end on another surface than those right of or below them.

    firsts, ends, points  of EyePaths;  pixels  (n,) int64, sorted;  marked  (n,) bool, changed in place
    """
    end = np.full(len(pixels), -1)
    for e in range(len(ends)):
        if ends[e].lane == lane:
            end[ends[e].slot] = e
    below = i64(0)
    for i in range(len(pixels)):
        while below < len(pixels) and pixels[below] < pixels[i] + width:
            below += 1
        right = i + 1 if (pixels[i] + 1) % width else len(pixels)
        for j, pixel in ((right, pixels[i] + 1), (below, pixels[i] + width)):
            beside = j < len(pixels) and pixels[j] == pixel
            if beside and _same_first(firsts[i], firsts[j]) and _differ(ends, points, end[i], end[j]):
                marked[i] = marked[j] = True


@jit
def _same_first(a, b):
    """Whether two FIRST_VERTEX records are of the same surface: other edges are the picture's own."""
    return a.instance == b.instance and dot(a.ng, b.ng) > _SAME_SURFACE


@jit
def _differ(ends, points, a, b):
    """Whether two of the (m,) PATH_END, by row, -1 for none, lie on different surfaces and are bright enough
    to matter; points: (m,) RECEIVER of the ends."""
    strong = (a >= 0 and greatest(ends[a].weight) > _FAINT) or (b >= 0 and greatest(ends[b].weight) > _FAINT)
    if not strong or a < 0 or b < 0:
        return strong
    return ends[a].instance != ends[b].instance or dot(points[a].ng, points[b].ng) <= _SAME_SURFACE
