"""The iron works flooded: waves that gather the light of one lamp on walls, roof and floor."""

from __future__ import annotations

import math

import numpy as np

from ispm.library import ironworks
from ispm.library.cargo import container, crate
from ispm.library.common import add_camera, add_spot, closed_path
from ispm.library.finishes import Finishes, pieces
from ispm.library.forms import averaged, pipe, placed, pose
from ispm.library.shapes import lathe
from ispm.scene.animation import Animation
from ispm.scene.light import SpotLight
from ispm.scene.material import Material
from ispm.scene.mesh import Mesh, Morph
from ispm.scene.scene import Node, Part, Scene

STILL = 66_734  # triangles
PERIOD = 8.0  # s, after which the waves repeat
LEVEL = 1.15  # m, of the still water
_COLUMNS, _ROWS = 218, 127  # cells along x and z
_CYCLES = (4, 5, 5, 6, 6, 7, 7, 8, 9, 9, 10, 11)  # of each wave, in a period
_SLOPE = 0.030  # of each wave, the greatest
_KEYS = 240  # in a period; straight lines between them are at most 0.5 mm off
_GRAVITY = 9.81  # m/s2
_LAMP = (3.0, 4.3, 0.4)  # m


def ironworks_water(time: float | None = None) -> Scene:
    """The hall of the iron works under water, in waves that throw caustics, one light: 121,962 triangles.

    The water is 1.15 m deep; its surface, of 55,228 triangles, moves and repeats after 8 s.

    time  s; the water as it is at that moment. None: with its animation
    """
    scene, finishes = Scene(name="ironworks-water"), Finishes()
    ironworks.hall(scene, finishes)
    _flotsam(scene, finishes)
    ironworks.floor(scene, finishes, STILL - scene.triangle_count)
    water = Material(
        (1.0, 1.0, 1.0),
        roughness=0.0,
        ior=1.33,
        transmission=1.0,
        thickness=LEVEL,
        attenuation_color=(0.50, 0.82, 0.80),
        attenuation_distance=3.0,
        name="water",
    )
    _flow(scene, scene.add(water_surface(), material=water, name="water"))
    lamp = SpotLight((560.0, 500.0, 400.0), inner_angle=math.radians(60.0), outer_angle=math.radians(81.0))
    x, y, z = _LAMP
    add_spot(scene, lamp, "lamp", (x, y - 0.03, z), (x + 0.001, 0.0, z))
    for name, eye, target, fov in (
        ("shore", (16.5, 2.1, 5.3), (-8.0, 3.2, -2.2), 60.0),
        ("catwalk", (-16.5, 5.1, -7.8), (4.0, 1.6, 2.0), 60.0),
        ("rafters", (9.5, 2.0, -3.0), (-3.0, 7.0, 1.5), 70.0),
        ("shallows", (7.0, 2.6, -5.0), (1.5, 0.4, 1.0), 55.0),
    ):
        add_camera(scene, eye, target, math.radians(fov)).name = name
    return scene if time is None else scene.at(time)


def water_positions(time: float) -> np.ndarray:
    """Return the water's vertices at a time in s, (128 * 219, 3) float32 m, row by row along x.

    Airy waves of 0.7 to 7 m, whose periods divide PERIOD (deep water: angular frequency^2 = g k), so that
    they repeat exactly.
    """
    grid = _still_water()
    grid[:, 1] += sum(_heights(grid, cycles, time) for cycles in set(_CYCLES))
    return grid.astype(np.float32)


def water_surface() -> Mesh:
    """Return the still water: 55,228 triangles that face up, with a gap in each of 18 plinths.

    Its morph targets are all waves of one frequency at time 0 and a quarter of their period later, from the
    lowest frequency up: A sin(k x - w t) = A sin(k x) cos(w t) + A sin(k x - pi / 2) sin(w t).
    """
    k = np.arange((_ROWS + 1) * (_COLUMNS + 1)).reshape(_ROWS + 1, _COLUMNS + 1)
    a, b, c, d = k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]
    there = np.ones(a.shape, bool)
    for x, z in ironworks.COLUMNS:
        # four cells within the plinth, of those at the ends four in a row along the wall
        i = round((x / ironworks.HALF_X + 1.0) * 0.5 * _COLUMNS)
        j = round((z / ironworks.HALF_Z + 1.0) * 0.5 * _ROWS)
        if abs(x) < ironworks.HALF_X:
            there[j - 1 : j + 1, i - 1 : i + 1] = False
        else:
            there[j - 2 : j + 2, min(i, _COLUMNS - 1)] = False
    quads = np.stack([a, b, c, d], axis=-1)[there]
    kept, numbers = np.unique(np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]), return_inverse=True)
    mesh = averaged(Mesh(_still_water()[kept], numbers.reshape(-1, 3), name="water"))
    mesh.morphs = [
        _swell(mesh, cycles, quarters * PERIOD / (4.0 * cycles))
        for cycles in sorted(set(_CYCLES))
        for quarters in (0, 1)
    ]
    return mesh


