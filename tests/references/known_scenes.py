"""Scenes as papers and books test with, and a few that people often build: none was used to tune anything.

Each builds one Scene; its name tells the place and what is in it.
"""

from __future__ import annotations

import math

import numpy as np

import ispm
from ispm import Environment, Material, Scene, Sky, euler, shapes
from ispm.library.common import add_camera, lambert
from ispm.library.shapes import box, icosphere, lathe, polygons, sheet, tube
from ispm.library.studio_light import studio_radiance
from ispm.scene.light import DiskLight, RectLight, SphereLight

Color = tuple[float, float, float]

_WALL = 0.2  # m
_WHITE = 0.75, 0.75, 0.73
_DOWN = euler(-90.0, 0.0, 0.0, degrees=True)  # of a lamp that shines along -z
_WOOD = Material((0.5, 0.35, 0.2), roughness=0.4)
_CHROME = Material((0.9, 0.9, 0.88), metallic=1.0, roughness=0.0)
_PANE = Material(transmission=1.0, roughness=0.0, double_sided=True)


def _glass(thickness: float, ior: float = 1.5) -> Material:
    return Material(transmission=1.0, roughness=0.0, ior=ior, thickness=thickness)


def _room(
    scene: Scene,
    low: tuple[float, float],
    high: tuple[float, float, float],
    floor: Color | Material,
    sides: tuple[Color | Material, Color | Material] = (_WHITE, _WHITE),
    walls: Color = _WHITE,
) -> None:
    """Add a closed room above y = 0; low: x and z of its corner; sides: its walls at both ends of x."""
    (x0, z0), (x1, y1, z1), t, half = low, high, _WALL, _WALL / 2.0
    for corner, other, surface in (
        ((x0 - t, -t, z0 - t), (x1 + t, 0.0, z1 + t), floor),
        ((x0 - t, y1, z0 - t), (x1 + t, y1 + t, z1 + t), walls),
        ((x0 - t, -half, z0 - half), (x0, y1 + half, z1 + half), sides[0]),
        ((x1, -half, z0 - half), (x1 + t, y1 + half, z1 + half), sides[1]),
        ((x0 - half, -half, z0 - t), (x1 + half, y1 + half, z0), walls),
        ((x0 - half, -half, z1), (x1 + half, y1 + half, z1 + t), walls),
    ):
        scene.add(box(corner, other), material=surface if isinstance(surface, Material) else lambert(surface))


def _table(
    scene: Scene, x: float, z: float, half: tuple[float, float], top: float, wood: Material = _WOOD
) -> None:
    """Add a table with its middle above (x, z), 5 cm thick, that stands on four legs of 6 cm."""
    place, (a, b) = (x, 0.0, z), half
    scene.add(box((-a, top - 0.05, -b), (a, top, b)), material=wood, translation=place)
    for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
        u, v = i * (a - 0.1), j * (b - 0.1)
        leg = box((u - 0.03, -0.02, v - 0.03), (u + 0.03, top - 0.04, v + 0.03))
        scene.add(leg, material=lambert((0.3, 0.2, 0.1)), translation=place)


def plates() -> Scene:
    """Four plates from smooth to rough under four lamps from small to large (Veach 1997, figure 9.2)."""
    scene, gray = Scene(name="hall balls, four metal plates"), lambert((0.4,) * 3)
    scene.add(box((-6.0, -0.5, -4.0), (6.0, 0.0, 6.0)), material=gray)
    scene.add(box((-6.0, -0.5, -4.5), (6.0, 6.0, -4.0)), material=gray)
    for y, z, degrees, roughness in (
        (0.35, 2.6, 8.6, 0.07),
        (0.7, 1.3, 20.0, 0.14),
        (1.25, 0.1, 34.4, 0.24),
        (2.0, -0.9, 51.6, 0.4),
    ):
        metal = Material((0.35, 0.36, 0.38), metallic=1.0, roughness=roughness)
        turn = euler(degrees, 0.0, 0.0, degrees=True)
        plate = box((-2.0, -0.02, -0.5), (2.0, 0.02, 0.5))
        scene.add(plate, material=metal, translation=(0.0, y, z), rotation=turn)
    for x, radius in ((-1.8, 0.02), (-0.6, 0.06), (0.6, 0.2), (1.8, 0.5)):
        radiance = 7.5 / (math.pi * radius**2)
        scene.add(SphereLight((radiance,) * 3, radius=radius), translation=(x, 3.8, -2.0))
    scene.add(SphereLight((60.0,) * 3, radius=0.4), translation=(5.0, 5.0, 5.0))
    add_camera(scene, (0.0, 1.8, 7.5), (0.0, 1.5, 0.0), math.radians(40))
    return scene


