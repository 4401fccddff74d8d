"""Still lifes of metal and glass: the ring, the glass sphere and the objects in a box of the talk's table.

Numbers of triangles, lights and moving objects are those of the rows of McGuire and Luebke's talk (HPG 2009).
"""

from __future__ import annotations

import math

import numpy as np

from ispm.library.common import add_camera, add_spot, closed_path, lambert, turns_about
from ispm.library.masonry import tiles
from ispm.library.shapes import ball, box, lathe, polygons, sheet, tube
from ispm.scene.animation import Animation
from ispm.scene.light import PointLight, SpotLight
from ispm.scene.material import Material
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Node, Scene

PERIOD = 8.0  # s
_KEYS = 2.0 * np.pi * np.arange(32) / 32  # the phase at each key of an animation

BRASS = (0.91, 0.74, 0.42)
GOLD = (1.00, 0.77, 0.34)
CHROME = (0.77, 0.78, 0.78)


def caustic_ring() -> Scene:
    """A polished brass ring whose inside gathers a spot's light on a pale plate: 812 triangles.

    The ring, 20 cm across, slides on a small figure of eight while the light swings about it, so the
    cusp of its caustic moves; both are back where they began after 8 s.
    """
    scene = Scene(name="caustic-ring")
    scene.add(_backdrop(1.4, 0.60, 0.90, 20, 10, -0.02), material=lambert((0.30, 0.32, 0.36), "slate paper"))
    plate = box((-0.20, -0.02, -0.20), (0.24, 0.0, 0.20), "plate")
    scene.add(plate, material=lambert((0.78, 0.76, 0.72), "plaster"))
    inner, outer, height = 0.100, 0.108, 0.040
    # sunk by 1 mm, so that no light creeps in under it
    profile = [(inner, -0.001), (outer, -0.001), (outer, height), (inner, height), (inner, -0.001)]
    ring = scene.add(
        lathe(profile, 50, "ring"), material=Material(BRASS, metallic=1.0, roughness=0.0, name="brass")
    )
    pivot = Node("pivot")
    scene.roots.append(pivot)
    lamp = SpotLight((620.0, 500.0, 350.0), inner_angle=math.radians(18.0), outer_angle=math.radians(36.0))
    add_spot(scene, lamp, "lamp", (-0.74, 0.27, 0.52), (0.0, 0.0, 0.0), pivot)
    slide = 0.02 * np.stack([np.sin(_KEYS), 0.0 * _KEYS, 0.5 * np.sin(2.0 * _KEYS)], axis=1)
    scene.animations.append(
        Animation(
            [
                closed_path(ring, "translation", slide, PERIOD),
                closed_path(pivot, "rotation", turns_about((0.0, 1.0, 0.0), 0.5 * np.sin(_KEYS)), PERIOD),
            ],
            "swing",
        )
    )
    # Parallel light meets half a radius behind the centre, seen from where it comes from.
    add_camera(scene, (0.06, 0.44, 0.40), (0.038, 0.0, -0.027), math.radians(27.0))
    return scene


def glass_sphere() -> Scene:
    """A glass ball and a smaller one on a checkered table, five lights: 8,034 triangles.

    Both balls wander on closed paths of 8 s; a red and a green matte ball stand still.
    """
    scene = Scene(name="glass-sphere")
    scene.add(_niche(1.25, 1.20, 20, 20, -0.04), material=lambert((0.52, 0.50, 0.47), "paper"))
    scene.add(_checkers(24, 16, 0.06), material=lambert((1.0, 1.0, 1.0), "checkers"))
    rim = box((-0.75, -0.04, -0.51), (0.75, -0.002, 0.51), "table")
    scene.add(rim, material=lambert((0.30, 0.17, 0.09), "walnut"))
    red, green = lambert((0.66, 0.06, 0.04), "red"), lambert((0.08, 0.36, 0.20), "green")
    scene.add(ball(0.075, 30, 21, "red ball"), material=red, translation=(0.30, 0.075, -0.17))
    scene.add(ball(0.050, 27, 24, "green ball"), material=green, translation=(-0.33, 0.050, 0.10))
    large = scene.add(ball(0.125, 50, 26, "glass ball"), material=_glass(0.25))
    small = scene.add(ball(0.055, 36, 22, "small glass ball"), material=_glass(0.11))
    sway, turn = np.sin(_KEYS), 1.0 - np.cos(_KEYS)
    around = np.stack([0.04 * sway - 0.06, 0.0 * sway + 0.126, 0.03 * turn - 0.03], axis=1)
    beside = np.stack([0.20 + 0.05 * turn, 0.0 * turn + 0.056, 0.16 + 0.06 * sway], axis=1)
    scene.animations.append(
        Animation(
            [
                closed_path(large, "translation", around, PERIOD),
                closed_path(small, "translation", beside, PERIOD),
            ],
            "wander",
        )
    )
    for name, intensity, place in (
        ("key", (46.0, 41.0, 33.0), (-0.55, 0.85, -0.42)),
        ("fill", (4.0, 5.0, 7.0), (0.85, 0.60, 0.45)),
        ("amber", (3.2, 1.7, 0.5), (0.56, 0.30, -0.10)),
        ("rose", (2.6, 0.9, 1.2), (-0.58, 0.28, 0.22)),
        ("overhead", (6.0, 5.6, 5.0), (0.10, 1.00, 0.25)),
    ):
        scene.add(PointLight(intensity), name=name, translation=place)
    add_camera(scene, (0.10, 0.42, 0.98), (0.02, 0.085, 0.0), math.radians(31.0))
    return scene


