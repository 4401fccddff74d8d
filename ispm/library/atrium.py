"""The atrium: a colonnaded court in the sun, lit in its galleries by light that bounced."""

from __future__ import annotations

import copy
import math

import numpy as np

from ispm.library import masonry
from ispm.library.common import add_camera, lambert
from ispm.library.shapes import box, merge, sweep
from ispm.scene.animation import Animation, Channel
from ispm.scene.light import PointLight
from ispm.scene.material import Material
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Node, Part, Scene

BAY = 3.2  # m between the axes of columns
HALF_X, HALF_Z = 3.5 * BAY, 1.5 * BAY  # the axes of the colonnade: 7 by 3 bays
GALLERY = 3.3  # m from the colonnade's axis to the wall behind
SPRING, UPPER, UPPER_SPRING, EAVES = 4.2, 6.6, 9.8, 11.6  # heights in m
PERIOD = 12.0  # s

STONE = lambert((0.74, 0.68, 0.57), "limestone")
PALE = lambert((0.78, 0.73, 0.64), "pale limestone")
WARM = lambert((0.72, 0.63, 0.50), "sandstone")
PLASTER = lambert((0.76, 0.71, 0.62), "plaster")
DARK = lambert((0.46, 0.36, 0.28), "brownstone")
FLOOR = lambert((0.80, 0.75, 0.67), "floor")
ROOF = lambert((0.52, 0.22, 0.12), "terracotta")
WOOD = Material((0.23, 0.12, 0.06), roughness=0.6, name="oak")
BRASS = Material((0.80, 0.58, 0.25), metallic=1.0, roughness=0.4, name="brass")
GLAZE = Material((0.10, 0.26, 0.30), roughness=0.35, name="glaze")
LEAVES = lambert((0.09, 0.20, 0.05), "leaves")
PAPER = lambert((0.86, 0.42, 0.10), "paper")
RED = lambert((0.66, 0.04, 0.035), "red cloth", double_sided=True)
GREEN = lambert((0.05, 0.36, 0.09), "green cloth", double_sided=True)
BLUE = lambert((0.04, 0.11, 0.52), "blue cloth", double_sided=True)
OCHRE = lambert((0.72, 0.40, 0.05), "ochre cloth", double_sided=True)


def atrium(time: float | None = None) -> Scene:
    """A two-storey colonnaded court with arches and strong drapes, in moving sun: 67,414 triangles.

    30 x 17 x 14 m, open to the sky; the galleries are lit only by light that bounced. A paper lantern
    of 480 triangles drifts on a closed path, and the sun, a point light 300 m away of some 20,000 lx in
    the court, swings on a small arc; both are back where they began after 12 s.

    time  s; the court as it stands at that moment. None: with its animation
    """
    scene = Scene(name="atrium")
    _shell(scene)
    _arcades(scene)
    _galleries(scene)
    _drapes(scene)
    _furniture(scene)
    _moving(scene)
    add_camera(scene, (-10.4, 1.75, -1.5), (6.0, 3.2, 0.5), math.radians(55.0))
    own = copy.deepcopy(scene)  # so that editing a material changes this scene only
    return own if time is None else own.at(time)


def _place(
    scene: Scene, parts: list[Part], name: str, x: float, y: float, z: float, turn: float = 0.0
) -> Node:
    """Add a node that shows `parts`, turned by `turn` radians about y."""
    rotation = (0.0, math.sin(0.5 * turn), 0.0, math.cos(0.5 * turn))
    node = Node(name, (x, y, z), rotation, parts=parts)
    scene.roots.append(node)
    return node


def _bays() -> list[tuple[float, float, float, int]]:
    """x, z, turn and number of the middle of each bay; the turn takes +z to the court's side."""
    along = [(-HALF_X + (k + 0.5) * BAY, k) for k in range(7)]
    across = [(-HALF_Z + (k + 0.5) * BAY, k) for k in range(3)]
    return [
        *((x, -HALF_Z, 0.0, k) for x, k in along),
        *((x, HALF_Z, math.pi, k) for x, k in along),
        *((-HALF_X, z, 0.5 * math.pi, k) for z, k in across),
        *((HALF_X, z, -0.5 * math.pi, k) for z, k in across),
    ]


