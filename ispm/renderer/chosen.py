"""What a renderer chooses once and holds, so that sequences do not jump."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ispm.accel.world import World
from ispm.framing.camera import default_camera, default_light, given_camera, passed_points
from ispm.renderer.picture import Frame
from ispm.scene.camera import Camera
from ispm.scene.packed import Packed
from ispm.scene.placing import Tree
from ispm.scene.scene import Node, Scene


class Chosen:
    """The camera and the light of scenes that bring none, and the exposure that is held.

    They are made of the scene at rest and of all that its animations pass, when first asked for.
    place   packs a scene and places it in `world`
    say     takes a line for the user
    wanted  what camera was asked for: a Camera with a pose, a name, an index or None
    """

    def __init__(self, place: Callable[[Scene], Packed], world: World, say: Callable[[str], None]) -> None:
        self._place, self._world, self._say = place, world, say
        self._cameras: dict[float, tuple[Camera, np.ndarray]] = {}  # by the picture's aspect
        self._light: Node | None = None
        self.exposure: float | None = None
        self.wanted: Camera | str | int | None = None

    def want(self, camera: Camera | str | int | None) -> None:
        """Ask for a camera; None: for what the scene suggests, found anew, and so is the light."""
        self.wanted = camera
        if camera is None:
            self._cameras, self._light = {}, None

    def eye(self, scene: Scene, size: tuple[int, int], tree: Tree | None = None) -> tuple[Camera, np.ndarray]:
        """Return the camera for pictures of `size`, and its (4, 4) pose. Else as `given_camera`."""
        given = given_camera(scene, self.wanted, tree)
        if given is not None:
            return given
        aspect = size[0] / size[1]
        if aspect not in self._cameras:
            packed = self._place(scene.at_rest())
            self._cameras[aspect] = default_camera(packed, self._world, aspect, passed_points(scene))
        return self._cameras[aspect]

    def lit(self, scene: Scene, size: tuple[int, int], tree: Tree) -> Tree:
        """Return the scene's tree, with a light where it has none, nor an environment."""
        if scene.environment is not None or any(node.light is not None for node in tree.nodes):
            return tree
        if self._light is None:
            rest = scene.at_rest()
            _, pose = self.eye(rest, size)
            packed = self._place(rest)
            self._light, line = default_light(packed, self._world, pose[:3, 3], passed_points(scene))
            self._say(line)
        return Tree([*tree.nodes, self._light], [*tree.parents, -1])

    def expose(self, frame: Frame) -> Frame:
        """Return the frame; with setting "hold" it is shown at the exposure of the first one."""
        if frame.settings.exposure == "hold":
            if self.exposure is None:
                self.exposure = frame.exposure
            frame.exposure = self.exposure
        return frame
