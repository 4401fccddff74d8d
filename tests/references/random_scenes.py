"""Compare pictures of random scenes with paths from the eye: what nobody tuned for, by the number.

python -m references.random_scenes 0-19            # in tests/; some 20 s a scene on two cores
python -m references.random_scenes 3 --passes 64 --pictures FOLDER
python -m references.random_scenes --write         # those of the table of docs/accuracy.md, which it replaces

Each number is a scene: a room or open ground, things of random shapes and materials, and lamps with a
surface or an environment, so that paths find all light. All pixels count: edges, glass and mirrors, too.
Their means over blocks are compared, for one pass and after several: bias and relMSE over the picture, and
of the blocks that differ by more than noise the worst.
"""

from __future__ import annotations

import argparse
import math
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from transport import Tracer

import ispm
from ispm import Environment, Material, Scene, Settings, Texture, shapes
from ispm.gpu import Gpu, open_gpu
from ispm.library.common import add_camera, lambert
from ispm.library.shapes import box
from ispm.reference.paths import path_light
from ispm.scene.light import DiskLight, RectLight, SphereLight
from ispm.scene.mesh import Mesh
from ispm.stages.camera import CameraView
from references.page import table, write_between

_SIZE = 640, 360
_BLOCK = 8  # pixels a side
_PARTS = 16
_PLACES, _PATHS = 24, 2  # of a block and part
_BOUNCES = 32  # also those within rough glass, which pictures do not count
_FINE = 1e-4  # of the diagonal: textures as sharp as pixels see them
_FLOOR = 1e-3  # of the mean's square, as in all relMSE
_OFF = 0.05  # of a block's light and of the picture's mean, that it differs by
_SURE = 4.0  # standard errors
_WRITTEN = "0-19"  # in the page's table
_HEADINGS = ["", "place and light", "things", "bias", "relMSE", "bias, 16 passes", "±", "relMSE"]

Random = np.random.Generator


@dataclass(frozen=True)
class Difference:
    """A picture beside the truth, block by block, less the noise of the truth.

    bias, uncertain  share of light that there is too much, and one standard error of it
    relmse     as `bench.metrics` has it
    off        share of blocks that differ by more than _OFF and four standard errors
    worst, at  how much the block that is the most so does, and its middle, pixels
    """

    bias: float
    uncertain: float
    relmse: float
    off: float
    worst: float
    at: tuple[int, int]

    def __str__(self) -> str:
        return (
            f"bias {self.bias:+.2%} +- {self.uncertain:.2%}, relMSE {self.relmse:.4f}, {self.off:.1%} off by "
            f"{_OFF:.0%}, worst {self.worst:+.0%} at {self.at}"
        )


def main() -> None:
    """Print a line for each scene and number of passes."""
    parser = argparse.ArgumentParser(description="Compare pictures of random scenes with paths.")
    parser.add_argument("numbers", nargs="*", metavar="N", help="scenes; 3-7: those from 3 to 7")
    parser.add_argument("--passes", type=int, default=16, metavar="N")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="where ours and theirs are kept")
    parser.add_argument("--write", action="store_true", help="the page's table")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    gpu, rows = open_gpu(), []
    for words in given.numbers or [_WRITTEN]:
        first, _, last = words.partition("-")
        for number in range(int(first), int(last or first) + 1):
            rows.append(_row(number, *_compared(number, given.passes, given.pictures, gpu)))
    if given.write:
        write_between("random", table(_HEADINGS, rows, "rllrrrrr"))


def _row(number: int, name: str, first: Difference, last: Difference) -> list[str]:
    place, floor, *things = name.split(", ")
    told = f"{first.bias:+.2%}", f"{first.relmse:.4f}", f"{last.bias:+.2%}"
    more = f"{last.uncertain:.2%}", f"{last.relmse:.4f}"
    return [str(number), f"{place}, {floor}", ", ".join(things), *told, *more]


def _compared(number: int, passes: int, folder: Path | None, gpu: Gpu) -> tuple[str, Difference, Difference]:
    """The scene's name, and how one pass and the mean of some differ from paths."""
    started = time.perf_counter()
    scene = random_scene(number)
    truth, error = paths_picture(scene)
    print(f"{number}: {scene.name}", flush=True)
    first, last = rendered(scene, passes, gpu)
    found = [difference(_block_means(each), truth, error) for each in (first, last)]
    for count, each in zip((1, passes), found, strict=True):
        print(f"  {count:3} passes: {each}", flush=True)
    print(f"  {time.perf_counter() - started:.0f} s", flush=True)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(folder / f"{number}.npz", ours=last, truth=truth, error=error)
    return scene.name, *found


