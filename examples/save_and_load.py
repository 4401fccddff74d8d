"""A scene built in code, written as glTF, and read back: the same picture."""

import numpy as np

import ispm
from ispm import shapes

SIZE = (320, 240)

scene = ispm.Scene()
gray = ispm.Material((0.7, 0.7, 0.7))
scene.add(shapes.box((4.0, 0.1, 4.0)), material=gray, name="floor", translation=(0.0, -0.05, 0.0))
glass = ispm.Material(roughness=0.0, transmission=1.0, thickness=0.8, ior=1.5, name="glass")
scene.add(shapes.sphere(0.4), material=glass, name="ball", translation=(0.0, 0.41, 0.0))
scene.add(ispm.PointLight((40.0, 38.0, 34.0)), name="lamp", translation=(-1.0, 2.0, -0.5))
scene.add(ispm.Camera.look_at((0.6, 1.1, 2.4), (0.0, 0.3, 0.0)), name="camera")

before = ispm.render(scene, size=SIZE)
ispm.save(scene, "ball.glb")
after = ispm.render("ball.glb", size=SIZE)
after.save("ball.png")
print("the same picture:", np.array_equal(before.image, after.image))
