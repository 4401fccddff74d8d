"""Which pixels' direct light is averaged: those of one surface, be it flat, bumpy, or of facets that shading
smooths."""

import math

import numpy as np
import pytest

from ispm.optics.jit import jit
from ispm.stages.area_shapes import Shapes, keep_alike, least_cosine

OFF = 0.015  # m off a plane, where a pixel is a centimetre wide


@jit
def _weigh(shapes, i, k, room, turn, weights):
    keep_alike(shapes, i, k, room, turn, weights)


def kept(point, normal, flat, aside, smoothing=1.0):
    """Whether each pixel of a row, (n, 3) each, is averaged with the one so far right of it."""
    count = len(point)
    rows = [np.ascontiguousarray(np.asarray(a, np.float32).T) for a in (point, normal, flat)]
    off = np.full(count, OFF, np.float32)
    shapes = Shapes(np.zeros(count, np.uint32), *rows, off, least_cosine(smoothing))
    room = tuple(np.zeros((3, count - aside), np.float32))
    weights = np.ones(count - aside, np.float32)
    _weigh(shapes, 0, aside, room, np.zeros(count - aside, np.float32), weights)
    assert np.isin(weights, (0.0, 1.0)).all()
    return weights == 1.0


def tilted(angle):
    return np.stack([np.sin(angle), 0.0 * angle, np.cos(angle)], axis=-1)


def pixels(count=60):
    return 0.01 * (np.arange(count) - count / 2)


@pytest.mark.parametrize("degrees", [1.0, 6.0, 22.5])
def test_facets_of_a_smooth_ball_are_one_surface(degrees):
    """Of .5 m: pixels 6 and 12 aside are turned by 6.9 and 13.8 degrees of 16, 15 by more; of 8, where passes
    average over half as much, 6. Wide facets lie up to a pixel within the ball."""
    angle, step = pixels() / 0.5, math.radians(degrees)
    facet = (np.floor(angle / step) + 0.5) * step
    away = 0.5 * math.cos(0.5 * step) / np.cos(angle - facet)
    place = away[:, None] * tilted(angle)
    for aside, smoothing in ((6, 1.0), (12, 1.0), (6, 0.5)):
        assert kept(place, tilted(angle), tilted(facet), aside, smoothing).all()
    if degrees == 1.0:
        assert not kept(place, tilted(angle), tilted(facet), 15).any()
        assert not kept(place, tilted(angle), tilted(facet), 9, 0.5).any()


def test_bumps_on_a_plane_are_one_surface():
    """Normal maps turn shading normals, by up to 12 degrees here."""
    x = pixels()
    up = np.broadcast_to([0.0, 0.0, 1.0], (len(x), 3))
    bumps = tilted(math.radians(12.0) * np.sin(100.0 * x))
    assert kept(np.stack([x, 0 * x, 0 * x], 1), bumps, up, 7).all()


def test_steps_edges_and_facets_that_are_meant_are_not():
    x = pixels()
    up = np.broadcast_to([0.0, 0.0, 1.0], (len(x), 3))
    stair = np.stack([x, 0 * x, 0.02 * (x > 0)], 1)
    assert (~kept(stair, up, up, 4)).sum() == 4  # those across the step
    roof = np.where(x[:, None] < 0.0, tilted(np.radians(-10.0)), tilted(np.radians(10.0)))
    slope = np.stack([x, 0 * x, -np.abs(x) * math.tan(math.radians(10.0))], 1)
    assert (~kept(slope, roof, roof, 4)).sum() == 4
