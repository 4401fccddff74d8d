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

checks = ispm.Material(base_color_texture=ispm.Texture(stripes), roughness=0.5)
oak = ispm.Material(base_color_texture=ispm.Texture(wood), roughness=0.5)

scene = ispm.Scene(name="still life")
scene.add(shapes.plane(6, 6), material=oak)
scene.add(shapes.sphere(0.4), material=checks, translation=(-1.1, 0.4, 0.1))
scene.add(shapes.cylinder(0.3, 0.8), material=checks, translation=(-0.1, 0.4, -0.5))
scene.add(shapes.cone(0.35, 0.9), material=checks, translation=(0.8, 0.45, -0.2))
scene.add(shapes.torus(0.35, 0.12), material=oak, translation=(0.2, 0.12, 0.6))
turned = ispm.euler(y=math.radians(30))
scene.add(shapes.box(0.6), material=oak, translation=(1.5, 0.3, 0.5), rotation=turned)
scene.add(ispm.SpotLight((260, 240, 210)), translation=(-2, 3.5, 2.5)).look_at((0.2, 0.3, 0))
scene.add(ispm.PointLight((6, 8, 12)), translation=(3, 2, 3))

camera = ispm.Camera.look_at(eye=(0.2, 1.6, 3.6), target=(0.2, 0.3, 0.0), yfov=math.radians(42))
frame = ispm.render(scene, camera=camera, size=SIZE)
frame.save("still_life.png")
frame.show()
