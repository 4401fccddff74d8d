"""Random scenes: a room or open ground, things of random shapes and materials, by a number.

Lamps have a surface, or an environment shines, so that paths from the eye find all light. See `beside_paths`.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

import ispm
from ispm import Environment, Material, Scene, Texture, shapes
from ispm.library.common import add_camera, lambert
from ispm.library.shapes import box
from ispm.scene.light import DiskLight, RectLight, SphereLight
from ispm.scene.mesh import Mesh

Random = np.random.Generator

_ASSET, _RAISED = 1.3, 0.003  # metres: an asset's size, and how far it is above what it stands on


def random_scene(number: int) -> Scene:
    """Return the random scene of a number, the same every time."""
    random = np.random.default_rng(number)
    scene = Scene()
    room = random.random() < 0.5
    names = [_room(scene, random) if room else _ground(scene, random)]
    for k in range(random.integers(3, 8)):
        names.append(_thing(scene, random, k))
    scene.name = ", ".join(names)
    _look(scene, random, room, aim=0.35)
    return scene


def asset_scene(file: Path) -> Scene:
    """Return a file's meshes, 1.3 m in size, in the room or on the ground of a random scene, by its name.

    Lights of its own are left out.
    """
    random = np.random.default_rng(zlib.crc32(file.name.encode()))
    scene = Scene()
    room = random.random() < 0.5
    place = _room(scene, random) if room else _ground(scene, random)
    part = ispm.load(file)
    part.environment = None
    for node in part.nodes:
        node.light = node.camera = None
    low, high = part.bounds
    scale = _ASSET / float((high - low).max())
    x, y, z = (-scale * np.array([(low[0] + high[0]) / 2.0, low[1], (low[2] + high[2]) / 2.0])).tolist()
    scene.merge(part, translation=(x, y + _RAISED, z), scale=(scale,) * 3)
    scene.name = f"{place}, {_thing(scene, random, 4)}"
    _look(scene, random, room, aim=0.45)
    return scene


def _look(scene: Scene, random: Random, room: bool, aim: float) -> None:
    """A camera that looks at a point `aim` metres above the middle."""
    angle, away = random.uniform(-0.9, 0.9), random.uniform(2.3, 2.8) if room else random.uniform(2.5, 4.5)
    eye = away * math.sin(angle), random.uniform(0.7, 1.9), away * math.cos(angle)
    if room:
        eye = tuple(np.clip(eye, (-2.3, 0.3, -2.3), (2.3, 2.3, 2.3)).tolist())
    add_camera(scene, eye, (0.0, aim, 0.0), math.radians(random.uniform(30.0, 60.0)))


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
