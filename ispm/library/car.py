"""A coupe of the sixties that looks along +x: twenty moving parts of 20,120 triangles, two headlights."""

from __future__ import annotations

import math

import numpy as np

from ispm.library.common import add_spot
from ispm.library.finishes import Finishes
from ispm.library.forms import averaged, beveled_box, loft, pipe, placed, pose, refined, unwrapped
from ispm.library.shapes import box, lathe, merge, tube
from ispm.scene.light import SpotLight
from ispm.scene.material import Material
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Node, Part, Scene

TRIANGLES = 20_120
WHEEL = 0.34  # m, radius of a tyre
_AXLES = (-1.38, 1.40)  # x of the wheels
_TRACK = 0.76  # z of the middles of the tyres
_ARCH = 0.42  # m, radius of a wheel arch
_SILL, _WIDTH, _END = 0.23, 0.90, 2.32


def car(scene: Scene, finishes: Finishes) -> tuple[Node, list[Node]]:
    """Hang the car into the scene, on its wheels at the origin; return its node and those of its wheels."""
    root = Node("car")
    scene.roots.append(root)
    paint = Material((0.50, 0.028, 0.022), roughness=0.32, name="car paint")
    chrome = Material((0.78, 0.78, 0.79), metallic=1.0, roughness=0.22, name="chrome")
    glass = Material((0.80, 0.86, 0.84), roughness=0.0, transmission=1.0, double_sided=True, name="window")
    black = Material((0.03, 0.03, 0.032), roughness=0.6, name="black trim")
    lamp = Material((1.0, 0.93, 0.78), unlit=True, name="headlamp glass")
    rear = Material((0.09, 0.002, 0.001), unlit=True, name="tail lamp glass")

    def hang(
        name: str, *parts: tuple[Mesh, Material], at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ) -> Node:
        node = Node(name, at, parts=[Part(mesh, material) for mesh, material in parts])
        root.children.append(node)
        return node

    roof, windows = _cabin()
    hang("body", (merge([_shell(), roof], "body"), paint))
    hang("windows", (windows, glass))
    hang("seats", (unwrapped(_seats(), 1.0), finishes["rubber"]))
    hang("front bumper", (_bumper(2.30, 0.20), chrome))
    hang("rear bumper", (_bumper(-2.30, -0.20), chrome))
    hang("grille", (_grille(), chrome))
    wheels = []
    tyre, rim = _wheel()
    for name, x in (("front", _AXLES[1]), ("rear", _AXLES[0])):
        for side, s in (("left", -1.0), ("right", 1.0)):
            turn = pose(yaw=0.0 if s > 0 else 180.0)
            parts = ((unwrapped(placed(tyre, turn), 1.0), finishes["rubber"]), (placed(rim, turn), chrome))
            wheels.append(hang(f"{name} {side} wheel", *parts, at=(x, WHEEL, s * _TRACK)))
    for side, s in (("left", -1.0), ("right", 1.0)):
        ring, lens = _lamp(0.105)
        hang(f"{side} headlamp", (ring, chrome), (lens, lamp), at=(2.235, 0.64, s * 0.62))
        frame = beveled_box((-0.03, -0.07, -0.2), (0.06, 0.07, 0.2), 0.012, "frame")
        hang(
            f"{side} tail lamp",
            (frame, chrome),
            (box((-0.036, -0.05, -0.18), (-0.03, 0.05, 0.18), "lens"), rear),
            at=(-2.28, 0.66, s * 0.55),
        )
        hang(f"{side} mirror", (_mirror(s), chrome), at=(0.62, 0.90, s * 0.86))
    hang("spoiler", (_spoiler(), paint))
    hang("exhaust", (_exhaust(), chrome))
    hang("antenna", (pipe([(-1.75, 0.80, 0.6), (-1.85, 1.45, 0.6)], 0.006, 6, name="antenna"), black))
    chassis = beveled_box((-2.1, 0.17, -0.60), (2.1, 0.30, 0.60), 0.03, "chassis")
    rest = TRIANGLES - sum(len(part.mesh.triangles) for node in root.children for part in node.parts)
    hang("chassis", (refined(chassis, rest), black))
    # wide enough that the hall is lit beside the way as well
    beam = SpotLight((620.0, 540.0, 400.0), inner_angle=math.radians(4.0), outer_angle=math.radians(50.0))
    for side, s in (("left", -1.0), ("right", 1.0)):
        add_spot(scene, beam, f"{side} headlight", (2.36, 0.64, s * 0.62), (12.0, 0.42, s * 1.5), root)
    return root, wheels


