"""Photons to receivers through tiles of the screen, in compute shaders; `tiled_cpu` does the same on the CPU."""

from __future__ import annotations

import numpy as np

from ispm import wgsl
from ispm.gpu import Gpu

_PATH = "estimators/tiled.wgsl"
_SCREEN = wgsl.load(_PATH).dtype("Screen")
_BOX = wgsl.load(_PATH).dtype("Box")
_SIDE = 8  # receivers along a tile's edge


class Tiled:
    """The `tiled` estimator on the GPU, see `estimators.Estimator`.

    A tile's photons are listed by atomic counters, so their order changes from run to run, and the sums
    with it by 2e-7 of the peak.
    """

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._bound, self._count, self._scan, self._fill, self._gather, self._gloss = (
            gpu.compute(_PATH, entry) for entry in ("bound", "count", "scan", "fill", "gather", "gather_gloss")
        )
        self._receivers, self._photons, self._boxes, self._counts, self._starts, self._members, self._result = (
            gpu.buffer(f"tiled {name}")
            for name in ("receivers", "photons", "boxes", "counts", "starts", "members", "result")
        )

    def __call__(
        self, receivers: np.ndarray, photons: np.ndarray, clip_from_world: np.ndarray, size: tuple[int, int]
    ) -> np.ndarray:
        """Return (h*w, 16) float32 channels, see `estimators.Estimator`."""
        if not len(photons) or not len(receivers):
            return np.zeros((len(receivers), 16), np.float32)
        tiles = -(-size[0] // _SIDE), -(-size[1] // _SIDE)
        tile_count = tiles[0] * tiles[1]
        screen = np.zeros((), _SCREEN)
        screen["clip_from_world"], screen["size"] = np.transpose(clip_from_world), size
        screen["tiles"], screen["photon_count"] = tiles, len(photons)
        seen = dict(screen=screen, receivers=self._receivers.write(receivers))
        sent = dict(screen=screen, photons=self._photons.write(photons))
        boxes = self._boxes.sized(tile_count * _BOX.itemsize)
        counts = self._counts.sized(tile_count * 4)
        starts = self._starts.sized((tile_count + 1) * 4)
        with self._gpu.frame() as frame:
            self._bound(frame, over=tile_count, boxes=boxes, counts=counts, **seen)
            self._count(frame, over=len(photons), boxes=boxes, counts=counts, **sent)
            self._scan(frame, over=1, screen=screen, counts=counts, starts=starts)
        length = int(self._gpu.read_buffer(starts, np.uint32, tile_count + 1)[-1])
        members = self._members.sized(length * 4)
        result = self._result.sized(len(receivers) * 64)
        lists = dict(starts=starts, members=members, result=result, photons=self._photons)
        with self._gpu.frame() as frame:
            self._fill(
                frame, over=len(photons), boxes=boxes, counts=counts, starts=starts, members=members, **sent
            )
            frame.clear_buffer(result)
            self._gather(frame, over=tile_count * _SIDE, **seen, **lists)
            if (receivers["alpha"] > 0.0).any():
                self._gloss(frame, over=tile_count * _SIDE * 2, boxes=boxes, **seen, **lists)
        return self._gpu.read_buffer(result, np.float32, len(receivers) * 16).reshape(-1, 16)

    def close(self) -> None:
        """Free the memory on the device."""
        for buffer in (
            self._receivers, self._photons, self._boxes, self._counts, self._starts, self._members, self._result,
        ):  # fmt: skip
            buffer.close()
