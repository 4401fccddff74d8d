"""The parts of a picture: files with all layers, and arithmetic on them."""

import numpy as np

import ispm

SIZE = (640, 360)

frame = ispm.render("cornell-box", size=SIZE)
frame.save("layers.exr")  # beauty, direct, indirect, depth, normals, ids, ...
frame.save("layers.npz", layers=["full", "direct", "indirect", "depth"])

assert np.array_equal(frame.radiance, (frame.direct + frame.indirect) + frame.emission)
share = frame.indirect.sum() / frame.radiance.sum()
print(f"{share:.0%} of the light is indirect; the nearest thing is {frame.depth.min():.2f} m away")
for view in ("direct", "indirect", "ambient", "normal", "depth"):
    frame.save(f"layers_{view}.png", show=view)
