"""Sheen in pictures: what it makes of lights, and as bright as slow paths find it."""

import math

import numpy as np
import pytest
from layered import assert_as_bright_as_paths, floor, lit_floor
from transport import render

from ispm.library.shapes import icosphere
from ispm.optics.jit import jit
from ispm.optics.sheen import eval_sheen, sheen_albedo
from ispm.scene.camera import Camera
from ispm.scene.environment import Environment
from ispm.scene.material import Material, Texture
from ispm.scene.scene import Scene

f32 = np.float32
UP = f32(0), f32(1), f32(0)


@jit
def lobes(roughness, wo, wi, f, albedo):
    for i in range(len(wo)):
        o, w = (wo[i, 0], wo[i, 1], wo[i, 2]), (wi[i, 0], wi[i, 1], wi[i, 2])
        s = math.sqrt((o[0] + w[0]) ** 2 + (o[1] + w[1]) ** 2 + (o[2] + w[2]) ** 2)
        h = f32((o[0] + w[0]) / s), f32((o[1] + w[1]) / s), f32((o[2] + w[2]) / s)
        f[i], albedo[i] = eval_sheen(roughness, UP, o, w, h), sheen_albedo(roughness, o[1])


@pytest.mark.parametrize("mapped", [False, True])
def test_a_picture_of_a_floor_with_sheen_is_the_formula(gpu, mapped):
    """Direct light of a matte floor under sheen, by factors or by textures that stand for them; 1 % of the
    brightest, which pixels' halves and normals round."""
    color, roughness = np.array([1.0, 0.5, 0.25]), 0.45
    look = dict(sheen_color=tuple(color), sheen_roughness=roughness)
    if mapped:
        color, roughness = np.array([1.0, 0.0, 0.2]), 0.9 * 102 / 255
        picture = Texture(np.full((1, 1, 4), (255, 0, 255, 102), np.uint8))
        look = dict(sheen_color=(1.0, 0.7, 0.2), sheen_roughness=0.9)
        look |= dict(sheen_color_texture=picture, sheen_roughness_texture=picture)
    scene = floor(Material((0.4,) * 3, specular=0.0, **look), uv=0.5)
    frame, places, wo, wi, irradiance = lit_floor(gpu, scene, (0.5, 2.0, -0.5))
    f, albedo = np.zeros((2, len(places)), f32)
    lobes(f32(roughness), wo.astype(f32), wi.astype(f32), f, albedo)
    base = (1.0 - color.max() * albedo) * 0.4 / math.pi
    expected = (base[:, None] + f[:, None] * color) * irradiance[:, None]
    assert (f * irradiance).max() > 0.1 * expected.max()
    near = np.abs(places).max(axis=1) < 9.0  # on the floor
    found = frame.direct.reshape(-1, 3)[near]
    np.testing.assert_allclose(found, expected[near], rtol=2e-3, atol=1e-2 * expected.max())


def test_a_white_ball_with_sheen_in_even_light_is_white(gpu):
    """What sheen hides it reflects: radiance 1 all over, but for the filter of light by few directions."""
    scene = Scene()
    material = Material((1.0,) * 3, specular=0.0, sheen_color=(1.0,) * 3, sheen_roughness=0.6)
    scene.add(icosphere(1.0, 24, "ball"), material=material, name="ball")
    scene.environment = Environment(np.ones((4, 8, 3), f32))
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), yfov=0.6)
    frame, _ = render(gpu, scene, camera, size=(48, 48), antialias=False, passes=4)
    shown = np.isfinite(frame.depth)
    radiance = frame.radiance[shown]
    error = radiance.std(axis=0) / math.sqrt(len(radiance))
    assert (np.abs(radiance.mean(axis=0) - 1.0) < 4.0 * error + 4e-3).all()


@pytest.mark.parametrize(
    "look",
    [
        dict(base_color=(0.5, 0.1, 0.1), sheen_color=(0.9, 0.6, 0.3), sheen_roughness=0.5),
        dict(base_color=(0.02,) * 3, specular=0.0, sheen_color=(0.8,) * 3, sheen_roughness=1.0),
        dict(base_color=(0.6, 0.3, 0.2), sheen_color=(0.5,) * 3, sheen_roughness=0.3, clearcoat=0.8),
        dict(base_color=(0.9,) * 3, metallic=1.0, roughness=0.0, sheen_color=(0.7,) * 3, sheen_roughness=0.7),
    ],
    ids=["velvet", "black", "coated", "mirror"],
)
def test_a_ball_with_sheen_is_as_bright_as_paths_find_it(gpu, look):
    assert_as_bright_as_paths(gpu, Material(**look), samples=256)
