"""Pictures with their truth, to learn from: color, depth, normals and ids of balls at random places."""

import numpy as np

import ispm
from ispm.scene.shapes import icosphere

SIZE = (320, 240)
PICTURES = 4

random = np.random.default_rng(0)
for number in range(PICTURES):
    scene = ispm.builtin("cornell-box")
    for k in range(5):
        radius = random.uniform(0.2, 0.5)
        place = (random.uniform(0.6, 5.0), radius, random.uniform(0.6, 2.0))
        color = ispm.Material(tuple(random.uniform(0.1, 0.9, 3)), roughness=random.uniform(0.3, 1.0))
        scene.add(icosphere(radius, 12), material=color, name=f"ball {k}", translation=place)
    frame = ispm.render(scene, size=SIZE, photons=20_000, seed=number)
    frame.save(f"{number:04d}.png")
    frame.save(f"{number:04d}.npz", layers=["full", "depth", "normal", "instance", "albedo"])
    balls = [i for i, node in enumerate(scene.nodes) if node.name.startswith("ball")]
    print(f"{number:04d}: balls cover {np.isin(frame.instance, balls).mean():.0%} of the picture")
