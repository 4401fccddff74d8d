"""A built-in scene, rendered and saved."""

import ispm

SIZE = (640, 360)

frame = ispm.render("cornell-box", size=SIZE, photons=100_000)
frame.save("first_picture.png")
print(f"{frame.stats.stored_photons} photons in {frame.stats.total_ms:.0f} ms")
