"""A red box moves through a white room, and what is near it turns red."""

import numpy as np

import ispm
from ispm import shapes

SIZE = (320, 180)
FRAMES = 36
PASSES = 4

white = ispm.Material((0.8, 0.8, 0.8), specular=0)
red = ispm.Material((0.8, 0.05, 0.03), specular=0)
scene = ispm.Scene(name="white room")
for size, place in (
    ((6.0, 0.2, 4.0), (0.0, -0.1, 0.0)),
    ((6.0, 0.2, 4.0), (0.0, 2.9, 0.0)),
    ((6.0, 2.8, 0.2), (0.0, 1.4, -2.1)),
    ((0.2, 2.8, 4.0), (-3.1, 1.4, 0.0)),
    ((0.2, 2.8, 4.0), (3.1, 1.4, 0.0)),
):
    scene.add(shapes.box(size), material=white, translation=place)
for x in (-1.2, 1.2):
    scene.add(shapes.cylinder(0.25, 2.8), material=white, translation=(x, 1.4, -1.2))
box = scene.add(shapes.box((1.1, 1.6, 1.1)), material=red, name="box")
lamp = ispm.RectLight((30, 29, 27), width=2.4, height=0.8)
scene.add(lamp, translation=(0, 2.79, 0.9)).look_at((0, 0, 0.901))

times = np.array([0.0, 1.0, 2.0])
places = np.array([(-2.3, 0.8, -0.3), (0.0, 0.8, -0.6), (2.3, 0.8, -0.3)])
scene.animations.append(ispm.Animation([ispm.Channel(box, "translation", times, places)], "through"))

camera = ispm.Camera.look_at((0.0, 1.5, 5.2), (0.0, 1.35, 0.0), yfov=0.62)
settings = ispm.Settings(size=SIZE, passes=PASSES, exposure="hold")
film = ispm.Film(duration=FRAMES / 24)
sheet = "interreflection.png"
ispm.animate(scene, "interreflection.mp4", settings, film=film, camera=camera, contact_sheet=sheet)
