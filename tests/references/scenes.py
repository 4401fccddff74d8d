"""Scenes that Mitsuba renders too: Lambert walls, with one thing each that must be right, and `rooms.py`;
and all that there are, with those of `lit.py` and `held_out.py`.

Metals are white, so that every model of Fresnel's reflects all. Boxes are sunk into what they stand on, and
walls into each other: no two faces share a plane.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ispm.library.common import add_camera, add_spot, lambert
from ispm.library.rooms import cornell_box
from ispm.library.shapes import box, icosphere, lathe, polygons
from ispm.scene.light import DirectionalLight, PointLight, SpotLight
from ispm.scene.material import Material, Texture
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Scene
from ispm.scene.sky import Sky
from references.held_out import HELD_OUT
from references.lit import LIT, under_sky
from references.rooms import ROOMS

Triple = tuple[float, float, float]

_WHITE, _GREY, _OCHRE = (0.7, 0.7, 0.7), (0.5, 0.5, 0.5), (0.6, 0.4, 0.2)
_RED, _BLUE, _GREEN = (0.6, 0.15, 0.1), (0.15, 0.25, 0.6), (0.25, 0.5, 0.2)
DIM = 1e-3  # what surfaces reflect of what they did where only caustics are of interest
_SUNK = 0.02  # m that a thing is below the floor it stands on
_FAR_SIDE = 4  # of a room's sides: at low z
_SIDES = ([0, 2, 6, 4], [1, 5, 7, 3], [0, 4, 5, 1], [2, 3, 7, 6], [0, 1, 3, 2], [4, 6, 7, 5])


def ggx_floor() -> Scene:
    """A rough metal floor between Lambert walls: direct highlights, and gloss lit by the walls."""
    scene = Scene(name="ggx-floor")
    metal = Material((1.0, 1.0, 1.0), metallic=1.0, roughness=0.5, name="metal")
    _room(scene, (4.0, 3.0, 4.0), (_RED, _BLUE, metal, _WHITE, _WHITE, _GREY))
    _block(scene, (2.4, 0.0, 2.0), (3.2, 1.0, 2.8), _OCHRE)
    _point(scene, (1.2, 2.4, 1.6), 6.0)
    add_camera(scene, (2.2, 1.9, 0.15), (2.0, 0.5, 2.6), math.radians(60.0))
    return scene


def spot() -> Scene:
    """A room lit by one spot with a soft edge."""
    scene = Scene(name="spot")
    _room(scene, (4.0, 3.0, 4.0), (_RED, _GREEN, _GREY, _WHITE, _WHITE, _WHITE))
    _block(scene, (2.5, 0.0, 2.2), (3.3, 1.2, 3.0), _OCHRE)
    light = SpotLight((20.0,) * 3, inner_angle=0.25, outer_angle=0.6)
    add_spot(scene, light, "spot", (3.2, 2.6, 0.8), (1.6, 0.0, 2.6))
    add_camera(scene, (2.2, 1.7, 0.15), (1.9, 0.8, 3.0), math.radians(60.0))
    return scene


def sun() -> Scene:
    """A loggia: a directional light comes in through its open side."""
    scene = Scene(name="sun")
    for low, high, color in (
        ((-0.3, -0.2, -0.3), (4.3, 0.0, 4.3), _OCHRE),
        ((-0.3, 3.0, -0.3), (4.3, 3.2, 4.3), _WHITE),
        ((-0.2, -0.1, -0.2), (0.0, 3.1, 4.1), _WHITE),
        ((4.0, -0.1, -0.2), (4.2, 3.1, 4.1), _BLUE),
        ((-0.1, -0.1, 4.0), (4.1, 3.1, 4.2), _WHITE),
        ((2.2, -_SUNK, 1.6), (3.0, 0.9, 2.4), _RED),
    ):
        scene.add(box(low, high), material=lambert(color))
    # along (0.5, -0.7, 0.6), over the eye's shoulder
    direction = np.array([0.5, -0.7, 0.6])
    node = add_spot(scene, SpotLight(), "sun", (0.0, 0.0, 0.0), tuple(direction))
    node.light = DirectionalLight((10.0,) * 3)
    add_camera(scene, (1.6, 1.5, -1.9), (2.1, 1.3, 2.0), math.radians(50.0))
    return scene


def textured() -> Scene:
    """A floor with a texture and a normal map, a wall with a texture."""
    scene = Scene(name="textured")
    x, y = np.meshgrid(*[2.0 * np.pi * (np.arange(64) + 0.5) / 64] * 2)
    waves = np.stack([np.sin(2 * x) * np.cos(y), np.cos(x + 2 * y), np.sin(3 * y)], axis=-1)
    colors = Texture(_bytes(0.6 + 0.3 * waves))
    slope = np.stack([-0.35 * np.cos(3 * x), 0.35 * np.sin(2 * y + x), np.ones_like(x)], axis=-1)
    slope /= np.linalg.norm(slope, axis=-1, keepdims=True)
    normals = Texture(_bytes(0.5 + 0.5 * slope), srgb=False)
    floor = replace(lambert(_WHITE), base_color_texture=colors, normal_texture=normals)
    back = replace(lambert((0.9, 0.8, 0.7)), base_color_texture=colors)
    _room(scene, (4.0, 3.0, 4.0), (_RED, _GREEN, floor, _WHITE, _WHITE, back))
    _block(scene, (2.5, 0.0, 2.2), (3.3, 1.2, 3.0), _WHITE)
    _point(scene, (1.4, 2.4, 1.7), 6.0)
    add_camera(scene, (2.2, 1.9, 0.15), (1.9, 0.6, 3.0), math.radians(60.0))
    return scene


def door() -> Scene:
    """Two rooms, the light in one, the eye in the other: all that is seen came through the door."""
    scene = Scene(name="door")
    _room(scene, (10.2, 3.0, 6.0), ((0.3, 0.4, 0.7), _WHITE, (0.5, 0.35, 0.22), _WHITE, _WHITE, _WHITE))
    for low, high in (
        ((5.0, -0.05, -0.05), (5.2, 3.05, 2.2)),
        ((5.0, -0.05, 3.3), (5.2, 3.05, 6.05)),
        ((5.0, 2.1, 2.2), (5.2, 3.05, 3.3)),
    ):
        scene.add(box(low, high), material=lambert(_WHITE))
    _block(scene, (7.7, 0.0, 2.7), (8.7, 0.4, 4.5), (0.55, 0.35, 0.2))
    _block(scene, (5.8, 0.0, 5.4), (7.0, 1.8, 5.9), (0.25, 0.5, 0.3))
    _block(scene, (2.0, 0.0, 4.0), (3.0, 0.8, 5.0), (0.7, 0.2, 0.2))
    _point(scene, (2.2, 2.5, 1.2), 60.0)
    add_camera(scene, (10.0, 1.7, 5.6), (5.0, 1.2, 2.2), math.radians(49.0))
    return scene


def colonnade() -> Scene:
    """A long hall with two rows of thin columns."""
    scene = Scene(name="colonnade")
    _room(scene, (28.0, 5.0, 8.0), (_WHITE, _WHITE, (0.45, 0.42, 0.4), _WHITE, (0.6, 0.35, 0.25), _WHITE))
    column = lathe([(0.18, -_SUNK), (0.18, 5.0 + _SUNK)], 32, "column")
    for i in range(12):
        for z in (2.2, 5.8):
            scene.add(column, material=lambert((0.65, 0.62, 0.55)), translation=(2.0 + 2.2 * i, 0.0, z))
    _point(scene, (11.0, 3.5, 4.0), 60.0)
    add_camera(scene, (0.6, 1.7, 4.9), (14.0, 1.6, 3.6), math.radians(43.0))
    return scene


def sky_colonnade() -> Scene:
    """The hall of `colonnade`, its far side open to a clear sky."""
    scene = under_sky(colonnade(), Sky(sun_elevation=0.6, sun_azimuth=-0.5, sun_radius=0.0))
    scene.name = "sky-colonnade"
    scene.roots.remove(scene.roots[_FAR_SIDE])
    for node in scene.nodes:
        for part in node.parts:
            part.material = replace(part.material, double_sided=True)
    return scene


def cornell_with_glass() -> Scene:
    """The Cornell box with a glass ball in the tall block's place."""
    scene = cornell_box()
    scene.name = "glass-ball"
    scene.roots.remove(scene["tall block"])
    glass = Material(transmission=1.0, thickness=1.0, roughness=0.0, name="glass")
    scene.add(icosphere(1.0, 40, "ball"), material=glass, translation=(3.7, 1.4, 3.4))
    return scene