def basin() -> Scene:
    """A sunny yard with a steel basin that lights itself, and a steel bar, on varnish."""
    scene = Scene(name="yard sun and sky, steel basin, steel bar, varnish")
    scene.add(box((-3.0, -0.1, -3.0), (3.0, 0.0, 3.0)), material=Material((0.4, 0.25, 0.12), roughness=0.3))
    scene.add(box((-3.0, -0.1, -1.6), (3.0, 2.0, -1.5)), material=lambert((0.6, 0.55, 0.5)))
    steel = Material((0.62, 0.62, 0.63), metallic=1.0, roughness=0.28)
    scene.add(box((-0.51, 0.4, -0.36), (0.51, 0.41, 0.36)), material=steel)
    for side in (-1.0, 1.0):
        scene.add(shapes.box((0.01, 0.3, 0.72)), material=steel, translation=(side * 0.505, 0.55, 0.0))
        scene.add(shapes.box((1.0, 0.3, 0.01)), material=steel, translation=(0.0, 0.55, side * 0.355))
    scene.add(shapes.cylinder(0.05, 1.0), material=steel, translation=(0.9, 0.5, 0.0))
    scene.environment = Sky(sun_elevation=0.8, sun_azimuth=0.6, turbidity=3.0)
    add_camera(scene, (0.4, 1.9, 2.2), (0.0, 0.45, 0.0), math.radians(40))
    return scene


def door() -> Scene:
    """A room lit through a door ajar by the lamp of the next (Veach and Guibas 1997, figure 6)."""
    scene, wall = Scene(name="two rooms panel, door ajar, table, three balls"), (0.6, 0.55, 0.5)
    _room(scene, (-2.5, -6.0), (2.5, 2.6, 2.5), (0.4, 0.3, 0.2), sides=(wall, wall))
    for low, high in (
        ((-2.6, -0.1, -2.1), (-0.5, 2.7, -2.0)),
        ((0.5, -0.1, -2.1), (2.6, 2.7, -2.0)),
        ((-0.6, 2.0, -2.1), (0.6, 2.7, -2.0)),
    ):
        scene.add(box(low, high), material=lambert((0.5, 0.6, 0.5)))
    leaf, ajar = box((0.0, 0.01, -0.04), (0.98, 1.99, 0.0)), euler(0.0, -20.0, 0.0, degrees=True)
    scene.add(leaf, material=lambert((0.55, 0.4, 0.25)), translation=(-0.49, 0.0, -2.0), rotation=ajar)
    panel = RectLight((400.0, 380.0, 330.0), width=1.2, height=1.2)
    scene.add(panel, translation=(0.0, 2.55, -4.0), rotation=_DOWN)
    _table(scene, 0.6, -0.2, (0.9, 0.4), 0.75)
    metal, matte = Material((0.9,) * 3, metallic=1.0, roughness=0.05), Material((0.7,) * 3, roughness=0.6)
    for surface, x, z in ((metal, 0.1, -0.1), (_glass(0.3), 0.6, 0.05), (matte, 1.1, -0.1)):
        scene.add(shapes.sphere(0.16), material=surface, translation=(x, 0.911, z))
    add_camera(scene, (0.3, 1.4, 2.3), (0.1, 0.95, -1.0), math.radians(55))
    return scene


