"""What a renderer chooses once and holds, so that sequences do not jump."""

from __future__ import annotations

import copy
from collections.abc import Callable

import numpy as np

from ispm.accel.world import World
from ispm.framing.camera import default_camera, given_camera, passed_points, without_lamps
from ispm.framing.ground import ground_node
from ispm.framing.light import DefaultLight, brings_light, default_light
from ispm.renderer.picture import Frame
from ispm.scene.camera import Camera
from ispm.scene.packed import Packed
from ispm.scene.placing import Tree
from ispm.scene.scene import Node, Scene
from ispm.settings import Unlit


class Chosen:
    """The camera and the light of scenes that bring none, the ground, and the exposure that is held.

    They are made of the scene at rest and of all that its animations pass, when first asked for.
    place   packs a scene and places it in `world`
    say     takes a line for the user
    wanted  what camera was asked for: a Camera with a pose, a name, an index or None
    """

    def __init__(self, place: Callable[[Scene], Packed], world: World, say: Callable[[str], None]) -> None:
        self._place, self._world, self._say = place, world, say
        self._cameras: dict[float, tuple[Camera, np.ndarray]] = {}  # by the picture's aspect
        self._lights: dict[Unlit, DefaultLight] = {}  # by the setting
        self._ground: Node | None = None
        self.exposure: float | None = None
        self.wanted: Camera | str | int | None = None

    def want(self, camera: Camera | str | int | None) -> None:
        """Ask for a camera; None: for what the scene suggests, found anew, and so is the light."""
        self.wanted = camera
        if camera is None:
            self._cameras, self._lights, self._ground = {}, {}, None

    def eye(self, scene: Scene, size: tuple[int, int], tree: Tree | None = None) -> tuple[Camera, np.ndarray]:
        """Return the camera for pictures of `size`, and its (4, 4) pose. Else as `given_camera`."""
        given = given_camera(scene, self.wanted, tree)
        if given is not None:
            return given
        aspect = size[0] / size[1]
        if aspect not in self._cameras:
            packed = self._place(without_lamps(scene))
            self._cameras[aspect] = default_camera(packed, self._world, aspect, passed_points(scene))
        return self._cameras[aspect]

    def lit(self, scene: Scene, size: tuple[int, int], tree: Tree, kind: Unlit) -> tuple[Scene, Tree]:
        """Return the scene and its tree, with the light of that kind where they have none."""
        if brings_light(scene, tree):
            if kind not in ("auto", "none"):
                self._say(f"the scene has light of its own; setting light, {kind}, is for scenes without")
            return scene, tree
        if kind not in self._lights:
            rest = scene.at_rest()
            _, pose = self.eye(rest, size)
            packed = self._place(rest)
            self._lights[kind] = default_light(kind, packed, self._world, pose, passed_points(scene))
        light = self._lights[kind]
        if light.line:
            self._say(light.line)
        if light.environment is not None:
            scene = copy.copy(scene)
            scene.environment = light.environment
        if light.node is not None:
            tree = Tree([*tree.nodes, light.node], [*tree.parents, -1])
        return scene, tree

    def grounded(self, scene: Scene, tree: Tree) -> Tree:
        """Return a scene's tree with the ground beneath it, its last node."""
        if self._ground is None:
            self._ground = ground_node(self._place(without_lamps(scene)), passed_points(scene))
        return Tree([*tree.nodes, self._ground], [*tree.parents, -1])

    def expose(self, frame: Frame) -> Frame:
        """Return the frame; with setting "hold" it is shown at the exposure of the first one."""
        if frame.settings.exposure == "hold":
            if self.exposure is None:
                self.exposure = frame.exposure
            frame.exposure = self.exposure
        return frame
