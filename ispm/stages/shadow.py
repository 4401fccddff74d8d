"""Shadow maps of the point lights: cubes of depth."""

from __future__ import annotations

import math
from itertools import compress

from ispm.errors import SceneError
from ispm.frame import GpuScene, ShadowMaps, vertex_layout
from ispm.gpu import Gpu, Raster, Recording
from ispm.scene.packed import Draw
from ispm.stages.face import face_uniforms, seen_by_faces

_FULL_CUBES = 4  # cubes of the asked resolution that all lights share
_SMALLEST = 64  # texels of a side


def shadow_side(resolution: int, light_count: int) -> int:
    """Return the texels of a face's edge: lights beyond four share the texels of four.

    A multiple of 16 and at least 64, but never more than `resolution`.
    """
    shared = resolution * math.sqrt(min(1.0, _FULL_CUBES / max(light_count, 1)))
    return min(resolution, max(_SMALLEST, int(shared) // 16 * 16))


class ShadowStage:
    """Draws the scene's depth as each light sees it.

    resolution  texels of a face's edge where there are few lights
    Raises SceneError where the adapter cannot hold as many maps as there are lights.
    """

    def __init__(self, gpu: Gpu, resolution: int) -> None:
        self._gpu = gpu
        self.resolution = min(resolution, gpu.max_texture)
        path = "stages/shadow.wgsl"
        self._opaque = gpu.raster(path, fragment=None, vertex_layout=vertex_layout("position"))
        self._masked = gpu.raster(
            path, vertex="vs_masked", fragment="fs_masked",
            vertex_layout=vertex_layout("position", "color", "uv0", "uv1"),
        )  # fmt: skip
        self._cubes = gpu.texture("shadow cubes", "depth32float", dimension="cube-array", layers=6)

    def __call__(self, frame: Recording, scene: GpuScene, near: float, pass_index: int = 0) -> ShadowMaps:
        """Record the draws and return where their result will be.

        near  m, a tiny part of the scene's diagonal
        """
        count = scene.light_count
        if 6 * count > self._gpu.max_layers:
            raise SceneError(
                f"the scene has {count} lights, but {self._gpu.name} holds shadow maps for at most "
                f"{self._gpu.max_layers // 6}; remove some"
            )
        side = shadow_side(self.resolution, count)
        self._cubes.sized((side, side), layers=6 * max(count, 1))
        for index in range(count):
            self._draw(frame, scene, index, near, pass_index)
        return ShadowMaps(self._cubes, side, near)

    def close(self) -> None:
        """Free the maps."""
        self._cubes.close()

    def _draw(self, frame: Recording, scene: GpuScene, index: int, near: float, pass_index: int) -> None:
        map = scene.packed.maps[index]
        seen = seen_by_faces(scene.boxes, map)

        def pipeline(draw: Draw) -> Raster:
            return self._masked if scene.is_masked(draw.material) else self._opaque

        first = 6 * index + (0 if len(map.axes) == 6 else 4)  # a single view fills the cube's +z face
        for row, uniform in enumerate(face_uniforms(map, index, near, pass_index=pass_index)):
            shared = {"face": frame.uniform(uniform), "instances": scene.instances}
            with frame.draw_into(depth=self._cubes.view(layer=first + row)) as canvas:
                canvas.vertices(scene.vertices)
                canvas.indices(scene.indices)
                visible = compress(scene.draws, seen[row])
                for draw in scene.each(frame, canvas, visible, pipeline, shared):
                    scene.draw_indexed(canvas, draw)
