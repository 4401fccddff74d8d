"""Photons to receivers through tiles of the screen, in compute shaders; `tiled_cpu` does it on the CPU."""

from __future__ import annotations

import numpy as np

from ispm import wgsl
from ispm.gpu import Gpu
from ispm.optics.incident import no_light

_PATH = "estimators/tiled.wgsl"
_SCREEN = wgsl.load(_PATH).dtype("Screen")
_BOX = wgsl.load(_PATH).dtype("Box")
_SIDE = 8  # receivers along a tile's edge
_ENTRIES = ("bound", "count", "scan", "fill", "sort", "gather", "gather_gloss")
_BUFFERS = ("receivers", "photons", "boxes", "counts", "starts", "members", "result")


class Tiled:
    """The `tiled` estimator on the GPU, see `estimators.Estimator`.

    A tile's photons are listed by atomic counters, so their order changes from run to run, and the sums
    with it by 2e-7 of the peak.
    """

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._passes = {entry: gpu.compute(_PATH, entry) for entry in _ENTRIES}
        self._buffers = {name: gpu.buffer(name) for name in _BUFFERS}

    def __call__(
        self, receivers: np.ndarray, photons: np.ndarray, clip_from_world: np.ndarray, size: tuple[int, int]
    ) -> np.ndarray:
        """Return (h*w, 16) float32 channels, see `estimators.Estimator`."""
        if not len(photons) or not len(receivers):
            return no_light(len(receivers))
        screen = np.zeros((), _SCREEN)
        screen["clip_from_world"], screen["size"] = np.transpose(clip_from_world), size
        screen["tiles"] = -(-size[0] // _SIDE), -(-size[1] // _SIDE)
        screen["photon_count"] = len(photons)
        self._buffers["receivers"].write(receivers)
        self._buffers["photons"].write(photons)
        self._list(screen)
        return self._sum(screen, len(receivers), bool((receivers["alpha"] > 0.0).any()))

    def _list(self, screen: np.ndarray) -> None:
        """Fill `members` with each tile's photons; those of tile t start at starts[t]."""
        passes, buffers = self._passes, self._buffers
        tile_count, photon_count = int(screen["tiles"].prod()), int(screen["photon_count"])
        receivers, photons = buffers["receivers"], buffers["photons"]
        boxes = buffers["boxes"].sized(tile_count * _BOX.itemsize)
        counts = buffers["counts"].sized(tile_count * 4)
        starts = buffers["starts"].sized((tile_count + 1) * 4)
        tiles = dict(screen=screen, boxes=boxes, counts=counts)
        with self._gpu.frame() as frame:
            passes["bound"](frame, over=tile_count, receivers=receivers, **tiles)
            passes["count"](frame, over=photon_count, photons=photons, **tiles)
            passes["scan"](frame, over=1, screen=screen, counts=counts, starts=starts)
        length = int(self._gpu.read_buffer(starts, np.uint32, tile_count + 1)[-1])
        members = buffers["members"].sized(length * 4)
        with self._gpu.frame() as frame:
            passes["fill"](frame, over=photon_count, photons=photons, starts=starts, members=members, **tiles)
            across, _, _ = passes["sort"].workgroup
            threads = across * tile_count
            passes["sort"](frame, over=threads, starts=starts, members=members)

    def _sum(self, screen: np.ndarray, receiver_count: int, glossy: bool) -> np.ndarray:
        """Sum the lists at the receivers."""
        column_count = int(screen["tiles"].prod()) * _SIDE
        result = self._buffers["result"].sized(receiver_count * 64)
        lists = {
            name: self._buffers[name] for name in ("receivers", "photons", "starts", "members", "result")
        }
        with self._gpu.frame() as frame:
            frame.clear_buffer(result)
            self._passes["gather"](frame, over=column_count, screen=screen, **lists)
            if glossy:
                boxes = self._buffers["boxes"]
                self._passes["gather_gloss"](
                    frame, over=2 * column_count, screen=screen, boxes=boxes, **lists
                )
        return self._gpu.read_buffer(result, np.float32, receiver_count * 16).reshape(-1, 16)
