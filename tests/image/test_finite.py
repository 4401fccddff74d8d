"""Every pixel is a number, where surfaces of all kinds meet at all angles."""

import math

import numpy as np

from ispm import Camera, Renderer, Settings, builtin


def test_a_level_has_no_infinite_pixel(gpu):
    """Glossy parts at right angles but for the rounding of their normals: weights of receivers are down to
    2^-127, whose inverse is infinite."""
    camera = Camera.look_at((-20.0, 1.9, 0.1), (-6.0, 2.6, -0.2), yfov=math.radians(58.0))
    settings = Settings(size=(320, 180), antialias=False)
    with Renderer(builtin("cargo-level").at(0.0), settings, camera, gpu=gpu) as renderer:
        frame = renderer.render()
    assert np.isfinite(frame.radiance).all()
