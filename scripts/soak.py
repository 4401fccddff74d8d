"""Render again and again, and fail where memory mappings, file descriptors or resident memory grow.

.venv/bin/python scripts/soak.py                    6,000 calls, 300 + 5,000 frames, 30 renderers: 2 hours
.venv/bin/python scripts/soak.py --calls 60 --frames 30 --live 100 --renderers 6

Each of the four is warm after its first half: caches of the driver are full, each kernel was called. What
the other half takes more than that is a leak. Linux alone: it reads /proc.
"""

from __future__ import annotations

import argparse
import gc
import math
import random
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
                guests.append(scene.add(ispm.PointLight((9.0,) * 3), translation=(1.0, 2.0, 1.0)))
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
        light = draw.choice([ispm.PointLight, ispm.SpotLight, ispm.DirectionalLight])
        bright = 1.0 if light is ispm.DirectionalLight else 30.0
        turn = (-draw.uniform(0.3, 0.9), draw.uniform(-0.3, 0.3), 0.0, 0.7)
        place = draw.uniform(-1.0, 1.0), 3.5, draw.uniform(-1.0, 1.0)
        scene.add(light((bright,) * 3), translation=place, rotation=turn)
    return scene


def material(draw: random.Random) -> ispm.Material:
    """Return a material by chance: mat, metal, glass, with holes or a texture."""
    made = ispm.Material(base_color=tuple(draw.uniform(0.2, 0.9) for _ in range(3)), roughness=draw.random())
    kind = draw.randrange(6)
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
    return made


def run(name: str, times: int, work: Callable[[], Iterator[None]]) -> str:
    """Do `work` so many times; print what is held, and return in words what grew."""
    started, going, warm = time.monotonic(), work(), None
    for done in range(1, times + 1):
        next(going)
        if done == (times + 1) // 2:
            warm = Held.now()
        if done % max(times // LINES, 1) == 0 or done == times:
            print(f"{name:10s} {done:6d} {Held.now()} {time.monotonic() - started:7.0f} s", flush=True)
    going.close()  # type: ignore[attr-defined]
    if warm is None:
        return ""
    end = Held.now()
    bounds = {"mappings": MAPPINGS, "descriptors": 0, "memory": MEMORY}
    grew = {what: getattr(end, what) - getattr(warm, what) for what in bounds}
    return ", ".join(f"{name}: {grew[what]} more {what}" for what in bounds if grew[what] > bounds[what])


def main(arguments: list[str]) -> int:
    """Return 1 where something grew."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parts = {
        "calls": (calls, 6000),
        "frames": (frames, 300),
        "live": (live, 5000),
        "renderers": (renderers, 30),
    }
    for name, (work, times) in parts.items():
        parser.add_argument(f"--{name}", type=int, default=times, metavar="N", help=work.__doc__)
    asked = vars(parser.parse_args(arguments))
    warnings.simplefilter("ignore")
    grew = [run(name, asked[name], work) for name, (work, _) in parts.items()]
    print("\n".join(["grew:", *filter(None, grew)]) if any(grew) else "nothing grew")
    return 1 if any(grew) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
