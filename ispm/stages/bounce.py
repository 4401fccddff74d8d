"""Bounce maps: where the photons of lights first hit, rasterised.

McGuire and Luebke 2009: the first segment of a photon's path leaves a point, so it is a picture.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import compress

import numpy as np

from ispm.frame import BounceMap, BounceMaps, GpuScene
from ispm.gpu import Canvas, Gpu, Raster, Recording, Texture
from ispm.optics.records import NO_HIT
from ispm.scene.packed import Draw
from ispm.stages.face import face_uniforms, seen_by_faces
from ispm.tracer.plan import PlannedMap

_PAGE = 2048  # texels of a page's edge, where no face is wider: 64 MiB
_STEP = 64  # texels


class BounceStage:
    """Draws the scene as each map sees it; both sides of every surface count.

    Texels take the nearest surface within the light's range that is no hole of its material.
    All faces lie side by side on one page, or few: a pass and a texture of each would cost more than
    what is drawn.
    """

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        path, formats = "stages/bounce.wgsl", ["rgba32uint"]
        self._opaque = gpu.raster(path, formats)
        self._masked = gpu.raster(path, formats, vertex="vs_masked", fragment="fs_masked")
        self._pages: list[Texture] = []
        self._depth = gpu.texture("bounce depth", "depth32float", usage=["attachment"])

    def __call__(
        self, frame: Recording, scene: GpuScene, plan: Sequence[PlannedMap], near: float, pass_index: int = 0
    ) -> BounceMaps:
        """Record the draws and return where their result will be.

        near  m, a tiny part of the scene's diagonal
        """
        maps, size, count = _arrange(plan, min(_PAGE, self._gpu.max_texture))
        for page in range(len(self._pages), count):
            self._pages.append(self._gpu.texture(f"bounce maps {page}", "rgba32uint", usage=["attachment"]))
        for page, target in enumerate(self._pages[:count]):
            depth = self._depth.sized(size)
            with frame.draw_into(target.sized(size), depth=depth, clear=(NO_HIT, 0, 0, 0)) as canvas:
                for index, (each, planned) in enumerate(zip(maps, plan, strict=True)):
                    halves = (2.0 * planned.shift[0] / each.width, 2.0 * planned.shift[1] / each.width)
                    uniforms = face_uniforms(each.map, index, near, halves, pass_index)
                    self._draw(frame, canvas, scene, each, uniforms, each.places[:, 0] == page)
        return BounceMaps(self._pages[:count], maps)

    def close(self) -> None:
        """Free the textures."""
        for texture in (*self._pages, self._depth):
            texture.close()

    def _draw(
        self,
        frame: Recording,
        canvas: Canvas,
        scene: GpuScene,
        map: BounceMap,
        uniforms: np.ndarray,
        here: np.ndarray,
    ) -> None:
        """Draw those faces of a map that are `here`, (F,) bool, and see anything."""

        def pipeline(draw: Draw) -> Raster:
            return self._masked if scene.is_masked(draw.material) else self._opaque

        seen = seen_by_faces(scene.boxes, map.map)
        for face in np.flatnonzero(here & seen.any(axis=1)):
            shared = {
                "face": frame.uniform(uniforms[face]), "vertices": scene.vertices, "indices": scene.indices,
                "instances": scene.instances,
            }  # fmt: skip
            x, y = map.places[face, 1:].tolist()
            canvas.viewport(x, y, map.width, map.width)
            for draw in scene.each(frame, canvas, compress(scene.draws, seen[face]), pipeline, shared):
                scene.draw_corners(canvas, draw)


def _arrange(plan: Sequence[PlannedMap], edge: int) -> tuple[list[BounceMap], tuple[int, int], int]:
    """Place all maps' faces in rows, the widest first; return the maps, a page's size and the pages' number.

    edge  of a page at most, where no face is wider
    """
    maps = [BounceMap(each.map, np.zeros((len(each.map.axes), 3), np.int64), each.width) for each in plan]
    area = sum(len(each.places) * each.width**2 for each in maps)
    widest = max((each.width for each in maps), default=0)
    width, most = max(widest, min(edge, _rounded(1.1 * math.sqrt(area)))), max(widest, edge)
    page = x = y = row = height = 0
    for each in sorted(maps, key=lambda each: -each.width):
        for place in each.places:
            if x + each.width > width:
                x, y, row = 0, y + row, 0
            if y + each.width > most:
                page, x, y, row = page + 1, 0, 0, 0
            place[:] = page, x, y
            x, row = x + each.width, max(row, each.width)
            height = max(height, y + row)
    return maps, (width, max(widest, min(most, _rounded(height)))), page + 1 if maps else 0


def _rounded(size: float) -> int:
    """The next multiple of a step, so that pages seldom change their size."""
    return -(-math.ceil(size) // _STEP) * _STEP
