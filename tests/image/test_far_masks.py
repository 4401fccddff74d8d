"""Masked surfaces so far away that a pixel holds many holes: as much of them is seen as there is."""

import math

import numpy as np
import pytest

from ispm import Camera, Material, Renderer, Scene, Settings, Texture, euler, shapes
from ispm.scene.material import AlphaMode

SIZE = 96, 64
TEXELS = 256  # along each side of a sheet that is as wide as 64 pixels


@pytest.mark.parametrize("antialias", [False, True])
@pytest.mark.parametrize("opaque", [0.3, 0.7])
def test_a_far_sheet_shows_its_share_of_holes(gpu, opaque, antialias):
    """Texels are opaque at random, 16 of them to a pixel, which takes one or four. The mean of 48 x 48 pixels
    is off by four times its deviation once in 16,000. By the opacity's mean over a pixel the sheet was gone,
    or without holes. Where edges are mixed a surface's samples take its light from the pixels about them,
    whose share of it is as even."""
    texels = np.ones((TEXELS, TEXELS, 4))
    texels[..., 3] = np.random.default_rng(5).random((TEXELS, TEXELS)) < opaque
    material = Material(
        (0.0, 0.0, 0.0, 1.0),
        base_color_texture=Texture(texels, linear=False),
        alpha_mode=AlphaMode.MASK,
        emission=(1.0, 1.0, 1.0),
        specular=0.0,
    )
    scene = Scene()
    scene.add(shapes.plane(2.0, 2.0), material=material, rotation=euler(90, 0, 0, degrees=True))
    camera = Camera(pose=Camera.look_at((0.0, 0.0, 5.0), (0.0, 0.0, 0.0)).pose, ymag=1.0)
    settings = Settings(size=SIZE, bounces=0, light="none", antialias=antialias)
    with Renderer(scene, settings, camera, gpu=gpu) as renderer:
        shown = renderer.render().radiance[8:56, 24:72, 1]
    assert abs(shown.mean() - opaque) < 4.0 * math.sqrt(opaque * (1.0 - opaque) / shown.size)
    if antialias:
        assert shown.std() < 0.75 * math.sqrt(opaque * (1.0 - opaque))
