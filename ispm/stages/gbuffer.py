"""What the eye sees at each pixel: which triangle, rasterised, and where on it, computed."""

from __future__ import annotations

from ispm.frame import SLOTS, SPECULAR_SLOTS, GBuffer, GpuScene
from ispm.gpu import FLAT, Gpu, Group, Kept, Raster, RasterState, Recording, Texture
from ispm.optics.records import MATERIAL_SPECULAR_MAPPED
from ispm.scene.packed import Draw
from ispm.scene.within import solid_about
from ispm.stages.camera import CameraView

_DRAWN = {"ids": "rg32uint", "bump": "rgba16float", "base": "rgba16float", "emission": "rgba16float"}
_COMPUTED = {"points": "rgba32uint", "normals": "rg32uint", "depth": "r32float"}
_SPECULAR = "rgba8unorm-srgb"  # holds what such a texture says as it is


class GBufferStage:
    """Draws the scene as the eye sees it; back faces are drawn of double-sided materials alone.

    In   scene, view
    Out  GBuffer of the view's size
    Opacity below the cutoff (MASK), or next to none (BLEND), is a hole.
    The rasteriser decides which triangle a pixel shows. What it interpolates is off by as much as it snaps
    corners to its grid, so points, depth and normals come from the triangles in a second pass.
    """

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._pipelines: dict[tuple[bool, bool, bool, bool], Raster] = {}
        self._resolve = [
            gpu.raster("stages/seen.wgsl", tuple(_COMPUTED.values()), FLAT, BUMPY=bumpy)
            for bumpy in (False, True)
        ]
        self._drawn, self._computed = (
            {name: gpu.texture(f"gbuffer {name}", format) for name, format in formats.items()}
            for formats in (_DRAWN, _COMPUTED)
        )
        self._specular = gpu.texture("gbuffer specular", _SPECULAR)
        self._unmapped = gpu.texture("gbuffer without specular", _SPECULAR, usage=["sampled"]).sized((1, 1))
        self._map_specular = gpu.raster(
            "stages/gbuffer.wgsl", [_SPECULAR], RasterState(depth=None, fragment="fs_specular"), TEXTURED=True
        )
        self._nearest = gpu.texture("gbuffer nearest", "depth32float", usage=["attachment"])
        self._kept, self._last = Kept(), GBuffer(**self._textures(), specular=self._unmapped)

    def __call__(self, frame: Recording, scene: GpuScene, view: CameraView) -> GBuffer:
        """Record the draws and return where their result will be: the last frame's if it is the same."""
        packed = scene.packed
        if self._kept.lacks(frame, packed.placed, packed.looks, view.size, view.uniform().tobytes()):
            specular = self._draw(frame, scene, view)
            self._last = GBuffer(**self._textures(), specular=specular)  # another one, so that all can tell
        return self._last

    def _textures(self) -> dict[str, Texture]:
        """Those of a GBuffer that every scene has, by name."""
        return {name: each for name, each in (self._drawn | self._computed).items() if name != "bump"}

    def _draw(self, frame: Recording, scene: GpuScene, view: CameraView) -> Texture:
        """Record the draws; return what is `specular` of the GBuffer."""
        drawn, computed = (
            {name: target.sized(view.size) for name, target in targets.items()}
            for targets in (self._drawn, self._computed)
        )
        camera = frame.uniform(view.uniform())
        windows = [(window, {"camera": camera, **scene.corners(frame, window)}) for window in scene.windows]
        seen, within = scene.seen_by(view.sees), solid_about(scene.packed, view.eye_or_direction)
        with frame.draw_into(*drawn.values(), depth=self._nearest.sized(view.size)) as canvas:
            for window, shared in windows:
                groups: dict[Raster, Group] = {}
                for draw in scene.draws_in(window, seen):
                    raster = self._pipeline(scene, draw, within)
                    if raster not in groups:
                        groups[raster] = raster.bind(0, **shared)
                    material = frame.uniform(scene.packed.materials[draw.material])
                    maps = scene.material_maps(draw.material, *SLOTS)
                    canvas.use(raster, groups[raster], raster.bind(1, material=material, **maps))
                    scene.draw_corners(canvas, draw, window)
        resolve = self._resolve[bool((scene.packed.materials["normal_texture"]["texture"] >= 0).any())]
        with frame.draw_into(*computed.values()) as canvas:
            for _, shared in windows:
                canvas.use(resolve, resolve.bind(0, **shared, ids=drawn["ids"], bumps=drawn["bump"]))
                canvas.draw(3)
        flags = scene.packed.materials["flags"]
        mapped = [draw for draw in seen if flags[draw.material] & MATERIAL_SPECULAR_MAPPED != 0]
        if not mapped:
            return self._unmapped
        specular, raster = self._specular.sized(view.size), self._map_specular
        with frame.draw_into(specular, clear=(1.0, 1.0, 1.0, 1.0)) as canvas:
            for window, shared in windows:
                group = raster.bind(0, **shared, drawn_ids=drawn["ids"])
                for draw in scene.draws_in(window, mapped):
                    material = frame.uniform(scene.packed.materials[draw.material])
                    maps = scene.material_maps(draw.material, *SPECULAR_SLOTS)
                    canvas.use(raster, group, raster.bind(1, material=material, **maps))
                    scene.draw_corners(canvas, draw, window)
        return specular

    def _pipeline(self, scene: GpuScene, draw: Draw, within: int) -> Raster:
        """The pipeline for a draw's material, see `shows_backs`; compiled when first needed."""
        key = (
            scene.is_masked(draw.material),
            scene.is_textured(draw.material),
            scene.shows_backs(draw, within),
            draw.mirrored,
        )
        if key not in self._pipelines:
            masked, textured, shows_backs, mirrored = key
            cull, front = "none" if shows_backs else "back", "cw" if mirrored else "ccw"
            self._pipelines[key] = self._gpu.raster(
                "stages/gbuffer.wgsl",
                tuple(_DRAWN.values()),
                RasterState(cull=cull, front=front),
                MASKED=masked,
                TEXTURED=textured,
            )
        return self._pipelines[key]
