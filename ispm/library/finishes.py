"""Surfaces of the built-in halls: painted and rusty steel, concrete, wood; stains and wear as textures."""

from __future__ import annotations

from collections import defaultdict
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ispm.library.common import stand
from ispm.library.forms import unwrapped
from ispm.library.shapes import merge
from ispm.scene.material import Material, Texture
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Node, Part, Scene

_SIDE = 256  # texels
_GRAIN = 100  # seed of the fine noise that all have

Rgb = tuple[float, float, float]


class _Finish(NamedTuple):
    """How a surface looks.

    base, stain  linear reflectance, or F0 of metals, of what is clean and of what is stained
    cover        share that is stained
    rough        roughness of the clean and of the stained
    metallic     0 or 1
    metres       that one texture spans
    seed         of the stains
    stretch      stains are so many times as long as wide, downwards
    pattern      "stripes" aslant in the colour of stains, as of hazard tape, or "bricks" in courses
    """

    base: Rgb
    stain: Rgb
    cover: float
    rough: tuple[float, float]
    metallic: float = 0.0
    metres: float = 3.0
    seed: int = 1
    stretch: int = 1
    pattern: str = ""


FINISHES: dict[str, _Finish] = {
    "concrete": _Finish((0.40, 0.385, 0.36), (0.15, 0.14, 0.125), 0.35, (0.85, 0.55), metres=6.0, seed=1),
    "concrete wall": _Finish((0.46, 0.44, 0.40), (0.22, 0.20, 0.17), 0.40, (0.9, 0.8), 0.0, 5.0, 2, 3),
    "brick": _Finish((0.34, 0.135, 0.085), (0.22, 0.10, 0.07), 0.45, (0.9, 0.9), 0.0, 1.2, 3, 1, "bricks"),
    "steel": _Finish((0.26, 0.27, 0.28), (0.15, 0.13, 0.115), 0.40, (0.5, 0.7), 0.0, 2.0, 4),
    "rust": _Finish((0.20, 0.085, 0.04), (0.09, 0.035, 0.018), 0.50, (0.8, 0.95), 0.0, 1.5, 5),
    "galvanized": _Finish((0.62, 0.63, 0.64), (0.42, 0.42, 0.42), 0.45, (0.42, 0.62), 1.0, 1.2, 6),
    "dark metal": _Finish((0.07, 0.07, 0.075), (0.11, 0.07, 0.05), 0.30, (0.45, 0.8), 0.0, 2.0, 7),
    "corrugated": _Finish((0.34, 0.37, 0.38), (0.21, 0.13, 0.09), 0.22, (0.55, 0.9), 0.0, 4.0, 8, 4),
    "roofing": _Finish((0.30, 0.29, 0.28), (0.19, 0.12, 0.08), 0.30, (0.7, 0.9), 0.0, 5.0, 9, 3),
    "red paint": _Finish((0.58, 0.045, 0.03), (0.20, 0.06, 0.03), 0.22, (0.4, 0.85), 0.0, 2.0, 10),
    "green paint": _Finish((0.05, 0.34, 0.13), (0.10, 0.10, 0.05), 0.22, (0.45, 0.85), 0.0, 2.0, 11),
    "blue paint": _Finish((0.035, 0.12, 0.50), (0.08, 0.08, 0.10), 0.22, (0.4, 0.85), 0.0, 2.0, 12),
    "yellow paint": _Finish((0.72, 0.42, 0.03), (0.26, 0.13, 0.04), 0.20, (0.4, 0.85), 0.0, 1.5, 13),
    "orange paint": _Finish((0.70, 0.19, 0.02), (0.24, 0.08, 0.03), 0.22, (0.4, 0.85), 0.0, 2.0, 14),
    "white paint": _Finish((0.66, 0.65, 0.61), (0.34, 0.29, 0.23), 0.25, (0.45, 0.8), 0.0, 2.5, 15, 3),
    "teal paint": _Finish((0.05, 0.30, 0.32), (0.08, 0.12, 0.11), 0.22, (0.45, 0.85), 0.0, 2.5, 16),
    "hazard": _Finish((0.72, 0.46, 0.03), (0.03, 0.03, 0.03), 0.0, (0.5, 0.7), 0.0, 0.5, 17, 1, "stripes"),
    "wood": _Finish((0.40, 0.24, 0.12), (0.22, 0.12, 0.06), 0.45, (0.75, 0.9), 0.0, 1.2, 18, 8),
    "rubber": _Finish((0.028, 0.028, 0.030), (0.05, 0.048, 0.045), 0.4, (0.8, 0.95), 0.0, 1.0, 19),
    "copper": _Finish((0.90, 0.56, 0.42), (0.30, 0.34, 0.26), 0.30, (0.35, 0.7), 1.0, 1.0, 20),
    "hull": _Finish((0.52, 0.54, 0.56), (0.36, 0.36, 0.36), 0.35, (0.45, 0.7), 0.0, 3.0, 21, 2),
    "dark hull": _Finish((0.12, 0.13, 0.15), (0.18, 0.17, 0.16), 0.30, (0.4, 0.65), 0.0, 3.0, 22, 2),
    "deck": _Finish((0.20, 0.21, 0.22), (0.09, 0.09, 0.095), 0.40, (0.42, 0.7), 0.0, 4.0, 23),
    "stone": _Finish((0.50, 0.46, 0.39), (0.30, 0.26, 0.21), 0.45, (0.85, 0.9), 0.0, 2.5, 24, 2),
    "dark stone": _Finish((0.17, 0.16, 0.155), (0.09, 0.085, 0.085), 0.45, (0.5, 0.8), 0.0, 2.5, 25),
}
"""Name to surface. All are dusty enough to be seen by direct and indirect light, none is a mirror."""


