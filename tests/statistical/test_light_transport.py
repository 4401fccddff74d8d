"""Light in rooms whose answer is known in closed form, through the whole renderer."""

import math

import numpy as np
import pytest
from test_bsdf import integrate, surface, towards
from test_flux import bounced_irradiance, plate
from transport import lit, render

from ispm.library.builtin import builtin
from ispm.library.common import lambert
from ispm.library.shapes import polygons
from ispm.scene.camera import Camera, look_at_pose
from ispm.scene.material import Material
from ispm.scene.scene import Scene


@pytest.mark.parametrize(("metallic", "roughness"), [(0.0, 1.0), (0.0, 0.6), (1.0, 0.6), (1.0, 1.0)])
def test_glossy_patch_in_even_light_shows_its_albedo(gpu, metallic, roughness):
    """Radiance is the same from everywhere, so a surface reflects it times its directional albedo.

    A patch before the wall of an integrating sphere; it takes 0.9 % of the light's directions.
    """
    scene = builtin("integrating-sphere", albedo=0.7, radius=2.0, flux=100.0)
    color, half, z = (0.8, 0.5, 0.3), 0.3, -1.8
    corners = np.array([(-half, -half, z), (half, -half, z), (half, half, z), (-half, half, z)])
    scene.add(polygons([corners]), material=Material(color, metallic=metallic, roughness=roughness))
    eye, target = np.array([0.9, 0.0, z + 1.2]), np.array([0.0, 0.0, z])
    camera = Camera(yfov=0.13, pose=look_at_pose(eye, target))
    frame, photons = render(gpu, scene, camera, photons=150_000, bounces=12)
    patch = frame.instance == 1  # the wall is 0
    assert patch.all()
    incident = 0.7 * (1 - 0.7**12) / 0.3 * 100 / (4 * math.pi**2 * 2.0**2)
    albedo, _ = integrate(surface(color, metallic, roughness), towards(1.2 / 1.5), 256, 256)
    found = frame.indirect[patch].mean(axis=0, dtype=float)
    # a quarter of the patch is in view; flux and gloss differ from photon to photon
    in_view = np.count_nonzero(photons["instance"] == 1) / 4
    assert in_view > 1000
    assert found == pytest.approx(albedo * incident, rel=4 * math.sqrt(2 / in_view) + 0.01)


def test_second_plane_lights_the_first(gpu):
    """Irradiance around the axis between two planes (method, V5), from a picture of the lower one."""
    height, gap, intensity, albedo = 1.0, 2.0, 10.0, 0.7
    scene = Scene()
    for name, y, turn in (("lower", 0.0, (0, 0, 0, 1)), ("upper", gap, (1, 0, 0, 0))):
        gray = lambert((albedo,) * 3)
        scene.add(plate(8.0, 0.0, name), material=gray, translation=(0, y, 0), rotation=turn)
    lit(scene, (0, height, 0), 4 * math.pi * intensity)
    half = 0.8
    camera = Camera(ymag=half, pose=look_at_pose(np.array([0.0, 0.8, 0.0]), np.zeros(3)))
    frame, photons = render(gpu, scene, camera, size=(90, 90), photons=400_000, bounces=1)
    nodes, weights = np.polynomial.legendre.leggauss(5)
    r = half * np.hypot(nodes[:, None], nodes)
    exact = [[bounced_irradiance(x, height, gap, intensity, albedo, 8.0) for x in row] for row in r]
    mean = weights @ np.array(exact) @ weights / 4
    near = (photons["instance"] == 0) & (np.abs(photons["position"][:, ::2]) < half).all(axis=1)
    # filter of reach h blurs by h^2 / 16 of the Laplacian: with h = 0.4 m under 1 %
    found = frame.irradiance[..., 0].mean(dtype=float)
    assert found == pytest.approx(mean, rel=4 / math.sqrt(near.sum()) + 0.01)


def test_color_bleeds_as_the_wall_is_colored(gpu):
    """Method, V6: after one bounce the colors of light are those of what it came from, exactly."""
    scene = Scene()
    scene.add(plate(3.0, 0.0, "lower"), material=lambert((0.5,) * 3))
    upper = lambert((0.9, 0.3, 0.1))
    scene.add(plate(3.0, 0.0, "upper"), material=upper, translation=(0, 2, 0), rotation=(1, 0, 0, 0))
    camera = Camera(ymag=1.0, pose=look_at_pose(np.array([0.0, 0.8, 0.0]), np.zeros(3)))
    frame, _ = render(gpu, lit(scene, (0, 1, 0)), camera, bounces=1)
    ratio = frame.irradiance / frame.irradiance[..., :1]
    assert ratio[..., 1] == pytest.approx(1 / 3, rel=1e-4)
    assert ratio[..., 2] == pytest.approx(1 / 9, rel=1e-4)
