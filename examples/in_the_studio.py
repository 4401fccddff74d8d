"""Turned things for sale, lit by the studio: a flask of brushed steel, a glazed cup, a copper tin."""

import numpy as np

import ispm

SIZE = (640, 360)
PASSES = 64

scene = ispm.Scene(name="in the studio")


def turned(profile: list[tuple[float, float]], bevel: float = 0.004, sides: int = 160) -> ispm.Mesh:
    """A profile of radius and height, from the axis below to that on top, turned; its corners are round."""
    points, smooth = np.array(profile), []
    for a, b, c in zip(points[:-2], points[1:-1], points[2:], strict=True):
        ends = [b + (e - b) * min(bevel / np.hypot(*(e - b)), 0.4) for e in (a, c)]
        smooth += [
            (1 - t) ** 2 * ends[0] + 2 * t * (1 - t) * b + t**2 * ends[1] for t in np.linspace(0, 1, 7)
        ]
    rows = np.array([points[0], *smooth, points[-1]])
    angle = np.linspace(0, 2 * np.pi, sides + 1)
    around = np.stack([np.cos(angle), np.ones(sides + 1), np.sin(angle)], axis=1)
    k = (np.arange(len(rows) - 1)[:, None] * (sides + 1) + np.arange(sides)).ravel()
    quads = [np.stack([k, k + sides + 1, k + 1], 1), np.stack([k + 1, k + sides + 1, k + sides + 2], 1)]
    slope = np.gradient(rows, axis=0)[:, [1, 0]] * (1, -1)
    slope /= np.linalg.norm(slope, axis=1, keepdims=True)
    positions, normals = ((r[:, None, [0, 1, 0]] * around).reshape(-1, 3) for r in (rows, slope))
    return ispm.Mesh(positions, np.concatenate(quads), normals)


steel = ispm.Material((0.62, 0.61, 0.59), metallic=1, roughness=0.3)
copper = ispm.Material((0.95, 0.64, 0.54), metallic=1, roughness=0.2)
glaze, black = (ispm.Material(c, roughness=r) for c, r in (((0.06, 0.22, 0.3), 0.1), ((0.02,) * 3, 0.35)))
flask = [(0, 0), (0.075, 0), (0.075, 0.3), (0.05, 0.36), (0.045, 0.375), (0, 0.375)]
cap = [(0, 0.375), (0.05, 0.375), (0.05, 0.43), (0, 0.43)]
cup = [(0, 0), (0.045, 0), (0.066, 0.02), (0.07, 0.12), (0.064, 0.12), (0.06, 0.025), (0.04, 0.01), (0, 0.01)]
tin = [
    (0, 0),
    (0.06, 0),
    (0.06, 0.07),
    (0.062, 0.07),
    (0.062, 0.09),
    (0.012, 0.095),
    (0.012, 0.11),
    (0, 0.11),
]
for profile, material, x, z in (
    (flask, steel, -0.13, -0.05),
    (cap, black, -0.13, -0.05),
    (cup, glaze, 0.04, 0.1),
    (tin, copper, 0.2, -0.06),
):  # fmt: skip
    scene.add(turned(profile), material=material, translation=(x, 0.0, z))
scene.add(ispm.shapes.plane(8, 8), material=ispm.Material((0.55, 0.54, 0.52), specular=0))
camera = ispm.Camera.look_at(eye=(0.25, 0.42, 0.95), target=(0.0, 0.17, 0.0), yfov=0.52)
with ispm.Renderer(scene, ispm.Settings(size=SIZE), camera) as renderer:
    for frame in renderer.converge(PASSES):
        frame.save("in_the_studio.png")
