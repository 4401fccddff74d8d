"""Scenes lit by surfaces, by the sky and by a studio, and rough metals: what came after `scenes.py`.

Their references are by our own paths from the eye, see `traced.py`.
"""

from __future__ import annotations

import math

import numpy as np

from ispm import shapes
from ispm.library.common import add_camera, lambert
from ispm.library.rooms import cornell_box
from ispm.library.shapes import box, icosphere, polygons
from ispm.library.studio_light import studio_radiance
from ispm.scene.environment import Environment
from ispm.scene.light import SphereLight
from ispm.scene.material import Material, Texture
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Scene
from ispm.scene.sky import Sky

Triple = tuple[float, float, float]

_WHITE, _CREAM, _GREY = (0.8, 0.8, 0.8), (0.75, 0.7, 0.6), (0.5, 0.5, 0.5)
_RED, _BLUE, _WOOD = (0.65, 0.2, 0.15), (0.2, 0.3, 0.65), (0.55, 0.35, 0.2)
_GOLD, _STEEL = (1.00, 0.77, 0.34), (0.62, 0.60, 0.58)
_ALPHAS = 0.05, 0.1, 0.2
_SUNK = 0.02  # m that a thing is below what it stands on


def area_box() -> Scene:
    """The Cornell box, lit by the lamp that its photograph has: a bright quad in its ceiling."""
    scene = cornell_box()
    scene.name = "area-box"
    scene.roots.remove(scene["light"])
    glow = Material((0.78,) * 3, specular=0.0, emission=(17.0, 12.0, 4.0), name="lamp")
    scene.add(_facing_down(1.30, 1.05), material=glow, translation=(2.78, 5.478, 2.795))
    return scene


def lamp_behind_glass() -> Scene:
    """A glass ball between a round lamp and a floor, on which it throws the lamp's picture."""
    scene = Scene(name="lamp-behind-glass")
    for low, high, color in (
        ((-3.0, -0.2, -3.0), (3.0, 0.0, 3.0), _CREAM),
        ((-3.1, -0.1, 2.0), (3.1, 2.6, 2.2), _BLUE),
        ((1.1, -_SUNK, 0.5), (1.7, 0.7, 1.1), _RED),
    ):
        scene.add(box(low, high), material=lambert(color))
    glass = Material(transmission=1.0, thickness=1.0, roughness=0.0, name="glass")
    scene.add(icosphere(0.4, 40, "ball"), material=glass, translation=(0.0, 0.85, 0.2))
    scene.add(SphereLight((45.0,) * 3, radius=0.25), name="lamp", translation=(0.5, 2.1, 0.4))
    add_camera(scene, (-0.3, 1.9, -3.0), (0.0, 0.45, 0.3), math.radians(44.0))
    return scene


def studio_metals() -> Scene:
    """Balls of rough gold and blocks of rough steel in a studio; alpha .05, .1 and .2."""
    scene = Scene(name="studio-metals", environment=Environment(studio_radiance(), name="studio"))
    scene.add(shapes.plane(8.0, 8.0), material=lambert(_GREY))
    for k, alpha in enumerate(_ALPHAS):
        gold, steel = (
            Material(color, metallic=1.0, roughness=math.sqrt(alpha), name=name)
            for color, name in ((_GOLD, "gold"), (_STEEL, "steel"))
        )
        x = 0.95 * (k - 1)
        scene.add(icosphere(0.36, 40), material=gold, translation=(x, 0.36, 0.45))
        scene.add(box((x - 0.1, -_SUNK, -0.75), (x + 0.5, 1.0, -0.35)), material=steel)
    add_camera(scene, (1.0, 1.45, 2.9), (0.1, 0.45, 0.0), math.radians(36.0))
    return scene


