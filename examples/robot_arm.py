"""A robot arm that code moves, shown live: joints are nodes. `--frames N` ends it, or Ctrl-C."""

import argparse
import contextlib
import math
import time

import ispm
from ispm import shapes

SIZE = (640, 360)

parser = argparse.ArgumentParser()
parser.add_argument("--frames", type=int, default=0)
frames = parser.parse_args().frames

steel = ispm.Material(base_color=(0.7, 0.7, 0.72), metallic=1.0, roughness=0.4)
scene = ispm.builtin("cornell-box")
for name in ("short block", "tall block"):
    scene.remove(name)
joints: list[ispm.Node] = []
place = (2.8, 0.2, 2.8)
for length in (1.7, 1.4, 0.8):
    carries = joints[-1] if joints else None
    joint = scene.add(shapes.sphere(0.25), material=steel, translation=place, parent=carries)
    scene.add(shapes.box((0.3, length, 0.3)), material=steel, translation=(0, length / 2, 0), parent=joint)
    joints, place = [*joints, joint], (0.0, length, 0.0)
times: list[float] = []  # of frames, ms
settings = ispm.Settings(preset="live", size=SIZE)
with (
    ispm.view(scene, settings, block=False, on_frame=lambda f: times.append(f.stats.total_ms)) as viewer,
    contextlib.suppress(KeyboardInterrupt),
):
    while not frames or len(times) < frames:
        with viewer.editing():  # what moves together shows together
            for k, joint in enumerate(joints):
                joint.rotation = ispm.euler(z=0.6 * math.sin(0.7 * (k + 1) * time.monotonic()))
        time.sleep(1 / 60)
    if viewer.frame is not None:
        viewer.frame.save("robot_arm.png")
