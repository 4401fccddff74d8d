"""A lamp under water: its light comes through the waves onto the wall behind."""

import math

import numpy as np

import ispm
from ispm import shapes

SIZE = (320, 180)
FRAMES = 48
PASSES = 2
LEVEL = 0.7  # m, of still water
CELLS = 96
WAVES = np.random.default_rng(7).uniform(0.0, 2.0 * math.pi, (6, 2))  # heading and phase of each
CYCLES = (1, 1, 2, 2, 3, 3)  # of each wave while the film lasts, so that it goes on without a cut

plaster = ispm.Material((0.72, 0.7, 0.66), specular=0)
tiles = ispm.Material((0.07, 0.13, 0.15), specular=0)
bronze = ispm.Material((0.55, 0.3, 0.12), roughness=0.5)
water = ispm.Material(
    roughness=0, ior=1.33, transmission=1, thickness=LEVEL,
    attenuation_color=(0.6, 0.87, 0.9), attenuation_distance=1.5,
)  # fmt: skip

scene = ispm.Scene(name="basin")
for size, place, material in (
    ((3.2, 0.1, 2.2), (0.0, -0.05, 0.0), tiles),
    ((3.2, 2.4, 0.1), (0.0, 1.15, -1.05), plaster),
    ((0.1, 2.4, 2.2), (-1.55, 1.15, 0.0), plaster),
    ((0.1, 2.4, 2.2), (1.55, 1.15, 0.0), plaster),
    ((3.2, 0.8, 0.1), (0.0, 0.35, 1.05), tiles),
):
    scene.add(shapes.box(size), material=material, translation=place)
scene.add(shapes.sphere(0.22, segments=48, rings=24), material=bronze, translation=(-0.75, 0.75, -0.45))

across, along = np.meshgrid(np.linspace(-1.5, 1.5, CELLS + 1), np.linspace(-1.0, 1.0, CELLS + 1))
corner = np.arange(CELLS * (CELLS + 1)).reshape(CELLS, CELLS + 1)[:, :-1].ravel()
quads = corner[:, None] + np.array([0, CELLS + 1, CELLS + 2, 1])
triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def surface(turn: float) -> tuple[np.ndarray, np.ndarray]:
    """Positions, m, and normals of the water, (n, 3) each, at a part of the film, 0 to 2 pi."""
    height, slope_x, slope_z = np.zeros((3, CELLS + 1, CELLS + 1))
    for (heading, phase), cycles in zip(WAVES, CYCLES, strict=True):
        number, steep = 14.0 * cycles**0.7, 0.08
        x, z = number * math.cos(heading), number * math.sin(heading)
        angle = x * across + z * along - cycles * turn + phase
        height += steep / number * np.sin(angle)
        slope_x += steep * math.cos(heading) * np.cos(angle)
        slope_z += steep * math.sin(heading) * np.cos(angle)
    normals = np.stack([-slope_x, np.ones_like(height), -slope_z], axis=-1).reshape(-1, 3)
    positions = np.stack([across, LEVEL + height, along], axis=-1).reshape(-1, 3)
    return positions, normals / np.linalg.norm(normals, axis=1, keepdims=True)


mesh = ispm.Mesh(surface(0.0)[0], triangles, surface(0.0)[1])
scene.add(mesh, material=water, name="water")
lamp = ispm.SpotLight((60, 53, 42), inner_angle=0.3, outer_angle=0.5)
scene.add(lamp, translation=(0.15, 0.1, 0.55)).look_at((0.0, LEVEL, 0.15))  # up, and back to the wall
scene.add(ispm.PointLight((0.9, 1.2, 1.6)), translation=(1.0, 2.1, 0.9))


def flow(renderer: ispm.Renderer, seconds: float) -> None:
    """Move the water."""
    mesh = renderer.scene["water"].parts[0].mesh
    mesh.positions, mesh.normals = surface(2.0 * math.pi * 24.0 * seconds / FRAMES)


camera = ispm.Camera.look_at((0.5, 1.3, 1.5), (-0.05, 0.95, -0.9), yfov=0.8)
settings = ispm.Settings(size=SIZE, passes=PASSES, photons=200_000, exposure=-0.5)
film = ispm.Film(duration=FRAMES / 24)
sheet = "water.png"
ispm.animate(scene, "water.mp4", settings, film=film, camera=camera, change=flow, contact_sheet=sheet)
