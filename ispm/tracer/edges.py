"""Pixels on edges of what mirrors and glass show, which want more rays than one."""

from __future__ import annotations

import numpy as np

from ispm.tracer.eye import REFLECTED, TRANSMITTED, EyePaths

_SAME_SURFACE = 0.9  # cosine of two normals
_FAINT = 0.05  # weight of what is seen, below which its edges do not matter


def edge_rows(paths: EyePaths, pixels: np.ndarray, width: int) -> np.ndarray:
    """Return the rows of the rays beside which a path ends on another surface, sorted.

    pixels  (n,) numbers y width + x of the rays' pixels, sorted
    Compared are pixels side by side that show the same mirror or glass; where it is rough nothing has edges.
    """
    grid = np.full((int(pixels[-1]) // width + 1, width), -1, np.int64)
    grid[pixels // width, pixels % width] = np.arange(len(pixels))
    marked = np.zeros(len(pixels), np.bool_)
    for lane in (REFLECTED, TRANSMITTED):
        ends = _ends_of(paths, lane)
        for a, b in ((grid[:, :-1], grid[:, 1:]), (grid[:-1], grid[1:])):
            both = (a >= 0) & (b >= 0)
            one, other = a[both], b[both]
            apart = _same_first(paths, one, other) & _differ(paths, ends[one], ends[other])
            marked[one[apart]] = marked[other[apart]] = True
    return np.flatnonzero(marked & (paths.firsts["blur"] == 0.0))


def _ends_of(paths: EyePaths, lane: int) -> np.ndarray:
    """(n,) the end that each ray's path has in a lane, -1: none."""
    ends = np.full(len(paths.direct), -1)
    rows = np.flatnonzero(paths.ends["lane"] == lane)
    ends[paths.ends["slot"][rows]] = rows
    return ends


def _same_first(paths: EyePaths, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Whether two rays meet the same surface first: other edges are the picture's own."""
    a, b = paths.firsts[one], paths.firsts[other]
    return np.asarray((a["instance"] == b["instance"]) & (_cosine(a["ng"], b["ng"]) > _SAME_SURFACE))


def _differ(paths: EyePaths, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Whether two ends, -1 for none, lie on different surfaces and are not too faint to matter."""
    if not len(paths.ends):
        return np.zeros(len(one), np.bool_)
    a, b = paths.ends[one], paths.ends[other]
    normals = paths.points["ng"]
    same = (a["instance"] == b["instance"]) & (_cosine(normals[one], normals[other]) > _SAME_SURFACE)
    strong = np.maximum((one >= 0) * a["weight"].max(axis=1), (other >= 0) * b["weight"].max(axis=1)) > _FAINT
    return np.asarray(strong & ((one < 0) != (other < 0) | ~same) & ((one >= 0) | (other >= 0)))


def _cosine(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(np.einsum("ij,ij->i", a, b))
