"""Furnished rooms, halls, streets and gardens by a number, unlike `random_scenes` built as people build them.

Walls meet, doors stand open, things have legs, bars, leaves and slats, and light comes from lamps of all
kinds, points and suns. With points and suns, whose caustics paths do not find, nothing is glass or narrow
metal.
"""

from __future__ import annotations

import math

import numpy as np

import ispm
from ispm import DirectionalLight, Environment, Material, PointLight, Scene, Sky, SpotLight, shapes
from ispm.library.common import add_camera, add_spot, lambert
from ispm.library.shapes import box, lathe, polygons
from ispm.scene.light import DiskLight, RectLight, SphereLight
from references.furniture import SUNK, Color, Site, add_thing, add_tree

_WALL = 0.15
_CELL = 1.1  # metres of floor that a thing has


def furnished_scene(number: int) -> Scene:
    """Return the furnished scene of a number, the same every time."""
    random = np.random.default_rng([number, 1])
    site = Site(Scene(), random, caustics=bool(random.random() < 0.5))
    place = (_room, _two_rooms, _hall, _street, _garden)[random.choice(5, p=(0.35, 0.2, 0.15, 0.15, 0.15))]
    site.scene.name = place(site) + ("" if site.caustics else ", no caustics")
    return site.scene


def _room(site: Site) -> str:
    wide, deep, high = site.between(3.0, 6.0), site.between(3.0, 7.0), site.between(2.3, 3.2)
    lit_by_sky = site.chance(0.5)
    walls = site.surface() if site.chance(0.2) else lambert(site.color(0.3, 0.85))
    _shell(site, wide, deep, high, walls)
    _wall_with_holes(site, wide, deep, high, walls, windows=site.random.integers(1, 4) if lit_by_sky else 0)
    told = _daylight(site, toward=(1.0, 0.0)) if lit_by_sky else _lamps(site, wide, deep, high)
    things = _furnish(site, wide, deep)
    _look_into(site, wide, deep)
    return f"room {told}, {things}"


def _two_rooms(site: Site) -> str:
    wide, deep, high = site.between(5.0, 8.0), site.between(3.0, 5.0), site.between(2.3, 2.9)
    walls = lambert(site.color(0.3, 0.85))
    _shell(site, wide, deep, high, walls)
    _wall_with_holes(site, wide, deep, high, walls, windows=0)
    x, door = site.between(-0.2, 0.6), site.between(-0.5, 0.5)
    half = deep / 2.0
    for low, top in (
        ((x, -_WALL, -half - SUNK), (x + 0.1, high + SUNK, door - 0.45)),
        ((x, -_WALL, door + 0.45), (x + 0.1, high + SUNK, half + SUNK)),
        ((x, 2.05, door - 0.45 - SUNK), (x + 0.1, high + SUNK, door + 0.45 + SUNK)),
    ):
        site.add(box(low, top), walls)
    leaf = box((0.0, 0.01, 0.0), (0.88, 2.03, 0.04))
    site.add(leaf, site.surface(), x + 0.1, door - 0.44, site.between(0.2, 1.5))
    told = _lamps(site, wide, deep, high, far=True)
    things = _furnish(site, wide, deep)
    _look_into(site, wide, deep)
    return f"two rooms {told}, {things}"


def _hall(site: Site) -> str:
    wide, deep, high = site.between(8.0, 14.0), site.between(10.0, 20.0), site.between(4.0, 7.0)
    walls = lambert(site.color(0.3, 0.8))
    _shell(site, wide, deep, high, walls)
    lit_by_sky = site.chance(0.5)
    _wall_with_holes(site, wide, deep, high, walls, windows=4 if lit_by_sky else 0)
    pillar = lathe([(0.28, -0.1), (0.28, 0.2), (0.2, 0.25), (0.18, high - 0.3), (0.3, high + 0.1)], 24)
    stone = site.surface()
    for z in np.arange(-deep / 2.0 + 2.0, deep / 2.0 - 1.0, 3.0):
        for x in (-wide / 4.0, wide / 4.0):
            site.add(pillar, stone, x, float(z))
    told = _daylight(site, toward=(1.0, 0.0)) if lit_by_sky else _lamps(site, wide, deep, high, power=8.0)
    things = _furnish(site, wide, deep)
    _look_into(site, wide, deep)
    return f"hall {told}, {things}"


