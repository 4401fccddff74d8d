"""Pictures with their truth, to learn from: color, depth, normals and ids of balls at random places."""

import numpy as np

import ispm
from ispm.scene.shapes import icosphere

SIZE = (320, 240)
PICTURES = 4

random = np.random.default_rng(0)
scene = ispm.builtin("cornell-box")
balls = [scene.add(icosphere(1.0, 12), name=f"ball {k}") for k in range(5)]
shown = [scene.nodes.index(ball) for ball in balls]
# exposure "hold": all pictures are as bright as the first one's asks for
settings = ispm.Settings(size=SIZE, photons=20_000, exposure="hold")
with ispm.Renderer(scene, settings) as renderer:
    for number in range(PICTURES):
        for ball in balls:
            radius = random.uniform(0.2, 0.5)
            ball.scale = (radius,) * 3
            ball.translation = (random.uniform(0.6, 5.0), radius, random.uniform(0.6, 2.0))
            color = tuple(random.uniform(0.1, 0.9, 3))
            ball.parts[0].material = ispm.Material(color, roughness=random.uniform(0.3, 1.0))
        renderer.settings = settings.replace(seed=number)
        frame = renderer.render()
        frame.save(f"{number:04d}.png")
        frame.save(f"{number:04d}.npz", layers=["full", "depth", "normal", "instance", "albedo"])
        print(f"{number:04d}: balls cover {np.isin(frame.instance, shown).mean():.0%} of the picture")