def _columns() -> list[tuple[float, float, float]]:
    """x, z and turn of each column between the corners; the turn takes +z to the court's side."""
    along = [-HALF_X + k * BAY for k in range(1, 7)]
    across = [-HALF_Z + k * BAY for k in range(1, 3)]
    return [
        *((x, -HALF_Z, 0.0) for x in along),
        *((x, HALF_Z, math.pi) for x in along),
        *((-HALF_X, z, 0.5 * math.pi) for z in across),
        *((HALF_X, z, -0.5 * math.pi) for z in across),
    ]


def _behind(x: float, z: float, turn: float, distance: float) -> tuple[float, float]:
    """The point `distance` metres from (x, z) away from the court."""
    return x - distance * math.sin(turn), z - distance * math.cos(turn)


def _shell(scene: Scene) -> None:
    """Floor, outer walls, the floors of the galleries and the roof: closed frames that overlap."""
    wall = GALLERY + 0.15  # slabs end inside the wall
    frames = [
        ("outer wall", PLASTER, [
            (GALLERY, -0.4), (GALLERY + 0.5, -0.4), (GALLERY + 0.5, 13.6), (GALLERY, 13.6),
        ]),
        ("coping", PALE, [(3.15, 13.5), (3.95, 13.5), (3.95, 13.75), (3.15, 13.75)]),
        ("dado", DARK, [(3.24, -0.1), (wall, -0.1), (wall, 1.0), (3.27, 1.0), (3.24, 0.95)]),
        ("gallery floor", PALE, [
            (-0.42, 6.0), (wall, 6.0), (wall, UPPER), (-0.68, UPPER), (-0.68, 6.48), (-0.60, 6.42),
            (-0.60, 6.30), (-0.50, 6.24), (-0.50, 6.10), (-0.42, 6.08),
        ]),
        ("cornice", PALE, [
            (-0.42, EAVES), (wall, EAVES), (wall, 12.25), (-0.66, 12.25), (-0.66, 12.10), (-0.58, 12.02),
            (-0.58, 11.92), (-0.50, 11.80), (-0.50, 11.70), (-0.42, 11.68),
        ]),
        ("roof", ROOF, [(-0.72, 12.20), (wall, 12.20), (wall, 13.40), (-0.72, 12.34)]),
        ("kerb", WARM, [(-0.75, -0.1), (0.65, -0.1), (0.65, 0.12), (-0.71, 0.12), (-0.75, 0.08)]),
    ]  # fmt: skip
    for name, material, profile in frames:
        scene.add(sweep(profile, HALF_X, HALF_Z, name), material=material)
    scene.add(_floor(), material=FLOOR)


def _floor() -> Mesh:
    """Tiles in two shades of stone, each a little its own, with a dark border round the court."""
    end_x, end_z = HALF_X + GALLERY + 0.1, HALF_Z + GALLERY + 0.1
    xs, zs = _grid_lines(HALF_X, 29, end_x), _grid_lines(HALF_Z, 13, end_z)
    i, k = np.meshgrid(np.arange(len(xs) - 1), np.arange(len(zs) - 1), indexing="ij")
    shade = np.where((i + k)[..., None] % 2 == 0, (1.0, 1.0, 1.0), (0.74, 0.64, 0.56))
    from_edge = np.minimum(np.minimum(i - 4, 31 - i), np.minimum(k - 4, 15 - k))
    shade = np.where((from_edge == 2)[..., None], (0.42, 0.24, 0.18), shade)
    shade = shade * np.random.default_rng(7).uniform(0.86, 1.0, (*i.shape, 1))
    return masonry.tiles(xs, zs, shade, "floor")


def _grid_lines(half: float, count: int, end: float) -> np.ndarray:
    """(count + 8,) m along one axis: `count` from -half to half, and 4 more on either side to `end`."""
    outer = np.linspace(-end, -half, 5)[:-1], np.linspace(half, end, 5)[1:]
    return np.insert(np.linspace(-half, half, count), [0] * 4 + [count] * 4, np.concatenate(outer))