def _street(site: Site) -> str:
    site.add(shapes.plane(60.0, 60.0), lambert(site.color(0.15, 0.5)))
    for side in (-1.0, 1.0):
        for k in range(4):
            walls = lambert(site.color(0.2, 0.8))
            x, z, high = side * site.between(4.0, 5.5), 5.0 * k - 8.0, site.between(4.0, 9.0)
            low, top = min(x, x + side * 4.0), max(x, x + side * 4.0)
            site.add(box((low, -0.1, z), (top, high, z + 4.9)), walls)
            for y in np.arange(1.0, high - 1.5, 2.4):
                for across in (0.8, 2.8):
                    frame = box((x - 0.05, y, z + across), (x + 0.05, y + 1.3, z + across + 0.9))
                    pane = Material((0.04,) * 3, roughness=0.05) if site.caustics else site.surface()
                    site.add(frame, pane)
                slab = box((min(x, x - side * 0.7), y - 0.12, z + 0.5), (max(x, x - side * 0.7), y, z + 4.2))
                site.add(slab, walls)
    things = ", ".join(add_thing(site, float(x), float(z)) for x, z in site.random.uniform(-3.0, 3.0, (5, 2)))
    told = _daylight(site)
    add_camera(site.scene, (site.between(-2.0, 2.0), 1.6, 9.0), (0.0, 1.6, 0.0), site.between(0.8, 1.1))
    return f"street {told}, {things}"


def _garden(site: Site) -> str:
    site.add(shapes.plane(40.0, 40.0), lambert(site.color(0.1, 0.5)))
    post, rail = box((-0.04, -0.1, -0.04), (0.04, 1.1, 0.04)), box((-4.0, 0.9, -0.02), (4.0, 1.0, 0.02))
    wood = site.surface()
    for x in np.linspace(-4.0, 4.0, 33):
        site.add(post, wood, float(x), -3.0)
    site.add(rail, wood, 0.0, -3.0)
    for x, z in ((site.between(-3.0, -1.5), -1.5), (site.between(1.5, 3.0), site.between(-2.0, 0.0))):
        add_tree(site, x, z)
    things = ", ".join(add_thing(site, float(x), float(z)) for x, z in site.random.uniform(-1.6, 1.6, (4, 2)))
    told = _daylight(site)
    add_camera(site.scene, (site.between(-2.0, 2.0), 1.5, 5.0), (0.0, 0.8, -0.5), site.between(0.7, 1.0))
    return f"garden {told}, {things}"


def _shell(site: Site, wide: float, deep: float, high: float, walls: Material) -> None:
    """Floor, ceiling and three walls; the fourth, towards +X, is of `_wall_with_holes`."""
    x, z, w = wide / 2.0, deep / 2.0, _WALL
    site.add(box((-x - w, -w, -z - w), (x + w, 0.0, z + w)), site.surface())
    site.add(box((-x - w, high, -z - w), (x + w, high + w, z + w)), lambert((0.8,) * 3))
    site.add(box((-x - w, -w, -z - w), (-x, high + w, z + w)), lambert(site.color(0.2, 0.85)))
    site.add(box((-x - w, -w, -z - w), (x + w, high + w, -z)), walls)
    site.add(box((-x - w, -w, z), (x + w, high + w, z + w)), walls)
    if site.chance(0.6):  # skirting
        for k in (-1.0, 1.0):
            site.add(box((-x, -SUNK, k * z - 0.015), (x, 0.1, k * z + 0.015)), lambert((0.7,) * 3))


