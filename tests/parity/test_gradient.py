"""The WGSL and numba twins of `ispm.optics.gradient` turn light alike."""

from pathlib import Path

import numpy as np

from ispm.optics.gradient import turn, turned_light
from ispm.optics.jit import jit
from ispm.optics.vector import vec3

SHADER = str(Path(__file__).with_name("gradient.wgsl"))
N = 4096


@jit
def turned_rows(rows, gradients, out):
    for i in range(len(rows)):
        off = turn(vec3(rows[i, 4]), vec3(rows[i, 5]))
        for c in range(3):
            out[i, c] = turned_light(rows[i, 0], gradients[i], c, off)


def test_turned_light_agrees(gpu):
    """WGSL keeps slopes over the light in floats of 16 bits, off by 2^-11 of themselves: two of them, times
    an offset of at most a half. Light spans what is seen, from moonlight to the sun."""
    random = np.random.default_rng(3)
    rows = np.zeros((N, 6, 4), np.float32)
    rows[:, 0, :3] = 10.0 ** random.uniform(-6.0, 6.0, (N, 3))
    rows[:, 1:4, :3] = random.normal(size=(N, 3, 3)) * rows[:, :1, :3]
    rows[:, 4:, :3] = random.normal(size=(N, 2, 3))
    near = random.random(N) < 0.7
    rows[near, 5] = rows[near, 4] + 0.3 * rows[near, 5]
    rows[:, 4:, :3] /= np.linalg.norm(rows[:, 4:, :3], axis=-1, keepdims=True)
    result = gpu.buffer("result").sized(N * 16)
    with gpu.frame() as frame:
        gpu.compute(SHADER)(frame, over=N, given=gpu.buffer("given").write(rows), result=result)
    found = gpu.read_buffer(result, np.float32, N * 4).reshape(-1, 4)[:, :3]
    ours = np.zeros((N, 3), np.float32)
    turned_rows(rows, np.ascontiguousarray(rows[:, 1:4]).reshape(N, 12), ours)
    light = rows[:, 0, :3]
    steep = np.linalg.norm(rows[:, 1:4, :3], axis=1) / light
    assert (abs(found - ours) / light < 2.0**0.5 * 0.5 * 2.0**-11 * steep + 1e-5).all()
    assert (ours == 0.0).any() and (ours > light).mean() > 0.3 and (ours >= 0.0).all()


def test_black_stays_black(gpu):
    rows = np.zeros((1, 6, 4), np.float32)
    rows[0, 1:4, :3], rows[0, 4, 2], rows[0, 5, 0] = 1.0, 1.0, 1.0
    result = gpu.buffer("result").sized(16)
    with gpu.frame() as frame:
        gpu.compute(SHADER)(frame, over=1, given=gpu.buffer("given").write(rows), result=result)
    assert not gpu.read_buffer(result, np.float32, 4).any()
