"""A glass elephant in a gallery of rough stone, and a hall of stone elephants: what is made of `elephant`."""

from __future__ import annotations

import math

import numpy as np

from ispm.library.common import add_camera, add_spot, closed_path, stand, turns_about
from ispm.library.elephant import elephant
from ispm.library.finishes import Finishes, cloud, pieces
from ispm.library.forms import averaged, beveled_box, placed, pose, refined, unwrapped
from ispm.library.masonry import column
from ispm.library.shapes import box, lathe, sheet
from ispm.scene.animation import Animation
from ispm.scene.light import PointLight, SpotLight
from ispm.scene.material import Material
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Node, Part, Scene

_GALLERY = 138_912  # triangles
PERIOD = 12.0  # s
_KEYS = 2.0 * np.pi * np.arange(48) / 48


def glass_figure() -> Scene:
    """A glass elephant that turns on a pedestal in a gallery of hewn stone, one light: 277,814 triangles.

    8 x 6 x 5 m; the elephant, 1.1 m high, goes once round in 12 s.
    """
    scene, finishes = Scene(name="glass-figure"), Finishes()
    _pedestal(scene, finishes)
    for name, finish, points in _walls():
        collected = pieces()
        collected[finish].append(averaged(points))
        finishes.add(scene, name, collected)
    floor = pieces()
    x, z = np.linspace(-4.2, 4.2, 125), np.linspace(-3.2, 3.2, 96)
    grid = np.zeros((96, 125, 3))
    grid[..., 0], grid[..., 2] = x, z[:, None]
    floor["dark stone"].append(refined(sheet(grid), _GALLERY - scene.triangle_count))
    finishes.add(scene, "floor", floor)

    glass = Material(
        roughness=0.0,
        ior=1.5,
        transmission=1.0,
        thickness=0.5,
        attenuation_color=(0.86, 0.97, 0.98),
        attenuation_distance=0.6,
        name="glass",
    )
    scale = 0.5
    figure = elephant()
    small = Mesh(scale * figure.positions, figure.triangles, figure.normals, name="elephant")
    node = scene.add(small, material=glass, name="elephant", translation=(0.0, 1.062, 0.0))
    scene.animations.append(
        Animation([closed_path(node, "rotation", turns_about((0.0, 1.0, 0.0), _KEYS + 0.25), PERIOD)], "turn")
    )
    lamp = SpotLight((900.0, 830.0, 720.0), inner_angle=math.radians(15.0), outer_angle=math.radians(52.0))
    add_spot(scene, lamp, "lamp", (-2.7, 4.2, 1.4), (0.1, 1.3, 0.0))
    for name, eye, target, fov in (
        ("front", (0.75, 1.80, 2.6), (0.24, 1.50, 0.0), 42.0),
        ("caustic", (-0.6, 2.3, 2.0), (0.75, 0.95, -0.5), 46.0),
        ("gallery", (3.6, 1.7, 2.75), (-0.9, 1.35, -0.6), 56.0),
    ):
        add_camera(scene, eye, target, math.radians(fov)).name = name
    return scene


def _pedestal(scene: Scene, finishes: Finishes) -> None:
    """A stepped pedestal with a round turntable."""
    stand = pieces()
    stand["stone"] += [
        beveled_box((-0.95, -0.02, -0.75), (0.95, 0.14, 0.75), 0.02),
        beveled_box((-0.80, 0.14, -0.60), (0.80, 0.24, 0.60), 0.03),
        beveled_box((-0.70, 0.22, -0.50), (0.70, 0.92, 0.50), 0.02),
        beveled_box((-0.82, 0.90, -0.62), (0.82, 1.0, 0.62), 0.03),
    ]
    disc = [(0.0, 0.99), (1.06, 0.99), (1.08, 1.01), (1.08, 1.04), (1.06, 1.06), (0.0, 1.06)]
    stand["stone"].append(lathe(disc, 96))
    finishes.add(scene, "pedestal", stand)


