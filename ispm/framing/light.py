"""Light for scenes that bring none: the same for all moments of their animations."""

from __future__ import annotations

import math
from itertools import chain
from typing import NamedTuple

import numpy as np

from ispm.accel.world import World
from ispm.framing.camera import NO_POINTS, extent, free_way
from ispm.framing.interior import interior_viewpoint
from ispm.library.studio_light import FRONT, studio_radiance
from ispm.optics.atmosphere import horizontal_irradiance
from ispm.scene.camera import look_at_pose
from ispm.scene.environment import Environment
from ispm.scene.light import DirectionalLight, Light, PointLight
from ispm.scene.material import Material
from ispm.scene.packed import Packed
from ispm.scene.placing import Tree
from ispm.scene.scene import Node, Part, Scene
from ispm.scene.sky import Sky
from ispm.scene.values import BRIGHTEST
from ispm.settings import Unlit

_SUN = np.array([0.6, 1.0, 0.7])  # where a far lamp stands
_ASIDE = math.radians(65.0)  # from the camera to the left, where a sky's sun stands: it shows what is round
_LEVEL = 1e-3  # of a camera's direction: less of it is level than of one that looks straight down


class DefaultLight(NamedTuple):
    """What lights a scene that has no light.

    node, environment  either or none
    line  says so to the user
    """

    node: Node | None = None
    environment: Environment | Sky | None = None
    line: str = ""


def brings_light(scene: Scene, tree: Tree) -> bool:
    """Return whether a scene has any light: lamps, an environment, or a material that glows all over.

    One that glows where a texture says so, as a device's displays do, is one in a room alone, see
    `default_light`.
    """
    if scene.environment is not None or any(node.light is not None for node in tree.nodes):
        return True
    parts = chain.from_iterable(node.parts for node in tree.nodes if isinstance(node.parts, list))
    found = {id(part.material): part.material for part in parts if isinstance(part, Part)}
    materials = [each for each in found.values() if isinstance(each, Material)]  # others are refused later
    return any(each.emissive and each.emission_texture is None for each in materials)


def default_light(
    kind: Unlit, packed: Packed, world: World, pose: np.ndarray, passed: np.ndarray = NO_POINTS
) -> DefaultLight:
    """Return the light for a scene without one.

    pose    (4, 4), the camera's
    passed  (n, 3) m, points that moving things pass
    A white surface that faces a lamp, or up in the studio, has a radiance of about 1 cd/m2, which suits
    emissive materials of factor 1. A sky has its real light.
    """
    if kind == "none":
        return DefaultLight()
    if kind == "sky":
        sky = Sky(sun_azimuth=_camera_azimuth(pose) + _ASIDE)
        return DefaultLight(environment=sky, line="the scene has no light; a clear sky lights it")
    viewpoint = None if kind == "studio" else interior_viewpoint(packed, world)
    if kind == "auto" and viewpoint is not None and packed.materials["emission"].any():
        return DefaultLight()  # what glows in a room, if by a texture, is its lamp
    if kind == "studio" or (kind == "auto" and viewpoint is None):
        return DefaultLight(environment=_studio(pose), line="the scene has no light; a studio lights it")
    if viewpoint is None:
        return _far_lamp(packed, passed)
    return _lamp_in_room(packed, world, pose[:3, 3], viewpoint)


def _camera_azimuth(pose: np.ndarray) -> float:
    """Radians from -Z, to +X: where the camera stands, seen from what it shows."""
    x, z = pose[0, 2], pose[2, 2]
    return math.atan2(x, -z) if math.hypot(x, z) > _LEVEL else FRONT


def _studio(pose: np.ndarray) -> Environment:
    """The studio, set up for the camera; not seen but in what it is mirrored in."""
    image = studio_radiance()
    intensity = math.pi / float(horizontal_irradiance(image)[0])
    return Environment(image, FRONT - _camera_azimuth(pose), intensity, background=False, name="studio")


def _lamp_in_room(packed: Packed, world: World, eye: np.ndarray, viewpoint: np.ndarray) -> DefaultLight:
    """A lamp near the camera, which stands at eye, (3,) m, towards the room's middle and above."""
    position = eye + 0.15 * (viewpoint - eye)
    up = np.array([0.0, 1.0, 0.0])
    (free,) = free_way(world, position, up[None])
    position += up * min(0.3 * (packed.bounds[1, 1] - position @ up), 0.5 * float(free))
    light = PointLight((min(math.pi * (packed.diagonal / 3.0) ** 2, BRIGHTEST),) * 3)
    node = Node("default light", translation=position, light=light)
    return DefaultLight(node, line="the scene has no light; a lamp near the camera lights it")


def _far_lamp(packed: Packed, passed: np.ndarray) -> DefaultLight:
    """A lamp so far away that it is like the sun."""
    low, high, diagonal = extent(packed, passed)
    center, distance = (low + high) / 2.0, 20.0 * diagonal
    position = center + distance * _SUN / np.linalg.norm(_SUN)
    intensity = math.pi * distance * distance
    light: Light = PointLight((min(intensity, BRIGHTEST),) * 3)
    node = Node("default light", translation=position, light=light)
    if intensity > BRIGHTEST:  # so far away that its rays are parallel
        node.light = DirectionalLight((math.pi,) * 3)
        node.matrix = look_at_pose(position, center)
    return DefaultLight(node, line="the scene has no light; a lamp far away, like the sun, lights it")