def _wall_with_holes(
    site: Site, wide: float, deep: float, high: float, walls: Material, windows: int
) -> None:
    """The wall towards +X, with so many windows side by side, of bars, some of a pane."""
    x, z, w = wide / 2.0, deep / 2.0, _WALL
    if windows == 0:
        site.add(box((x, -w, -z - w), (x + w, high + w, z + w)), walls)
        return
    low, top = site.between(0.4, 1.0), high - site.between(0.2, 0.6)
    site.add(box((x, -w, -z - w), (x + w, low, z + w)), walls)
    site.add(box((x, top, -z - w), (x + w, high + w, z + w)), walls)
    step = deep / windows
    gap = site.between(0.4, 0.8) * step
    bar, pane = site.surface(), Material(transmission=1.0, roughness=0.0)
    panes = site.caustics and site.chance(0.5)
    for k in range(windows):
        left, right = -z + k * step, -z + (k + 1) * step
        a, b = (left + right - gap) / 2.0, (left + right + gap) / 2.0
        site.add(box((x, low - SUNK, left - w * (k == 0)), (x + w, top + SUNK, a)), walls)
        site.add(box((x, low - SUNK, b), (x + w, top + SUNK, right + w * (k == windows - 1))), walls)
        for y in (low, (low + top) / 2.0, top):
            site.add(box((x + 0.05, y - 0.02, a - SUNK), (x + 0.09, y + 0.02, b + SUNK)), bar)
        for y in (a, (a + b) / 2.0, b):
            site.add(box((x + 0.05, low - SUNK, y - 0.02), (x + 0.09, top + SUNK, y + 0.02)), bar)
        if panes:
            glass = polygons(
                [np.array([[x + 0.07, low, a], [x + 0.07, low, b], [x + 0.07, top, b], [x + 0.07, top, a]])]
            )
            site.add(glass, pane)
    if site.chance(0.3):  # a blind
        for y in np.arange(low, top, 0.06):
            slat = box((-0.025, -0.001, -z), (0.025, 0.001, z))
            turned = ispm.axis_angle((0.0, 0.0, 1.0), 0.6)
            site.scene.add(slat, material=bar, translation=(x - 0.05, float(y), 0.0), rotation=turned)


def _daylight(site: Site, toward: tuple[float, float] | None = None) -> str:
    """A sky, or a sun where there are no caustics; toward: (x, z) that it stands in, about."""
    angle = math.atan2(toward[1], toward[0]) if toward else site.between(-math.pi, math.pi)
    angle += site.between(-1.0, 1.0)
    height = site.between(0.3, 1.2)
    if site.caustics:
        up = np.cos((np.arange(64) + 0.5) / 64 * math.pi)[:, None, None]
        zenith, horizon = np.array(site.color(0.2, 1.0)), np.array(site.color(0.4, 1.0))
        share = np.clip(up, 0.0, 1.0)
        image = np.where(up > 0.0, zenith * share + horizon * (1.0 - share), 0.4 * horizon)
        image = np.repeat(image, 128, axis=1).astype(np.float32)
        image[10:22, 20:50] *= site.between(1.0, 8.0)
        site.scene.environment = Environment(image, rotation=angle)
        return "bright cloud"
    if site.chance(0.4):
        site.scene.environment = Sky(sun_elevation=height, sun_azimuth=angle).dome()
        return "dome"
    site.scene.environment = Environment(np.full((4, 8, 3), site.color(0.3, 1.0), np.float32))
    eye = math.cos(angle) * math.cos(height), math.sin(height), math.sin(angle) * math.cos(height)
    sun = DirectionalLight(tuple((site.between(1.0, 10.0) * np.array((1.0, 0.95, 0.85))).tolist()))
    site.scene.add(sun, translation=eye).look_at((0.0, 0.0, 0.0))
    return "sun"


def _lamps(site: Site, wide: float, deep: float, high: float, power: float = 1.0, far: bool = False) -> str:
    """One to three lamps; far: all on the side towards +X."""
    told = []
    for _ in range(site.random.integers(1, 4)):
        x = site.between(0.25 if far else -0.35, 0.4) * wide
        z = site.between(-0.35, 0.35) * deep
        light = tuple((power * site.between(3.0, 15.0) * np.array(site.color(0.6, 1.0))).tolist())
        told.append(_soft_lamp(site, light, x, high, z) if site.caustics else _point(site, light, x, high, z))
    return " ".join(told)


