"""The picture at low resolution: one receiver of light for each block of pixels."""

from __future__ import annotations

import numpy as np

from ispm.frame import GBuffer, GpuScene
from ispm.gpu import Buffer, Gpu, Kept, Recording
from ispm.optics.records import RECEIVER
from ispm.stages.camera import CameraView


class Downsample:
    """Choose a pixel of each K x K block and describe the surface it sees.

    In   gbuffer (W, H)
    Out  (w h,) RECEIVER, row by row, w = ceil(W / K); `valid`: instance row + 1
    """

    def __init__(self, gpu: Gpu, subsampling: int) -> None:
        self._block = subsampling
        self._shader = gpu.compute("stages/downsample.wgsl", BLOCK=subsampling)
        self.receivers = gpu.buffer("receivers")
        self._kept = Kept()

    def size(self, view: CameraView) -> tuple[int, int]:
        """Return (w, h) of the low resolution."""
        return -(-view.size[0] // self._block), -(-view.size[1] // self._block)

    def __call__(self, frame: Recording, scene: GpuScene, gbuffer: GBuffer, view: CameraView) -> Buffer:
        width, height = self.size(view)
        self.receivers.sized(width * height * RECEIVER.itemsize)
        if not self._kept.lacks(frame, gbuffer, scene.packed.looks, view.uniform().tobytes()):
            return self.receivers
        self._shader(
            frame,
            over=(width, height),
            camera=view.uniform(),
            materials=scene.materials,
            **gbuffer.surfaces,
            depth=gbuffer.depth,
            ids=gbuffer.ids,
            receivers=self.receivers,
        )
        return self.receivers

    def read(self, gpu: Gpu, view: CameraView) -> np.ndarray:
        """Return the receivers as (w h,) RECEIVER."""
        width, height = self.size(view)
        return gpu.read_buffer(self.receivers, RECEIVER, width * height)