def objects_in_box() -> Scene:
    """Metal, glass and matte things in a box with an orange and a blue wall, two lights: 19,642 triangles.

    3.6 x 2 x 2 m, open in front. A glass ball bobs, a golden ring turns in the air and a chrome ball slides;
    all are back where they began after 8 s.
    """
    scene = Scene(name="objects-in-box")
    _box_walls(scene)
    stone = lambert((0.74, 0.72, 0.68), "stone")
    scene.add(box((-1.12, 0.0, -0.72), (-0.44, 0.42, -0.08), "plinth"), material=stone)
    scene.add(box((0.62, 0.0, -0.80), (1.14, 0.80, -0.28), "tall plinth"), material=stone)
    knot, ochre = tube(_trefoil(96, 0.098), 0.072, 28, "knot"), lambert((0.80, 0.62, 0.20), "ochre")
    scene.add(knot, material=ochre, translation=(-0.78, 0.79, -0.40))
    scene.add(_vase(), material=lambert((0.10, 0.42, 0.44), "teal clay"), translation=(0.88, 0.80, -0.54))
    angle = 2.0 * np.pi * np.arange(72) / 72
    circle = 0.21 * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    gold = Material(GOLD, metallic=1.0, roughness=0.0, name="gold")
    chrome = Material(CHROME, metallic=1.0, roughness=0.0, name="chrome")
    glass = scene.add(ball(0.27, 60, 31, "glass ball"), material=_glass(0.54))
    ring = scene.add(tube(circle, 0.050, 28, "golden ring"), material=gold, translation=(0.06, 1.22, -0.25))
    marble = scene.add(ball(0.17, 42, 27, "chrome ball"), material=chrome)
    sway, turn = np.sin(_KEYS), 1.0 - np.cos(_KEYS)
    bob = np.stack([0.0 * sway + 0.46, 0.30 + 0.08 * turn, 0.0 * sway + 0.26], axis=1)
    slide = np.stack([0.12 * sway - 0.42, 0.0 * sway + 0.172, 0.52 - 0.05 * turn], axis=1)
    scene.animations.append(
        Animation(
            [
                closed_path(glass, "translation", bob, PERIOD),
                closed_path(ring, "rotation", turns_about((0.0, 1.0, 0.0), _KEYS + 0.6), PERIOD),
                closed_path(marble, "translation", slide, PERIOD),
            ],
            "dance",
        )
    )
    scene.add(PointLight((14.0, 12.5, 10.0)), name="left light", translation=(-0.75, 1.80, 0.25))
    scene.add(PointLight((7.0, 7.6, 9.0)), name="right light", translation=(0.95, 1.76, 0.40))
    add_camera(scene, (0.0, 0.92, 3.25), (0.0, 0.90, 0.0), math.radians(43.0))
    return scene


def _glass(thickness: float) -> Material:
    """Clear glass, faintly green where it is thick."""
    return Material(
        roughness=0.0,
        ior=1.5,
        transmission=1.0,
        thickness=thickness,
        attenuation_color=(0.90, 0.97, 0.94),
        attenuation_distance=0.5,
        name="glass",
    )


def _backdrop(width: float, front: float, height: float, columns: int, rows: int, y: float) -> Mesh:
    """A sheet of paper that lies at height `y` and rises behind in a round bend: 2 columns rows triangles.

    front   reach towards +z from the middle, m; it bends up as far behind
    height  to which it rises
    """
    along, rise = _bent(2.0 * front, height, rows)
    grid = np.empty((columns + 1, rows + 1, 3))
    grid[..., 0] = np.linspace(-0.5 * width, 0.5 * width, columns + 1)[:, None]
    grid[..., 1], grid[..., 2] = y + rise, front - along
    # (next column) x (next row), x and -z, points up
    return sheet(grid, "backdrop")


