"""Anything may move between frames: a light on a circle, a picture for each step."""

import math

import ispm

SIZE = (320, 180)
STEPS = 8

scene = ispm.builtin("cornell-box")
with ispm.Renderer(scene, ispm.Settings(size=SIZE, exposure="hold")) as renderer:
    for step in range(STEPS):
        angle = 2.0 * math.pi * step / STEPS
        scene["light"].translation = (2.78 + 1.5 * math.cos(angle), 4.5, 2.8 + 1.5 * math.sin(angle))
        frame = renderer.render()
        frame.save(f"light_{step}.png")
        print(f"step {step}: {frame.stats.total_ms:.0f} ms")