def mirror_ring() -> Scene:
    """A mirror ring of 128 flat facets on a floor."""
    scene = Scene(name="mirror-ring")
    corners = np.array([[-6, 0, -6], [-6, 0, 6], [6, 0, 6], [6, 0, -6]], float)
    scene.add(polygons([corners], "floor"), material=lambert((0.8,) * 3))
    scene.add(_facets(128, 1.0, 0.5), material=Material(metallic=1.0, roughness=0.0, double_sided=True))
    _point(scene, (2.4, 1.9, 0.0), 10.0)
    add_camera(scene, (0.0, 2.9, -2.6), (0.0, 0.0, -0.05), math.radians(38.0))
    return scene


def dimmed(scene: Scene, factor: float) -> Scene:
    """Return the scene with Lambert surfaces that reflect `factor` of what they did: of its light, what took
    k of them on its way is `factor`^k of what it was."""
    for node in scene.nodes:
        for part in node.parts:
            material = part.material
            if material.metallic == 0.0 and material.transmission == 0.0:
                color = tuple(factor * c for c in material.base_color[:3])
                part.material = replace(material, base_color=color)
    return scene


SCENES = {
    "ggx-floor": ggx_floor,
    "spot": spot,
    "sun": sun,
    "textured": textured,
    "door": door,
    "colonnade": colonnade,
    "cornell-box": cornell_box,
    "glass-ball": cornell_with_glass,
    "mirror-ring": mirror_ring,
    **ROOMS,
}
"""Name to function: what Mitsuba renders."""