def _niche(radius: float, height: float, columns: int, rows: int, y: float) -> Mesh:
    """A round niche that is open in front, by 120 degrees: 2 columns rows triangles. It begins a fifth of its
    radius from the middle."""
    along, rise = _bent(0.8 * radius, height, rows)
    across = (0.2 * radius + along) * np.exp(1j * np.radians(np.linspace(-120.0, 120.0, columns + 1)))[
        :, None
    ]
    grid = np.empty((columns + 1, rows + 1, 3))
    grid[..., 0], grid[..., 1], grid[..., 2] = across.imag, y + rise, -across.real
    return sheet(grid, "backdrop")


def _bent(length: float, height: float, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Way along the floor and height at rows + 1 even steps of paper that rises at the end of `length`."""
    bend = 0.5 * height
    flat, curve = length - bend, 0.5 * math.pi * bend
    s = np.linspace(0.0, flat + curve + height - bend, rows + 1)
    angle = np.clip((s - flat) / bend, 0.0, 0.5 * math.pi)
    along = np.minimum(s, flat) + bend * np.sin(angle)
    return along, bend * (1.0 - np.cos(angle)) + np.maximum(s - flat - curve, 0.0)


def _checkers(columns: int, rows: int, side: float) -> Mesh:
    """A table top of square tiles, light and dark by turns: 2 columns rows triangles."""
    xs, zs = (side * (np.arange(n + 1) - 0.5 * n) for n in (columns, rows))
    i, k = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    shade = np.where(((i + k) % 2 == 0)[..., None], (0.80, 0.74, 0.64), (0.36, 0.25, 0.18))
    shade = shade * np.random.default_rng(5).uniform(0.92, 1.0, (columns, rows, 1))
    return tiles(xs, zs, shade, "checkers")


def _box_walls(scene: Scene) -> None:
    """Five walls, their fronts towards the air: 10 triangles."""
    white = lambert((0.76, 0.75, 0.72), "white paint")
    x0, x1, y0, y1, z0, z1 = -1.8, 1.8, 0.0, 2.0, -1.0, 1.0
    for name, color, corners in (
        ("floor", None, [(x0, y0, z1), (x1, y0, z1), (x1, y0, z0), (x0, y0, z0)]),
        ("ceiling", None, [(x0, y1, z0), (x1, y1, z0), (x1, y1, z1), (x0, y1, z1)]),
        ("back wall", None, [(x0, y0, z0), (x1, y0, z0), (x1, y1, z0), (x0, y1, z0)]),
        ("orange wall", (0.72, 0.22, 0.05), [(x0, y0, z1), (x0, y0, z0), (x0, y1, z0), (x0, y1, z1)]),
        ("blue wall", (0.08, 0.20, 0.58), [(x1, y0, z0), (x1, y0, z1), (x1, y1, z1), (x1, y1, z0)]),
    ):
        paint = lambert(color, name) if color else white
        scene.add(polygons([np.array(corners)], name), material=paint)


def _trefoil(count: int, size: float) -> np.ndarray:
    """(count, 3) points of a trefoil knot, some 6 `size` wide, that faces +z."""
    t = 2.0 * np.pi * np.arange(count) / count
    knot = [np.sin(t) + 2.0 * np.sin(2.0 * t), np.cos(t) - 2.0 * np.cos(2.0 * t), -np.sin(3.0 * t)]
    return size * np.stack(knot, axis=1)


def _vase() -> Mesh:
    """A vase 0.5 m high, closed at the foot and hollow: 4,416 triangles."""
    heights = [0.0, 0.05, 0.17, 0.28, 0.37, 0.43, 0.50]
    radii = [0.085, 0.100, 0.165, 0.150, 0.082, 0.070, 0.105]
    y = np.linspace(0.0, 0.50, 30)
    outside = np.interp(y, heights, radii)
    for _ in range(6):  # rounds the corners of the outline
        outside[1:-1] = 0.25 * outside[:-2] + 0.5 * outside[1:-1] + 0.25 * outside[2:]
    inside = np.stack([outside[:-17:-1] - 0.012, y[:-17:-1]], axis=1)
    profile = [(0.0, 0.0), *zip(outside, y, strict=True), *inside, (0.0, float(inside[-1, 1]))]
    return lathe([(float(r), float(h)) for r, h in profile], 48, "vase")
