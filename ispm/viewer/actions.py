"""The edits that a user makes, from a scene as it stands to `Edit`s; nothing is changed here."""

from __future__ import annotations

import copy
import math
from collections.abc import Container
from dataclasses import fields, replace
from typing import Any

import numpy as np

from ispm.errors import SceneError
from ispm.scene.light import (
    DirectionalLight,
    DiskLight,
    Light,
    PointLight,
    RectLight,
    SphereLight,
    SpotLight,
    SurfaceLight,
)
from ispm.scene.node import Node
from ispm.scene.rotation import euler, quaternion, rotation_matrix
from ispm.scene.scene import Scene
from ispm.viewer.edits import Assign, Edit, Hidden

LIGHTS: dict[str, type[Light]] = {
    "point": PointLight,
    "spot": SpotLight,
    "directional": DirectionalLight,
    "rect": RectLight,
    "disk": DiskLight,
    "sphere": SphereLight,
}
_ACROSS = 0.25  # of the distance at which its light is looked for: how large a lamp is made
_SHEAR = 1e-4  # cosine between axes of a matrix, beyond which it has no rotation and scale


def add_light(scene: Scene, kind: str, pose: np.ndarray, distance: float) -> tuple[Edit, Node]:
    """Return the edit that adds a light, and its node.

    pose      (4, 4) of the camera: it shines as the camera looks, from a little above it
    distance  m, at which it gives about 3 lx
    """
    number = 1
    while (name := f"{kind} light {number}") in scene:
        number += 1
    light = _sized(LIGHTS[kind](), {}, distance)
    strength = 3.0 / _illuminance(light, distance)
    node = Node(name, light=replace(light, intensity=(strength,) * 3))
    turn, eye = pose[:3, :3], pose[:3, 3]
    ahead = 0.0 if kind == "spot" else 0.5
    node.translation = tuple((eye - turn[:, 2] * ahead * distance + turn[:, 1] * 0.2 * distance).tolist())
    node.rotation = quaternion(turn)
    return Edit(f"add {name}", (Assign(scene, "roots", [*scene.roots, node]),)), node


def delete(scene: Scene, node: Node) -> Edit:
    """Return the edit that takes a node out of every place where it hangs."""
    steps = [
        Assign(owner, name, [child for child in held if child is not node])
        for owner, name, held in _holders(scene)
        if any(child is node for child in held)
    ]
    if not steps:
        raise SceneError(f"delete: node '{node.name}' is not in the scene")
    return Edit(f"delete {node.name or 'a node'}", tuple(steps))


def duplicate(scene: Scene, node: Node, shift: np.ndarray) -> tuple[Edit, Node]:
    """Return the edit that hangs a copy of a node, and of all below it, beside it, and the copy.

    shift  (3,) m, world space, from the one to the other
    Lights and materials are copied; meshes are shared.
    """
    copied = _copied(node, _free_name(scene, node.name), {})
    for owner, name, held in _holders(scene):
        if any(child is node for child in held):
            parent = np.eye(4) if owner is scene else scene.world_matrix(owner)
            for step in placed(copied, translation_of(node) + _inside(parent, shift)):
                setattr(copied, step.field, step.value)
            return Edit(f"duplicate {node.name or 'a node'}", (Assign(owner, name, [*held, copied]),)), copied
    raise SceneError(f"duplicate: node '{node.name}' is not in the scene")


def move(scene: Scene, node: Node, world: np.ndarray, gesture: object = None) -> Edit:
    """Return the edit that takes a node's origin to a place in the world, (3,) m."""
    place, local = scene.world_matrix(node), node.local_matrix()
    parent = place @ np.linalg.inv(local)
    goal = np.linalg.inv(parent) @ np.append(np.asarray(world, np.float64), 1.0)
    return Edit(f"move {node.name or 'a node'}", placed(node, goal[:3]), gesture)


def placed(node: Node, translation: np.ndarray) -> tuple[Assign, ...]:
    """Return the steps that give a node a place, (3,) m in its parent's space."""
    if node.matrix is None:
        return (Assign(node, "translation", tuple(np.asarray(translation, np.float64).tolist())),)
    matrix = np.array(node.matrix, np.float64)
    matrix[:3, 3] = translation
    return (Assign(node, "matrix", matrix),)


def turn(node: Node, degrees: tuple[float, float, float], gesture: object = None) -> Edit:
    """Return the edit that turns a node to angles about the parent's x, y and z, one after the other."""
    rotation = euler(*degrees, degrees=True)
    return Edit(f"turn {node.name or 'a node'}", _apart(node, "rotation", rotation), gesture)


def scale(node: Node, factors: tuple[float, float, float], gesture: object = None) -> Edit:
    """Return the edit that scales a node along its axes."""
    if not all(math.isfinite(f) and abs(f) >= 1e-9 for f in factors):
        raise SceneError("scale: factors must not be 0")
    return Edit(f"scale {node.name or 'a node'}", _apart(node, "scale", factors), gesture)


def hide(hidden: Hidden, node: Node, away: bool) -> Edit:
    """Return the edit that hides a node with all below it, or shows it again."""
    nodes = hidden.nodes | {node} if away else hidden.nodes - {node}
    return Edit(f"{'hide' if away else 'show'} {node.name or 'a node'}", (Assign(hidden, "nodes", nodes),))