TRACED = {**LIT, "sky-colonnade": sky_colonnade, **HELD_OUT}
"""Likewise what `traced.py` renders."""


def pictured(name: str) -> tuple[Scene, float]:
    """Return what the small reference `name` shows, and what a picture of it is to be divided by.

    Those called `-caustic` leave out what came by way of two Lambert surfaces or more: the scene is dimmed.
    """
    known = {**SCENES, **TRACED}
    of = next(scene for scene in sorted(known, key=len, reverse=True) if name.startswith(scene))
    scene = known[of]()
    return (dimmed(scene, DIM), DIM) if name.endswith("-caustic") else (scene, 1.0)


def _room(scene: Scene, size: Triple, sides: Sequence[Material | Triple]) -> None:
    """Walls that face inwards, from the origin to `size`; at low x, high x, low y and so on."""
    corners = np.array([[size[k] * (i >> k & 1) for k in range(3)] for i in range(8)], float)
    for face, side in zip(_SIDES, sides, strict=True):
        wall = polygons([corners[face]])
        wall.uv0 = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
        scene.add(wall, material=side if isinstance(side, Material) else lambert(side))


def _block(scene: Scene, low: Triple, high: Triple, color: Triple) -> None:
    scene.add(box((low[0], low[1] - _SUNK, low[2]), high), material=lambert(color))


def _point(scene: Scene, place: Triple, intensity: float) -> None:
    scene.add(PointLight((intensity,) * 3), name="light", translation=place)


def _facets(count: int, radius: float, height: float) -> Mesh:
    """The side of a prism, seen from both sides, on the floor."""
    angle = 2.0 * np.pi * np.arange(count) / count
    low = radius * np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], axis=1)
    top, after = low + np.array([0.0, height, 0.0]), np.roll(np.arange(count), -1)
    return polygons([np.stack([low[k], top[k], top[j], low[j]]) for k, j in enumerate(after)], "ring")


def _bytes(values: np.ndarray) -> np.ndarray:
    """(h, w, 3) in [0, 1] as (h, w, 4) uint8, opaque."""
    opaque = np.concatenate([values, np.ones((*values.shape[:2], 1))], axis=-1)
    return np.rint(255.0 * np.clip(opaque, 0.0, 1.0)).astype(np.uint8)
