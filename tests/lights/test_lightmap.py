"""The maps of lights: what they hold, to the last bit of flux, and where they look."""

import math

import numpy as np
import pytest

from ispm.library.shapes import box
from ispm.lights.lightmap import (
    CUBE_AXES,
    LightMap,
    cone_measure,
    cropped,
    face_directions,
    falloff,
    light_map,
    light_maps,
    square_map,
    texel_measures,
    view_of,
)
from ispm.scene.light import DirectionalLight, Light, PointLight, SpotLight
from ispm.scene.packed import pack
from ispm.scene.scene import Scene

ROOM = np.array([(-2.0, 0.0, -3.0), (3.0, 2.5, 1.0)])
SHIFTS = [(0.0, 0.0), (0.31, -0.44), (-0.5, 0.5)]


def record(light: Light, position: tuple[float, ...] = (0.4, 1.9, -0.7), **node: object) -> np.void:
    """The LIGHT of a light in a scene."""
    scene = Scene()
    scene.add(light, translation=position, **node)
    return pack(scene).lights[0]


def map_of(light: Light, position: tuple[float, ...] = (0.4, 1.9, -0.7), **node: object) -> LightMap:
    return light_map(0, record(light, position, **node), ROOM)


def spot(degrees: float, inner: float = 0.0) -> SpotLight:
    return SpotLight(inner_angle=math.radians(inner), outer_angle=math.radians(degrees))


TURNED = {"rotation": (0.2, 0.3, 0.1, 0.9)}


@pytest.mark.parametrize("width", [1, 2, 3, 16, 113])
@pytest.mark.parametrize("shift", SHIFTS)
@pytest.mark.parametrize("position", [(0.4, 1.9, -0.7), (30.0, 80.0, 20.0)])
def test_texels_of_a_point_light_sum_to_their_solid_angle(width, shift, position):
    light = record(PointLight(), position)
    map = light_map(0, light, ROOM)
    square = map.spread**2
    expected = 4 * math.pi if len(map.axes) == 6 else 4 * math.asin(square / (1 + square))
    assert (len(map.axes) == 6) == (position[0] < 1)
    assert texel_measures(map, light, width, shift).sum() == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("width", [8, 33])
@pytest.mark.parametrize("shift", SHIFTS)
@pytest.mark.parametrize("degrees", [0.5, 5.0, 30.0, 75.0, 90.0])
def test_texels_of_a_hard_cone_sum_to_its_solid_angle(degrees, width, shift):
    """2 pi (1 - cos), to the edge's width, 1e-6 of the cosine, and the record's rounding."""
    light = record(spot(degrees, degrees - 1e-6), **TURNED)
    total = texel_measures(light_map(0, light, ROOM), light, width, shift).sum()
    cosine = math.cos(math.radians(degrees))
    assert total == pytest.approx(2 * math.pi * (1 - cosine), rel=1e-5, abs=2 * math.pi * 1.1e-6)


@pytest.mark.parametrize(("inner", "outer"), [(0.0, 5.0), (20.0, 30.0), (0.0, 75.0), (60.0, 90.0)])
def test_texels_of_a_soft_cone_sum_to_the_integral_of_its_falloff(inner, outer):
    light = record(spot(outer, inner), **TURNED)
    nodes, weights = np.polynomial.legendre.leggauss(64)
    low, high = math.cos(math.radians(outer)), math.cos(math.radians(inner))
    cosines = low + (nodes + 1) / 2 * (high - low)
    fade = float(weights @ ((cosines - low) / (high - low)) ** 2) / 2 * (high - low)
    expected = 2 * math.pi * (fade + 1 - high)
    map = light_map(0, light, ROOM)
    assert texel_measures(map, light, 16).sum() == pytest.approx(expected, rel=1e-4)
    assert map.measure == pytest.approx(expected, rel=1e-4 if outer < 10 else 1e-6)  # a float32 cosine


@pytest.mark.parametrize(
    "rotation", [(0.0, 0.0, 0.0, 1.0), (-(0.5**0.5), 0.0, 0.0, 0.5**0.5), (0.2, 0.3, 0.1, 0.9)]
)
def test_texels_of_a_directional_light_sum_to_the_area_it_lights(rotation):
    light = record(DirectionalLight(), rotation=rotation)
    map = light_map(0, light, ROOM)
    s, t, axis = map.axes[0]
    area = 4 / (np.linalg.norm(s) * np.linalg.norm(t))
    assert map.measure == pytest.approx(area, rel=1e-12)
    assert texel_measures(map, light, 7, (0.1, 0.2)).sum() == pytest.approx(area, rel=1e-12)
    # it holds the scene with 2 % to spare, no more
    corners = np.array([[ROOM[i >> k & 1][k] for k in range(3)] for i in range(8)]) - map.origin
    assert np.abs(corners @ map.axes[0].T).max(axis=0) == pytest.approx(1 / 1.02, rel=1e-6)
    assert axis @ light["direction"] > 0.0 and abs(s @ t) < 1e-12


def test_a_directional_light_above_takes_the_floor():
    down = (-(0.5**0.5), 0.0, 0.0, 0.5**0.5)
    assert map_of(DirectionalLight(), rotation=down).measure == pytest.approx(5 * 4 * 1.02**2, rel=1e-5)


