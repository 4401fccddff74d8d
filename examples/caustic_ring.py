"""The caustic of a brass ring at three moments of its animation, and the photons that draw it."""

from PIL import Image

import ispm

SIZE = (640, 360)

scene = ispm.builtin("caustic-ring")
with ispm.Renderer(scene, ispm.Settings(size=SIZE, photons=200_000, exposure="hold")) as renderer:
    for moment in (0.0, 2.0, 6.0):
        renderer.scene = scene.at(moment)
        renderer.render().save(f"ring_{moment:.0f}s.png")
        Image.fromarray(renderer.view("photons")).save(f"ring_{moment:.0f}s_photons.png")
