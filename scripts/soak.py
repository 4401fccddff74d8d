"""Render again and again, and fail where memory mappings, file descriptors or resident memory grow.

.venv/bin/python scripts/soak.py      6,000 calls, 300 + 5,000 frames, 30 renderers, 2,000 frames: 2.5 hours
.venv/bin/python scripts/soak.py --calls 60 --frames 30 --live 100 --renderers 6 --cargo 40

Each of these four is warm after its first half: caches of the driver are full, each kernel was called. What
the other half takes more than that is a leak. The fifth, --cargo, is stricter: 2,000 frames of one scene in
which everything moves, whose memory stays within 1 % once the first tenth is done, and of which the last 200
take no more than 5 % longer than the first 200; fewer than 400 are told of, and not judged. Linux alone: it
reads /proc.
"""

from __future__ import annotations

import argparse
import gc
import math
import random
import statistics
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import numpy as np

import ispm
from ispm.library.shapes import box, icosphere
from ispm.scene.material import AlphaMode

SMALL = {"size": (64, 36), "photons": 500}
LINES = 24  # printed of each part
MAPPINGS = 64  # that may come and go: drivers and allocators map at will
MEMORY = 24  # MiB, likewise
CARGO_MEMORY = 0.01  # of the memory after the first tenth of --cargo, which the rest may take more
WINDOW = 200  # frames at either end of --cargo whose median times are compared,
SLOWER = 0.05  # and by how much the last ones' may be longer


@dataclass(frozen=True)
class Held:
    """What the process holds: memory mappings, file descriptors, and MiB of resident memory."""

    mappings: int
    descriptors: int
    memory: int

    @classmethod
    def now(cls) -> Held:
        gc.collect()
        proc = Path("/proc/self")
        mappings = proc.joinpath("maps").read_text().count("\n")
        pages = int(proc.joinpath("statm").read_text().split()[1])
        return cls(mappings, len(list(proc.joinpath("fd").iterdir())), pages * 4096 >> 20)

    def __str__(self) -> str:
        return f"{self.mappings:6d} mappings {self.descriptors:4d} descriptors {self.memory:6d} MiB"


def calls() -> Iterator[None]:
    """Pictures of one scene, each by a call of `ispm.render`."""
    scene = ispm.builtin("cornell-box")
    for seed in count():
        ispm.render(scene, seed=seed, **SMALL)
        yield


def frames() -> Iterator[None]:
    """Frames of one renderer, of which nothing is as in the one before."""
    draw = random.Random(7)
    with ispm.Renderer(changed(draw), **settings(draw)) as renderer:
        while True:
            renderer.scene = changed(draw)
            made = settings(draw)
            renderer.settings, renderer.camera = made["settings"], made["camera"]
            renderer.render().image  # noqa: B018  made when first asked for
            renderer.view("photons")
            yield


