"""A robot arm that code moves, shown live: each joint is a node, and what it carries moves along.

python robot_arm.py [--frames N]    ends after N pictures, or with Ctrl-C
"""

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
joints, carries, place = [], None, (2.8, 0.2, 2.8)
for length in (1.7, 1.4, 0.8):
    joint = scene.add(shapes.sphere(0.25), material=steel, translation=place, parent=carries)
    limb = {"translation": (0, length / 2, 0), "scale": (0.3, length, 0.3)}
    scene.add(shapes.box(1.0), material=steel, parent=joint, **limb)
    joints, carries, place = [*joints, joint], joint, (0, length, 0)

times = []  # of frames, ms
settings = ispm.Settings(preset="live", size=SIZE)
calls = dict(on_frame=lambda frame: times.append(frame.stats.total_ms), on_pick=print)
with ispm.view(scene, settings, block=False, **calls) as viewer, contextlib.suppress(KeyboardInterrupt):
    while not frames or len(times) < frames:
        with viewer.editing():  # what moves together shows together
            for k, joint in enumerate(joints):
                joint.rotation = ispm.euler(z=0.6 * math.sin(0.7 * (k + 1) * time.monotonic()))
        time.sleep(1 / 60)
    viewer.frame.save("robot_arm.png")
