"""Textures of metal and of paint keep their colors from afar, where a pixel shows many texels."""

import math

import numpy as np
from transport import Tracer, render

from ispm import shapes
from ispm.reference.paths import path_light
from ispm.scene.camera import Camera
from ispm.scene.light import DirectionalLight
from ispm.scene.material import Material, Texture
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView

SIZE = 96, 64
WINDOW = np.s_[16:48, 24:72]
PAINT, METAL, STRIPES = 0.03, 0.9, 8  # one of so many columns is metal
SUN, TOWARD = 10.0, (0.5, 2.0, 2.0)  # lux, from there


def striped_panel():
    """A panel of dark paint with thin strips of metal in the sun."""
    color, data = np.zeros((2, 512, 512, 3), np.float32)
    color[:], data[..., 1] = PAINT, 0.3
    color[:, ::STRIPES] = METAL
    data[:, ::STRIPES, 2] = 1.0
    scene = Scene()
    material = Material(
        (1.0, 1.0, 1.0),
        metallic=1.0,
        roughness=1.0,
        base_color_texture=Texture(color),
        metallic_roughness_texture=Texture(data, srgb=False),
    )
    scene.add(shapes.plane(4, 4), material=material)
    sun = scene.add(DirectionalLight((SUN,) * 3), translation=TOWARD)
    sun.look_at((0.0, 0.0, 0.0))
    return scene, Camera.look_at((0.0, 3.0, 1.5), (0.0, 0.0, 0.0), yfov=math.radians(30))


def test_metal_strips_on_paint_keep_their_color_from_afar(gpu):
    """Off the sun's mirrored direction, as paths see it by each texel: within what the paint's own reflection
    of .04 lacks where much of its area counts as metal, half a byte of metalness in each of seven levels, and
    4 standard errors."""
    scene, camera = striped_panel()
    frames = [render(gpu, scene, camera, size=SIZE, seed=seed)[0] for seed in range(4)]
    ours = np.array([frame.radiance[WINDOW].mean() for frame in frames])
    tracer, view = Tracer(scene, footprint=1e-6), CameraView(SIZE, camera.pose, camera.yfov, None)
    truths, random = [], np.random.default_rng(1)
    y, x = (each[WINDOW].ravel() for each in np.indices(SIZE[::-1]))
    for part in range(64):
        dx, dy = random.random((2, len(x)))
        rays = view.rays_through(x + dx, y + dy)
        light = path_light(tracer.tables, *rays, samples=range(part, part + 1), bounces=8, threads=2)
        truths.append(light.mean())
    truth = np.mean(truths)
    noise = math.hypot(*(np.std(each, ddof=1) / math.sqrt(len(each)) for each in (ours, truths)))
    metal, paint = METAL / STRIPES, PAINT * (STRIPES - 1) / STRIPES
    irradiance = SUN * TOWARD[1] / math.hypot(*TOWARD)
    f0, shown = metal + 0.04 * (STRIPES - 1) / STRIPES, metal + 0.04 * paint / (metal + paint)
    lacks = (1 - shown / f0) * (truth - paint * irradiance / math.pi)
    rounding = 7 * 0.5 / 255 * (metal + paint) * irradiance / math.pi
    assert abs(ours.mean() - truth) < lacks + rounding + 4 * noise
