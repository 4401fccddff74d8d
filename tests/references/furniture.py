"""Furniture of `furnished_scenes`: things that have legs, boards, bars, leaves and slats."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import ispm
from ispm import AlphaMode, Material, Scene, Texture, shapes
from ispm.library.common import lambert
from ispm.library.shapes import box, lathe, merge, moved
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Node

Random = np.random.Generator
Color = tuple[float, float, float]

SUNK = 0.005  # metres: what stands on another goes into it


@dataclass
class Site:
    """What is built: its scene, its random numbers and whether paths find caustics of its lights."""

    scene: Scene
    random: Random
    caustics: bool

    def color(self, low: float, high: float) -> Color:
        r, g, b = self.random.uniform(low, high, 3).tolist()
        return r, g, b

    def between(self, low: float, high: float) -> float:
        return float(self.random.uniform(low, high))

    def chance(self, share: float) -> bool:
        return bool(self.random.random() < share)

    def add(self, mesh: Mesh, material: Material, x: float = 0.0, z: float = 0.0, turn: float = 0.0) -> Node:
        rotation = ispm.axis_angle((0.0, 1.0, 0.0), turn)
        return self.scene.add(mesh, material=material, translation=(x, 0.0, z), rotation=rotation)

    def surface(self) -> Material:
        """What furniture is made of: mostly matte or wood, some plastic and metal, glass where it may be."""
        kinds: list[Callable[[], Material]] = [
            lambda: lambert(self.color(0.1, 0.8)),
            lambda: Material(self.color(0.05, 0.7), roughness=self.between(0.4, 0.9)),
            lambda: Material(base_color_texture=self.grain(), roughness=self.between(0.4, 0.8)),
            lambda: Material(self.color(0.4, 0.95), metallic=1.0, roughness=self.between(0.5, 0.8)),
        ]
        if self.caustics:
            kinds += [
                lambda: Material(self.color(0.02, 0.5), roughness=self.between(0.05, 0.3)),
                lambda: Material(self.color(0.5, 0.95), metallic=1.0, roughness=self.between(0.0, 0.4)),
            ]
        return kinds[self.random.integers(len(kinds))]()

    def grain(self) -> Texture:
        """Stripes of wood, of two colors."""
        t = np.linspace(0.0, 20.0, 64)
        wave = 0.5 + 0.5 * np.sin(t + 2.0 * np.sin(0.3 * t[:, None]))
        light, dark = np.array(self.color(0.4, 0.8)), np.array(self.color(0.1, 0.35))
        return Texture(dark + wave[..., None] * (light - dark), linear=False)


def add_thing(site: Site, x: float, z: float) -> str:
    """Add a random thing at x, z and return what it is called."""
    things: dict[str, Callable[[], None]] = {
        "table": lambda: _table(site, x, z),
        "chair": lambda: _chair(site, x, z),
        "shelf": lambda: _shelf(site, x, z),
        "plant": lambda: _plant(site, x, z),
        "steps": lambda: _steps(site, x, z),
        "screen": lambda: _screen(site, x, z),
        "sofa": lambda: _sofa(site, x, z),
        "rack": lambda: _rack(site, x, z),
        "jars": lambda: _jars(site, x, 0.0, z),
        "crates": lambda: _crates(site, x, z),
    }
    name = str(site.random.choice(list(things)))
    things[name]()
    return name


def _table(site: Site, x: float, z: float) -> None:
    wide, deep, high = site.between(0.4, 0.5), site.between(0.3, 0.45), site.between(0.45, 0.75)
    parts = [box((-wide, high - 0.03, -deep), (wide, high, deep))]
    for i in (-1, 1):
        for k in (-1, 1):
            a, b = i * (wide - 0.05), k * (deep - 0.05)
            parts.append(box((a - 0.02, -SUNK, b - 0.02), (a + 0.02, high - 0.03 + SUNK, b + 0.02)))
    site.add(merge(parts), site.surface(), x, z, site.between(0.0, 6.0))
    _jars(site, x, high, z)


def _chair(site: Site, x: float, z: float) -> None:
    parts = [box((-0.2, 0.42, -0.2), (0.2, 0.45, 0.2))]
    for a in (-0.18, 0.18):
        parts.append(box((a - 0.015, -SUNK, -0.195), (a + 0.015, 0.43, -0.165)))
        parts.append(box((a - 0.015, -SUNK, 0.165), (a + 0.015, 0.9, 0.195)))
    parts += [box((-0.18, y, 0.17), (0.18, y + 0.05, 0.19)) for y in (0.6, 0.72, 0.84)]
    site.add(merge(parts), site.surface(), x, z, site.between(0.0, 6.0))


def _shelf(site: Site, x: float, z: float) -> None:
    high, turn = site.between(1.2, 2.0), float(site.random.integers(4)) * math.pi / 2.0
    levels = np.arange(0.05, high, 0.33)
    parts = [box((-0.45, y, -0.15), (0.45, y + 0.02, 0.15)) for y in (*levels, high - 0.02)]
    parts += [box((a - 0.01, -SUNK, -0.15), (a + 0.01, high, 0.15)) for a in (-0.45, 0.45)]
    parts.append(box((-0.45, 0.0, -0.155), (0.45, high, -0.145)))
    site.add(merge(parts), site.surface(), x, z, turn)
    for y in levels[:-1]:
        a = -0.42
        while a < 0.2:
            thick, tall = site.between(0.015, 0.05), site.between(0.18, 0.27)
            book = box((a, y + 0.02 - SUNK, -0.13), (a + thick, y + 0.02 + tall, site.between(0.02, 0.12)))
            site.add(book, lambert(site.color(0.05, 0.8)), x, z, turn)
            a += thick + 0.002


def _plant(site: Site, x: float, z: float) -> None:
    pot = lathe([(0.0, 0.0), (0.1, 0.0), (0.15, 0.25), (0.13, 0.25), (0.0, 0.22)], 32)
    site.add(moved(pot, y=-SUNK), site.surface(), x, z)
    _leaves(site, x, 0.6, z, 0.3, int(site.random.integers(20, 80)), 0.12)


def add_tree(site: Site, x: float, z: float) -> None:
    """Add a tree at x, z."""
    site.add(moved(shapes.cylinder(0.12, 2.2), y=1.0), lambert(site.color(0.1, 0.3)), x, z)
    _leaves(site, x, 2.4, z, 0.9, 400, 0.22)


def _leaves(site: Site, x: float, y: float, z: float, reach: float, count: int, size: float) -> None:
    """Leaves in a ball: four-cornered, or cut out of squares by a texture; some let light through."""
    color = site.random.uniform((0.05, 0.25, 0.02), (0.3, 0.6, 0.15))
    cut = site.chance(0.4)
    through = 0.5 if site.chance(0.5) else 0.0
    t = np.linspace(-1.0, 1.0, 32)
    shape = (t[:, None] ** 2 / 0.3 + t**2 < 1.0).astype(np.float32)
    image = np.concatenate([np.broadcast_to(color, (32, 32, 3)), shape[..., None]], axis=-1)
    leaf = Material(
        (1.0,) * 3 if cut else tuple(color.tolist()),
        base_color_texture=Texture(image.astype(np.float32), linear=False) if cut else None,
        alpha_mode=AlphaMode.MASK if cut else AlphaMode.OPAQUE,
        diffuse_transmission=through,
        diffuse_transmission_color=tuple(color.tolist()) if through else (1.0,) * 3,
        roughness=0.6,
        double_sided=True,
    )
    places = site.random.normal(size=(count, 3))
    places *= reach * site.random.random((count, 1)) ** 0.33 / np.linalg.norm(places, axis=1, keepdims=True)
    axes = site.random.normal(size=(count, 2, 3))
    along = axes[:, 0] / np.linalg.norm(axes[:, 0], axis=1, keepdims=True)
    across = np.cross(along, axes[:, 1])
    across *= 0.4 / np.linalg.norm(across, axis=1, keepdims=True)
    corners = [
        [p - size * a, p + size * b, p + size * a, p - size * b]
        for p, a, b in zip(places + np.array((x, y, z)), 0.5 * along, 0.5 * across, strict=True)
    ]
    positions = np.array(corners, np.float32).reshape(-1, 3)
    first = 4 * np.arange(count)[:, None]
    triangles = np.concatenate([first + np.array(corner) for corner in ((0, 1, 2), (0, 2, 3))])
    uv = np.tile(np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32), (count, 1))
    site.scene.add(Mesh(positions, triangles, uv0=uv), material=leaf)


def _steps(site: Site, x: float, z: float) -> None:
    parts = [box((-0.4, -SUNK, 0.2 * k - 0.4), (0.4, 0.17 * (k + 1), 0.4)) for k in range(4)]
    site.add(merge(parts), site.surface(), x, z, float(site.random.integers(4)) * math.pi / 2.0)


def _screen(site: Site, x: float, z: float) -> None:
    """A screen of slats, of which some are metal."""
    parts = [box((-0.45, y, -0.01), (0.45, y + 0.03, 0.01)) for y in np.arange(0.1, 1.4, 0.07)]
    parts += [box((a - 0.015, -SUNK, -0.02), (a + 0.015, 1.45, 0.02)) for a in (-0.46, 0.46)]
    site.add(merge(parts), site.surface(), x, z, site.between(0.0, 6.0))


def _sofa(site: Site, x: float, z: float) -> None:
    parts = [
        box((-0.5, -SUNK, -0.3), (0.5, 0.4, 0.35)),
        box((-0.5, 0.3, 0.25), (0.5, 0.8, 0.4)),
        box((-0.55, -SUNK, -0.3), (-0.4, 0.58, 0.39)),
        box((0.4, -SUNK, -0.3), (0.55, 0.58, 0.39)),
    ]
    color = site.color(0.05, 0.7)
    velvet = Material(color, sheen_color=site.color(0.1, 0.8), sheen_roughness=site.between(0.3, 0.9))
    site.add(merge(parts), velvet if site.chance(0.3) else lambert(color), x, z, site.between(0.0, 6.0))


def _rack(site: Site, x: float, z: float) -> None:
    """Thin upright rods between two boards."""
    rods = [(a, b) for a in np.linspace(-0.35, 0.35, 8) for b in (-0.2, 0.2)]
    parts = [moved(shapes.cylinder(0.012, 0.9), x=float(a), y=0.45, z=float(b)) for a, b in rods]
    parts += [box((-0.4, y, -0.25), (0.4, y + 0.02, 0.25)) for y in (-SUNK, 0.88)]
    site.add(merge(parts), site.surface(), x, z, site.between(0.0, 6.0))


def _jars(site: Site, x: float, y: float, z: float) -> None:
    for k in range(3):
        size = site.between(0.06, 0.13)
        a, b = 0.22 * math.cos(2.1 * k), 0.22 * math.sin(2.1 * k)
        outside = [(0.0, 0.0), (0.7, 0.0), (1.0, 0.8), (0.5, 1.8), (0.6, 2.2)]
        inside = [(0.5, 2.2), (0.4, 1.8), (0.9, 0.8), (0.6, 0.1), (0.0, 0.1)]
        jar = lathe([(size * r, size * h) for r, h in outside + inside], 40)
        material = site.surface()
        if site.caustics and site.chance(0.4):
            material = Material(transmission=1.0, thickness=0.01, roughness=0.0)
        site.scene.add(jar, material=material, translation=(x + a, y - 0.002, z + b))


def _crates(site: Site, x: float, z: float) -> None:
    for k in range(3):
        size, turn = site.between(0.12, 0.2), site.between(0.0, 1.5)
        low = 0.0 if k < 2 else 0.24
        crate = box((-size, low - SUNK, -size), (size, low + 1.6 * size, size))
        site.add(crate, site.surface(), x + (0.25 * (2 * k - 1) if k < 2 else 0.0), z, turn)
