"""A frame's arrays, made from what the GPU gave when they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from ispm.kernels.threads import run_threads
from ispm.optics.jit import jit
from ispm.stages.camera import CameraView

f32 = np.float32


class Layers(Mapping[str, np.ndarray]):
    """Arrays by name, each made once, at its first use."""

    def __init__(self, makers: Mapping[str, Callable[[], np.ndarray]]) -> None:
        self._makers = dict(makers)
        self._made: dict[str, np.ndarray] = {}

    def __getstate__(self) -> dict[str, np.ndarray]:
        return dict(self)  # makers cannot be pickled; what they make can

    def __setstate__(self, made: dict[str, np.ndarray]) -> None:
        self._made = made
        self._makers = dict.fromkeys(made, lambda: np.zeros(0, np.float32))

    def __repr__(self) -> str:
        return f"<Layers {', '.join(self)}>"

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self._made:
            self._made[name] = self._makers[name]()
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._makers)

    def __len__(self) -> int:
        return len(self._makers)


def rgb(texels: np.ndarray) -> np.ndarray:
    """Return (h, w, 3) of (h, w, 4) float32."""
    return np.ascontiguousarray(texels[..., :3])


def sum_layers(direct: np.ndarray, indirect: np.ndarray, emission: np.ndarray, threads: int) -> np.ndarray:
    """Return (direct + indirect) + emission in float32, in this order, from (h, w, 4) texels."""
    out = np.empty((*direct.shape[:2], 3), np.float32)
    edges = np.linspace(0, len(out), threads + 1).astype(np.int64)

    def part(k: int) -> None:
        rows = slice(edges[k], edges[k + 1])
        _sum_layers(direct[rows], indirect[rows], emission[rows], out[rows])

    run_threads(part, threads)
    return out


@jit
def _sum_layers(direct, indirect, emission, out):
    for y in range(out.shape[0]):
        for x in range(out.shape[1]):
            for c in range(3):
                out[y, x, c] = (direct[y, x, c] + indirect[y, x, c]) + emission[y, x, c]


def linear_depth(depth: np.ndarray, view: CameraView) -> np.ndarray:
    """Return metres along the view axis for reversed clip depth; infinite where nothing is."""
    with np.errstate(divide="ignore"):
        if view.ymag is None:
            return np.asarray(f32(view.near) / depth, np.float32)
        metres = f32(view.far) - depth * f32(view.far - view.near)
    return np.where(depth > 0.0, metres, np.float32(np.inf)).astype(np.float32)


def decode_normals(packed: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Return (h, w, 3) unit shading normals of packed (h, w, 2) uint32; zero where nothing is."""
    p = np.ascontiguousarray(packed[..., :1]).view(np.int16) * f32(1.0 / 32767.0)
    z = 1.0 - np.abs(p).sum(axis=-1)
    folded = (1.0 - np.abs(p[..., ::-1])) * np.where(p >= 0.0, f32(1.0), f32(-1.0))
    n = np.concatenate([np.where((z < 0.0)[..., None], folded, p), z[..., None]], axis=-1)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    return np.where((depth > 0.0)[..., None], n, f32(0.0)).astype(np.float32)
