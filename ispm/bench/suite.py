"""What a frame costs on this machine, and how near the tracer comes to Embree.

Everything is measured in the run that reports it. Nothing is kept from frame to frame but the trees of
meshes, and camera, light and an object move in every one.
"""

from __future__ import annotations

import math
import os
import platform
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from ispm import __version__
from ispm.accel.surface import SurfaceTable
from ispm.accel.world import World
from ispm.bench.rays import rays_of_walk
from ispm.gpu.traffic import Traffic, traffic
from ispm.kernels.threads import thread_count
from ispm.library.builtin import builtin
from ispm.lights.emission import emit_rays
from ispm.optics.texture import TextureTable
from ispm.photons.walk import walk
from ispm.renderer import Renderer, Stats
from ispm.renderer.light import map_plan
from ispm.renderer.watch import rendering_seconds
from ispm.scene.packed import Packed, pack
from ispm.scene.scene import Scene
from ispm.settings import Settings

SCENE = "atrium"
FORMAT = 2  # of reports as JSON; 1 had no number, and no quartiles
_TIMES = ("direct", "bounce_map", "copy", "trace", "radiance", "upsample", "compose", "total", "direct_only")
STAGES = (*(f"{name}_ms" for name in _TIMES), "fps_full", "fps_direct")
_FRAMES, _QUICK_FRAMES = 20, 8
_WARM_UP = 3  # frames that are not counted: kernels compile, memory grows
_CAMERA_SWAY = 0.3  # m, to either side
_REPETITIONS, _WALK_REPETITIONS = 7, 30
_TEXTURE_FOOTPRINT = 0.005  # of the diagonal, as the renderer has it
_TRACE_REPEATS = 8  # of the rays in one run, which outlasts the start of threads so


@dataclass(frozen=True)
class Spread:
    """Median, 5th and 95th percentile, and the quartiles."""

    median: float
    low: float
    high: float
    q1: float
    q3: float


@dataclass(frozen=True)
class Machine:
    """What was measured on.

    others  cores that other processes kept busy during the run, on average; NaN where unknown
    """

    processor: str
    cores: int
    others: float
    adapter: str
    system: str
    versions: dict[str, str]


@dataclass(frozen=True)
class FrameTimes:
    """A frame of a moving scene.

    stats        of the last frame, for its counts
    columns      by name: stages in ms and frames per second as `Stats` has them; `photons_per_s`, those
                 emitted in a second of `trace_ms`; `ns_per_stored_photon` of it
    no_bounces   ms of the same frames with `bounces` 0: nothing emitted, nothing traced
    prepare      ms before each of them that no stage counts: packing what moved, fitting trees to it
    traffic      bytes that one of them moves between CPU and device; traffic_bare: one without bounces
    seen         share of the pixels, 0 to 1, that show a surface
    """

    scene: str
    frames: int
    stats: Stats
    columns: dict[str, Spread]
    no_bounces: Spread
    prepare: Spread
    traffic: Traffic
    traffic_bare: Traffic
    seen: float


@dataclass(frozen=True)
class TraceRate:
    """Rays per second of one walk, on some threads.

    walk    the whole of it: shading, roulette and storing included
    own     the tracer alone on the walk's rays
    embree  Embree on the same rays
    """

    threads: int
    walk: float
    own: float
    embree: float


@dataclass(frozen=True)
class Report:
    """The outcome of `run_bench`; `rates` is empty where Embree is not installed.

    peak_memory  resident bytes of the process after the frames, compilers and all
    format       of the report in a file; kind: which of the reports it is
    """

    machine: Machine
    frame: FrameTimes
    rays: int
    rates: list[TraceRate]
    peak_memory: int
    format: int = FORMAT
    kind: str = "frame"


