"""Pictures with their truth, to learn from: color, depth, normals, ids with their names, and the camera."""

import json

import numpy as np

import ispm

SIZE = (320, 240)
PICTURES = 4

random = np.random.default_rng(0)
scene = ispm.builtin("cornell-box")
balls = [scene.add(ispm.shapes.sphere(1.0), name=f"ball {k}") for k in range(5)]
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

        K, pose = renderer.camera.intrinsics(SIZE), renderer.camera.extrinsics("opencv")
        with open(f"{number:04d}.json", "w") as file:
            json.dump({"K": K.tolist(), "camera_to_world": pose.tolist()}, file)
        seen = np.isin(frame.instance, frame.names.find("ball *"))
        print(f"{number:04d}: balls cover {seen.mean():.0%} of the picture")

ids, names = np.load("0000.npz")["instance"], ispm.read_names("0000.npz")  # a file knows its names
print("in the first:", ", ".join(sorted({names[k].name for k in np.unique(ids[ids >= 0])})))