def egg() -> Scene:
    """A lamp that shines up and a spot in a can, and an egg of glass (Veach 1997, figure 10.4)."""
    scene = Scene(name="room disks, table, glass egg")
    _room(scene, (-2.5, -2.5), (2.5, 2.8, 2.8), (0.45, 0.4, 0.35), sides=((0.6, 0.2, 0.15), (0.2, 0.35, 0.5)))
    _table(scene, 0.0, 0.0, (0.9, 0.5), 0.75)
    place = (0.2, 0.96, 0.1)
    scene.add(shapes.sphere(0.17), material=_glass(0.3), translation=place, scale=(1.0, 1.2, 1.0))
    pole = Material((0.6,) * 3, metallic=1.0, roughness=0.3)
    shade = Material((0.8, 0.75, 0.6), metallic=1.0, roughness=0.3, double_sided=True)
    cone = [(0.05, 1.75), (0.22, 2.0), (0.21, 2.0), (0.045, 1.76), (0.0, 1.765)]
    scene.add(lathe([(0.03, 0.0), (0.03, 1.75)], 16), material=pole, translation=(-1.8, 0.0, -1.8))
    scene.add(lathe(cone, 32), material=shade, translation=(-1.8, 0.0, -1.8))
    up = DiskLight((9000.0, 8500.0, 7500.0), radius=0.09)
    scene.add(up, translation=(-1.8, 1.83, -1.8), rotation=euler(90.0, 0.0, 0.0, degrees=True))
    can = lathe([(0.1, 0.0), (0.1, 0.25), (0.0, 0.25)], 32)
    tin = Material((0.7,) * 3, metallic=1.0, roughness=0.4, double_sided=True)
    scene.add(can, material=tin, translation=(1.6, 2.3, 1.2))
    scene.add(DiskLight((12000.0,) * 3, radius=0.04), translation=(1.6, 2.5, 1.2), rotation=_DOWN)
    add_camera(scene, (0.6, 1.6, 2.5), (-0.1, 0.95, 0.0), math.radians(55))
    return scene


def candles() -> Scene:
    """Seven flames on plates of brass, a goblet and a mirror."""
    scene, random, wall = Scene(name="room flames, glass, mirror"), np.random.default_rng(3), (0.5, 0.4, 0.3)
    _room(scene, (-1.5, -1.5), (1.5, 2.2, 2.0), (0.35, 0.2, 0.12), sides=(wall, wall))
    top = Material((0.35, 0.2, 0.1), roughness=0.35)
    scene.add(shapes.cylinder(0.8, 0.05), material=top, translation=(0.0, 0.7, 0.0))
    brass = Material((0.9, 0.7, 0.3), metallic=1.0, roughness=0.25, double_sided=True)
    flame = Material((0.1,) * 3, emission=(90000.0, 50000.0, 18000.0))
    plate = [(0.0, 0.0), (0.07, 0.0), (0.08, 0.01), (0.045, 0.012), (0.04, 0.03)]
    for k in range(7):
        angle, radius, height = k / 7 * math.tau, 0.25 + 0.3 * (k % 2), 0.12 + 0.2 * random.random()
        x, z = radius * math.cos(angle), radius * math.sin(angle)
        wax = shapes.cylinder(0.035, height)
        scene.add(wax, material=lambert((0.8, 0.75, 0.65)), translation=(x, 0.725 + height / 2.0, z))
        place = (x, 0.755 + height, z)
        scene.add(icosphere(0.009, 3), material=flame, translation=place, scale=(1.0, 2.2, 1.0))
        scene.add(lathe(plate, 32), material=brass, translation=(x, 0.7255, z))
    foot = [(0.0, 0.0), (0.05, 0.0), (0.05, 0.004), (0.006, 0.01), (0.006, 0.09)]
    cup = [(0.04, 0.12), (0.05, 0.2), (0.047, 0.2), (0.037, 0.125), (0.0, 0.1)]
    scene.add(lathe(foot + cup, 48), material=_glass(0.01), translation=(0.12, 0.7255, 0.25))
    mirror = Material((0.95,) * 3, metallic=1.0, roughness=0.02)
    pane, leans = box((-0.1, 0.0, -0.003), (0.1, 0.3, 0.003)), euler(-8.6, 0.0, 0.0, degrees=True)
    scene.add(pane, material=mirror, translation=(-0.1, 0.73, -0.5), rotation=leans)
    add_camera(scene, (0.5, 1.35, 1.7), (0.0, 0.8, 0.0), math.radians(42))
    return scene