def _arcades(scene: Scene) -> None:
    """Columns, arches and piers of both storeys, and the balustrades of the upper one."""
    low = [Part(masonry.column(SPRING - 0.1, 0.31, 0.98, 18, "column"), STONE)]
    high = [Part(masonry.column(UPPER_SPRING - UPPER, 0.25, 0.98, 14, "upper column"), STONE)]
    strip = [Part(box((-0.25, -0.03, -0.35), (0.25, 1.86, 0.35), "strip"), WARM)]
    for number, (x, z, turn) in enumerate(_columns()):
        _place(scene, low, f"column {number}", x, 0.1, z, turn)
        _place(scene, high, f"upper column {number}", x, UPPER, z, turn)
        _place(scene, strip, f"strip {number}", x, SPRING, z, turn)
        _place(scene, strip, f"upper strip {number}", x, UPPER_SPRING, z, turn)
    wall, ring = masonry.arch(BAY - 0.2, 1.88, 0.5, 1.12, 1.30, 0.05, 15, "arch")
    arch = [Part(wall, WARM), Part(ring, PALE)]
    rail = [Part(masonry.balustrade(2.5, 7, 6, "balustrade"), PALE)]
    for number, (x, z, turn, _) in enumerate(_bays()):
        _place(scene, arch, f"arch {number}", x, SPRING - 0.04, z, turn)
        _place(scene, arch, f"upper arch {number}", x, UPPER_SPRING - 0.04, z, turn)
        _place(scene, rail, f"balustrade {number}", x, UPPER, z, turn)
    corner = [Part(masonry.pier(0.0, 6.0, 0.46, SPRING, "pier"), WARM)]
    upper_corner = [Part(masonry.pier(UPPER, EAVES, 0.46, UPPER_SPRING, "upper pier"), WARM)]
    for number, (sx, sz) in enumerate(((-1, -1), (1, -1), (-1, 1), (1, 1))):
        _place(scene, corner, f"pier {number}", sx * HALF_X, 0.0, sz * HALF_Z)
        _place(scene, upper_corner, f"upper pier {number}", sx * HALF_X, 0.0, sz * HALF_Z)


def _galleries(scene: Scene) -> None:
    """Ribs, beams and wall piers behind each column; doors in every other bay."""
    rib_wall, rib_ring = masonry.arch(2.86, 1.88, 0.36, 1.2, 1.34, 0.04, 11, "rib")
    rib = [Part(rib_wall, PLASTER), Part(rib_ring, PALE)]
    shaft = box((-0.27, -0.05, -0.06), (0.27, 6.05, 0.2))
    cap = box((-0.33, SPRING - 0.2, -0.05), (0.33, SPRING, 0.46))
    base = box((-0.31, -0.04, -0.05), (0.31, 0.5, 0.26))
    respond = [Part(merge([shaft, cap, base], "respond"), STONE)]
    beam = [Part(box((-0.13, -0.32, -1.72), (0.13, 0.04, 1.72), "beam"), WOOD)]
    for number, (x, z, turn) in enumerate(_columns()):
        wall_x, wall_z = _behind(x, z, turn, GALLERY)
        x, z = _behind(x, z, turn, 1.725)
        _place(scene, rib, f"rib {number}", x, SPRING - 0.04, z, turn + 0.5 * math.pi)
        _place(scene, respond, f"respond {number}", wall_x, 0.0, wall_z, turn)
        _place(scene, beam, f"beam {number}", x, EAVES, z, turn)
    stone, wood = masonry.door("door")
    door = [Part(stone, STONE), Part(wood, WOOD)]
    for number, (x, z, turn, k) in enumerate(_bays()):
        x, z = _behind(x, z, turn, GALLERY - 0.04)
        if k % 2 == 1:
            _place(scene, door, f"door {number}", x, 0.0, z, turn)
            _place(scene, door, f"upper door {number}", x, UPPER, z, turn)