def _still_water() -> np.ndarray:
    """The (128 * 219, 3) vertices of water without waves."""
    x = np.linspace(-ironworks.HALF_X, ironworks.HALF_X, _COLUMNS + 1)
    z = np.linspace(-ironworks.HALF_Z, ironworks.HALF_Z, _ROWS + 1)
    grid = np.full((_ROWS + 1, _COLUMNS + 1, 3), LEVEL)
    grid[..., 0], grid[..., 2] = x, z[:, None]
    return grid.reshape(-1, 3)


def _heights(points: np.ndarray, cycles: int, time: float) -> np.ndarray:
    """How far the waves of one frequency raise (n, 3) points of the water, (n,) m."""
    x, _, z = points.T.astype(np.float64)
    omega = 2.0 * math.pi * cycles / PERIOD
    wave_number = omega**2 / _GRAVITY
    drawn = np.random.default_rng(4).uniform(0.0, 2.0 * math.pi, (len(_CYCLES), 2))
    height = np.zeros(len(points))
    for heading, phase in drawn[np.array(_CYCLES) == cycles]:
        along = wave_number * (math.cos(heading) * x + math.sin(heading) * z)
        height += _SLOPE / wave_number * np.sin(along - omega * time + phase)
    return height


def _swell(still: Mesh, cycles: int, time: float) -> Morph:
    """What the waves of one frequency change of the still water."""
    rise = np.zeros(still.positions.shape)
    rise[:, 1] = _heights(still.positions, cycles, time)
    raised = averaged(Mesh(still.positions + rise, still.triangles)).normals
    assert raised is not None and still.normals is not None
    # over their height, normals of a surface of heights are sums as the heights are
    normals = raised / raised[:, 1:2] - still.normals
    return Morph(rise.astype(np.float32), normals.astype(np.float32), name=f"{cycles} cycles, {time:.3f} s")


def _flow(scene: Scene, water: Node) -> None:
    """The animation of the water: each pair of targets by the cosine and the sine of its frequency."""
    angle = 2.0 * math.pi / _KEYS * np.outer(np.arange(_KEYS), sorted(set(_CYCLES)))
    weights = np.stack([np.cos(angle), np.sin(angle)], axis=-1).reshape(_KEYS, -1)
    scene.animations.append(Animation([closed_path(water, "weights", weights, PERIOD)], "flow"))


def _flotsam(scene: Scene, finishes: Finishes) -> None:
    """What the flood left: containers aslant, crates; and the lamp over the water on its cable."""
    stock = pieces()
    for finish, place in (
        ("blue paint", pose(-9.0, 0.0, 3.4, yaw=24.0)),
        ("orange paint", pose(11.5, 0.0, -4.6, yaw=-12.0)),
    ):
        sheets, frame = container()
        stock[finish] += [placed(sheets, place), placed(frame, place)]
    for place, size, finish in (
        (pose(6.0, 0.0, 5.9, yaw=-9.0), (1.4, 1.2, 1.2), "red paint"),
        (pose(6.1, 1.22, 5.9, yaw=3.0), (1.2, 0.8, 1.0), "green paint"),
        (pose(2.2, 0.0, -6.6, yaw=14.0), (1.3, 1.5, 1.1), "yellow paint"),
    ):
        panels, frame = crate(*size)
        stock[finish].append(placed(panels, place))
        stock["dark metal"].append(placed(frame, place))
    x, y, z = _LAMP
    shade = [(0.10, 0.30), (0.14, 0.24), (0.46, 0.0), (0.43, 0.0), (0.11, 0.21), (0.0, 0.21)]
    shade = [(0.0, 0.33), *shade]
    stock["teal paint"].append(placed(lathe(shade[::-1], 28), pose(x, y, z)))
    stock["rubber"].append(pipe([(x, y + 0.32, z), (x, 9.3, z)], 0.02, 8))
    finishes.add(scene, "flotsam", stock)
    bulb = lathe([(0.0, 0.02), (0.06, 0.05), (0.075, 0.11), (0.05, 0.18), (0.0, 0.20)], 16, "bulb")
    glow = Material((1.0, 0.92, 0.76), unlit=True, name="bulb")
    node = scene["flotsam"]
    node.parts.append(Part(placed(bulb, pose(x, y, z)), glow))