def _walls() -> list[tuple[str, str, Mesh]]:
    """Name, surface and mesh of walls and vault: hewn blocks that stand out of deep joints."""
    hx, hz, h = 4.0, 3.0, 3.4
    columns = 148
    result: list[tuple[str, str, Mesh]] = []
    for name, width, yaw, reach in (
        ("back wall", 2 * hx, 0.0, hz),
        ("right wall", 2 * hz, -90.0, hx),
        ("left wall", 2 * hz, 90.0, hx),
        ("front wall", 2 * hx, 180.0, hz),
    ):
        count = round(columns * width / (2 * hx))
        top, rows = (h, 64) if reach == hz else (h + 1.6, 94)  # the others close the vault's ends
        u, v = np.meshgrid(np.linspace(-0.5 * width, 0.5 * width, count + 1), np.linspace(0.0, top, rows + 1))
        out = _hewn(u, v, len(result), 0.8, 0.425)
        grid = np.stack([u, v - 0.01, out], axis=-1)
        result.append((name, "stone", placed(sheet(grid[::-1]), pose(yaw=yaw) @ pose(z=-reach))))
    angle = np.linspace(0.0, np.pi, 109)
    x, turn = np.meshgrid(np.linspace(-hx, hx, 161), angle)
    out = _hewn(x, 3.6 * turn, 9, 0.8, 0.6)
    radius = np.array([hz, 1.55])
    vault = np.stack(
        [x, h - 0.02 + (radius[1] - out) * np.sin(turn), (radius[0] - out) * np.cos(turn)], axis=-1
    )
    result.append(("vault", "stone", averaged(sheet(vault))))
    return result


def _hewn(u: np.ndarray, v: np.ndarray, seed: int, long: float, high: float) -> np.ndarray:
    """How far blocks of `long` by `high` m stand out of a wall at (u, v) in m; no two are the same."""
    course = np.floor(v / high).astype(int)
    along = u / long + 0.5 * (course % 2) + 40.0
    block = np.floor(along).astype(int)
    edge = np.minimum(
        np.minimum(along % 1.0, 1.0 - along % 1.0) * long, np.minimum(v % high, high - v % high)
    )
    field = cloud(60 + seed, 1, 1.5)
    rough = field[(np.rint(90.0 * v).astype(int)) % 256, (np.rint(90.0 * u).astype(int)) % 256]
    own = np.random.default_rng(seed).uniform(0.0, 1.0, (64, 128))[course % 64, block % 128]
    pillow = np.clip(edge / (0.12 * long), 0.0, 1.0)
    return np.asarray((0.055 + 0.035 * own + 0.035 * (rough - 0.5)) * pillow)


def million() -> Scene:
    """A temple of stone elephants by the light of thirty drifting lanterns: 1,000,400 triangles.

    44 x 20 x 11 m. The lanterns are point lights that go round on closed paths of 12 s.
    """
    scene, finishes = Scene(name="million"), Finishes()
    figure = elephant(76_200)
    statue = Mesh(1.25 * figure.positions, figure.triangles, figure.normals, name="statue")
    stone = Part(unwrapped(statue, 2.5), finishes["dark stone"])
    rows = [(x, s) for x in (-13.5, -4.5, 4.5, 13.5) for s in (-1.0, 1.0)]
    places = [pose(x, 1.0, s * 5.4, yaw=55.0 * s) for x, s in rows]
    stand(scene, "elephant", [stone], places)
    plinth = pieces()
    plinth["stone"] += [
        beveled_box((-2.3, -0.02, -1.5), (2.3, 0.3, 1.5), 0.04),
        beveled_box((-2.1, 0.28, -1.3), (2.1, 0.86, 1.3), 0.04),
        beveled_box((-2.2, 0.84, -1.4), (2.2, 1.005, 1.4), 0.04),
    ]
    finishes.add(scene, "plinths", plinth, [pose(x, 0.0, s * 5.4) for x, s in rows])
    _temple(scene, finishes)
    _lanterns(scene, finishes)
    for name, eye, target, fov in (
        ("nave", (20.4, 2.2, 1.4), (-8.0, 3.0, -0.6), 54.0),
        ("court", (-9.2, 1.7, -1.6), (-3.4, 2.6, 5.8), 58.0),
        ("above", (-19.5, 7.6, -2.0), (4.0, 1.8, 1.0), 60.0),
    ):
        add_camera(scene, eye, target, math.radians(fov)).name = name
    return scene


