"""What the eye sees at each pixel: ids, normals, material and depth, rasterised."""

from __future__ import annotations

from itertools import compress

from ispm.frame import SLOTS, GBuffer, GpuScene
from ispm.gpu import Gpu, Group, Raster, Recording
from ispm.optics import records
from ispm.scene.packed import Draw
from ispm.stages.camera import CameraView

_FORMATS = {
    "ids": "rg32uint",
    "normals": "rgba16float",
    "base": "rgba16float",
    "emission": "rgba16float",
}


class GBufferStage:
    """Draws the scene as the eye sees it: back faces of double-sided materials only.

    In   scene, view
    Out  GBuffer of the view's size
    Opacity below the cutoff (MASK), or below a hash of pixel, instance and pass (BLEND), is a hole.
    """

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._pipelines: dict[tuple[bool, bool, bool, bool], Raster] = {}
        self._targets = {name: gpu.texture(f"gbuffer {name}", format) for name, format in _FORMATS.items()}
        self._depth = gpu.texture("gbuffer depth", "depth32float")

    def __call__(self, frame: Recording, scene: GpuScene, view: CameraView) -> GBuffer:
        """Record the draws and return where their result will be."""
        out = GBuffer(
            **{name: target.sized(view.size) for name, target in self._targets.items()},
            depth=self._depth.sized(view.size),
        )
        shared = {
            "camera": frame.uniform(view.uniform()), "vertices": scene.vertices, "indices": scene.indices,
            "instances": scene.instances,
        }  # fmt: skip
        groups: dict[Raster, Group] = {}
        seen = view.sees(scene.boxes)
        with frame.draw_into(*self._targets.values(), depth=out.depth) as canvas:
            for draw in compress(scene.draws, seen):
                raster = self._pipeline(scene, draw)
                if raster not in groups:
                    groups[raster] = raster.bind(0, **shared)
                material = frame.uniform(scene.packed.materials[draw.material])
                maps = scene.material_maps(draw.material, *SLOTS)
                canvas.use(raster, groups[raster], raster.bind(1, material=material, **maps))
                scene.draw_corners(canvas, draw)
        return out

    def close(self) -> None:
        """Free the textures."""
        for texture in (*self._targets.values(), self._depth):
            texture.close()

    def _pipeline(self, scene: GpuScene, draw: Draw) -> Raster:
        """The pipeline for a draw's material; compiled when first needed."""
        flags = scene.packed.materials[draw.material]["flags"]
        key = (
            scene.is_masked(draw.material),
            scene.is_textured(draw.material),
            bool(flags & records.MATERIAL_DOUBLE_SIDED),
            draw.mirrored,
        )
        if key not in self._pipelines:
            masked, textured, double_sided, mirrored = key
            self._pipelines[key] = self._gpu.raster(
                "stages/gbuffer.wgsl", tuple(_FORMATS.values()),
                cull="none" if double_sided else "back", front="cw" if mirrored else "ccw",
                MASKED=masked, TEXTURED=textured, MIRRORED=mirrored,
            )  # fmt: skip
        return self._pipelines[key]