def pool() -> Scene:
    """Caustics of waves on a pool's floor, from a lamp with a surface, under an even sky."""
    scene = Scene(name="open ball and even sky, waves")
    scene.add(box((-3.3, -1.5, -2.3), (3.3, -1.2, 2.3)), material=lambert((0.4, 0.65, 0.7)))
    for low, high in (
        ((-3.3, -1.4, -2.3), (-3.0, 0.1, 2.3)),
        ((3.0, -1.4, -2.3), (3.3, 0.1, 2.3)),
        ((-3.2, -1.4, -2.3), (3.2, 0.1, -2.0)),
        ((-3.2, -1.4, 2.0), (3.2, 0.1, 2.3)),
    ):
        scene.add(box(low, high), material=lambert((0.6, 0.7, 0.72)))
    x, z = np.meshgrid(np.linspace(-3.05, 3.05, 64), np.linspace(-2.05, 2.05, 64))
    y = -0.1 + 0.02 * np.sin(3.0 * x + 1.2 * z) + 0.015 * np.sin(-2.0 * x + 4.0 * z + 1.0)
    water = Material(transmission=1.0, roughness=0.0, ior=1.33, double_sided=True)
    scene.add(sheet(np.stack([x, y, z], axis=-1)), material=water)
    scene.add(icosphere(0.35, 8), material=lambert((0.8, 0.3, 0.2)), translation=(0.8, -0.85, 0.3))
    post = box((-0.3, -1.21, -0.3), (0.3, -0.3, 0.3))
    scene.add(post, material=lambert((0.8, 0.8, 0.3)), translation=(-1.0, 0.0, -0.3))
    lamp = SphereLight((40000.0, 38000.0, 33000.0), radius=0.6)
    scene.add(lamp, translation=(3.0, 8.0, 3.0))
    scene.environment = Environment(np.full((8, 16, 3), (60.0, 90.0, 140.0), np.float32))
    add_camera(scene, (1.5, 2.2, 4.6), (0.0, -0.6, 0.0), math.radians(48))
    return scene


def jewels() -> Scene:
    """A cut stone, rings of metal and a coated ball in the studio."""
    scene = Scene(name="open studio, gem, two rings, coated ball", environment=Environment(studio_radiance()))
    scene.add(box((-2.0, -0.1, -2.0), (2.0, 0.0, 2.0)), material=Material((0.8,) * 3, roughness=0.5))
    stone = lathe([(0.0, -0.43), (0.5, 0.0), (0.5, 0.02), (0.3, 0.16), (0.0, 0.16)], 8)
    scene.add(stone, material=_glass(0.5, ior=2.4), translation=(0.35, 0.44, 0.2))
    gold = Material((1.0, 0.77, 0.34), metallic=1.0, roughness=0.12)
    scene.add(shapes.torus(0.35, 0.07), material=gold, translation=(-0.5, 0.071, 0.2))
    coated = Material((0.9, 0.87, 0.82), roughness=0.2, clearcoat=1.0, clearcoat_roughness=0.02)
    scene.add(shapes.sphere(0.22), material=coated, translation=(-0.1, 0.22, -0.6))
    upright = euler(90.0, 0.0, 0.0, degrees=True)
    scene.add(shapes.torus(0.3, 0.09), material=_CHROME, translation=(0.55, 0.39, -0.7), rotation=upright)
    add_camera(scene, (0.0, 1.1, 2.4), (0.0, 0.25, 0.0), math.radians(36))
    return scene


