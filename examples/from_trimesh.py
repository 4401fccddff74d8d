"""A mesh made by trimesh, in a scene built from nothing. Needs `pip install trimesh`."""

import math

import trimesh

import ispm

SIZE = (480, 360)

capsule = trimesh.creation.capsule(height=0.6, radius=0.25)  # along z
floor = trimesh.creation.box(extents=(4.0, 4.0, 0.1))

scene = ispm.Scene()
red = ispm.Material((0.7, 0.1, 0.08), roughness=0.4)
upright = ispm.euler(x=-math.pi / 2)  # z to y
scene.add(ispm.Mesh.from_trimesh(capsule), material=red, translation=(0.0, 0.25, 0.0), rotation=upright)
scene.add(ispm.Mesh.from_trimesh(floor), translation=(0.0, -0.05, 0.0), rotation=upright)
scene.add(ispm.PointLight((60.0, 55.0, 45.0)), name="lamp", translation=(1.2, 2.0, 1.0))

camera = ispm.Camera.look_at(eye=(1.2, 1.0, 2.2), target=(0.0, 0.5, 0.0))
ispm.render(scene, camera=camera, size=SIZE).save("from_trimesh.png")