def difference(ours: np.ndarray, truth: np.ndarray, error: np.ndarray) -> Difference:
    """Return the Difference of (h, w, 3) blocks, whose truth has these standard errors."""
    mean = truth.mean()
    weight = 1.0 / (truth**2 + _FLOOR * mean**2)
    relmse = ((ours - truth) ** 2 * weight).mean() - (error**2 * weight).mean()
    shown = truth.mean(axis=-1) + _OFF * mean
    away, noise = (ours - truth).mean(axis=-1) / shown, error.mean(axis=-1) / shown
    sure = np.abs(away) - _SURE * noise
    y, x = np.unravel_index(np.argmax(sure), sure.shape)
    return Difference(
        float(ours.mean() / mean - 1.0),
        float(error.mean() / np.sqrt(noise.size) / mean),
        float(relmse),
        float((sure > _OFF).mean()),
        float(away[y, x]),
        (int(_BLOCK * x + _BLOCK // 2), int(_BLOCK * y + _BLOCK // 2)),
    )


def rendered(scene: Scene, passes: int, gpu: Gpu) -> tuple[np.ndarray, np.ndarray]:
    """Return pictures, (h, w, 3) cd/m2, of one pass and of the mean of so many."""
    settings = Settings(size=_SIZE, bounces=_BOUNCES, light="none")
    with ispm.Renderer(scene, settings, gpu=gpu) as renderer:
        first = renderer.render().radiance.copy()
        *_, last = renderer.converge(passes)
        return first, last.radiance.copy()


def paths_picture(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Return the means over blocks, (h, w, 3), by paths from the eye, and their standard errors."""
    camera = scene.default_camera(_SIZE)
    view = CameraView(_SIZE, camera.pose, camera.yfov, camera.ymag)
    tracer, random = Tracer(scene, footprint=_FINE), np.random.default_rng(7)
    width, height = _SIZE[0] // _BLOCK, _SIZE[1] // _BLOCK
    y, x = np.divmod(np.arange(width * height), width)
    parts = []
    for part in range(_PARTS):
        dx, dy = random.random((2, len(x), _PLACES))
        rays = view.rays_through(_BLOCK * (x[:, None] + dx), _BLOCK * (y[:, None] + dy))
        light = path_light(
            tracer.tables, rays[0].reshape(-1, 3), rays[1].reshape(-1, 3),
            samples=range(part * _PATHS, (part + 1) * _PATHS), bounces=_BOUNCES, seed=part, threads=2,
        )  # fmt: skip
        parts.append(light.reshape(height, width, _PLACES, 3).mean(axis=2))
    return np.mean(parts, axis=0), np.std(parts, axis=0, ddof=1) / math.sqrt(_PARTS)


def _block_means(picture: np.ndarray) -> np.ndarray:
    height, width = picture.shape[0] // _BLOCK, picture.shape[1] // _BLOCK
    return np.asarray(picture.reshape(height, _BLOCK, width, _BLOCK, 3).mean(axis=(1, 3)), np.float64)


def random_scene(number: int) -> Scene:
    """Return the random scene of a number, the same every time."""
    random = np.random.default_rng(number)
    scene = Scene()
    room = random.random() < 0.5
    names = [_room(scene, random) if room else _ground(scene, random)]
    for k in range(random.integers(3, 8)):
        names.append(_thing(scene, random, k))
    scene.name = ", ".join(names)
    angle, away = random.uniform(-0.9, 0.9), random.uniform(2.3, 2.8) if room else random.uniform(2.5, 4.5)
    eye = away * math.sin(angle), random.uniform(0.7, 1.9), away * math.cos(angle)
    if room:
        eye = tuple(np.clip(eye, (-2.3, 0.3, -2.3), (2.3, 2.3, 2.3)).tolist())
    add_camera(scene, eye, (0.0, 0.35, 0.0), math.radians(random.uniform(30.0, 60.0)))
    return scene


def _room(scene: Scene, random: Random) -> str:
    """A room of 5 m, 2.6 m high, in half of all with a window, and its light; returns what it is called."""
    half, top, wall = 2.5, 2.6, 0.2
    sides = [lambert(_color(random, 0.2, 0.85)) for _ in range(3)]
    floor = _surface(random)
    scene.add(box((-half, -wall, -half), (half, 0.0, half)), material=floor[1])
    scene.add(box((-half, top, -half), (half, top + wall, half)), material=lambert((0.8,) * 3))
    scene.add(box((-half - wall, -wall, -half), (-half, top + wall, half)), material=sides[0])
    scene.add(box((-half - wall, -wall, -half - wall), (half + wall, top + wall, -half)), material=sides[1])
    scene.add(box((-half - wall, -wall, half), (half + wall, top + wall, half + wall)), material=sides[2])
    if random.random() < 0.5:
        low, high, near, far = 0.8, 2.1, *np.sort(random.uniform(-2.0, 2.0, 2))
        far = max(far, near + 0.5)
        for a, b in (
            ((half, -wall, -half), (half + wall, low, half)),
            ((half, high, -half), (half + wall, top + wall, half)),
            ((half, low, -half), (half + wall, high, near)),
            ((half, low, far), (half + wall, high, half)),
        ):
            scene.add(box(a, b), material=sides[0])
        return f"window {_surround(scene, random)}, floor {floor[0]}"
    scene.add(box((half, -wall, -half), (half + wall, top + wall, half)), material=sides[0])
    lamps = [
        _lamp(scene, random, (random.uniform(-1.8, 1.8), 2.2, random.uniform(-1.8, 1.8))) for _ in range(2)
    ]
    return f"room {' '.join(lamps)}, floor {floor[0]}"


def _ground(scene: Scene, random: Random) -> str:
    floor = _surface(random)
    scene.add(shapes.plane(14.0, 14.0), material=floor[1])
    told = "open"
    if random.random() < 0.4:
        scene.add(box((-2.0, 0.0, -2.6), (2.0, 1.6, -2.4)), material=lambert(_color(random, 0.2, 0.85)))
        told = "yard"
    if random.random() < 0.3:
        lamps = [_lamp(scene, random, (random.uniform(-2, 2), 2.4, random.uniform(-1, 2))) for _ in range(2)]
        return f"{told} {' '.join(lamps)}, floor {floor[0]}"
    return f"{told} {_surround(scene, random)}, floor {floor[0]}"


def _lamp(scene: Scene, random: Random, place: tuple[float, float, float]) -> str:
    color = np.array(_color(random, 0.6, 1.0)) * 12.0
    kind = str(random.choice(["rect", "disk", "sphere", "mesh"]))
    size = float(random.uniform(0.05, 0.5))
    light = tuple((color / (math.pi * size * size)).tolist())
    if kind == "mesh":
        glow = Material((0.0, 0.0, 0.0), specular=0.0, emission=tuple(0.3 * c for c in light))
        scene.add(shapes.torus(0.8 * size, 0.2 * size), material=glow, translation=place)
        return kind
    lamp = {
        "rect": lambda: RectLight(light, size, 2.0 * size),
        "disk": lambda: DiskLight(light, 0.8 * size),
        "sphere": lambda: SphereLight(light, 0.4 * size),
    }[kind]()
    scene.add(lamp, translation=place).look_at((0.0, 0.2, 0.0))
    return kind


def _surround(scene: Scene, random: Random) -> str:
    """A gradient, with clouds or softboxes; in two of three with a sun."""
    height, width = 128, 256
    up = np.cos((np.arange(height) + 0.5) / height * math.pi)[:, None, None]
    zenith, horizon = np.array(_color(random, 0.1, 1.0)), np.array(_color(random, 0.3, 1.0))
    share = np.clip(up, 0.0, 1.0)
    image = np.where(up > 0.0, zenith * share + horizon * (1.0 - share), 0.3 * horizon * (1.0 + up))
    image = np.repeat(image, width, axis=1).astype(np.float32)
    told = "sky"
    if random.random() < 0.5:
        for _ in range(4):
            row, column = random.integers(10, 60), random.integers(0, width - 40)
            image[row : row + random.integers(4, 25), column : column + random.integers(6, 40)] *= (
                random.uniform(2, 12)
            )
        told = "boxes"
    if random.random() < 0.67:
        row, column = random.integers(12, 56), random.integers(0, width - 8)
        across = random.integers(1, 4)
        solid = 2.0 * math.pi**2 / (height * width) * math.sin(math.pi * row / height) * across**2
        image[row : row + across, column : column + across] = random.uniform(1.0, 8.0) / solid
        told += f" sun{across}"
    scene.environment = Environment(image, rotation=float(random.uniform(0.0, 6.0)))
    return told


def _thing(scene: Scene, random: Random, k: int) -> str:
    name, mesh, low = _shape(random)
    told, material = _surface(random)
    size = random.uniform(0.4, 1.1)
    angle = 2.4 * k + random.uniform(-0.4, 0.4)
    away = 0.45 * math.sqrt(k + 0.3)
    lift = random.choice([0.002, -0.02, 0.15])
    place = away * math.cos(angle), size * low + lift, away * math.sin(angle)
    turn = ispm.axis_angle((0.0, 1.0, 0.0), random.uniform(0.0, 6.0))
    scene.add(mesh, material=material, translation=place, rotation=turn, scale=(size,) * 3)
    return f"{told} {name}"


def _shape(random: Random) -> tuple[str, Mesh, float]:
    """A shape's name, its mesh and how high its origin is above its foot, m."""
    kind = str(random.choice(["ball", "box", "ring", "can", "cone", "sheet", "slab"]))
    if kind == "ring":
        return kind, shapes.torus(0.4, 0.12), 0.12
    made: dict[str, Callable[[], tuple[Mesh, float]]] = {
        "ball": lambda: (shapes.sphere(0.35), 0.35),
        "box": lambda: (shapes.box((0.5, 0.6, 0.4)), 0.3),
        "can": lambda: (shapes.cylinder(0.25, 0.7), 0.35),
        "cone": lambda: (shapes.cone(0.35, 0.7), 0.35),
        "sheet": lambda: (shapes.box((0.9, 0.7, 0.01)), 0.35),
        "slab": lambda: (shapes.box((0.8, 0.05, 0.5)), 0.025),
    }
    mesh, low = made[kind]()
    return kind, mesh, low


def _surface(random: Random) -> tuple[str, Material]:
    """A random material and what it is called."""
    color, rough = _color(random, 0.05, 0.9), float(random.uniform(0.02, 1.0))
    kinds: dict[str, Callable[[], Material]] = {
        "matte": lambda: lambert(color),
        "plastic": lambda: Material(color, roughness=rough),
        "metal": lambda: Material(_color(random, 0.5, 1.0), metallic=1.0, roughness=rough),
        "mirror": lambda: Material((0.95,) * 3, metallic=1.0, roughness=0.0),
        "glass": lambda: Material(
            transmission=1.0,
            thickness=0.01,
            roughness=0.0,
            attenuation_color=_color(random, 0.5, 1.0),
            attenuation_distance=0.5,
        ),
        "frosted": lambda: Material(transmission=1.0, thickness=0.01, roughness=0.6 * rough),
        "thin": lambda: Material(
            _color(random, 0.5, 1.0), transmission=1.0, roughness=0.0 if rough < 0.5 else 0.5 * rough
        ),
        "half": lambda: Material(
            color,
            metallic=float(random.random()),
            roughness=rough,
            transmission=float(random.random()),
            thickness=0.01,
        ),
        "coat": lambda: Material(
            color,
            metallic=float(random.integers(2)),
            roughness=rough,
            clearcoat=1.0,
            clearcoat_roughness=float(random.uniform(0.0, 0.4)),
        ),
        "sheen": lambda: Material(
            color, sheen_color=_color(random, 0.3, 1.0), sheen_roughness=float(random.uniform(0.2, 1.0))
        ),
        "brushed": lambda: Material(
            _color(random, 0.5, 1.0), metallic=1.0, roughness=0.5 * rough, anisotropy=float(random.random())
        ),
        "leaf": lambda: Material(
            color,
            diffuse_transmission=float(random.uniform(0.3, 1.0)),
            diffuse_transmission_color=_color(random, 0.3, 0.9),
            double_sided=True,
        ),
        "checker": lambda: Material(base_color_texture=_checker(random), roughness=rough),
        "patches": lambda: Material(color, metallic=1.0, metallic_roughness_texture=_noise(random)),
        "bumps": lambda: Material(color, roughness=rough, normal_texture=_bumps(random)),
    }
    kind = str(random.choice(list(kinds)))
    return kind, kinds[kind]()


def _color(random: Random, low: float, high: float) -> tuple[float, float, float]:
    r, g, b = random.uniform(low, high, 3).tolist()
    return r, g, b


def _checker(random: Random) -> Texture:
    squares = np.where(
        np.indices((8, 8)).sum(axis=0)[..., None] % 2, _color(random, 0.5, 0.9), _color(random, 0.0, 0.5)
    )
    return Texture(squares, linear=False, mipmaps=False)


def _noise(random: Random) -> Texture:
    values = random.random((8, 8, 3))
    return Texture((255 * values).astype(np.uint8), srgb=False, mipmaps=False)


def _bumps(random: Random) -> Texture:
    t = np.linspace(0.0, 2.0 * math.pi, 64, endpoint=False)
    x, y = np.meshgrid(np.sin(4 * t), np.sin(3 * t))
    normal = np.stack([0.4 * x, 0.4 * y, np.ones_like(x)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return Texture((0.5 * normal + 0.5).astype(np.float32), srgb=False, mipmaps=False)


if __name__ == "__main__":
    main()
