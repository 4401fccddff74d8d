"""A bounce map of which one texel is sampled."""

import numpy as np

from ispm.accel.meet import Rays, _contiguous


def test_one_ray_from_a_shared_place_is_of_the_kernels_type():
    """Rays of a camera share their origin. Of one ray that is contiguous as it is, and not to be written to,
    which another kernel had to be compiled for."""
    shared = np.broadcast_to(np.zeros(3), (1, 3))
    rays = _contiguous(Rays(shared, np.ones((1, 3)), False))
    assert rays.origins.flags.writeable and rays.origins.flags.c_contiguous
