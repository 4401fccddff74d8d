"""Direct light against closed forms: every kind of light, many of them, and through sheets."""

from __future__ import annotations

import math

import numpy as np
import pytest
from exact import mixed_scene, quad, view_of
from lit import Lamp

from ispm.gpu import Gpu
from ispm.scene.camera import look_at_pose
from ispm.scene.light import DirectionalLight, PointLight, SpotLight
from ispm.scene.material import Material
from ispm.scene.packed import pack
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView

LAMBERT = dict(specular=0.0, roughness=1.0)
DOWN = (-(0.5**0.5), 0.0, 0.0, 0.5**0.5)  # a rotation that turns -Z to -Y
RHO, INTENSITY = np.array([0.5, 0.25, 0.75]), np.array([10.0, 20.0, 40.0])


@pytest.fixture(scope="module")
def lamp(gpu: Gpu) -> Lamp:
    return Lamp(gpu)


def above(target: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> CameraView:
    return CameraView((160, 90), look_at_pose(np.array([0.0, 4.0, 6.0]), np.array(target)), near=0.01)


def over_a_plane(*lights: tuple[object, float]) -> Scene:
    """A plane of RHO at y = 0 and lights above its middle, that shine downwards."""
    scene = Scene()
    scene.add(quad(20.0), material=Material(base_color=tuple(RHO), **LAMBERT))
    for light, height in lights:
        scene.add(light, translation=(0.0, height, 0.0), rotation=DOWN)
    return scene


def rounding(tangent: np.ndarray) -> np.ndarray:
    """Base color and normal are halves: 2^-10 each, the normal's times the tangent of the light's angle."""
    return 2.0**-10 * (1.5 + tangent)


def test_point_light_over_a_plane_follows_the_inverse_square(lamp: Lamp) -> None:
    """V4: L = rho I h / (pi (h^2 + x^2)^1.5), per channel, and no self-shadow."""
    h = 1.5
    lit = lamp(pack(over_a_plane((PointLight(tuple(INTENSITY)), h))), above())
    square = (lit.points[..., [0, 2]] ** 2).sum(-1, keepdims=True)
    expected = RHO * INTENSITY * h / (math.pi * (h * h + square) ** 1.5)
    on = lit.ids == 1
    error = np.abs(lit.radiance / expected - 1.0).max(-1)
    assert on.mean() > 0.5 and (error[on] < rounding(np.sqrt(square[..., 0]) / h)[on]).all()


def test_spot_over_a_plane_follows_its_cones(lamp: Lamp) -> None:
    """V4 times KHR_lights_punctual's falloff: full within the inner cone, exactly 0 beyond the outer."""
    h, inner, outer = 1.5, 0.5, 0.9
    spot = SpotLight(tuple(INTENSITY), inner_angle=inner, outer_angle=outer)
    lit = lamp(pack(over_a_plane((spot, h))), above())
    square = (lit.points[..., [0, 2]] ** 2).sum(-1, keepdims=True)
    cosine = h / np.sqrt(h * h + square)
    fade = np.clip((cosine - math.cos(outer)) / (math.cos(inner) - math.cos(outer)), 0.0, 1.0) ** 2
    expected = fade * RHO * INTENSITY * h / (math.pi * (h * h + square) ** 1.5)
    on, tangent = lit.ids == 1, np.sqrt(square) / h
    # the falloff's slope: its edge shifts by float32's rounding of the cosine over their difference
    bound = rounding(tangent) * expected + 1e-5 * expected.max()
    assert (np.abs(lit.radiance - expected) < bound)[on].all()
    angle = np.arccos(cosine[..., 0])
    assert (lit.radiance[on & (angle > outer + 1e-3)] == 0.0).all()
    assert (on & (angle > outer)).any() and (on & (angle < inner)).any()


@pytest.mark.parametrize("tilt", [0.0, 0.6, 1.4])
def test_directional_light_follows_the_cosine(lamp: Lamp, tilt: float) -> None:
    scene = over_a_plane()
    half = -math.pi / 4.0 + tilt / 2.0  # about x
    scene.add(DirectionalLight(tuple(INTENSITY)), rotation=(math.sin(half), 0.0, 0.0, math.cos(half)))
    lit = lamp(pack(scene), above())
    expected = RHO * INTENSITY * math.cos(tilt) / math.pi
    on = lit.ids == 1
    assert (np.abs(lit.radiance[on] / expected - 1.0) < rounding(np.array(math.tan(tilt)))).all()


def test_range_windows_the_light(lamp: Lamp) -> None:
    """KHR_lights_punctual: clamp(1 - (d / range)^4, 0, 1) / d^2."""
    free = lamp(pack(over_a_plane((PointLight(), 1.0))), above())
    bound = lamp(pack(over_a_plane((PointLight(range=3.0), 1.0))), above()).radiance
    distance = np.linalg.norm(free.points - (0.0, 1.0, 0.0), axis=-1, keepdims=True)
    expected = free.radiance * np.clip(1.0 - (distance / 3.0) ** 4, 0.0, 1.0)
    on = free.ids == 1
    assert np.abs(bound - expected)[on].max() < 1e-4 * free.radiance.max()
    assert (bound[on & (distance[..., 0] > 3.0)] == 0.0).all()


def test_light_behind_a_surface_does_not_show(lamp: Lamp) -> None:
    scene = Scene()
    scene.add(quad(5.0), material=Material(double_sided=True))
    scene.add(PointLight(), translation=(0.0, -1.0, 0.0))
    assert (lamp(pack(scene), above()).radiance == 0.0).all()


def scattered(count: int) -> list[tuple[object, np.ndarray]]:
    """Lights of all kinds about `mixed_scene`."""
    random = np.random.default_rng(3)
    kinds = [
        PointLight((1.0, 2.0, 3.0)),
        SpotLight((3.0, 1.0, 2.0), outer_angle=1.2),
        DirectionalLight((0.1, 0.1, 0.2)),
    ]
    places = random.uniform([-3.5, 1.0, -3.5], [3.5, 4.0, 3.5], (count, 3))
    return [(kinds[k % 3], place) for k, place in enumerate(places)]


def lit_by(lamp: Lamp, lights: list[tuple[object, np.ndarray]]) -> np.ndarray:
    scene = mixed_scene()
    scene.roots = [node for node in scene.roots if node.light is None]
    for light, place in lights:
        scene.add(light, translation=tuple(place), rotation=DOWN)
    # all tiles have the least side, so that company does not change a light's map
    return lamp(pack(scene), view_of((64, 36)), 32).radiance


def test_sixty_four_lights_add_up(lamp: Lamp) -> None:
    lights = scattered(64)
    eights = [lit_by(lamp, lights[k : k + 8]) for k in range(0, 64, 8)]
    together, alone = lit_by(lamp, lights), sum(lit_by(lamp, [light]) for light in lights[:8])
    assert together.max() > 0.0 and np.abs(together - sum(eights)).max() < 1e-5 * together.max()
    assert np.abs(eights[0] - alone).max() < 1e-5 * eights[0].max()


def test_more_lights_than_fit_at_once_add_up(lamp: Lamp) -> None:
    lights = scattered(300)
    together = lit_by(lamp, lights)
    apart = sum(lit_by(lamp, lights[k : k + 100]) for k in range(0, 300, 100))
    assert np.abs(together - apart).max() < 1e-5 * together.max()


def fresnel(cosine: np.ndarray, ior: float) -> np.ndarray:
    """Unpolarised reflectance of a boundary."""
    other = np.sqrt(ior * ior - 1.0 + cosine**2)
    s = (cosine - other) / (cosine + other)
    p = (ior * ior * cosine - other) / (ior * ior * cosine + other)
    return 0.5 * (s * s + p * p)


TINT = np.array([0.9, 0.5, 0.2])


@pytest.mark.parametrize("light", [PointLight(), DirectionalLight(), SpotLight(outer_angle=1.0)])
@pytest.mark.parametrize("layers", [1, 2])
def test_sheets_tint_by_exactly_their_transmittance(lamp: Lamp, light: object, layers: int) -> None:
    """Behind them base color x (1 - F) for each; no photon carries that light."""
    tints = {}
    for sheets in (0, layers):
        scene = over_a_plane((light, 3.0))
        for k in range(sheets):
            glass = Material(base_color=tuple(TINT), roughness=0.0, transmission=1.0, ior=1.5)
            scene.add(quad(20.0), material=glass, translation=(0.0, 1.0 + k, 0.0))
        view = CameraView((160, 90), look_at_pose(np.array([0.0, 0.9, 2.0]), np.zeros(3)), near=0.01)
        tints[sheets] = lamp(pack(scene), view)
    free, tinted = tints[0], tints[layers]
    on = (free.ids > 0) & (tinted.ids > 0) & (tinted.points[..., 1] < 0.5) & (free.radiance[..., 0] > 1e-3)
    way = np.array([0.0, 3.0, 0.0]) - free.points
    cosine = (
        np.ones(on.shape)
        if isinstance(light, DirectionalLight)
        else way[..., 1] / np.linalg.norm(way, axis=-1)
    )
    one = TINT * (1.0 - fresnel(cosine, 1.5))[..., None]
    with np.errstate(invalid="ignore", divide="ignore"):
        error = np.abs(tinted.radiance / free.radiance - one**layers)
    # a byte each time a sheet is drawn, and the angle's change over a texel
    assert on.sum() > 3000 and error[on].max() < 0.5 * layers / 255.0 + 2e-3


def test_sheets_tint_only_what_lies_behind_the_nearest(lamp: Lamp) -> None:
    """A board before the sheet, and the diffuse half of the sheet itself, have the light as it comes."""
    glass = Material(base_color=tuple(TINT), roughness=0.0, transmission=0.5)
    paper = Material(base_color=tuple(0.5 * TINT), specular=0.0)  # as much diffuse, and nothing goes through
    lit = []
    for sheet in (glass, paper):
        scene = over_a_plane((PointLight(), 3.0))
        scene.add(quad(3.0), material=sheet, translation=(0.0, 0.5, 0.0))
        scene.add(quad(0.5), material=Material(**LAMBERT), translation=(1.0, 1.5, 0.0))
        lit.append(lamp(pack(scene), above((0.0, 0.5, 0.0))))
    clear, opaque = lit
    board, sheet = clear.ids == 3, clear.ids == 2
    assert board.sum() > 50 and (clear.radiance[board] == opaque.radiance[board]).all()
    lost = clear.radiance[sheet] / np.maximum(opaque.radiance[sheet], 1e-9)
    # glass's diffuse half gives way to the half vector's reflection, 4 % and more at grazing angles
    assert sheet.sum() > 2000 and np.median(lost, axis=0) == pytest.approx(0.96, abs=0.01)
    shaded = opaque.radiance[sheet].max(-1) == 0.0
    assert shaded.sum() > 50 and (clear.radiance[sheet][shaded] == 0.0).all()


def test_thin_shades_glow_and_keep_light_from_what_is_behind(lamp: Lamp) -> None:
    """Rough sheets scatter light through themselves, so they are opaque to shadow maps."""
    scene = over_a_plane((PointLight(tuple(INTENSITY)), 2.0))
    paper = Material(base_color=(0.8, 0.8, 0.8), roughness=0.8, transmission=1.0, double_sided=True)
    scene.add(quad(1.0), material=paper, translation=(0.0, 1.0, 0.0))
    view = CameraView(
        (160, 90), look_at_pose(np.array([0.0, 0.3, 3.0]), np.array([0.0, 0.5, 0.0])), near=0.01
    )
    lit = lamp(pack(scene), view)
    x, z = np.abs(lit.points[..., 0]), np.abs(lit.points[..., 2])
    shade, below = lit.ids == 2, (lit.ids == 1) & (x < 1.7) & (z < 1.7)
    assert shade.sum() > 200 and (lit.radiance[shade].min(axis=0) > 0.0).all()
    assert below.sum() > 200 and (lit.radiance[below] == 0.0).all()