def _outline(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Half the width, and the heights of the lower and the upper edge, of the body at x."""
    end = np.clip(np.abs(x) / _END, 0.0, 1.0)
    width = _WIDTH * (1.0 - 0.10 * end**4) * (1.0 - end**14) ** 0.35
    top = np.interp(
        x, [-2.32, -2.2, -1.4, -0.6, 0.7, 1.6, 2.2, 2.32], [0.80, 0.86, 0.89, 0.90, 0.89, 0.83, 0.76, 0.70]
    )
    low = np.interp(x, [-2.32, -2.1, -1.9, 1.95, 2.15, 2.32], [0.42, 0.34, _SILL, _SILL, 0.32, 0.40])
    for axle in _AXLES:
        reach = np.sqrt(np.maximum(_ARCH**2 - (x - axle) ** 2, 0.0))
        low = np.where(np.abs(x - axle) < _ARCH, np.maximum(low, WHEEL - 0.10 + 1.19 * reach), low)
    return np.maximum(width, 0.55), low, top


def _shell() -> Mesh:
    """The body below the windows: rings across, whose lower edge follows the wheel arches."""
    x = np.linspace(-_END, _END, 53)
    for axle in _AXLES:
        angle = np.linspace(0.0, np.pi, 17)
        x = np.append(x[np.abs(x - axle) > _ARCH], axle + _ARCH * np.cos(angle))
        x = np.append(x, [axle - _ARCH - 0.03, axle + _ARCH + 0.03])
    x = np.unique(np.round(np.append(x, [2.27, -2.27, 2.3, -2.3]), 4))
    width, low, top = _outline(x)
    t = 2.0 * np.pi * (np.arange(40) + 0.5) / 40
    # a superellipse; starting below and turning so that it is counter-clockwise seen from +x
    c, s = np.cos(t - 0.5 * np.pi), np.sin(t - 0.5 * np.pi)
    across, up = (np.sign(v) * np.abs(v) ** 0.5 for v in (c, s))
    middle, half = 0.5 * (low + top), 0.5 * (top - low)
    y = middle[:, None] + half[:, None] * up
    crease = 0.022 * np.exp(-(((y - 0.60) / 0.05) ** 2)) - 0.05 * np.clip((y - 0.6) / 0.3, 0.0, 1.0) ** 2
    z = -across * (width[:, None] + crease)
    rings = np.stack([np.broadcast_to(x[:, None], y.shape), y, z], axis=-1)
    return loft(rings, "shell")


def _cabin() -> tuple[Mesh, Mesh]:
    """The roof with its pillars, and the windows between them: one sheet that is shared out."""
    s = np.linspace(0.0, 1.0, 41)  # from the rear window's foot to the windscreen's
    x = np.interp(s, [0.0, 0.36, 0.66, 1.0], [-1.75, -0.80, 0.02, 0.80])
    height = np.interp(s, [0.0, 0.36, 0.66, 1.0], [0.86, 1.29, 1.31, 0.86])
    kernel = np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16.0
    for _ in range(2):  # rounds the roof's corners
        height[2:-2] = np.convolve(height, kernel, "valid")
    v = np.linspace(-1.0, 1.0, 41)
    share = np.clip((height - 0.86) / 0.45, 0.0, 1.0)[:, None]
    out = np.sign(v) * np.abs(np.sin(0.5 * np.pi * np.abs(v))) ** 0.55
    z = (0.80 - 0.22 * share * (1.0 - np.abs(v) ** 3)) * out
    up = 1.0 - np.abs(v) ** 3.2
    y = 0.84 + (height[:, None] - 0.84) * up
    points = np.stack([np.broadcast_to(x[:, None], y.shape), y, z], axis=-1)
    rows, columns = points.shape[:2]
    k = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]
    quads = np.stack([a, d, c, b], axis=-1)
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij")
    low = points[:-1, :-1, 1]
    edge = np.abs(j - 19.5)
    side = (edge > 10) & (edge < 18) & (i > 7) & (i < 33) & (np.abs(i - 19) > 0.5) & (low > 0.885)
    screen = (edge < 13) & (((i > 26) & (i < 39)) | ((i < 14) & (i > 1)))
    glass = side | screen
    whole = np.concatenate([quads.reshape(-1, 4)[:, [0, 1, 2]], quads.reshape(-1, 4)[:, [0, 2, 3]]])
    smooth = averaged(Mesh(points.reshape(-1, 3), whole))
    parts = []
    for mask, name in ((~glass, "roof"), (glass, "windows")):
        own = quads[mask]
        triangles = np.concatenate([own[:, [0, 1, 2]], own[:, [0, 2, 3]]])
        kept, numbers = np.unique(triangles, return_inverse=True)
        assert smooth.normals is not None  # averaged makes them
        parts.append(Mesh(smooth.positions[kept], numbers.reshape(-1, 3), smooth.normals[kept], name=name))
    return parts[0], parts[1]


def _seats() -> Mesh:
    """Two seats, a bench, a dashboard and a steering wheel."""
    seat = [beveled_box((-0.25, 0.60, -0.26), (0.25, 0.78, 0.26), 0.05)]
    seat.append(
        placed(beveled_box((-0.08, 0.0, -0.25), (0.08, 0.52, 0.25), 0.05), pose(-0.28, 0.66, roll=14.0))
    )
    parts = [placed(m, pose(-0.25, 0.0, z)) for m in seat for z in (-0.38, 0.38)]
    parts.append(beveled_box((-1.25, 0.60, -0.66), (-0.85, 0.84, 0.66), 0.05))
    parts.append(beveled_box((0.42, 0.74, -0.70), (0.72, 0.91, 0.70), 0.04))
    angle = 2.0 * np.pi * np.arange(20) / 20
    circle = 0.17 * np.stack([0.0 * angle, np.cos(angle), np.sin(angle)], axis=1)
    parts.append(placed(tube(circle, 0.014, 6), pose(0.28, 0.93, -0.38, roll=-22.0)))
    return merge(parts, "seats")


def _bumper(x: float, bend: float) -> Mesh:
    """A bumper of polished bar, bent round the corners."""
    path = [
        (x - 2.4 * bend, 0.44, -0.90),
        (x, 0.44, -0.84),
        (x + 0.25 * bend, 0.44, 0.0),
        (x, 0.44, 0.84),
        (x - 2.4 * bend, 0.44, 0.90),
    ]
    bar = pipe(path, 0.052, 12, 0.16)
    guards = [
        beveled_box((x - 0.09, 0.36, z - 0.04), (x + 0.09, 0.53, z + 0.04), 0.02) for z in (-0.35, 0.35)
    ]
    return merge([bar, *guards], "bumper")


def _grille() -> Mesh:
    """Bars across the front between the lamps, and a frame round them."""
    bars = [box((2.26, y - 0.006, -0.46), (2.31, y + 0.006, 0.46)) for y in np.linspace(0.56, 0.70, 6)]
    frame = [beveled_box((2.22, y - 0.012, -0.48), (2.33, y + 0.012, 0.48), 0.005) for y in (0.535, 0.725)]
    frame += [beveled_box((2.22, 0.53, z - 0.012), (2.33, 0.73, z + 0.012), 0.005) for z in (-0.48, 0.48)]
    return merge([*bars, *frame, box((2.2, 0.54, -0.47), (2.265, 0.72, 0.47))], "grille")


def _wheel() -> tuple[Mesh, Mesh]:
    """A tyre and a rim with spokes, about the origin, seen from +z."""
    angle = np.linspace(-0.80 * np.pi, 0.80 * np.pi, 15)
    profile = [(0.285 + 0.055 * math.cos(a), 0.105 * math.sin(a)) for a in angle]
    ring = [*profile, (0.215, 0.062), (0.215, -0.062), profile[0]]
    tyre = placed(lathe(ring, 30), pose(pitch=90.0))
    outer = [
        (0.0, 0.030),
        (0.05, 0.032),
        (0.06, 0.012),
        (0.10, 0.0),
        (0.185, 0.006),
        (0.20, 0.030),
        (0.222, 0.055),
        (0.222, -0.05),
        (0.0, -0.05),
    ]
    disc = placed(lathe([(r, y) for r, y in reversed(outer)], 30), pose(pitch=90.0))
    spoke = beveled_box((-0.020, 0.05, 0.0), (0.020, 0.205, 0.030), 0.006)
    nut = beveled_box((-0.011, 0.068, 0.006), (0.011, 0.09, 0.034), 0.004)
    around = [pose(roll=72.0 * k) for k in range(5)]
    return merge([tyre], "tyre"), merge(
        [disc, placed(spoke, *around), placed(nut, *(p @ pose(roll=36.0) for p in around))], "rim"
    )


def _lamp(radius: float) -> tuple[Mesh, Mesh]:
    """A headlamp that looks along +x: its ring, and its lens."""
    profile = [
        (0.0, -0.09),
        (radius + 0.02, -0.09),
        (radius + 0.02, 0.05),
        (radius, 0.065),
        (radius - 0.012, 0.05),
        (radius - 0.012, 0.02),
        (0.0, 0.02),
    ]
    bulb = [(0.0, 0.022), (radius - 0.013, 0.022), (0.7 * radius, 0.048), (0.0, 0.062)]
    return (
        placed(lathe(profile, 28), pose(roll=-90.0), name="ring"),
        placed(lathe(bulb, 24), pose(roll=-90.0), name="lens"),
    )


def _mirror(side: float) -> Mesh:
    """A mirror on a stalk, on the left (-1) or the right."""
    stalk = pipe([(0.0, -0.09, -0.06 * side), (0.0, 0.02, 0.05 * side)], 0.012, 8)
    return merge(
        [stalk, beveled_box((-0.03, 0.0, 0.05 * side - 0.085), (0.05, 0.10, 0.05 * side + 0.085), 0.02)],
        "mirror",
    )


def _spoiler() -> Mesh:
    """A wing behind on two feet."""
    wing = placed(
        beveled_box((-0.13, -0.014, -0.74), (0.13, 0.014, 0.74), 0.008), pose(-2.08, 1.02, roll=8.0)
    )
    feet = [box((-2.13, 0.83, z - 0.02), (-2.03, 1.01, z + 0.02)) for z in (-0.5, 0.5)]
    return merge([wing, *feet], "spoiler")


def _exhaust() -> Mesh:
    """Two pipes that end behind."""
    profile = [(0.026, -0.3), (0.034, -0.3), (0.034, 0.3), (0.026, 0.3), (0.026, -0.3)]
    one = placed(lathe(profile, 20), pose(roll=90.0))
    return merge([placed(one, pose(-2.02, 0.27, z)) for z in (-0.42, -0.32)], "exhaust")
