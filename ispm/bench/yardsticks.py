"""What the machine can do at most, measured beside the frames: fill, transfers, memory, Embree's rays."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

from ispm.bench.suite import FrameTimes, Walked
from ispm.gpu import FLAT, Gpu, Target, open_gpu
from ispm.gpu.traffic import Traffic
from ispm.scene.scene import Scene
from ispm.settings import Settings

_FILL_SIZE, _FILL_LAYERS = (1920, 1080), 8
_FILL_FORMAT = "rgba16float"  # the widest that every adapter blends
_TRANSFER = 1 << 25  # bytes, a frame's worth at 1920x1080
_REPETITIONS = 9
# What upsampling does with each pixel: reads points, normals, base color and glow of the G-buffer, and writes
# indirect radiance and irradiance (stages/gbuffer.py, stages/upsample.py). Of receivers there are few.
_UPSAMPLED = 16 + 8 + 8 + 8 + 2 * 16  # bytes


@dataclass(frozen=True)
class Yardsticks:
    """Rates of the adapter, medians of _REPETITIONS runs.

    fill    pixels per second that are blended additively, rgba16float, full screen
    upload  bytes per second from numpy to a buffer;  readback: from a buffer to numpy
    memory  bytes per second, read and written, where a buffer is copied to another one
    """

    adapter: str
    fill: float
    upload: float
    readback: float
    memory: float


@dataclass(frozen=True)
class Floor:
    """What indirect light would add to a frame if its stages did nothing but what cannot be left out, ms.

    rays       of photons and gather rays, as fast as Embree follows this scene's photons; NaN without Embree
    transfers  of the bytes that indirect light moves between CPU and device, at the measured rates
    upsample   memory that each pixel of the picture reads and writes for its indirect light
    """

    rays: float
    transfers: float
    upsample: float

    @property
    def total(self) -> float:
        """One after the other."""
        return self.rays + self.transfers + self.upsample


def measure_yardsticks() -> Yardsticks:
    """Measure the adapter that frames are rendered on. Raises AdapterError where none serves."""
    gpu = open_gpu()
    try:
        data = np.zeros(_TRANSFER, np.uint8)
        source, target = gpu.buffer("yardstick").write(data), gpu.buffer("copy").sized(_TRANSFER)

        def copy() -> None:
            with gpu.frame() as frame:
                frame.encoder.copy_buffer_to_buffer(source.handle, 0, target.handle, 0, _TRANSFER)

        return Yardsticks(
            gpu.name,
            math.prod(_FILL_SIZE) * _FILL_LAYERS / _seconds(gpu, filling(gpu)),
            _TRANSFER / _seconds(gpu, lambda: source.write(data)),
            _TRANSFER / _seconds(gpu, lambda: gpu.read_buffer(source, np.uint8, _TRANSFER)),
            2 * _TRANSFER / _seconds(gpu, copy),
        )
    finally:
        gpu.close()


def filling(gpu: Gpu) -> Callable[[], None]:
    """Return what fills a texture with additive layers once."""
    raster = gpu.raster("bench/fill.wgsl", [Target(_FILL_FORMAT, blend="add")], FLAT)
    screen = gpu.texture("fill", _FILL_FORMAT).sized(_FILL_SIZE)

    def fill() -> None:
        with gpu.frame() as frame, frame.draw_into(screen) as canvas:
            canvas.use(raster)
            canvas.draw(3, _FILL_LAYERS)

    return fill


def _seconds(gpu: Gpu, run: Callable[[], object]) -> float:
    """Return the median time of several runs, the device's work included."""
    times = []
    for _ in range(_REPETITIONS + 1):
        gpu.wait()
        start = time.perf_counter()
        run()
        gpu.wait()
        times.append(time.perf_counter() - start)
    return float(np.median(times[1:]))


def embree_rate(scene: Scene, settings: Settings, repetitions: int = 5) -> float:
    """Return the rays per second at which Embree follows a scene's photons on all threads; NaN without it."""
    if find_spec("embreex") is None:
        return math.nan
    from ispm.bench.embree import compare_rates

    walked = Walked(scene.at(0.0), settings)
    if not len(walked.origins):
        return math.nan
    race = walked.repeated()
    return compare_rates(walked.world, walked.packed, *race, repetitions=repetitions)["embree"]


def floor_of(times: FrameTimes, settings: Settings, rays_per_s: float, rates: Yardsticks) -> Floor:
    """Return what indirect light would add at a frame's counts and the measured rates."""
    added = times.traffic.since(times.traffic_bare)
    return Floor(
        1e3 * rays_of_frame(times, settings) / rays_per_s,
        1e3 * _transfer_seconds(added, rates),
        1e3 * math.prod(settings.size) * _UPSAMPLED / rates.memory,
    )


def rays_of_frame(times: FrameTimes, settings: Settings) -> float:
    """Return how many rays photons and receivers send out for a frame's indirect light.

    Photons of bounce maps begin with a hit; others with a ray.
    """
    stats = times.stats
    photons = stats.photon_hits - stats.emitted_photons * (stats.emission == "map")
    receivers = times.seen * math.prod(-(-side // settings.subsampling) for side in settings.size)
    return photons + receivers * settings.gather_rays


def _transfer_seconds(moved: Traffic, rates: Yardsticks) -> float:
    return max(moved.sent, 0) / rates.upload + max(moved.read, 0) / rates.readback


def yardstick_table(rates: Yardsticks) -> list[tuple[object, ...]]:
    """Return a table of rates with a row of headings."""
    return [
        ("what the adapter does at most", "", "unit"),
        ("additive fill", rates.fill / 1e6, "million pixels/s"),
        ("upload", rates.upload / 1e9, "GB/s"),
        ("readback", rates.readback / 1e9, "GB/s"),
        ("memory, read and written", rates.memory / 1e9, "GB/s"),
    ]