def _temple(scene: Scene, finishes: Finishes) -> None:
    """Columns between the statues, walls and a barrel vault of blocks, a paved floor."""
    post = pieces()
    post["stone"].append(column(7.0, 0.48, 1.5, 36, "column"))
    spots = [
        (x, s * z)
        for x in np.arange(-18.0, 19.0, 4.5)
        if abs(x / 4.5) % 2 != 1
        for z in (3.4, 7.9)
        for s in (-1, 1)
    ]
    spots += [(x, s * 7.9) for x in (-13.5, -4.5, 4.5, 13.5) for s in (-1, 1)]
    spots += [(s * 20.6, z) for s in (-1, 1) for z in (-7.9, -3.4, 3.4, 7.9)]
    finishes.add(scene, "columns", post, [pose(float(x), 0.0, float(z)) for x, z in spots])
    beams = pieces()
    beams["stone"] += [box((-22.2, 6.95, s * 3.4 - 0.6), (22.2, 7.9, s * 3.4 + 0.6)) for s in (-1, 1)]
    beams["stone"] += [
        beveled_box((-22.2, 7.7, s * 3.4 - 0.75), (22.2, 8.05, s * 3.4 + 0.75), 0.06) for s in (-1, 1)
    ]
    beams["stone"] += [box((-22.2, 7.9, s * 7.0 - 3.2), (22.2, 8.2, s * 7.0 + 3.2)) for s in (-1, 1)]
    finishes.add(scene, "architraves", beams)
    for name, width, yaw, reach in (
        ("north wall", 44.0, 0.0, 9.8),
        ("south wall", 44.0, 180.0, 9.8),
        ("west wall", 19.6, 90.0, 22.0),
        ("east wall", 19.6, -90.0, 22.0),
    ):
        high = 8.1 if reach < 10.0 else 11.6
        u, v = np.meshgrid(
            np.linspace(-0.5 * width, 0.5 * width, round(8 * width) + 1), np.linspace(0.0, high, 97)
        )
        out = 1.5 * _hewn(u, v, len(name), 1.6, 0.9)
        own = pieces()
        own["stone"].append(
            placed(sheet(np.stack([u, v - 0.02, out], axis=-1)[::-1]), pose(yaw=yaw) @ pose(z=-reach))
        )
        finishes.add(scene, name, own)
    x, turn = np.meshgrid(np.linspace(-22.1, 22.1, 221), np.linspace(0.0, np.pi, 65))
    out = 1.5 * _hewn(x, 3.6 * turn, 31, 1.6, 0.9)
    vault = pieces()
    vault["stone"].append(
        sheet(np.stack([x, 8.0 + (3.5 - out) * np.sin(turn), (3.5 - out) * np.cos(turn)], axis=-1))
    )
    finishes.add(scene, "vault", vault)
    u, v = np.meshgrid(np.linspace(-22.2, 22.2, 371), np.linspace(-10.0, 10.0, 167))
    paved = 0.5 * _hewn(u, v + 20.0, 5, 1.2, 1.2) - 0.045
    floor = pieces()
    floor["dark stone"].append(sheet(np.stack([u, paved, v], axis=-1)))
    finishes.add(scene, "floor", floor)


def _lanterns(scene: Scene, finishes: Finishes) -> None:
    """Thirty lanterns: a light above a small bowl, each on its own closed path."""
    random = np.random.default_rng(12)
    colors = [(1.0, 0.58, 0.24), (1.0, 0.44, 0.16), (0.40, 0.66, 1.0), (1.0, 0.72, 0.40), (0.45, 1.0, 0.72)]
    flame = Material((1.0, 0.80, 0.50), unlit=True, name="flame")
    bowl = lathe(
        [(0.0, -0.24), (0.10, -0.22), (0.20, -0.14), (0.22, -0.08), (0.19, -0.09), (0.0, -0.17)], 20, "bowl"
    )
    wick = lathe([(0.0, -0.165), (0.05, -0.15), (0.06, -0.11), (0.0, -0.04)], 10, "flame")
    parts = [Part(unwrapped(bowl, 1.0), finishes["copper"]), Part(wick, flame)]
    channels = []
    for number in range(30):
        x = -20.0 + 40.0 * (number + 0.5) / 30
        lane = (0.0, 1.9, -1.9)[number % 3]
        reach = random.uniform((0.5, 0.15, 0.4), (1.3, 0.45, 0.9))
        phase = _KEYS + random.uniform(0.0, 2.0 * np.pi)
        height = (2.4, 3.6, 4.8)[(number // 3) % 3]
        path = np.stack(
            [
                x + reach[0] * np.sin(phase),
                height + reach[1] * np.sin(2.0 * phase),
                lane + reach[2] * np.cos(phase),
            ],
            axis=1,
        )
        node = Node(f"lantern {number}", parts=parts)
        scene.roots.append(node)
        r, g, b = (34.0 * c for c in colors[number % 5])
        scene.add(PointLight((r, g, b)), name=f"light {number}", parent=node)
        channels.append(closed_path(node, "translation", path, PERIOD))
    scene.animations.append(Animation(channels, "drift"))
