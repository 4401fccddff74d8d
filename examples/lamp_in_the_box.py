"""The Cornell box with a lamp in its ceiling, a ball of glass and one of rough gold."""

import ispm
from ispm import shapes

SIZE = (640, 360)
PASSES = 64

scene = ispm.builtin("cornell-box")
for gone in ("light", "tall block", "short block"):
    scene.roots.remove(scene[gone])
lamp = ispm.RectLight((21, 17, 11), width=1.3, height=1.05, name="lamp")
scene.add(lamp, translation=(2.78, 5.47, 2.8)).look_at((2.78, 0, 2.801))

glass = ispm.Material(transmission=1, thickness=1, roughness=0, ior=1.5)
gold = ispm.Material((1.0, 0.77, 0.34), metallic=1, roughness=0.35)
white = ispm.Material((0.73, 0.73, 0.73), specular=0)
scene.add(shapes.sphere(0.95, segments=128, rings=64), material=glass, translation=(1.75, 0.97, 1.7))
turned = ispm.euler(y=0.3)
scene.add(shapes.box((1.65, 1.3, 1.65)), material=white, translation=(3.75, 0.64, 3.4), rotation=turned)
scene.add(shapes.sphere(0.85, segments=128, rings=64), material=gold, translation=(3.75, 2.14, 3.4))

camera = ispm.Camera.look_at(eye=(2.78, 2.75, -5.2), target=(2.78, 2.6, 2.8), yfov=0.8)
settings = ispm.Settings(size=SIZE)
with ispm.Renderer(scene, settings, camera) as renderer:
    for frame in renderer.converge(PASSES):
        frame.save("lamp_in_the_box.png")
