"""Mirrors and glass in pictures: what is seen in them is what stands before and behind them."""

import numpy as np
import pytest
from transport import render

from ispm.library.shapes import box, icosphere, polygons
from ispm.scene.camera import Camera
from ispm.scene.light import PointLight
from ispm.scene.material import Material
from ispm.scene.scene import Scene

SIZE = (160, 120)
EYE = Camera.look_at((0.1, 1.1, 1.9), (0.0, 0.9, 0.0), yfov=1.2)
MIRROR = Material((1.0,) * 3, metallic=1.0, roughness=0.0)


def lambert(*color):
    return Material(color, specular=0.0)


def half_room(scene, side):
    """A room from z = 0 to 2 `side`, open at z = 0, with a block, and its lamp."""
    x, y, z = 1.5, 2.0, 2.0 * side
    c = np.array([(a * x, b * y, d * z) for a in (-1, 1) for b in (0, 1) for d in (0, 1)])
    faces = {
        "left": ([0, 1, 3, 2], (0.7, 0.2, 0.2)), "right": ([4, 6, 7, 5], (0.2, 0.6, 0.2)),
        "floor": ([0, 4, 5, 1], (0.6,) * 3), "ceiling": ([2, 3, 7, 6], (0.6,) * 3),
        "back": ([1, 5, 7, 3], (0.3, 0.4, 0.8)),
    }  # fmt: skip
    for name, (corners, color) in faces.items():
        material = lambert(*color)
        material.double_sided = True
        scene.add(polygons([c[corners]]), material=material, name=name)
    block = box((-0.9, 0, -0.2), (-0.4, 0.8, 0.2))
    scene.add(block, material=lambert(0.8, 0.7, 0.2), translation=(0, 0, 0.7 * side))
    scene.add(PointLight((3.0,) * 3), translation=(0.5, 1.6, 1.2 * side))
    return scene


def mirror_room(material=MIRROR):
    """A half room closed at z = 0, by a mirror of reflectance 1."""
    scene = half_room(Scene(), 1.0)
    wall = np.array([(-1.5, 0, 0), (1.5, 0, 0), (1.5, 2, 0), (-1.5, 2, 0)], float)
    scene.add(polygons([wall]), material=material, name="mirror")
    return scene


def in_mirror(frame):
    shown = np.isin(frame.instance, frame.names.find("mirror"))
    assert 0.2 < shown.mean() < 0.9
    return shown


def test_direct_light_in_a_mirror_is_that_of_the_mirrored_room(gpu):
    scene = mirror_room()
    seen, _ = render(gpu, scene, EYE, size=SIZE, bounces=0, antialias=False)
    twin, _ = render(gpu, half_room(Scene(), -1.0), EYE, size=SIZE, bounces=0, antialias=False)
    shown = in_mirror(seen)
    # the picture without mirror keeps colors and normals as halves and filters its shadows over 3 texels
    error = np.abs(seen.direct - twin.direct)[shown] / (twin.direct[shown] + 0.02)
    assert np.quantile(error, 0.9) < 5e-3 and (error > 0.05).mean() < 0.05
    assert not seen.emission.any()


def test_photons_in_a_mirror_light_as_in_the_mirrored_room(gpu):
    """Both rooms and both lamps, against one of each and the mirror: mean light of parts of the picture.

    40,000 photons from each lamp, three seeds: parts differ by 2 % from seed to seed. Each pixel is a
    receiver: of 4 x 4 pixels a receiver, so small a picture loses 5 % at the foot of a wall.
    """
    scene = mirror_room()
    both = half_room(half_room(Scene(), 1.0), -1.0)

    def picture(scene):
        seeds = (render(gpu, scene, EYE, size=SIZE, seed=k, subsampling=1)[0] for k in range(3))
        return np.mean([frame.radiance for frame in seeds], axis=0)

    pictures = [picture(scene), picture(both)]
    shown = in_mirror(render(gpu, scene, EYE, size=SIZE, bounces=0)[0])
    ys, xs = np.nonzero(shown)
    for row in np.array_split(np.unique(ys), 3):
        for column in np.array_split(np.unique(xs), 3):
            part = np.zeros_like(shown)
            part[row[0] : row[-1] + 1, column[0] : column[-1] + 1] = True
            a, b = (picture[part & shown].mean(axis=0) for picture in pictures)
            assert a == pytest.approx(b, rel=0.05), (row[0], column[0])


def test_layers_of_a_mirror_s_pixels_are_its_own(gpu):
    """Depth, normal and ids do not look into the mirror."""
    clear, _ = render(gpu, mirror_room(), EYE, size=SIZE, bounces=0)
    dull = Material((1.0,) * 3, metallic=1.0, roughness=0.9)
    rough, _ = render(gpu, mirror_room(dull), EYE, size=SIZE, bounces=0)
    for name in ("depth", "normal", "instance", "material", "albedo", "alpha"):
        assert (clear[name] == rough[name]).all()


@pytest.mark.parametrize(
    "material",
    [
        MIRROR,
        Material((1,) * 3, roughness=0.0, transmission=1.0, thickness=1.0),
        Material((1,) * 3, roughness=0.0, transmission=1.0),
        Material((1,) * 3, roughness=0.5, transmission=1.0, thickness=1.0),
    ],
    ids=["mirror", "glass", "sheet", "frost"],
)
def test_a_ball_of_glass_or_silver_is_neither_black_nor_flat(gpu, material):
    scene = half_room(half_room(Scene(), 1.0), -1.0)
    scene.add(icosphere(0.4, 16), material=material, translation=(0.3, 0.9, 0.5), name="ball")
    frame, _ = render(gpu, scene, EYE, size=SIZE, photons=10000)
    ball = np.isin(frame.instance, frame.names.find("ball"))
    assert np.isfinite(frame.radiance).all()
    light = frame.radiance.mean(axis=-1)
    inside, around = light[ball], light[~ball]
    assert ball.sum() > 300 and inside.mean() > 0.4 * around.mean()
    # little of it is dark, and it shows more than one thing
    assert (inside < 0.1 * around.mean()).mean() < 0.1
    assert inside.std() > 0.05 * inside.mean()


def test_edges_in_a_mirror_are_as_smooth_as_others(gpu):
    """A slanted white square in a mirror, against the same picture with 36 samples a pixel."""
    scene = Scene()
    wall = np.array([(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], float)
    scene.add(polygons([wall]), material=MIRROR)
    square = np.array([(-0.4, 1.1, 1.5), (-0.3, 2.2, 1.5), (0.7, 2.1, 1.5), (0.6, 1.0, 1.5)])
    scene.add(polygons([square]), material=Material((1.0,) * 3, unlit=True))
    scene.add(PointLight((1.0,) * 3), translation=(0, 0, 5))
    eye = Camera.look_at((0.0, 1.0, 1.6), (0.0, 0.9, 0.0), yfov=1.0)
    many = render(gpu, scene, eye, size=(480, 360), bounces=0, antialias=False)[0].emission[..., 0]
    truth = many.reshape(60, 6, 80, 6).mean(axis=(1, 3))
    errors = [
        np.abs(render(gpu, scene, eye, size=(80, 60), bounces=0, antialias=on)[0].emission[..., 0] - truth)
        for on in (False, True)
    ]
    assert 0.05 < truth.mean() < 0.9 and errors[0].max() > 0.3
    # four samples tell shares of a quarter
    assert errors[1].max() < 0.3 and errors[1].sum() < 0.4 * errors[0].sum()
