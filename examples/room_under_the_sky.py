"""A room in the afternoon: the sun and the sky come in through one window, the rest is reflected light."""

import numpy as np

import ispm
from ispm import shapes

SIZE = (640, 360)
PASSES = 64

u, v = np.meshgrid(np.arange(512) / 512, np.arange(512) / 512)
board = np.floor(8 * u)
shade = 0.75 + 0.1 * np.sin(7.1 * board**2) + 0.06 * np.sin(90 * u + 9 * np.sin(5 * v + 3 * board))
oak = ispm.Material(base_color_texture=ispm.Texture(shade[..., None] * (0.62, 0.4, 0.23)), roughness=0.45)
colors = (0.72, 0.69, 0.63), (0.85,) * 3, (0.13, 0.25, 0.38), (0.55, 0.14, 0.08), (0.7, 0.66, 0.58)
wall, white, blue, red, linen = (ispm.Material(color, specular=0) for color in colors)
glazed = ispm.Material((0.75, 0.35, 0.08), roughness=0.15)
brass = ispm.Material((0.91, 0.74, 0.42), metallic=1, roughness=0.3)

scene = ispm.Scene(name="room under the sky")
scene.environment = ispm.Sky(sun_elevation=0.55, sun_azimuth=1.25, turbidity=2.5)
for size, place, material in (
    ((5.4, 0.2, 4.4), (2.5, -0.1, 2), oak), ((5.4, 0.2, 4.4), (2.5, 2.8, 2), white),
    ((0.2, 2.8, 4.4), (-0.1, 1.35, 2), wall), ((5.4, 2.8, 0.2), (2.5, 1.35, -0.1), wall),
    ((5.4, 2.8, 0.2), (2.5, 1.35, 4.1), wall), ((0.2, 2.8, 1.2), (5.1, 1.35, 0.4), wall),
    ((0.2, 2.8, 1.2), (5.1, 1.35, 3.6), wall), ((0.2, 0.8, 2.2), (5.1, 0.35, 2), wall),
    ((0.2, 0.5, 2.2), (5.1, 2.5, 2), wall), ((0.06, 1.6, 0.06), (5.08, 1.5, 2), white),
    ((0.06, 0.06, 2.1), (5.08, 1.5, 2), white), ((0.5, 0.05, 2.2), (4.9, 0.74, 2), white),
    ((1.9, 0.36, 0.85), (1.6, 0.2, 0.55), blue), ((1.9, 0.5, 0.22), (1.6, 0.5, 0.24), blue),
    ((0.5, 0.4, 0.14), (1.15, 0.58, 0.5), linen), ((1.0, 0.05, 0.6), (2.3, 0.4, 1.9), oak),
    ((0.06, 0.38, 0.5), (1.9, 0.19, 1.9), oak), ((0.06, 0.38, 0.5), (2.7, 0.19, 1.9), oak),
    ((2.6, 0.015, 1.9), (2.2, 0.0075, 1.8), linen), ((0.7, 0.9, 0.03), (1.6, 1.65, 0.01), red),
):  # fmt: skip
    scene.add(shapes.box(size), material=material, translation=place)
scene.add(shapes.sphere(0.13), material=brass, translation=(2.55, 0.555, 1.8))
scene.add(shapes.torus(0.14, 0.05), material=glazed, translation=(2.15, 0.475, 2.0))
camera = ispm.Camera.look_at(eye=(0.5, 1.5, 3.7), target=(2.9, 0.95, 1.0), yfov=0.95)
with ispm.Renderer(scene, ispm.Settings(size=SIZE, preset="best"), camera) as renderer:
    for frame in renderer.converge(PASSES):
        frame.save("room_under_the_sky.png")
