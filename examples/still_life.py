"""Shapes with textures made by numpy, placed by Euler angles, lit by a lamp that looks at them."""

import math

import numpy as np

import ispm
from ispm import shapes

SIZE = (640, 360)

u, v = np.meshgrid(np.linspace(0, 1, 512, endpoint=False), np.linspace(0, 1, 256, endpoint=False))
stripes = np.where((np.floor(12 * u) + np.floor(6 * v)) % 2, 0.75, 0.2)  # gray, linear
rings = 0.5 + 0.25 * np.sin(40 * np.hypot(u - 0.5, v - 0.5) + 3 * np.sin(9 * v))
wood = rings[..., None] * (0.9, 0.55, 0.3)  # RGB

scene = ispm.Scene(name="still life")


def put(mesh: ispm.Mesh, picture: np.ndarray, **place: tuple[float, ...]) -> ispm.Node:
    material = ispm.Material(base_color_texture=ispm.Texture(picture), roughness=0.5)
    return scene.add(mesh, material=material, **place)


put(shapes.plane(6, 6), wood)
put(shapes.sphere(0.4), stripes, translation=(-1.1, 0.4, 0.1))
put(shapes.cylinder(0.3, 0.8), stripes, translation=(-0.1, 0.4, -0.5), rotation=ispm.euler(y=0.5))
put(shapes.cone(0.35, 0.9), stripes, translation=(0.8, 0.45, -0.2))
put(shapes.torus(0.35, 0.12), wood, translation=(0.2, 0.12, 0.6))
put(shapes.box(0.6), wood, translation=(1.5, 0.3, 0.5), rotation=ispm.euler(y=math.radians(30)))
scene.add(ispm.SpotLight((260, 240, 210)), translation=(-2, 3.5, 2.5)).look_at((0.2, 0.3, 0))
scene.add(ispm.PointLight((6, 8, 12)), translation=(3, 2, 3))

camera = ispm.Camera.look_at(eye=(0.2, 1.6, 3.6), target=(0.2, 0.3, 0.0), yfov=math.radians(42))
frame = ispm.render(scene, camera=camera, size=SIZE)
frame.save("still_life.png")
frame.show()
