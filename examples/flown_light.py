"""A light flown by a script, shown live: it circles, and its color goes round with it.

python flown_light.py [--frames N]    ends after N pictures, or with Ctrl-C
"""

import argparse
import contextlib
import math
import time

import ispm

SIZE = (640, 360)

parser = argparse.ArgumentParser()
parser.add_argument("--frames", type=int, default=0)
frames = parser.parse_args().frames

scene = ispm.builtin("caustic-ring")
lamp = scene.lights[0]
x, y, z = lamp.translation
assert lamp.light is not None
strength = max(lamp.light.intensity)

times: list[float] = []  # of frames, ms
settings = ispm.Settings(preset="live", size=SIZE)
with (
    ispm.view(scene, settings, block=False, on_frame=lambda f: times.append(f.stats.total_ms)) as viewer,
    contextlib.suppress(KeyboardInterrupt),
):
    while not frames or len(times) < frames:
        angle = time.monotonic()
        with viewer.editing():
            lamp.translation = (x + 0.5 * math.cos(angle), y, z + 0.5 * math.sin(angle))
            red, green, blue = (strength * (0.8 + 0.2 * math.cos(angle + k)) for k in range(3))
            lamp.light.intensity = (red, green, blue)
        time.sleep(1 / 60)
    if viewer.frame is not None:
        viewer.frame.save("flown_light.png")
    print(f"{len(times)} frames, the last in {times[-1]:.0f} ms")
