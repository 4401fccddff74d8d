"""Whole pictures by each estimator: the same light, to rounding."""

import numpy as np
import pytest
from transport import render

from ispm.library.builtin import builtin


@pytest.mark.parametrize("name", ["volumes", "grid"])
def test_pictures_agree_whatever_the_estimator(gpu, name):
    if name == "volumes" and not gpu.has("float32-blendable"):
        pytest.skip("this adapter cannot add up float32 by blending")
    scene = builtin("cornell-box")
    expected, photons = render(gpu, scene, photons=4000)
    frame, same = render(gpu, scene, photons=4000, estimator=name)
    assert (photons == same).all()
    # sums of some thousand float32 terms in another order
    assert np.abs(frame.indirect - expected.indirect).max() < 1e-4 * expected.indirect.max()