def shade() -> Scene:
    """A room at night: all its light comes through a lamp's patterned shade."""
    scene = Scene(name="shade")
    for low, high, color in (
        ((-0.2, -0.2, -0.2), (4.2, 0.0, 4.2), _WOOD),
        ((-0.2, 2.6, -0.2), (4.2, 2.8, 4.2), _WHITE),
        ((-0.2, -0.1, -0.1), (0.0, 2.7, 4.1), _RED),
        ((4.0, -0.1, -0.1), (4.2, 2.7, 4.1), _CREAM),
        ((-0.1, -0.1, -0.2), (4.1, 2.7, 0.0), _WHITE),
        ((-0.1, -0.1, 4.0), (4.1, 2.7, 4.2), _WHITE),
        ((1.2, -_SUNK, 2.6), (2.4, 0.6, 3.4), _GREY),
        ((1.78, 0.6 - _SUNK, 2.98), (1.82, 0.9, 3.02), _WOOD),
    ):
        scene.add(box(low, high), material=lambert(color))
    u, v = np.meshgrid((np.arange(64) + 0.5) / 64, (np.arange(32) + 0.5) / 32)
    bands = 0.5 + 0.45 * np.sin(2.0 * np.pi * (6.0 * u + 2.0 * v)) * np.sin(np.pi * v)
    paper = Texture(np.stack([bands, 0.75 * bands, 0.2 + 0.3 * bands], axis=-1))
    glow = Material((0.6,) * 3, specular=0.0, emission=(60.0, 50.0, 40.0), emission_texture=paper)
    scene.add(shapes.cylinder(0.22, 0.4), material=glow, name="shade", translation=(1.8, 1.1, 3.0))
    add_camera(scene, (3.5, 1.6, 0.35), (1.7, 1.0, 2.9), math.radians(60.0))
    return scene


def many_lamps() -> Scene:
    """A hall with 200 small lamps of three colors under its ceiling, and piers between them."""
    scene = Scene(name="many-lamps")
    for low, high, color in (
        ((-0.2, -0.2, -0.2), (20.2, 0.0, 10.2), _GREY),
        ((-0.2, 4.0, -0.2), (20.2, 4.2, 10.2), _WHITE),
        ((-0.2, -0.1, -0.1), (0.0, 4.1, 10.1), _WHITE),
        ((20.0, -0.1, -0.1), (20.2, 4.1, 10.1), _WOOD),
        ((-0.1, -0.1, -0.2), (20.1, 4.1, 0.0), _BLUE),
        ((-0.1, -0.1, 10.0), (20.1, 4.1, 10.2), _CREAM),
    ):
        scene.add(box(low, high), material=lambert(color))
    for k in range(6):
        for z in (3.0, 6.6):
            x = 2.6 + 3.0 * k
            scene.add(box((x, -_SUNK, z), (x + 0.4, 4.0 + _SUNK, z + 0.4)), material=lambert(_WHITE))
    lamp = _facing_down(0.12, 0.12)
    glows = [
        Material((0.5,) * 3, specular=0.0, emission=color)
        for color in ((90.0, 80.0, 60.0), (30.0, 60.0, 90.0), (160.0, 60.0, 40.0))
    ]
    for i in range(20):
        for k in range(10):
            place = 0.5 + i, 3.5 + 0.3 * ((3 * i + 5 * k) % 7) / 7, 0.5 + k
            scene.add(lamp, material=glows[(i + k // 2) % 3], translation=place)
    add_camera(scene, (0.5, 1.7, 4.9), (12.0, 1.5, 5.4), math.radians(50.0))
    return scene


def sun_yard() -> Scene:
    """A pillar, a canopy and a ball under an image of a sky, whose sun is four pixels of it."""
    dome = Sky(sun_elevation=0.5).dome()
    image = dome.image / dome.image.mean()
    image[87:89, 340:342] = 30_000.0, 28_500.0, 25_500.0
    scene = Scene(name="sun-yard", environment=Environment(image))
    for low, high, color in (
        ((-6.0, -0.2, -6.0), (6.0, 0.0, 6.0), _CREAM),
        ((-1.3, -_SUNK, -0.5), (-0.3, 2.4, 0.5), _RED),
        ((-2.5, 3.1, -3.8), (3.5, 3.2, -0.3), _GREY),
        ((2.4, -_SUNK, -3.0), (2.8, 3.15, -2.6), _WOOD),
    ):
        scene.add(box(low, high), material=lambert(color))
    scene.add(icosphere(0.7, 40, "ball"), material=lambert(_BLUE), translation=(1.2, 0.7, 0.6))
    add_camera(scene, (4.0, 3.0, 6.6), (0.2, 1.0, -0.4), math.radians(34.0))
    return scene


def under_sky(scene: Scene, sky: Sky) -> Scene:
    """Return the scene lit by a sky in place of its light."""
    scene.roots.remove(scene["light"])
    scene.environment = sky
    return scene


def _facing_down(width: float, depth: float) -> Mesh:
    x, z = 0.5 * width, 0.5 * depth
    return polygons([np.array([[-x, 0.0, -z], [x, 0.0, -z], [x, 0.0, z], [-x, 0.0, z]])], "lamp")


LIT = {
    "area-box": area_box,
    "lamp-behind-glass": lamp_behind_glass,
    "studio-metals": studio_metals,
    "shade": shade,
    "many-lamps": many_lamps,
    "sun-yard": sun_yard,
}
"""Name to function; `scenes.py` adds `sky-colonnade`."""
