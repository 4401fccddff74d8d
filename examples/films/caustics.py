"""A light goes round the polished ring, and the caustic within it follows."""

import math

import ispm

SIZE = (320, 180)
FRAMES = 36
PASSES = 4

scene = ispm.builtin("caustic-ring")
scene.animations.clear()
x, y, z = -0.4, 0.3, 0.28  # so near that the backdrop is outside


def go_round(renderer: ispm.Renderer, seconds: float) -> None:
    """Once round in as long as the film lasts, so that it goes on without a cut."""
    angle = 2.0 * math.pi * 24.0 * seconds / FRAMES
    lamp, c, s = renderer.scene.lights[0], math.cos(angle), math.sin(angle)
    lamp.translation = (c * x + s * z, y, c * z - s * x)
    lamp.look_at((0.0, 0.02, 0.0))


settings = ispm.Settings(size=SIZE, passes=PASSES, exposure="hold")
film = ispm.Film(duration=FRAMES / 24)
sheet = "caustics.png"
ispm.animate(scene, "caustics.mp4", settings, film=film, change=go_round, contact_sheet=sheet)