def as_kind(node: Node, kind: str, distance: float) -> Edit:
    """Return the edit that makes a node's light another kind.

    distance  m, at which it stays as bright before it, and a quarter of which a lamp without a size gets
    """
    light = node.light
    assert light is not None
    made = LIGHTS[kind]
    kept = {f.name: getattr(light, f.name) for f in fields(made) if hasattr(light, f.name)}
    if (isinstance(light, PointLight | SpotLight) and light.radius == 0.0) or made in (PointLight, SpotLight):
        kept.pop("radius", None)  # a point has none to give, and becomes none
    new = _sized(made(**kept), kept, distance)
    factor = _illuminance(light, distance) / _illuminance(new, distance)
    r, g, b = (float(v) * factor for v in light.intensity)
    new = replace(new, intensity=(r, g, b))
    return Edit(f"make {node.name or 'the light'} {kind}", (Assign(node, "light", new),))


def _sized(light: Light, kept: Container[str], distance: float) -> Light:
    """A lamp of a size that suits what is lit at `distance`, m, in the measures that are not `kept`."""
    if not isinstance(light, SurfaceLight):
        return light
    across = {name: distance * _ACROSS * (0.5 if name == "radius" else 1.0) for name in light.SIZES}
    sizes: dict[str, Any] = {name: size for name, size in across.items() if name not in kept}
    return replace(light, **sizes)


def _illuminance(light: Light, distance: float) -> float:
    """What a light of intensity 1 gives, lx, so many metres before it: of lamps as if they were points."""
    if isinstance(light, DirectionalLight):
        return 1.0
    seen = 1.0
    if isinstance(light, SurfaceLight):
        whole = light.area / (2.0 if light.shines_both_ways else 1.0)
        seen = whole / 4.0 if isinstance(light, SphereLight) else whole
    return seen / (distance * distance)


def translation_of(node: Node) -> np.ndarray:
    """Return a node's place in its parent's space, (3,) m."""
    return np.asarray(node.translation if node.matrix is None else node.matrix[:3, 3], np.float64)


def angles_of(node: Node) -> tuple[float, float, float]:
    """Return the degrees about the parent's x, y and z, one after the other, that a node is turned by."""
    if node.matrix is None:
        m = rotation_matrix(np.asarray(node.rotation, np.float64))
    else:
        m = node.matrix[:3, :3] / np.maximum(np.linalg.norm(node.matrix[:3, :3], axis=0), 1e-30)
    about_y = math.asin(min(max(-float(m[2, 0]), -1.0), 1.0))
    if abs(float(m[2, 0])) < 1.0 - 1e-9:
        about_x, about_z = math.atan2(m[2, 1], m[2, 2]), math.atan2(m[1, 0], m[0, 0])
    else:  # x and z turn about one axis: all of it is told as x
        about_x, about_z = math.atan2(-m[1, 2], m[1, 1]), 0.0
    x, y, z = (round(math.degrees(a), 6) + 0.0 for a in (about_x, about_y, about_z))
    return x, y, z


def scale_of(node: Node) -> tuple[float, float, float]:
    """Return a node's factors along its axes."""
    if node.matrix is None:
        x, y, z = (float(v) for v in node.scale)
    else:
        x, y, z = np.linalg.norm(node.matrix[:3, :3], axis=0).tolist()
    return x, y, z


def _apart(node: Node, name: str, value: Any) -> tuple[Assign, ...]:
    """The steps that give a node a rotation or a scale; one placed by a matrix gets all three apart."""
    if node.matrix is None:
        return (Assign(node, name, value),)
    axes = node.matrix[:3, :3] / np.maximum(np.linalg.norm(node.matrix[:3, :3], axis=0), 1e-30)
    if np.abs(axes.T @ axes - np.eye(3)).max() > _SHEAR or np.linalg.det(axes) < 0.0:
        raise SceneError(
            f"node '{node.name}' is placed by a matrix that shears or mirrors; it can only be moved"
        )
    given = {
        "translation": tuple(node.matrix[:3, 3].tolist()),
        "rotation": quaternion(axes),
        "scale": scale_of(node),
        name: value,
        "matrix": None,
    }
    return tuple(Assign(node, each, what) for each, what in given.items())


def _holders(scene: Scene) -> list[tuple[Any, str, list[Node]]]:
    """What nodes hang in: owner, field, list."""
    found: dict[int, tuple[Any, str, list[Node]]] = {id(scene): (scene, "roots", scene.roots)}
    for node in scene.nodes:
        found.setdefault(id(node), (node, "children", node.children))
    return list(found.values())


def _copied(node: Node, name: str, materials: dict[int, Any]) -> Node:
    made = copy.copy(node)
    made.name, made.light, made.parts = name, copy.copy(node.light), [copy.copy(p) for p in node.parts]
    for part in made.parts:
        part.material = materials.setdefault(id(part.material), copy.copy(part.material))
    made.children = [_copied(child, child.name, materials) for child in node.children]
    return made


def _free_name(scene: Scene, name: str) -> str:
    taken = {node.name for node in scene.nodes}
    number = 2
    while f"{name} {number}" in taken:
        number += 1
    return f"{name} {number}"


def _inside(parent: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """A step in the world as one in the space of a parent, (4, 4)."""
    return np.asarray(np.linalg.inv(parent[:3, :3]) @ shift)