@pytest.mark.parametrize(("inner", "rel"), [(0.0, 1e-3), (20.0, 1e-3), (29.9999, 5e-3)])
def test_measure_of_a_square_partly_in_a_cone(inner, rel):
    """Against a thousand times as many points, where the square holds more than a thousandth of its angle."""
    light = record(spot(30.0, inner))
    random = np.random.default_rng(1)
    for _ in range(8):
        polar, azimuth, spread = random.uniform((0.1, 0.0, 0.05), (0.7, 6.28, 0.6))
        around = (math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth), -math.cos(polar))
        frame = view_of(np.array([around]))[0]
        map = square_map(0, light, frame, spread)
        s = 2 * (np.arange(2001) + 0.5) / 2001 - 1
        density = (1 + spread**2 * (s**2 + s[:, None] ** 2)) ** -1.5
        exact = (density * falloff(light, face_directions(map.axes[0], s, s[:, None]))).mean() * 4 * spread**2
        if exact > 4e-3 * spread**2:
            assert map.measure == pytest.approx(exact, rel=rel)


def test_a_spot_takes_one_view_unless_it_is_wide():
    assert [len(map_of(spot(d), **TURNED).axes) for d in (5.0, 45.0, 60.0, 62.0, 90.0)] == [1, 1, 1, 6, 6]
    assert map_of(spot(30.0)).spread == pytest.approx(math.tan(math.radians(30.0)), rel=1e-6)


def test_a_far_spot_takes_the_narrower_of_its_cone_and_the_scene():
    away = (0.0, 0.0, 100.0)  # looking at the room from in front
    assert map_of(spot(40.0), away).spread < 0.04
    assert map_of(spot(1.0), away).spread == pytest.approx(math.tan(math.radians(1.0)), rel=1e-3)


def test_falloff_of_narrow_cones_is_full_on_their_axis():
    """The spread of cosines within a degree is below a thousandth, which is no reason to dim the light."""
    for degrees in (0.1, 1.0, 5.0):
        light = record(spot(degrees), rotation=(0.2, 0.3, 0.1, 0.9))
        assert falloff(light, light["direction"].astype(float)) == pytest.approx(1.0, abs=0.1)
    assert cone_measure(light) > 0.0


@pytest.mark.parametrize("width", [4, 16])
def test_texel_solid_angles_are_unbiased_over_shifts(width):
    """The mean over shifts is the exact solid angle of the texel, up to the scale's fourth order."""
    map = map_of(PointLight())
    light = record(PointLight())
    nodes, weights = np.polynomial.legendre.leggauss(8)
    mean = sum(
        0.25 * wx * wy * texel_measures(map, light, width, (x / 2.0, y / 2.0))[0]
        for x, wx in zip(nodes, weights, strict=True)
        for y, wy in zip(nodes, weights, strict=True)
    )
    edges = np.linspace(-1.0, 1.0, width + 1)
    corner = np.arctan2(edges[:, None] * edges, np.sqrt(edges[:, None] ** 2 + edges**2 + 1.0))
    exact = np.diff(np.diff(corner, axis=0), axis=1)
    # measured: 4.6e-3 / W^2 ... / W^4; the exact angle in place of the density's errs by 40 % at W = 4
    assert np.abs(mean / exact - 1.0).max() < 2.0 / width**4


def test_a_cube_weighs_directions_like_the_sphere():
    """The mean of |d|-components squared over a map is 1/3, for any shift."""
    map, light = map_of(PointLight()), record(PointLight())
    for shift in SHIFTS:
        s, t = (2 * (np.arange(32) + 0.5 + k) / 32 - 1 for k in shift)
        d = np.stack([face_directions(axes, s, t[:, None]) for axes in CUBE_AXES])
        weights = texel_measures(map, light, 32, shift)
        assert np.einsum("fyx,fyxk->k", weights, d**2) / (4 * math.pi) == pytest.approx([1 / 3] * 3, abs=1e-4)


def test_cube_faces_look_where_those_of_cube_maps_do():
    """Face 2 k + s looks along axis k, forwards (s = 0) or backwards; WebGPU, 23.2."""
    for face, axes in enumerate(CUBE_AXES):
        expected = np.zeros(3)
        expected[face // 2] = 1.0 - 2.0 * (face % 2)
        assert face_directions(axes, np.array(0.0), np.array(0.0)) == pytest.approx(expected)
    # on +x, u grows with -z and v with -y
    right, down = (
        face_directions(CUBE_AXES[0], np.array(s), np.array(t)) for s, t in ((1.0, 0.0), (0.0, 1.0))
    )
    assert right[2] < 0.0 and down[1] < 0.0


def test_a_crop_is_the_part_it_names():
    map = map_of(DirectionalLight(), **TURNED)
    part = cropped(map, np.array([-0.5, 0.2]), np.array([0.1, 0.4]))
    assert part.measure == pytest.approx(map.measure * 0.3 * 0.1)
    across = map.axes[0] / (map.axes[0] ** 2).sum(axis=1, keepdims=True)
    for place, expected in (((-0.5, 0.2, -1.0), (-1, -1, -1)), ((0.1, 0.4, 1.0), (1, 1, 1))):
        point = map.origin + np.array(place) @ across
        assert (point - part.origin) @ part.axes[0].T == pytest.approx(expected)


@pytest.mark.parametrize("light", [PointLight(), spot(20.0), DirectionalLight()])
def test_maps_of_scenes_without_extent_are_finite(light):
    for bounds in (np.zeros((2, 3)), np.array([(1.0, 2.0, 3.0)] * 2)):
        map = light_map(0, record(light, (1.0, 9.0, 3.0)), bounds)
        assert np.isfinite(map.axes).all() and np.isfinite(map.measure)


def test_an_empty_scene_packs_with_any_light():
    scene = Scene()
    for light in (PointLight(), SpotLight(), DirectionalLight()):
        scene.add(light, translation=(0.0, 1.0, 0.0))
    scene.add(box((0, 0, 0), (0, 0, 0)))
    assert len(light_maps(pack(scene))) == 3