def run_bench(quick: bool = False, settings: Settings | None = None, frames: int | None = None) -> Report:
    """Measure the built-in scene `SCENE`.

    quick     a quarter of the pixels and fewer frames
    settings  default: those of `Settings`
    Raises AdapterError where no adapter serves.
    """
    settings = settings or Settings()
    if quick:
        width, height = settings.size
        settings = settings.replace(size=(max(width // 2, 1), max(height // 2, 1)))
    scene, machine = builtin(SCENE), watch_machine()
    frame = measure_frames(scene, settings, frames or (_QUICK_FRAMES if quick else _FRAMES))
    rays, rates = measure_trace(scene.at(0.0), settings)
    return Report(machine(frame.stats.adapter), frame, rays, rates, frame.stats.peak_memory)


def measure_frames(scene: Scene, settings: Settings, frames: int) -> FrameTimes:
    """Render `frames` moments of a scene after a few that are not counted, with bounces and without."""
    with Renderer(scene, settings) as renderer:
        moving = render_moving(renderer, scene, frames)
        renderer.settings = settings.replace(bounces=0)
        bare = render_moving(renderer, scene, frames)
        seen = float((renderer.render().instance >= 0).mean())
    stats = [each.stats for each in moving]
    columns = {name: spread([getattr(each, name) for each in stats]) for name in STAGES}
    columns["photons_per_s"] = spread([1e3 * s.emitted_photons / s.trace_ms for s in stats])
    columns["ns_per_stored_photon"] = spread([1e6 * s.trace_ms / max(s.stored_photons, 1) for s in stats])
    return FrameTimes(
        scene.name,
        frames,
        stats[-1],
        columns,
        spread([each.stats.total_ms for each in bare]),
        spread([each.wall_ms - each.stats.total_ms for each in moving]),
        moving[-1].traffic,
        bare[-1].traffic,
        seen,
    )


@dataclass(frozen=True)
class Rendered:
    """What one frame took: its statistics, ms from call to return, and bytes to and from the device."""

    stats: Stats
    wall_ms: float
    traffic: Traffic


def render_moving(renderer: Renderer, scene: Scene, frames: int) -> list[Rendered]:
    """Render `frames` moments of a scene after a few that are not counted."""
    return [_render(renderer, moment) for moment in moments(scene, frames + _WARM_UP)][_WARM_UP:]


def _render(renderer: Renderer, scene: Scene) -> Rendered:
    renderer.scene = scene
    before, start = traffic(), rendering_seconds()
    stats = renderer.render().stats
    return Rendered(stats, 1e3 * (rendering_seconds() - start), traffic().since(before))


def moments(scene: Scene, count: int) -> Iterator[Scene]:
    """Yield a scene at moments spread over its animations, the first camera swaying as it goes."""
    duration = max((animation.duration for animation in scene.animations), default=0.0)
    for k in range(count):
        phase = (k + 0.5) / count
        moment = scene.at(phase * duration)
        eye, *_ = moment.cameras
        pose = eye.local_matrix()
        pose[:3, 3] += pose[:3, 0] * (_CAMERA_SWAY * math.sin(2.0 * math.pi * phase))
        eye.matrix = pose
        yield moment


def spread(values: list[float]) -> Spread:
    """Return the median of values with their 5th and 95th percentile and quartiles."""
    return Spread(*np.percentile(values, (50.0, 5.0, 95.0, 25.0, 75.0)).tolist())


def measure_trace(scene: Scene, settings: Settings) -> tuple[int, list[TraceRate]]:
    """Return the rays of a walk, and its rates beside Embree's on one thread and on all.

    No rates where Embree is not installed.
    """
    walked = Walked(scene, settings)
    if find_spec("embreex") is None:
        return len(walked.origins), []
    from ispm.bench.embree import compare_rates

    rates = []
    world, race = walked.world, walked.repeated()
    for threads in sorted({1, thread_count(None)}):
        raw = compare_rates(world, walked.packed, *race, threads=threads, repetitions=_REPETITIONS)
        world.threads = threads
        rates.append(
            TraceRate(threads, len(walked.origins) / _seconds(walked.walk), raw["own"], raw["embree"])
        )
    return len(walked.origins), rates


class Walked:
    """The photons of a scene's first pass, and the rays that follow them: (N, 3) origins and directions."""

    def __init__(self, scene: Scene, settings: Settings) -> None:
        self.packed: Packed = pack(scene)
        self.world = World()
        self.world.update(self.packed)
        footprint = _TEXTURE_FOOTPRINT * self.packed.diagonal
        surfaces = SurfaceTable(
            self.packed, TextureTable.pack(self.packed.textures, self.packed.colors), footprint
        )
        plan = map_plan(self.packed, settings, 0)
        emitted = emit_rays(self.packed, self.world, surfaces, plan, settings.seed, 0)
        told = self.packed, self.world, surfaces, emitted, settings.bounces, settings.seed
        self.walk: Callable[[], Any] = partial(walk, *told, 0)
        self.origins, self.directions = rays_of_walk(*told)

    def repeated(self) -> tuple[np.ndarray, np.ndarray]:
        """Return origins and directions so often that a run outlasts the start of threads."""
        times = _TRACE_REPEATS, 1
        return np.tile(self.origins, times), np.tile(self.directions, times)


def _seconds(run: Callable[[], Any]) -> float:
    """Return the median time of many runs: the first few keep their threads on one core."""
    run()
    times = []
    for _ in range(_WALK_REPETITIONS):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return float(np.median(times))


def watch_machine() -> Callable[[str], Machine]:
    """Return a function that tells of the machine, and of what it did since; it takes the adapter's name."""
    others = _others()
    return lambda adapter: _machine(adapter, others())


def _machine(adapter: str, others: float) -> Machine:
    packages = [name for name in ("numba", "numpy", "wgpu", "embreex") if find_spec(name)]
    versions = {"ispm": __version__, "python": platform.python_version()}
    return Machine(
        _processor(),
        thread_count(None),
        others,
        adapter,
        platform.platform(),
        versions | {name: version(name) for name in packages},
    )


def _others() -> Callable[[], float]:
    """Return a function that returns how many cores others kept busy since."""
    before, started = _busy_seconds() - time.process_time(), time.perf_counter()
    return lambda: (_busy_seconds() - time.process_time() - before) / (time.perf_counter() - started)


def _busy_seconds() -> float:
    """Processor time that all processes took since the system started; NaN where it does not say."""
    try:
        words = Path("/proc/stat").read_text("utf-8").split("\n", 1)[0].split()[1:9]
        user, nice, system, _idle, _waiting, *interrupts = map(int, words)
        return (user + nice + system + sum(interrupts)) / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, AttributeError):
        return math.nan


def _processor() -> str:
    """The processor's name as the system gives it."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
        return next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()
