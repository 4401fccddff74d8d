"""A scene made ready for a frame: packed, placed in the tracer, with its camera and its lights."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ispm.accel.surface import SurfaceTable
from ispm.accel.world import World
from ispm.framing.camera import far_off, require_visible
from ispm.optics.texture import TextureTable
from ispm.renderer.chosen import Chosen
from ispm.renderer.converge import place_in_pixel
from ispm.renderer.limits import without_area
from ispm.scene.packed import Packed, pack
from ispm.scene.packed_material import texture_state
from ispm.scene.placing import Tree
from ispm.scene.scene import Scene
from ispm.scene.sun import turned
from ispm.settings import Settings
from ispm.stages.camera import CameraView

_EYE_NEAR = 1e-9  # of the scene's diagonal: the eye may stand low over a wide plain
# Of the scene's diagonal: over which photons see textures averaged; of an instance's: over which at most.
_TEXTURE_FOOTPRINT, _WIDEST_FOOTPRINT = 0.005, 0.02


class Ready:
    """Makes scenes ready; what did not change since the last one is used again.

    say       takes a line for the user
    world     the tracer's trees, of the scene that was placed last
    textures, surfaces  likewise, what photons meet
    chosen    what the scene does not bring
    """

    def __init__(self, threads: int, say: Callable[[str], None]) -> None:
        self._say = say
        self.world = World(threads)
        self.textures, self._looks = TextureTable.pack([]), list[tuple[object, ...]]()
        self.chosen = Chosen(self.place, self.world, say)
        self.surfaces = SurfaceTable(pack(Scene()), self.textures, 0.0)
        self._packed: Packed | None = None

    def __call__(self, scene: Scene, settings: Settings, index: int) -> tuple[Packed, CameraView]:
        """Return the scene with its lights, and what pass `index` of a picture sees it through."""
        size = settings.size
        tree = scene.tree()
        camera, pose = self.chosen.eye(scene, size, tree)
        lit, tree = self.chosen.lit(scene, size, tree, settings.light)
        if settings.ground:
            tree = self.chosen.grounded(scene, tree)
        packed = self.place(lit, tree)
        reach = float(np.abs(packed.bounds - pose[:3, 3]).max()) + packed.diagonal
        near = _EYE_NEAR * packed.diagonal if camera.ymag is None else 0.0
        view = CameraView(
            size,
            pose,
            camera.yfov,
            camera.ymag,
            near,
            reach,
            jitter=place_in_pixel(index),
            pass_index=index,
            aspect=camera.aspect,
            principal=camera.principal,
        )
        lights = turned(packed.lit, packed.surround.disc, index)
        return packed if lights is packed.lit else replace(packed, lit=lights), view

    def place(self, scene: Scene, tree: Tree | None = None) -> Packed:
        """Pack a scene and place it in the tracer. Raises SceneError where it cannot be rendered.

        tree  the scene's, or one with more in it
        """
        old = self._packed
        packed = pack(scene, old, tree)
        if packed is old:
            return packed
        require_visible(scene, packed)
        looks = [(*texture_state(t), color) for t, color in zip(packed.textures, packed.colors, strict=True)]
        if looks != self._looks:
            self.textures, self._looks = TextureTable.pack(packed.textures, packed.colors), looks
        if line := far_off(packed):
            self._say(line)
        if line := without_area(packed.geometry, old.geometry if old else None):
            self._say(line)
        self.world.update(packed)
        self._packed = packed
        footprint = _TEXTURE_FOOTPRINT * packed.diagonal
        self.surfaces = SurfaceTable(packed, self.textures, footprint, _WIDEST_FOOTPRINT)
        return packed
