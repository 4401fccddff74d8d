"""Direct light of the studio on plastic, in one pass, against the integral over all directions."""

import math

import numpy as np
from rgbe import seen_along

from ispm.library.shapes import polygons
from ispm.library.studio_light import studio_radiance
from ispm.renderer.renderer import Renderer
from ispm.scene.camera import Camera, look_at_pose
from ispm.scene.environment import Environment
from ispm.scene.material import Material
from ispm.scene.rotation import quaternion
from ispm.scene.scene import Scene
from ispm.settings import Settings

SIZE, SEEDS = (128, 72), 8
ALBEDO, ALPHA, F0 = 0.3, 0.64, 0.04
EYE = np.array([0.0, 2.0, 4.0])


def integral(n, wo):
    """Radiance along wo by the midpoints of 400 x 800 parts of the sphere, glTF 2.0, appendix B."""
    theta = math.pi * (np.arange(400) + 0.5) / 400
    phi = 2.0 * math.pi * (np.arange(800) + 0.5) / 800
    sine = np.sin(theta)[:, None]
    wi = np.stack(
        [sine * np.cos(phi), np.repeat(np.cos(theta)[:, None], 800, 1), sine * np.sin(phi)], axis=-1
    )
    light = seen_along(studio_radiance(), wi, 0.0)[..., 0] * sine * (math.pi / 400) * (2.0 * math.pi / 800)
    nl, nv = wi @ n, float(wo @ n)
    up = nl > 0.0
    wi, nl, light = wi[up], nl[up], light[up]
    h = wi + wo
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    a2 = ALPHA**2
    d = a2 / (math.pi * ((h @ n) ** 2 * (a2 - 1.0) + 1.0) ** 2)
    v = 0.5 / (nl * math.sqrt(nv**2 * (1.0 - a2) + a2) + nv * np.sqrt(nl**2 * (1.0 - a2) + a2))
    f = F0 + (1.0 - F0) * (1.0 - h @ wo) ** 5
    return float(((ALBEDO / math.pi * (1.0 - f) + d * v * f) * nl * light).sum())


def test_one_pass_of_plastic_is_as_bright_as_the_integral(gpu):
    """Where nothing shades, from one direction: the mean of 8 pictures of a plane is within 3.5 standard
    errors (of 8, by chance exceeded in one of 100), and 0.5 %: a ratio of means of 16 draws is biased by a
    sixteenth of what that of one is, 4 %."""
    scene = Scene(environment=Environment(studio_radiance()))
    n = np.array([0.0, 1.0, 0.0])
    corners = np.array([(-9, 0, -9), (-9, 0, 9), (9, 0, 9), (9, 0, -9)], float)
    scene.add(polygons([corners]), material=Material((ALBEDO,) * 3, roughness=math.sqrt(ALPHA)))
    turn = quaternion(look_at_pose(EYE, np.zeros(3))[:3, :3])
    scene.add(Camera(ymag=0.5), translation=tuple(EYE.tolist()), rotation=turn)
    means = []
    for seed in range(SEEDS):
        settings = Settings(size=SIZE, bounces=0, seed=seed, antialias=False)
        with Renderer(scene, settings, gpu=gpu) as renderer:
            means.append(float(renderer.render().radiance.mean()))
    error = np.std(means, ddof=1) / math.sqrt(SEEDS)
    exact = integral(n, EYE / np.linalg.norm(EYE))
    assert error < 0.005 * exact
    assert abs(np.mean(means) - exact) < 0.005 * exact + 3.5 * error, (np.mean(means) / exact, error / exact)
