"""The WGSL and numba twins of `ispm.optics.light` compute the same light."""

from pathlib import Path

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.light import light_arriving
from ispm.optics.records import LIGHT, LIGHT_DIRECTIONAL, LIGHT_SPOT

SHADER = str(Path(__file__).with_name("light.wgsl"))
N = 4096
EPS = float(np.finfo(np.float32).eps)


@jit
def arriving_rows(lights, positions, out):
    for i in range(len(lights)):
        position = positions[i, 0], positions[i, 1], positions[i, 2]
        out[i, 0, :3], out[i, 0, 3], out[i, 1, :3] = light_arriving(lights[i], position)


def random_lights() -> tuple[np.ndarray, np.ndarray]:
    """(N,) LIGHT, points, spots and suns, half of them with a range; (N, 4) float32 places, some beyond."""
    random = np.random.default_rng(5)
    lights, places = np.zeros(N, LIGHT), np.zeros((N, 4), np.float32)
    lights["kind"] = random.integers(0, 3, N)
    lights["position"], places[:, :3] = random.normal(size=(2, N, 3))
    lights["intensity"] = random.uniform(0.0, 100.0, (N, 3))
    directions = places[:, :3] - lights["position"] + random.normal(size=(N, 3)) * 0.5
    lights["direction"] = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    lights["range"] = np.where(random.random(N) < 0.5, 0.0, random.uniform(0.5, 6.0, N))
    lights["cone_offset"] = 1.0
    inner = random.uniform(0.0, 0.6, N)
    outer = inner + random.uniform(0.05, 0.9, N)
    spots = lights["kind"] == LIGHT_SPOT
    scale = 1.0 / (np.cos(inner) - np.cos(outer))
    lights["cone_scale"] = np.where(spots, scale, 0.0)
    lights["cone_offset"] = np.where(spots, -scale * np.cos(outer), 1.0)
    return lights, places


def test_light_that_arrives_agrees(gpu):
    """What is left of the light is 1 - x^4 of x = distance / range, times the square of a ramp of the cosine:
    a few roundings in x and in the cosine, times 4 and times twice the ramp's slope."""
    lights, places = random_lights()
    result = gpu.buffer("result").sized(N * 32)
    with gpu.frame() as frame:
        gpu.compute(SHADER)(
            frame, over=N, lights=gpu.buffer("lights").write(lights), result=result,
            positions=gpu.buffer("positions").write(places),
        )  # fmt: skip
    theirs = gpu.read_buffer(result, np.float32, N * 8).reshape(-1, 2, 4)
    ours = np.zeros((N, 2, 4), np.float32)
    arriving_rows(lights, places, ours)

    sun = lights["kind"] == LIGHT_DIRECTIONAL
    assert sun.any() and (ours[~sun, 0, :3] == 0.0).any() and (ours[~sun, 0, :3] > 0.0).any()
    assert np.abs(theirs[:, 0, 3] / ours[:, 0, 3] - 1.0).max() < 8 * EPS
    assert np.abs(theirs[:, 1] - ours[:, 1]).max() < 8 * EPS
    square = np.where(sun, 1.0, ours[:, 0, 3].astype(np.float64) ** 2)[:, None]
    off = np.abs(theirs[:, 0, :3] - ours[:, 0, :3].astype(np.float64)) * square / lights["intensity"]
    slope = np.where(lights["cone_scale"] > 0.0, lights["cone_scale"], 0.0)
    assert (off.max(axis=1) < 32 * EPS * (1.0 + slope)).all()