def _soft_lamp(site: Site, light: Color, x: float, high: float, z: float) -> str:
    """A panel in the ceiling, a ball on a cord, a tube or a bulb in a shade; light: cd, about."""
    kind = str(site.random.choice(["panel", "ball", "tube", "shade", "disk"]))
    if kind == "ball":
        radius, y = site.between(0.05, 0.2), high - site.between(0.4, 0.9)
        site.add(box((x - 0.004, y, z - 0.004), (x + 0.004, high, z + 0.004)), lambert((0.1,) * 3))
        radiance = tuple(v / (math.pi * radius * radius) for v in light)
        site.scene.add(SphereLight(radiance, radius), translation=(x, y, z))
        return kind
    if kind == "shade":
        y = high - site.between(0.5, 1.0)
        shade = lathe([(0.25, 0.0), (0.1, 0.3)], 32)
        paper = lambert(site.color(0.5, 0.8), double_sided=True)
        site.scene.add(shade, material=paper, translation=(x, y, z))
        site.scene.add(
            SphereLight(tuple(v / (math.pi * 0.0016) for v in light), 0.04), translation=(x, y + 0.1, z)
        )
        return kind
    if kind == "tube":
        glow = Material((0.0,) * 3, specular=0.0, emission=tuple(v / 0.05 for v in light))
        site.scene.add(
            shapes.cylinder(0.02, 1.2),
            material=glow,
            translation=(x, high - 0.06, z),
            rotation=ispm.axis_angle((1.0, 0.0, 0.0), math.pi / 2.0),
        )
        return kind
    size = site.between(0.2, 0.6)
    radiance = tuple(v / (size * size) for v in light)
    lamp = RectLight(radiance, size, size) if kind == "panel" else DiskLight(radiance, 0.56 * size)
    down = ispm.axis_angle((1.0, 0.0, 0.0), -math.pi / 2.0)
    site.scene.add(lamp, translation=(x, high - 0.01, z), rotation=down)
    return kind


def _point(site: Site, light: Color, x: float, high: float, z: float) -> str:
    if site.chance(0.5):
        site.scene.add(PointLight(light), translation=(x, high - site.between(0.3, 0.8), z))
        return "point"
    aim = x + site.between(-1.0, 1.0), 0.0, z + site.between(-1.0, 1.0)
    outer = site.between(0.3, 0.9)
    spot = SpotLight(light, inner_angle=0.7 * outer, outer_angle=outer)
    add_spot(site.scene, spot, "spot", (x, high - 0.1, z), aim)
    return "spot"


def _furnish(site: Site, wide: float, deep: float) -> str:
    """Things on cells of the floor; returns what they are called."""
    columns, rows = int((wide - 0.4) / _CELL), int((deep - 0.4) / _CELL)
    cells = site.random.permutation(columns * rows)
    told = []
    for cell in cells[: min(len(cells) - 2, int(site.random.integers(4, 9)))]:
        x = (cell % columns - (columns - 1) / 2.0) * _CELL
        z = (cell // columns - (rows - 1) / 2.0) * _CELL
        told.append(add_thing(site, float(x), float(z)))
    if site.chance(0.5):
        half = wide / 2.0
        picture = Material((0.95,) * 3, metallic=1.0, roughness=0.0) if site.caustics else site.surface()
        site.add(box((-half - SUNK, 0.9, -0.4), (-half + 0.03, 1.7, 0.5)), picture)
        told.append("picture")
    return ", ".join(told)


def _look_into(site: Site, wide: float, deep: float) -> None:
    """A camera in a corner away from the windows that looks across."""
    side = 1.0 if site.chance(0.5) else -1.0
    eye = -wide / 2.0 + 0.35, site.between(1.2, 1.9), side * (deep / 2.0 - 0.35)
    aim = site.between(0.0, 0.3) * wide, site.between(0.5, 1.0), -side * site.between(0.0, 0.3) * deep
    add_camera(site.scene, eye, aim, site.between(0.8, 1.15))
