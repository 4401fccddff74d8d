"""Walls that run towards a bright end, far away and seen aslant: a pixel of them is metres long."""

import math

import numpy as np
import pytest
from transport import render

from ispm.library.common import add_camera, lambert
from ispm.library.shapes import box
from ispm.scene.light import PointLight
from ispm.scene.scene import Scene

SIZE = 320, 180
FAR = 14.0, 23.3  # m along the corridor
LOST = 0.16  # share of light: .10 to .11 of three seeds; .5 where receivers serve what lies beyond them
SPREAD = 0.35  # median of |log| ratio: .23 to .26; 1.0 to 1.1 so


def corridor():
    """White, 24 m long, lit at its far end."""
    scene = Scene(name="corridor")
    for low, high in (
        ((-0.2, -0.2, -24), (2.2, 0, 0.2)),
        ((-0.2, 2.4, -24), (2.2, 2.6, 0.2)),
        ((-0.2, -0.1, -24), (0, 2.5, 0.1)),
        ((2, -0.1, -24), (2.2, 2.5, 0.1)),
        ((-0.1, -0.1, -24.2), (2.1, 2.5, -23.8)),
        ((-0.1, -0.1, 0), (2.1, 2.5, 0.2)),
    ):
        scene.add(box(low, high), material=lambert((0.8, 0.8, 0.8)))
    scene.add(PointLight((100.0, 100.0, 100.0)), translation=(1, 2, -22))
    add_camera(scene, (1.2, 1.5, -0.3), (0.9, 1.2, -8), math.radians(55))
    return scene


def test_walls_of_few_receivers_are_as_bright_as_with_one_for_each_pixel(gpu):
    few, many = (render(gpu, corridor(), size=SIZE, subsampling=block)[0] for block in (4, 1))
    far = (many.depth > FAR[0]) & (many.depth < FAR[1])
    assert far.sum() > 400
    ours, theirs = few.indirect[far], many.indirect[far]
    assert ours.mean() == pytest.approx(theirs.mean(), rel=LOST)
    assert np.median(abs(np.log(ours / theirs))) < SPREAD
