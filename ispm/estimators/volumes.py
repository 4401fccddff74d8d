"""The paper's estimator: photon volumes drawn by the rasteriser and added up by blending."""

from __future__ import annotations

import itertools
from functools import cache

import numpy as np

from ispm import wgsl
from ispm.errors import AdapterError
from ispm.gpu import Gpu, RasterState, Target

_PATH = "estimators/volumes.wgsl"
_SCREEN = wgsl.load(_PATH).dtype("Screen")
_SUM = Target("rgba32float", blend="add")


class Volumes:
    """The `volumes` estimator, see `estimators.Estimator`.

    Back faces are drawn, without a depth test, so the eye may stand inside a kernel and no near or far
    plane cuts one open. Sums are 32-bit floats: 16-bit ones stall where many small terms meet a large sum.
    Two targets a pass, because WebGPU promises 32 bytes per sample.

    talk    the kernel of the talk of 2009, for comparison: a cut Gaussian of a distance that is not an
            ellipsoid's
    errors  with it, as its slide has them: that distance with a minus, and a second cosine

    Raises AdapterError where the adapter cannot blend 32-bit floats.
    Source: McGuire and Luebke 2009, section 3.4.
    """

    def __init__(self, gpu: Gpu, talk: bool = False, errors: bool = False) -> None:
        if not gpu.has("float32-blendable"):
            raise AdapterError(
                f"{gpu.name}: it cannot blend 32-bit floats, which photon volumes need; "
                "choose the estimator 'tiled' or 'grid'"
            )
        self._gpu = gpu
        self._diffuse, self._light, self._gloss = (
            gpu.raster(
                _PATH,
                [_SUM] * targets,
                RasterState(depth=None, cull="front", fragment=fragment),
                TALK=talk,
                TALK_ERRORS=errors,
            )
            for fragment, targets in (("fs_diffuse", 1), ("fs_light", 2), ("fs_gloss", 2))
        )
        self._sums = [
            gpu.texture(name, "rgba32float") for name in ("light", "fresnel", "gloss f0", "gloss f90")
        ]
        self._faces = gpu.buffer("icosahedron", "index").write(icosahedron_faces())
        self._receivers, self._photons = gpu.buffer("receivers"), gpu.buffer("photons")

    def __call__(
        self, receivers: np.ndarray, photons: np.ndarray, clip_from_world: np.ndarray, size: tuple[int, int]
    ) -> np.ndarray:
        """Return (h*w, 16) float32 channels, see `estimators.Estimator`."""
        out = np.zeros((len(receivers), 4, 4), np.float32)
        if not len(photons) or not len(receivers):
            return out.reshape(-1, 16)
        screen = np.zeros((), _SCREEN)
        screen["clip_from_world"], screen["size"] = np.transpose(clip_from_world), size
        shared = dict(
            screen=screen, receivers=self._receivers.write(receivers), photons=self._photons.write(photons)
        )
        glossy = bool((receivers["alpha"] > 0.0).any())
        passes = [(self._light, self._sums[:2]), (self._gloss, self._sums[2:])]
        if not glossy:
            passes = [(self._diffuse, self._sums[:1])]
        with self._gpu.frame() as frame:
            for raster, targets in passes:
                with frame.draw_into(*(target.sized(size) for target in targets)) as canvas:
                    canvas.use(raster, raster.bind(0, frame, **shared))
                    canvas.indices(self._faces)
                    canvas.draw_indexed(60, len(photons))
        wanted = [target for _, targets in passes for target in targets]
        found = self._gpu.read_many([(target, np.float32, 4) for target in wanted])
        for k, sums in enumerate(found):
            out[:, k] = sums.reshape(-1, 4)
        return out.reshape(-1, 16)


def icosahedron_corners() -> np.ndarray:
    """Return the (12, 3) corners on the unit sphere, in the order of volumes.wgsl."""
    golden = (1 + 5**0.5) / 2
    first = np.array([[0, a, b] for b in (-golden, golden) for a in (-1, 1)])
    corners: np.ndarray = np.concatenate([first, first[:, [2, 0, 1]], first[:, [1, 2, 0]]])
    return corners / float(np.hypot(1, golden))


@cache
def icosahedron_faces() -> np.ndarray:
    """Return (60,) uint32: its 20 triangles, counterclockwise from outside."""
    corners = icosahedron_corners()
    edge = np.linalg.norm(corners[:, None] - corners[None], axis=2)[0]
    shortest = np.sort(edge)[1]
    faces = []
    for a, b, c in itertools.combinations(range(12), 3):
        p, q, r = corners[[a, b, c]]
        if np.allclose([np.linalg.norm(p - q), np.linalg.norm(q - r), np.linalg.norm(r - p)], shortest):
            outward = np.dot(np.cross(q - p, r - p), p) > 0.0
            faces += [a, b, c] if outward else [a, c, b]
    return np.array(faces, np.uint32)
