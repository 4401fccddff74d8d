"""Bounce maps: which triangles the photons of lights first hit, rasterised.

McGuire and Luebke 2009: the first segment of a photon's path leaves a point, so it is a picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import compress

import numpy as np

from ispm.errors import SettingsError
from ispm.frame import BounceMap, BounceMaps, GpuScene
from ispm.gpu import Canvas, Gpu, Kept, Raster, RasterState, Recording
from ispm.lights.atlas import pack_shelves
from ispm.lights.plan import PlannedMap
from ispm.optics.records import NO_HIT
from ispm.scene.packed import Draw
from ispm.stages.face import face_uniforms, seen_by_faces


class BounceStage:
    """Draws the scene as each map sees it; both sides of every surface count.

    Texels take the nearest surface that is no hole of its material.
    What is drawn is kept while it would be drawn alike.
    All faces lie side by side in one texture: a pass of its own for each would cost more than to draw it.
    """

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        path, format = "stages/bounce.wgsl", "rg32uint"
        self._opaque = gpu.raster(path, [format])
        self._masked = gpu.raster(path, [format], RasterState(vertex="vs_masked", fragment="fs_masked"))
        self._texels = gpu.texture("bounce maps", format, usage=["attachment"])
        self._depth = gpu.texture("bounce depth", "depth32float", usage=["attachment"])
        self._kept, self._maps = Kept(), BounceMaps(self._texels, [])

    def __call__(
        self, frame: Recording, scene: GpuScene, plan: Sequence[PlannedMap], near: float, pass_index: int = 0
    ) -> BounceMaps:
        """Record the draws and return where their result will be.

        near  m, a tiny part of the scene's diagonal
        Raises SettingsError where the maps are larger than the adapter's textures.
        """
        maps, size = _arrange(plan, self._gpu.max_texture)
        if not maps:
            return BounceMaps(self._texels, maps)
        if max(size) > self._gpu.max_texture:
            raise SettingsError(
                f"photons: {sum(each.photons for each in plan)} need bounce maps larger than "
                f"{self._gpu.name} can draw; use fewer, or emission 'rays'"
            )
        views = []
        for index, (map, planned) in enumerate(zip(maps, plan, strict=True)):
            x, y = planned.shift
            shift = (2.0 * x / map.width, 2.0 * y / map.width)
            views.append(face_uniforms(map.map, index, near, shift, pass_index))
        told = [(map.width, map.map.range, view.tobytes()) for map, view in zip(maps, views, strict=True)]
        if not self._kept.lacks(frame, scene.packed.placed, scene.packed.looks, *told):
            return self._maps
        self._maps = BounceMaps(self._texels, maps)
        depth = self._depth.sized(size)
        with frame.draw_into(self._texels.sized(size), depth=depth, clear=(NO_HIT, 0, 0, 0)) as canvas:
            for map, uniforms in zip(maps, views, strict=True):
                self._draw(frame, canvas, scene, map, uniforms)
        return self._maps

    def _draw(
        self, frame: Recording, canvas: Canvas, scene: GpuScene, map: BounceMap, uniforms: np.ndarray
    ) -> None:
        def pipeline(draw: Draw) -> Raster:
            return self._masked if scene.is_masked(draw.material) else self._opaque

        seen = seen_by_faces(scene.boxes, map.map)
        windows = [(window, scene.corners(frame, window)) for window in scene.windows]
        for uniform, (x, y), visible in zip(uniforms, map.corners.tolist(), seen, strict=True):
            if not visible.any():
                continue
            canvas.viewport(x, y, map.width, map.width)
            face = frame.uniform(uniform)
            for window, shared in windows:
                draws = scene.draws_in(window, compress(scene.draws, visible))
                for draw in scene.each(frame, canvas, draws, pipeline, {"face": face, **shared}):
                    scene.draw_corners(canvas, draw, window)


def _arrange(plan: Sequence[PlannedMap], limit: int) -> tuple[list[BounceMap], tuple[int, int]]:
    """Return the maps, their faces packed into one texture, and its (width, height) in texels."""
    widths = np.repeat([each.width for each in plan], [len(each.map.axes) for each in plan])
    order = np.argsort(-widths, kind="stable")
    corners = np.empty((len(widths), 2), np.int64)
    corners[order], size = pack_shelves(np.stack([widths, widths], axis=1)[order], limit)
    ends = np.cumsum([len(each.map.axes) for each in plan])[:-1]
    parts = np.split(corners, ends) if plan else []
    return [BounceMap(each.map, part, each.width) for each, part in zip(plan, parts, strict=True)], size
