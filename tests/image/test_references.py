"""Pictures against small references by a path tracer; docs/accuracy.md has all figures."""

import numpy as np
import pytest
from references import names, stored
from references.scenes import pictured
from transport import render

from ispm.bench.metrics import Comparison, compare


def error(gpu, name, over="whole", **settings) -> Comparison:
    reference = stored(name)
    scene, factor = pictured(name)
    frame, _ = render(gpu, scene, size=reference.size, bounces=reference.bounces, **settings)
    radiance = frame.radiance / np.float32(factor)
    return compare(
        radiance, reference.radiance, reference.masks[over], reference_error=reference.own_errors[over]
    )


def test_references_know_their_noise():
    for name in names():
        reference = stored(name)
        assert reference.samples >= 4096
        assert 0.0 <= reference.own_errors["whole"] < 2e-3, name
        assert np.isfinite(reference.radiance).all() and np.isfinite(reference.standard_error).all()


@pytest.mark.parametrize("name", [name for name in names() if name.endswith("-direct")])
def test_direct_light_is_exact(gpu, name):
    """Against the mean over each pixel: half floats are off by 2^-12 at most on average, and light is not
    quite linear within a pixel."""
    found = error(gpu, name)
    assert abs(found.bias) < 1e-3
    assert found.relmse < 1e-4
