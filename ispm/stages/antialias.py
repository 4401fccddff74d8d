"""Supersampled edges from one shaded sample a pixel."""

from __future__ import annotations

from functools import partial

import numpy as np

from ispm import wgsl
from ispm.frame import GpuScene, LitFrame, vertex_layout
from ispm.gpu import Gpu, Kept, Raster, RasterState, Recording
from ispm.scene.packed import Draw
from ispm.scene.within import solid_about
from ispm.stages.camera import CameraView

_SAMPLES = 4
_PATH = "stages/antialias.wgsl"
_THREADS = int(wgsl.load(_PATH).constants["THREADS"])
_EDGE = wgsl.load(_PATH).dtype("Edge")


class Antialias:
    """Draw ids and depth with four samples a pixel, then mix each pixel's light from its neighbours'.

    In   a LitFrame (W, H), alpha 1 where a surface is seen
    Out  its textures, but for irradiance: edge pixels are changed in place, their alpha the share of surface
    Source: Chajdas, McGuire and Luebke 2011.
    """

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._pipelines: dict[tuple[bool, bool, bool], Raster] = {}
        self._ids = gpu.texture("sample ids", "r16uint", samples=_SAMPLES)
        self._depth = gpu.texture("sample depth", "depth32float", samples=_SAMPLES)
        self._find, self._mix, self._write = (
            gpu.compute(_PATH, entry) for entry in ("find_edges", "mix_edges", "write_edges")
        )
        self._count = gpu.buffer("edge count")
        self._edges = gpu.buffer("edges")
        self._kept = Kept()

    def __call__(self, frame: Recording, scene: GpuScene, lit: LitFrame, view: CameraView) -> None:
        gbuffer = lit.gbuffer
        capacity = min(view.size[0] * view.size[1], self._gpu.max_binding // _EDGE.itemsize)
        edges = self._edges.sized(capacity * _EDGE.itemsize)
        samples = dict(sample_ids=self._ids.sized(view.size), sample_depth=self._depth.sized(view.size))
        shared = dict(camera=view.uniform(), ids=gbuffer.ids, edges=edges, **samples)
        packed = scene.packed
        if self._kept.lacks(frame, gbuffer, packed.placed, packed.looks, view.uniform().tobytes()):
            self._count.write(np.zeros(4, np.uint32))
            self._draw(frame, scene, view)
            self._find(frame, over=view.size, **shared, depth=gbuffer.depth, edge_count=self._count)
        self._mix(
            frame,
            over=_THREADS,
            **shared,
            listed_count=self._count,
            points=gbuffer.points,
            normals=gbuffer.normals,
            direct_in=lit.direct,
            indirect_in=lit.indirect,
            emission_in=lit.emission,
            through_in=lit.through,
            instances=scene.instances,
            materials=scene.materials,
        )
        self._write(
            frame,
            over=_THREADS,
            camera=view.uniform(),
            mixed=edges,
            listed_count=self._count,
            direct_out=lit.direct,
            indirect_out=lit.indirect,
            emission_out=lit.emission,
            through_out=lit.through,
        )

    def _draw(self, frame: Recording, scene: GpuScene, view: CameraView) -> None:
        shared = {"camera": frame.uniform(view.uniform()), "instances": scene.instances}
        with frame.draw_into(self._ids, depth=self._depth) as canvas:
            canvas.vertices(scene.vertices)
            canvas.indices(scene.indices)
            pipeline = partial(self._pipeline, scene, solid_about(scene.packed, view.eye_or_direction))
            for draw in scene.each(frame, canvas, scene.seen_by(view.sees), pipeline, shared):
                scene.draw_indexed(canvas, draw)

    def _pipeline(self, scene: GpuScene, within: int, draw: Draw) -> Raster:
        """The pipeline for a draw: what the G-buffer's shows and culls; compiled when first needed."""
        key = (scene.is_masked(draw.material), scene.shows_backs(draw, within), draw.mirrored)
        if key not in self._pipelines:
            masked, shows_backs, _ = key
            fields = ("position", "color", "uv0", "uv1") if masked else ("position",)
            state = RasterState(
                cull="none" if shows_backs else "back",
                front="cw" if draw.mirrored else "ccw",
                vertex="vs_masked" if masked else "vs",
                fragment="fs_masked" if masked else "fs",
                samples=_SAMPLES,
                vertex_layout=vertex_layout(*fields),
            )
            self._pipelines[key] = self._gpu.raster("stages/coverage.wgsl", ["r16uint"], state)
        return self._pipelines[key]