def _drapes(scene: Scene) -> None:
    """Curtains in arches, banners from the upper ones, and runners where the sun falls into the galleries."""
    curtain = masonry.drape(2.1, 3.75, 27, 15, 4.0, 0.4, 1, "curtain")
    banner = masonry.drape(2.0, 5.5, 24, 15, 4.0, 0.0, 2, "banner")
    tapestry = masonry.drape(2.0, 3.6, 24, 15, 4.0, 0.0, 3, "tapestry")
    pole = Part(masonry.pole(2.4, 0.0, "pole"), BRASS)
    bracketed = Part(masonry.pole(2.4, 0.5, "bracketed pole"), BRASS)
    bays = _bays()
    for bay, cloth in {0: OCHRE, 2: RED, 4: BLUE, 6: GREEN, 8: GREEN, 10: RED, 12: BLUE}.items():
        x, z, turn, _ = bays[bay]
        _place(scene, [Part(curtain, cloth), pole], f"curtain {bay}", x, SPRING - 0.09, z, turn)
    hangings = {1: GREEN, 3: OCHRE, 5: RED, 7: OCHRE, 9: BLUE, 11: OCHRE, 13: RED}
    for bay, mesh, cloth in [(bay, banner, cloth) for bay, cloth in hangings.items()] + [
        (18, tapestry, GREEN)
    ]:
        x, z, turn, _ = bays[bay]
        x, z = _behind(x, z, turn, -0.95)
        _place(scene, [Part(mesh, cloth), bracketed], f"{mesh.name} {bay}", x, UPPER_SPRING - 0.09, z, turn)
    for name, cloth, y, z in (("runner", RED, 0.0, 6.2), ("upper runner", BLUE, UPPER, 6.15)):
        scene.add(box((-10.6, y - 0.02, z - 0.7), (10.6, y + 0.02, z + 0.7), name), material=cloth)


def _furniture(scene: Scene) -> None:
    """A fountain in the middle, urns with shrubs round it."""
    _place(scene, [Part(masonry.fountain(28, "fountain"), PALE)], "fountain", 0.0, 0.0, 0.0)
    urn = [Part(masonry.urn(14, "urn"), GLAZE)]
    bush = [Part(masonry.bush(0.42, 4, 3, "bush"), LEAVES)]
    for number, (x, z) in enumerate((x, z) for x in (-6.4, -3.2, 3.2, 6.4) for z in (-3.6, 3.6)):
        _place(scene, urn, f"urn {number}", x, 0.0, z)
        _place(scene, bush, f"bush {number}", x, 1.13, z, turn=1.3 * number)


def _moving(scene: Scene) -> None:
    """The lantern and the sun, and the animation that moves both."""
    lantern = _place(scene, [Part(masonry.lantern(16, "lantern"), PAPER)], "lantern", 0.0, 0.0, 0.0)
    times = np.linspace(0.0, PERIOD, 33)
    angle = 2.0 * np.pi * times / PERIOD
    drift = np.stack([6.5 * np.cos(angle), 5.0 + 0.9 * np.sin(2.0 * angle), 2.2 * np.sin(angle)], axis=1)
    half = 0.5 * angle
    spin = np.stack([0.0 * half, np.sin(half), 0.0 * half, np.cos(half)], axis=1)

    swing = 0.06 * np.sin(angle)
    to_sun = np.stack([-0.42 + swing, np.ones_like(swing), -0.36 + 0.5 * swing], axis=1)
    path = 300.0 * to_sun / np.linalg.norm(to_sun, axis=1, keepdims=True)
    start, *_ = path
    sun = scene.add(PointLight((1.80e9, 1.71e9, 1.53e9)), name="sun", translation=tuple(start))

    lantern.translation, lantern.rotation = drift[0], spin[0]
    scene.animations.append(
        Animation(
            [
                Channel(lantern, "translation", times.astype(np.float32), drift.astype(np.float32)),
                Channel(lantern, "rotation", times.astype(np.float32), spin.astype(np.float32)),
                Channel(sun, "translation", times.astype(np.float32), path.astype(np.float32)),
            ],
            "drift",
        )
    )
