"""A dark corridor with two bends, lit by one, two, ... eight bounces: the light creeps round the corners."""

import ispm
from ispm import shapes

SIZE = (320, 180)
FRAMES = 48  # six for each number of bounces
PASSES = 4

white = ispm.Material((0.8, 0.78, 0.74), specular=0)
blue = ispm.Material((0.2, 0.35, 0.75), specular=0)
red = ispm.Material((0.75, 0.22, 0.12), specular=0)
scene = ispm.Scene(name="corridor")
for size, place, material in (
    ((8.0, 0.2, 10.0), (2.0, -0.1, 0.0), white),  # floor and ceiling
    ((8.0, 0.2, 10.0), (2.0, 2.6, 0.0), white),
    ((0.2, 2.5, 7.0), (-1.1, 1.25, 1.5), white),  # from the eye to the first bend
    ((0.2, 2.5, 5.0), (1.1, 1.25, 2.5), white),
    ((6.0, 2.5, 0.2), (1.9, 1.25, -2.1), blue),  # between the bends
    ((2.0, 2.5, 0.2), (2.1, 1.25, 0.1), white),
    ((0.2, 2.5, 4.4), (5.0, 1.25, 0.1), red),  # from the second bend to the lamp
    ((0.2, 2.5, 3.0), (3.0, 1.25, 1.6), white),
    ((2.2, 2.5, 0.2), (4.0, 1.25, 3.1), white),
    ((2.4, 2.5, 0.2), (0.0, 1.25, 5.0), white),
):
    scene.add(shapes.box(size), material=material, translation=place)
scene.add(shapes.sphere(0.35), material=white, translation=(0.4, 0.35, -1.0))
scene.add(ispm.PointLight((120, 105, 80)), translation=(4.0, 1.8, 2.4))


def bounces(renderer: ispm.Renderer, seconds: float) -> None:
    """One bounce more each quarter of a second."""
    renderer.settings = renderer.settings.replace(bounces=min(1 + int(4.0 * seconds + 1e-6), 8))


start, end = ((0.0, 1.6, 4.4), (0.1, 1.2, -2.0)), ((0.0, 1.6, 2.4), (0.3, 1.1, -2.0))
path = ispm.CameraPath([ispm.CameraKey(0, *start), ispm.CameraKey(2, *end)])
settings = ispm.Settings(size=SIZE, passes=PASSES, exposure=0.0)
film = ispm.Film(duration=FRAMES / 24)
sheet = "multi_bounce.png"
ispm.animate(scene, "multi_bounce.mp4", settings, film=film, camera=path, change=bounces, contact_sheet=sheet)
