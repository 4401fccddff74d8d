"""Textures of specular reflection in pictures: as bright as the factors that they stand for."""

import numpy as np
import pytest
from transport import render

from ispm.library.shapes import box, icosphere, polygons
from ispm.scene.camera import Camera
from ispm.scene.color import linear
from ispm.scene.light import PointLight, RectLight
from ispm.scene.material import Material, Texture
from ispm.scene.scene import Scene

COLOR, FACTOR = (230, 120, 60), 140  # bytes of the textures


def room(lamp, material):
    """A corner with a ball and, between it and the lamp, a sheet, all of one material."""
    scene = Scene()
    for corners in (
        [(-2, 0, -2), (-2, 0, 2), (2, 0, 2), (2, 0, -2)],
        [(-2, 0, -2), (2, 0, -2), (2, 3, -2), (-2, 3, -2)],
    ):
        mesh = polygons([np.array(corners, float)], "wall")
        mesh.uv0 = np.zeros((len(mesh.positions), 2), np.float32)
        scene.add(mesh, material=material)
    for mesh, place in (
        (icosphere(0.6, 8), (-0.5, 0.6, 0.0)),
        (box((0, 0, 0), (0.8, 0.02, 0.8)), (0.2, 1.0, 0)),
    ):
        mesh.uv0 = np.zeros((len(mesh.positions), 2), np.float32)
        scene.add(mesh, material=material, translation=place)
    scene.add(lamp, translation=(0.5, 2.5, 0.5), rotation=(-(0.5**0.5), 0, 0, 0.5**0.5))
    return scene


@pytest.mark.parametrize(
    "more",
    [
        dict(roughness=0.8),
        dict(roughness=0.3),
        dict(roughness=0.0),
        dict(roughness=0.0, transmission=0.8, double_sided=True),
    ],
    ids=["wide", "narrow", "mirror", "sheets"],
)
@pytest.mark.parametrize(
    "lamp", [PointLight((30.0,) * 3), RectLight((30.0,) * 3, 0.5, 0.5)], ids=["point", "rect"]
)
def test_a_picture_is_that_of_the_factors(gpu, more, lamp):
    """Random numbers are the same, and the texture's bytes are those that the G-buffer holds; what chances
    decide may turn by rounding, once in 500 pixels."""
    r, g, b = (float(c) for c in 20.0 * linear(np.array(COLOR) / 255.0))
    plain = Material((0.3, 0.4, 0.5), specular=0.9 * FACTOR / 255, specular_color=(r, g, b), **more)
    picture = Texture(np.full((2, 2, 4), (*COLOR, FACTOR), np.uint8))
    maps = dict(specular_texture=picture, specular_color_texture=picture)
    mapped = Material((0.3, 0.4, 0.5), specular=0.9, specular_color=(20.0,) * 3, **maps, **more)
    camera = Camera.look_at((0.5, 1.5, 4.0), (0.0, 0.8, 0.0), yfov=0.7)
    options = dict(size=(48, 32), photons=20_000, antialias=False)
    one, other = (render(gpu, room(lamp, m), camera, **options)[0] for m in (plain, mapped))
    for name in ("direct", "indirect"):
        a, b = getattr(one, name), getattr(other, name)
        off = np.abs(a - b).max(axis=-1) > 1e-4 * a.mean() + 2e-3 * a.max(axis=-1)
        assert off.mean() < 2e-3, name
        assert a.mean() > 0.0
    bare = render(gpu, room(lamp, Material((0.3, 0.4, 0.5), specular=0.9, **more)), camera, **options)[0]
    assert np.abs(bare.radiance - other.radiance).mean() > 0.02 * bare.radiance.mean()