def live() -> Iterator[None]:
    """Live frames in which everything moves, and objects and lights come and go."""
    draw, scene, guests = random.Random(5), changed(random.Random(5)), list[ispm.Node]()
    made = ispm.Settings(size=(96, 54), photons=4000, preset="live")
    with ispm.Renderer(scene, made) as renderer:
        for t in count():
            angle = 0.02 * t
            eye = 5.0 * math.sin(angle), 1.5 + math.sin(0.7 * angle), 5.0 * math.cos(angle)
            renderer.camera = ispm.Camera.look_at(eye, (0.0, 1.0, 0.0))
            for k, node in enumerate(scene.nodes[2:]):
                node.translation = tuple(np.add(node.translation, 0.02 * math.cos(angle + k)))
            if t % 7 == 3:
                guests.append(
                    scene.add(icosphere(0.3, 2), material=material(draw), translation=(0.0, 2.0, 0.0))
                )
            if t % 11 == 5:
                guests.append(scene.add(lamps(draw)[t // 11 % 7], translation=(1.0, 2.0, 1.0)))
            if t % 29 == 7:
                scene.environment = surroundings(draw)[t // 29 % 3]
            while len(guests) > 4:
                scene.remove(guests.pop(0))
            renderer.render().image  # noqa: B018  made when first asked for
            yield


def renderers() -> Iterator[None]:
    """Renderers that are opened and closed, each of a scene and settings of its own."""
    draw = random.Random(11)
    while True:
        with ispm.Renderer(changed(draw), **settings(draw)) as renderer:
            renderer.render()
        yield


def cargo() -> Iterator[None]:
    """Frames of `cargo-bay` in which the camera, the lights and all things move."""
    scene = ispm.builtin("cargo-bay")
    period = scene.animations[0].duration
    with ispm.Renderer(scene, ispm.Settings(size=(96, 54), photons=2000)) as renderer:
        for t in count():
            angle = 2.0 * math.pi * t / WINDOW  # all is back where it was after so many frames
            moment = scene.at(t % WINDOW / WINDOW * period)
            for k, node in enumerate(moment.nodes):
                swing = 0.1 * math.sin(angle + k), 0.0, 0.1 * math.cos(angle + k)
                node.translation = tuple(np.add(node.translation, swing))
            renderer.scene = moment
            renderer.render().image  # noqa: B018  made when first asked for
            yield


def settings(draw: random.Random) -> dict[str, object]:
    """Settings and a camera by chance."""
    size = draw.randrange(16, 160), draw.randrange(9, 90)
    made = ispm.Settings(
        size=size, photons=draw.choice([0, 500, 4000]), bounces=draw.choice([0, 1, 8]),
        preset=draw.choice(["default", "fast", "talk"]), subsampling=draw.choice([1, 2, 4]),
        emission=draw.choice(["map", "rays"]), shadow_resolution=draw.choice([64, 256, 1024]),
        antialias=draw.random() < 0.5, tonemap=draw.choice(["neutral", "agx"]), seed=draw.randrange(1 << 16),
        background=draw.choice([(0.0, 0.0, 0.0), (0.2, 0.3, 0.4), "transparent"]),
    )  # fmt: skip
    eye = draw.uniform(-2.0, 2.0), draw.uniform(0.5, 2.0), draw.uniform(3.0, 6.0)
    return {"settings": made, "camera": ispm.Camera.look_at(eye, (0.0, 1.0, 0.0))}


def changed(draw: random.Random) -> ispm.Scene:
    """Return a room with things in it: places, meshes, materials and lights by chance."""
    scene = ispm.Scene()
    scene.add(box((-4.0, -0.2, -4.0), (4.0, 0.0, 4.0)), material=material(draw))
    scene.add(box((-4.0, 0.0, -4.2), (4.0, 4.0, -4.0)), material=material(draw))
    for _ in range(draw.randrange(1, 6)):
        shape = icosphere(0.5, draw.randrange(1, 4)) if draw.random() < 0.5 else box((-0.4,) * 3, (0.4,) * 3)
        place = draw.uniform(-2.0, 2.0), draw.uniform(0.4, 2.0), draw.uniform(-2.0, 2.0)
        scene.add(shape, material=material(draw), translation=place, scale=(draw.uniform(0.3, 1.0),) * 3)
    for _ in range(draw.randrange(1, 4)):
        turn = (-draw.uniform(0.3, 0.9), draw.uniform(-0.3, 0.3), 0.0, 0.7)
        place = draw.uniform(-1.0, 1.0), 3.2, draw.uniform(-1.0, 1.0)
        scene.add(draw.choice(lamps(draw)), translation=place, rotation=turn)
    scene.environment = draw.choice([*surroundings(draw), None, None, None])
    return scene


def lamps(draw: random.Random) -> list[ispm.PointLight]:
    """Return a light of each kind, of a size by chance."""
    size, both = draw.uniform(0.1, 0.7), draw.random() < 0.3
    return [
        ispm.RectLight((40.0,) * 3, width=size, height=0.4, two_sided=both),
        ispm.PointLight((30.0,) * 3, radius=size),
        ispm.SpotLight((30.0,) * 3),
        ispm.SphereLight((20.0,) * 3, radius=0.5 * size),
        ispm.PointLight((30.0,) * 3),
        ispm.DiskLight((40.0,) * 3, radius=size, two_sided=both),
        ispm.DirectionalLight((1.0,) * 3),
    ]


def surroundings(draw: random.Random) -> list[ispm.Environment | ispm.Sky | None]:
    """Return what may be around a scene."""
    rows = draw.choice([2, 8])
    picture = np.full((rows, 2 * rows, 3), 0.3, np.float32)
    return [
        ispm.Environment(picture, rotation=draw.random()),
        ispm.Sky(sun_elevation=draw.uniform(0.1, 1.0), intensity=1e-3),
        None,
    ]


def material(draw: random.Random) -> ispm.Material:
    """Return a material by chance: mat, metal, glass, with holes or a texture, or one that glows."""
    made = ispm.Material(base_color=tuple(draw.uniform(0.2, 0.9) for _ in range(3)), roughness=draw.random())
    kind = draw.randrange(7)
    if kind == 1:
        made.metallic = 1.0
    elif kind == 2:
        made.transmission, made.roughness, made.thickness = 1.0, 0.0, draw.choice([0.0, 1.0])
    elif kind in (3, 4):
        made.base_color = (*made.base_color[:3], 0.6)
        made.alpha_mode = AlphaMode.MASK if kind == 3 else AlphaMode.BLEND
    elif kind == 5:
        shape = draw.choice([4, 16]), draw.choice([4, 16]), 4
        pixels = np.frombuffer(draw.randbytes(shape[0] * shape[1] * 4), np.uint8).reshape(shape)
        made.base_color_texture = ispm.Texture(pixels)
    elif kind == 6:
        made.emission = (draw.uniform(0.5, 8.0),) * 3
    return made


def run(name: str, times: int, work: Callable[[], Iterator[None]]) -> str:
    """Do `work` so many times; print what is held, and return in words what grew."""
    judge = cargo_grew if work is cargo else grew
    started, going, held, seconds = time.monotonic(), work(), dict[int, Held](), list[float]()
    for done in range(1, times + 1):
        start = time.perf_counter()
        next(going)
        seconds.append(time.perf_counter() - start)
        if done in (times // 10, (times + 1) // 2, times):
            held[done] = Held.now()
        if done % max(times // LINES, 1) == 0 or done == times:
            print(f"{name:10s} {done:6d} {Held.now()} {time.monotonic() - started:7.0f} s", flush=True)
    going.close()  # type: ignore[attr-defined]
    more = judge(held, seconds) if times else ""
    return f"{name}: {more}" if more else ""


def grew(held: dict[int, Held], seconds: list[float]) -> str:
    """Return what the second half took more; held: after so many times."""
    times = len(seconds)
    warm, end = held[(times + 1) // 2], held[times]
    bounds = {"mappings": MAPPINGS, "descriptors": 0, "memory": MEMORY}
    more = {what: getattr(end, what) - getattr(warm, what) for what in bounds}
    return ", ".join(f"{more[what]} more {what}" for what in bounds if more[what] > bounds[what])


def cargo_grew(held: dict[int, Held], seconds: list[float]) -> str:
    """Print what memory and times of --cargo are; return what grew."""
    times = len(seconds)
    if times < 10:
        return ""
    warm, end, window = held[times // 10].memory, held[times].memory, min(WINDOW, times // 2)
    first, last = (statistics.median(part) for part in (seconds[:window], seconds[-window:]))
    more, longer = end / warm - 1.0, last / first - 1.0
    print(
        f"cargo: memory {warm} MiB after {times // 10} frames, {end} MiB after {times} ({more:+.1%}); median "
        f"of the first {window} frames {1e3 * first:.1f} ms, of the last {1e3 * last:.1f} ms ({longer:+.1%})"
    )
    if window < WINDOW:
        return ""
    told = [f"memory by {more:.1%}"] * (more > CARGO_MEMORY)
    return ", ".join(told + [f"times by {longer:.1%}"] * (longer > SLOWER))


def main(arguments: list[str]) -> int:
    """Return 1 where something grew."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parts = {
        "calls": (calls, 6000),
        "frames": (frames, 300),
        "live": (live, 5000),
        "renderers": (renderers, 30),
        "cargo": (cargo, 2000),
    }
    for name, (work, times) in parts.items():
        parser.add_argument(f"--{name}", type=int, default=times, metavar="N", help=work.__doc__)
    asked = vars(parser.parse_args(arguments))
    warnings.simplefilter("ignore")
    told = list(filter(None, (run(name, asked[name], work) for name, (work, _) in parts.items())))
    print("\n".join(["grew:", *told]) if told else "nothing grew")
    return 1 if told else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