class Finishes:
    """The materials of one scene, made when first asked for, so that scenes share nothing."""

    def __init__(self) -> None:
        self._made: dict[str, Material] = {}

    def __getitem__(self, name: str) -> Material:
        """Return the material of FINISHES called `name`, always the same one."""
        if name not in self._made:
            self._made[name] = _material(name)
        return self._made[name]

    def parts(self, pieces: Pieces, name: str) -> list[Part]:
        """Return a part for each surface of `pieces`, unwrapped for its texture."""
        return [
            Part(unwrapped(merge(meshes, f"{name}, {finish}"), FINISHES[finish].metres), self[finish])
            for finish, meshes in pieces.items()
        ]

    def add(self, scene: Scene, name: str, pieces: Pieces, places: list[np.ndarray] | None = None) -> Node:
        """Hang `pieces` into the scene as a node, or with `places`, (4, 4) each, as one at each."""
        node = Node(name, parts=self.parts(pieces, name))
        if places is None:
            scene.roots.append(node)
        else:
            stand(scene, name, node.parts, places)
        return node


Pieces = defaultdict[str, list[Mesh]]
"""Meshes by the name of their surface."""


def pieces() -> Pieces:
    """Return an empty collection of meshes by surface."""
    return defaultdict(list)


def count(collected: Pieces) -> int:
    """Return how many triangles were collected."""
    return sum(len(mesh.triangles) for meshes in collected.values() for mesh in meshes)


@lru_cache(maxsize=64)
def cloud(seed: int, stretch: int = 1, slope: float = 1.6) -> np.ndarray:
    """Return (256, 256) noise that repeats seamlessly, its ranks spread evenly over 0 to 1.

    stretch  features are so many times as long, along rows
    slope    of the amplitude over the frequency: higher is smoother
    """
    fy, fx = np.meshgrid(np.fft.fftfreq(_SIDE) * stretch, np.fft.rfftfreq(_SIDE), indexing="ij")
    frequency = np.hypot(fx, fy) * _SIDE
    amplitude = np.where(frequency >= 1.0, np.maximum(frequency, 1.0) ** -slope, 0.0)
    phase = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, amplitude.shape)
    field = np.fft.irfft2(amplitude * np.exp(1j * phase), s=(_SIDE, _SIDE))
    ranks = np.empty(field.size)
    ranks[np.argsort(field, axis=None)] = np.linspace(0.0, 1.0, field.size)
    result = ranks.reshape(field.shape)
    result.flags.writeable = False
    return np.asarray(result)


def _material(name: str) -> Material:
    """A new material of FINISHES."""
    finish = FINISHES[name]
    field, grain = cloud(finish.seed, finish.stretch), cloud(_GRAIN, 1, 0.6)
    edge = 1.0 - finish.cover
    stained = np.clip((field - edge) / 0.45 + 0.5, 0.0, 1.0)[..., None]
    if finish.pattern == "stripes":
        stained = _stripes()[..., None]
    color = np.array(finish.base) * (1.0 - stained) + np.array(finish.stain) * stained
    if finish.pattern == "bricks":
        shade, mortar = _bricks()
        color = np.where(mortar[..., None], (0.30, 0.28, 0.25), color * shade[..., None])
    color = color * (0.82 + 0.30 * grain[..., None]) * (0.90 + 0.16 * field[..., None])
    clean, worn = finish.rough
    rough = clean + (worn - clean) * stained[..., 0] + 0.10 * (grain - 0.5)
    packed = np.zeros((_SIDE, _SIDE, 3), np.uint8)
    packed[..., 1] = np.round(255.0 * np.clip(rough, 0.05, 1.0))
    packed[..., 2] = 255
    return Material(
        metallic=finish.metallic,
        base_color_texture=Texture(_encoded(color), name=name),
        metallic_roughness_texture=Texture(packed, srgb=False, name=f"{name}, roughness"),
        name=name,
    )


def _stripes() -> np.ndarray:
    """(256, 256) stripes aslant, 0 and 1."""
    u, v = np.meshgrid(np.arange(_SIDE), np.arange(_SIDE))
    return np.where((u + v) % _SIDE < _SIDE // 2, 1.0, 0.0)


def _bricks() -> tuple[np.ndarray, np.ndarray]:
    """(256, 256) each: the shades of bricks, in 16 courses of 4 shifted by turns; where mortar is."""
    u, v = np.meshgrid(np.arange(_SIDE), np.arange(_SIDE))
    course = v // 16
    along = (u + 32 * (course % 2)) % _SIDE
    shades = np.random.default_rng(8).uniform(0.70, 1.15, (16, 4))
    return shades[course, along // 64], (v % 16 < 2) | (along % 64 < 2)


def _encoded(color: np.ndarray) -> np.ndarray:
    """(..., 3) uint8 sRGB of linear values."""
    linear = np.linspace(0.0, 1.0, 4096)
    curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)
    table = np.round(255.0 * curve).astype(np.uint8)
    return np.asarray(table[np.rint(4095.0 * np.clip(color, 0.0, 1.0)).astype(np.int64)])
