"""Light averaged among neighbors that show alike surfaces."""

import numpy as np
import pytest

from ispm.paths.denoise import denoise
from ispm.paths.vertices import FIRST_VERTEX

WIDTH, HEIGHT = 60, 40


def frosted(blur):
    """(n,) FIRST_VERTEX of a flat pane of rough glass that fills the picture."""
    firsts = np.zeros(WIDTH * HEIGHT, FIRST_VERTEX)
    firsts["blur"], firsts["alpha"], firsts["n"][:, 2] = blur, 0.2, 1.0
    return firsts


def denoised(light, firsts, smoothing):
    found = light.copy()
    denoise(found, np.arange(WIDTH * HEIGHT, dtype=np.uint32), WIDTH, firsts, smoothing, 2)
    return found.reshape(HEIGHT, WIDTH, -1)


@pytest.mark.parametrize("smoothing", [1.0, 0.5])
def test_what_stands_out_goes_farther_and_none_is_lost(smoothing):
    """One path in a hundred found a lamp. Away from the border each pixel's light is shared out whole."""
    light = np.random.default_rng(3).random((WIDTH * HEIGHT, 3)).astype(np.float32)
    bright = 20 * WIDTH + 30
    light[bright] += 100.0
    alone = light.copy()
    alone[bright] = light[bright - 1]
    spread = denoised(light, frosted(2.0), smoothing) - denoised(alone, frosted(2.0), smoothing)
    assert spread.sum(axis=(0, 1)) == pytest.approx(light[bright] - alone[bright], rel=1e-3)
    assert spread.max() < 10.0 if smoothing == 1.0 else spread.max() > 10.0


def test_later_passes_average_over_less():
    """The blur of a step is as wide as the passes' smoothing says, and in the end none."""
    step = np.repeat((np.arange(WIDTH) >= 30).astype(np.float32)[None], HEIGHT, axis=0).reshape(-1, 1)
    widths = []
    for smoothing in (1.0, 0.5, 0.01):
        row = denoised(step, frosted(4.0), smoothing)[20, :, 0]
        widths.append(int(((row > 1e-3) & (row < 1.0 - 1e-3)).sum()))
    assert widths[0] > widths[1] > widths[2] == 0


def test_another_surface_is_left_out():
    """Half of the picture is opaque: what the other half averages has none of its light."""
    light = np.zeros((WIDTH * HEIGHT, 1), np.float32)
    firsts, left = frosted(4.0), np.arange(WIDTH * HEIGHT) % WIDTH < 30
    firsts["blur"][left], light[left] = 0.0, 7.0
    found = denoised(light, firsts, 1.0)
    assert (found[:, :30] == 7.0).all() and (found[:, 30:] == 0.0).all()