def street() -> Scene:
    """A wet street at night: lamps, some 300 lit windows, and cars."""
    scene, random = Scene(name="street lamps and windows, wet road, cars"), np.random.default_rng(5)
    scene.add(
        box((-20.0, -0.2, -60.0), (20.0, 0.0, 10.0)), material=Material((0.05, 0.05, 0.055), roughness=0.3)
    )
    for side in (-1, 1):
        near, far = sorted((4.0 * side, 7.0 * side))
        scene.add(box((near, -0.1, -60.0), (far, 0.15, 10.0)), material=lambert((0.35, 0.34, 0.32)))
        z = 5.0
        while z > -55.0:
            wide, high = random.uniform(5.0, 9.0), random.uniform(6.0, 14.0)
            near, far = sorted((7.0 * side, 15.0 * side))
            front = lambert(tuple(random.uniform(0.2, 0.6, 3)))
            scene.add(box((near, 0.0, z - wide), (far, high, z - 0.05)), material=front)
            for storey in range(int(high // 3)):
                for k in range(int(wide // 2)):
                    lit = random.random() < 0.35
                    glow = (
                        tuple(np.array((1.0, 0.8, 0.5)) * random.uniform(10.0, 60.0)) if lit else (0.0,) * 3
                    )
                    pane = Material((0.05, 0.05, 0.06), roughness=0.1, emission=glow)
                    near, far = sorted((6.99 * side, 6.97 * side))
                    low, right = 3.0 * storey + 1.0, z - 1.2 - 2.0 * k
                    scene.add(box((near, low, right - 1.0), (far, low + 1.4, right)), material=pane)
            z -= wide
    for z in np.arange(2.0, -48.0, -7.0):
        for x in (-4.5, 4.5):
            post = box((x - 0.05, 0.0, z - 0.05), (x + 0.05, 5.0, z + 0.05))
            scene.add(post, material=Material((0.3,) * 3, roughness=0.5))
            globe = Material((0.2,) * 3, emission=(6000.0, 4300.0, 2500.0))
            scene.add(icosphere(0.15, 4), material=globe, translation=(x, 5.2, z))
    paint = Material((0.5, 0.05, 0.05), roughness=0.35, clearcoat=1.0)
    for x, z in ((-2.0, -4.0), (2.0, -9.0), (-2.0, -18.0)):
        scene.add(box((-0.9, 0.3, -2.0), (0.9, 0.9, 2.0)), material=paint, translation=(x, 0.0, z))
        cabin = box((-0.75, 0.89, -1.0), (0.75, 1.4, 1.2))
        scene.add(cabin, material=Material((0.02, 0.02, 0.03), roughness=0.05), translation=(x, 0.0, z))
    add_camera(scene, (0.0, 1.7, 7.0), (0.0, 1.8, -10.0), math.radians(50))
    return scene


def flake() -> Scene:
    """Mirror balls upon mirror balls (Haines 1987), in a room."""
    scene = Scene(name="room panel, 37 mirror balls")
    _room(scene, (-1.0, -1.0), (1.0, 2.0, 3.0), _WHITE, sides=((0.6, 0.2, 0.15), (0.2, 0.35, 0.5)))
    panel = RectLight((900.0, 850.0, 700.0), width=0.5, height=0.5)
    scene.add(panel, translation=(0.0, 1.98, 0.0), rotation=_DOWN)
    _add_balls(scene, np.array((0.0, 0.95, 0.0)), 0.28, 2)
    add_camera(scene, (0.0, 1.0, 2.9), (0.0, 0.95, 0.0), math.radians(42))
    return scene


def _add_balls(
    scene: Scene, center: np.ndarray, radius: float, levels: int, up: np.ndarray | None = None
) -> None:
    """Add a mirror ball and those half as large on it, to all sides but that of the one it sits on."""
    scene.add(icosphere(radius, 8 if levels < 2 else 12), material=_CHROME, translation=tuple(center))
    for side in np.vstack([np.eye(3), -np.eye(3)]) if levels else ():
        if up is None or side @ up > -0.5:
            _add_balls(scene, center + 1.5 * radius * side, radius / 2.0, levels - 1, side)


def mirrors() -> Scene:
    """Two walls of mirror that face each other."""
    scene = Scene(name="room four balls, facing mirrors, box, ball")
    _room(scene, (-1.2, -4.0), (1.2, 2.5, 4.0), (0.5, 0.35, 0.2), sides=(_CHROME, _CHROME))
    for z in (-3.0, -1.0, 1.0, 3.0):
        scene.add(SphereLight((900.0, 800.0, 600.0), radius=0.1), translation=(0.0, 2.2, z))
    block = box((-0.3, 0.0, -0.3), (0.3, 1.0, 0.3))
    scene.add(block, material=lambert((0.2, 0.5, 0.3)), translation=(0.4, 0.0, -1.5))
    red = Material((0.7, 0.2, 0.2), roughness=0.4)
    scene.add(shapes.sphere(0.3), material=red, translation=(-0.5, 0.3, 0.3))
    add_camera(scene, (-0.6, 1.5, 3.0), (0.5, 1.0, -1.0), math.radians(60))
    return scene


def television() -> Scene:
    """A room lit by what a screen shows."""
    scene = Scene(name="room screen, sofa, glass table")
    _room(scene, (-2.0, -2.0), (2.0, 2.4, 2.5), (0.3, 0.22, 0.15), sides=((0.6, 0.2, 0.15), (0.2, 0.35, 0.5)))
    y, x = np.mgrid[0:90, 0:160]
    red, blue = 0.8 * ((x // 20 + y // 20) % 2), 0.2 + 0.5 * (y / 90)
    green = 0.1 + 0.6 * np.exp(-((x - 110) ** 2 + (y - 40) ** 2) / 300)
    shown = ispm.Texture((np.stack([red, green, blue], axis=-1) * 255).astype(np.uint8))
    case = Material((0.02,) * 3, roughness=0.2)
    scene.add(box((-0.65, 0.6, -1.63), (0.65, 1.35, -1.6)), material=case)
    screen = Material((0.0,) * 3, specular=0.0, emission=(300.0,) * 3, emission_texture=shown)
    upright = euler(90.0, 0.0, 0.0, degrees=True)
    scene.add(shapes.plane(1.2, 0.675), material=screen, translation=(0.0, 0.98, -1.595), rotation=upright)
    board = Material((0.4, 0.25, 0.15), roughness=0.3)
    scene.add(box((-0.9, 0.0, -1.85), (0.9, 0.55, -1.35)), material=board)
    scene.add(box((-0.6, 0.0, 0.4), (1.0, 0.4, 1.2)), material=lambert((0.3, 0.3, 0.4)))
    top = Material((0.9,) * 3, transmission=1.0, roughness=0.0, thickness=0.03)
    scene.add(box((-0.4, 0.35, -0.65), (0.4, 0.38, -0.15)), material=top)
    scene.add(
        box((-0.3, 0.0, -0.6), (0.3, 0.35, -0.2)), material=Material((0.7,) * 3, metallic=1.0, roughness=0.2)
    )
    add_camera(scene, (1.2, 1.5, 2.3), (-0.1, 0.7, -0.8), math.radians(52))
    return scene


def greenhouse() -> Scene:
    """Pots with plants behind panes, under a sky without its sun."""
    scene, random = Scene(name="open sky, panes, plants"), np.random.default_rng(2)
    scene.environment = Sky(sun_elevation=0.8, sun_azimuth=1.0).dome()
    scene.add(box((-15.0, -0.2, -15.0), (15.0, 0.0, 15.0)), material=lambert((0.25, 0.3, 0.15)))
    frame = Material((0.8,) * 3, roughness=0.4)
    for x in np.arange(-2.0, 2.1, 1.0):
        scene.add(box((x - 0.03, 0.0, -2.0), (x + 0.03, 2.2, -1.94)), material=frame)
        scene.add(box((x - 0.03, 2.14, -2.0), (x + 0.03, 2.2, 2.0)), material=frame)
    back = [(-2.0, 0.0, -1.97), (2.0, 0.0, -1.97), (2.0, 2.2, -1.97), (-2.0, 2.2, -1.97)]
    roof = [(-2.0, 2.25, -2.0), (-2.0, 2.25, 2.0), (2.0, 2.25, 2.0), (2.0, 2.25, -2.0)]
    for corners in (back, roof):
        scene.add(polygons([np.array(corners)]), material=_PANE)
    scene.add(box((-2.1, 0.0, -2.1), (-2.0, 2.2, 2.0)), material=lambert((0.6, 0.35, 0.25)))
    clay = lambert((0.6, 0.3, 0.2), double_sided=True)
    green = Material((0.15, 0.4, 0.08), roughness=0.5, double_sided=True, diffuse_transmission=0.4)
    for _ in range(9):
        x, z = random.uniform(-1.5, 1.7), random.uniform(-1.6, 1.2)
        pot = lathe([(0.0, 0.0), (0.12, 0.0), (0.17, 0.3), (0.15, 0.3), (0.1, 0.03)], 24)
        scene.add(pot, material=clay, translation=(x, 0.0, z))
        for _ in range(14):
            angle, long = random.uniform(0.0, 360.0), random.uniform(0.25, 0.6)
            tip, waist = (0.0, 0.8 * long, 0.8 * long), (0.06, 0.3 * long, 0.2 * long)
            leaf = polygons([np.array([(0.0, 0.0, 0.0), waist, tip, (-waist[0], *waist[1:])])])
            turn = euler(0.0, angle, 0.0, degrees=True)
            scene.add(leaf, material=green, translation=(x, 0.25, z), rotation=turn)
    add_camera(scene, (1.2, 1.5, 4.2), (-0.2, 0.8, -0.5), math.radians(48))
    return scene


def neon() -> Scene:
    """Bent tubes that glow on a wall, above a polished floor."""
    scene, gray = Scene(name="room tubes, polished floor, three balls"), (0.4, 0.4, 0.42)
    polished = Material((0.08, 0.08, 0.1), roughness=0.15)
    _room(scene, (-2.0, -1.5), (2.0, 2.5, 3.0), polished, sides=(gray, gray), walls=gray)
    for points, glow in (
        (((-1.4, 0.8), (-0.6, 2.0), (0.2, 0.8)), (3000.0, 200.0, 900.0)),
        (((0.5, 0.8), (0.5, 1.9), (1.4, 1.9), (1.4, 0.8)), (200.0, 1800.0, 3000.0)),
    ):
        bent = tube(np.array([(*point, -1.45) for point in points]), 0.012, 8)
        scene.add(bent, material=Material((0.1,) * 3, emission=glow))
    copper = Material((0.8, 0.5, 0.3), metallic=1.0, roughness=0.3)
    matte = Material((0.7,) * 3, roughness=0.5)
    for surface, x, z in ((_CHROME, -0.8, 0.0), (matte, 0.2, 0.4), (copper, 1.1, -0.2)):
        scene.add(shapes.sphere(0.35), material=surface, translation=(x, 0.35, z))
    add_camera(scene, (0.0, 1.3, 2.9), (0.0, 0.9, -0.8), math.radians(52))
    return scene


def lampshade() -> Scene:
    """A bulb in a shade of paper, which lights the room."""
    scene = Scene(name="room bulb, paper shade, chair, mirror")
    _room(scene, (-1.8, -1.5), (1.8, 2.4, 2.5), (0.4, 0.3, 0.2), sides=((0.6, 0.2, 0.15), (0.2, 0.35, 0.5)))
    _table(scene, -0.6, -0.8, (0.4, 0.3), 0.64, Material((0.35, 0.22, 0.12), roughness=0.4))
    paper = Material(
        (0.9, 0.85, 0.7), roughness=0.9, specular=0.0, diffuse_transmission=0.5, double_sided=True
    )
    scene.add(lathe([(0.18, 0.0), (0.12, 0.28)], 48), material=paper, translation=(-0.6, 0.9, -0.8))
    brass = Material((0.8, 0.6, 0.3), metallic=1.0, roughness=0.2)
    foot = lathe([(0.0, 0.0), (0.07, 0.0), (0.07, 0.02), (0.015, 0.03), (0.015, 0.3)], 32)
    scene.add(foot, material=brass, translation=(-0.6, 0.64, -0.8))
    bulb = SphereLight((30000.0, 24000.0, 15000.0), radius=0.035)
    scene.add(bulb, translation=(-0.6, 1.03, -0.8))
    for low, high in (((0.3, 0.0, -0.8), (1.3, 0.45, 0.0)), ((0.3, 0.4, -0.85), (1.3, 0.95, -0.65))):
        scene.add(box(low, high), material=lambert((0.2, 0.3, 0.5)))
    scene.add(box((0.4, 1.2, -1.49), (1.0, 1.9, -1.46)), material=_CHROME)
    add_camera(scene, (0.6, 1.4, 2.3), (-0.1, 0.85, -0.6), math.radians(52))
    return scene


KNOWN = {
    scene.__name__: scene
    for scene in (
        plates,
        basin,
        door,
        egg,
        candles,
        pool,
        jewels,
        street,
        flake,
        mirrors,
        television,
        greenhouse,
        neon,
        lampshade,
    )
}
