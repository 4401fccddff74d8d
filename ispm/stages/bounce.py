"""Bounce maps: where the photons of point lights first hit, rasterised.

McGuire and Luebke 2009: the first segment of a photon's path leaves a point, so it is a picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import compress

from ispm.frame import BounceMap, BounceMaps, GpuScene
from ispm.gpu import Gpu, Raster, Recording, Texture
from ispm.optics.records import NO_HIT
from ispm.scene.packed import Draw
from ispm.stages.face import face_uniforms, seen_by_faces


class BounceStage:
    """Draws the scene into six faces about each light; both sides of every surface count.

    Texels take the nearest surface within the light's range that is no hole of its material.
    """

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        path, formats = "stages/bounce.wgsl", ["rgba32uint"]
        self._opaque = gpu.raster(path, formats)
        self._masked = gpu.raster(path, formats, vertex="vs_masked", fragment="fs_masked")
        self._maps: list[tuple[Texture, Texture]] = []  # texels and depth

    def __call__(
        self,
        frame: Recording,
        scene: GpuScene,
        widths: Sequence[int],
        shifts: Sequence[tuple[float, float]],
        near: float,
        pass_index: int = 0,
    ) -> BounceMaps:
        """Record the draws and return where their result will be.

        widths  texels of a face's edge for each light; 0: no map
        shifts  of each light's samples in texels, in [-0.5, 0.5]
        near    m, a tiny part of the scene's diagonal
        """
        maps: list[BounceMap] = []
        for light, (width, shift) in enumerate(zip(widths, shifts, strict=True)):
            if width > 0:
                texels, depth = self._textures(len(maps))
                texels.sized((width, width), layers=len(scene.packed.maps[light].axes))
                depth.sized((width, width))
                maps.append(BounceMap(light, texels, shift))
                self._draw(frame, scene, maps[-1], depth, near, pass_index)
        return BounceMaps(maps)

    def close(self) -> None:
        """Free the textures."""
        for pair in self._maps:
            for texture in pair:
                texture.close()

    def _textures(self, index: int) -> tuple[Texture, Texture]:
        if index == len(self._maps):
            texels = self._gpu.texture(f"bounce map {index}", "rgba32uint", dimension="2d-array", layers=6)
            depth = self._gpu.texture(f"bounce depth {index}", "depth32float", usage=["attachment"])
            self._maps.append((texels, depth))
        return self._maps[index]

    def _draw(
        self, frame: Recording, scene: GpuScene, map: BounceMap, depth: Texture, near: float, pass_index: int
    ) -> None:
        about = scene.packed.maps[map.light]
        shift = (2.0 * map.shift[0] / map.width, 2.0 * map.shift[1] / map.width)
        seen = seen_by_faces(scene.boxes, about)

        def pipeline(draw: Draw) -> Raster:
            return self._masked if scene.is_masked(draw.material) else self._opaque

        for layer, uniform in enumerate(face_uniforms(about, map.light, near, shift, pass_index)):
            shared = {
                "face": frame.uniform(uniform), "vertices": scene.vertices, "indices": scene.indices,
                "instances": scene.instances,
            }  # fmt: skip
            target = map.texels.view(layer=layer)
            with frame.draw_into(target, depth=depth, clear=(NO_HIT, 0, 0, 0)) as canvas:
                visible = compress(scene.draws, seen[layer])
                for draw in scene.each(frame, canvas, visible, pipeline, shared):
                    scene.draw_corners(canvas, draw)
