"""Render the references of scenes lit by surfaces and from all around, by our own paths from the eye.

python -m references.traced [NAME...]   # in tests/; half an hour on two cores

The paths (`ispm.reference.paths`) are held to Mitsuba's pictures and to exact answers by
`tests/statistical/test_paths.py` and `test_narrow_lobes.py`. Each picture is the mean of independent ones,
whose spread gives its standard error.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator

import numpy as np
from transport import Tracer

from ispm.kernels.threads import thread_count
from ispm.optics.records import NO_HIT
from ispm.reference.paths import path_light
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView
from references import FOLDER
from references.scenes import DIM, TRACED, dimmed

SIZE = 80, 45  # width and height
_BOUNCES = 8
_PARTS = 16
_PLACES, _PATHS = 32, 4  # of a pixel and part: rays from the eye, and paths of each
_OTHER_PLACES = {  # by noise, and by time
    "lamp-behind-glass": 64,
    "shade": 16,
    "many-lamps": 16,
    "strip-corridor": 16,
    "window-vase": 64,
}
_FINER = 6  # times as many, where caustics are
_CAUSTICS = ("lamp-behind-glass",)
_GRID = 8  # rays along a pixel's side that look for edges
_SAME_FACE = 0.97  # cosine of two normals
_FLAT = 0.01  # of the inverse depth that it bends by, from one of these rays to the next


def main() -> None:
    """Make those named, or all."""
    for name in sys.argv[1:] or TRACED:
        started = time.perf_counter()
        places = _OTHER_PLACES.get(name, _PLACES)
        mean, error = rendered(TRACED[name](), places, _BOUNCES)
        masks = {"whole": even_pixels(TRACED[name]())}
        if name in _CAUSTICS:
            # what came by way of one Lambert surface alone, less what came straight to it
            dark, _ = rendered(dimmed(TRACED[name](), DIM), places // 2, _BOUNCES)
            straight, _ = rendered(TRACED[name](), _PLACES, 0)
            caustic = (dark / DIM - straight).mean(axis=-1) > 0.1 * mean.mean(axis=-1)
            masks["caustic"] = masks["whole"] & caustic
            more, less_error = rendered(TRACED[name](), _FINER * places, _BOUNCES, caustic)
            mean[caustic], error[caustic] = more[caustic], less_error[caustic]
        _store(name, mean, error, masks, places * _PATHS * _PARTS)
        print(f"{name}: {time.perf_counter() - started:.0f} s", flush=True)


def rendered(
    scene: Scene, places: int, bounces: int, chosen: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return a picture, (h, w, 3) cd/m2, by so many rays a pixel and part, and its standard error; chosen:
    (h, w) the pixels that are not left black, all by default."""
    width, height = SIZE
    pixels = np.flatnonzero(np.ones(SIZE[::-1]) if chosen is None else chosen)
    light = np.zeros((_PARTS, height * width, 3))
    light[:, pixels] = list(_parts(scene, places, bounces, pixels))
    parts = light.reshape(_PARTS, height, width, 3)
    return parts.mean(axis=0), parts.std(axis=0, ddof=1) / np.sqrt(_PARTS)


def _parts(scene: Scene, places: int, bounces: int, pixels: np.ndarray) -> Iterator[np.ndarray]:
    """Independent estimates of what pixels show, (n, 3)."""
    tracer, view = Tracer(scene), _view(scene)
    width, random = SIZE[0], np.random.default_rng(7)
    for part in range(_PARTS):
        # rays of one pixel lie together: threads share them in chunks
        dx, dy = random.random((2, len(pixels), places))
        x, y = dx + (pixels % width)[:, None], dy + (pixels // width)[:, None]
        origins, directions = view.rays_through(x, y)
        samples = range(part * _PATHS, (part + 1) * _PATHS)
        rays = origins.reshape(-1, 3), directions.reshape(-1, 3)
        light = path_light(
            tracer.tables, *rays, samples=samples, bounces=bounces, seed=part, threads=thread_count(None)
        )
        yield light.reshape(len(pixels), places, 3).mean(axis=1)


def even_pixels(scene: Scene) -> np.ndarray:
    """Return (h, w): pixels that show one surface without an edge, not glass nor what shines itself."""
    tracer, (width, height) = Tracer(scene), SIZE
    steps = (np.arange(_GRID) + 0.5) / _GRID
    x = np.arange(width)[:, None, None] + steps
    y = np.arange(height)[:, None, None, None] + steps[:, None]
    origins, directions = _view(scene).rays_through(x, y)
    shape = origins.shape[:4]
    hits = tracer.world.trace(
        origins.reshape(-1, 3).astype(np.float32), directions.reshape(-1, 3).astype(np.float32)
    )
    met = hits["instance"] != NO_HIT
    normals, plain = np.zeros((len(hits), 3)), met.copy()
    normals[met], plain[met] = _faces(tracer, hits[met])
    normals = normals.reshape(height, width, _GRID**2, 3)
    alike = (normals @ normals[:, :, :1].swapaxes(-1, -2) > _SAME_FACE).all(axis=(2, 3))
    inverse = 1.0 / np.where(met, hits["t"], 1e9).reshape(shape)
    bends = [np.abs(np.diff(inverse, 2, axis=axis)).max(axis=(2, 3)) for axis in (2, 3)]
    flat = np.maximum(*bends) < _FLAT * inverse.mean(axis=(2, 3))
    return np.asarray(plain.reshape(shape).all(axis=(2, 3)) & alike & flat)


def _faces(tracer: Tracer, hits: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) unit normals of the triangles of HIT, and (n,) whether they neither shine nor let light pass."""
    packed = tracer.packed
    instances = packed.instances[hits["instance"]]
    first = instances["first_index"].astype(np.int64) + 3 * hits["primitive"].astype(np.int64)
    corners = packed.geometry.vertices["position"][packed.geometry.indices[first[:, None] + np.arange(3)]]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).astype(np.float64)
    turn = np.stack([instances[f"normal{k}"][:, :3] for k in range(3)], axis=1).astype(np.float64)
    normals = np.einsum("nij,nj->ni", turn, across)
    materials = packed.materials[instances["material"]]
    plain = (materials["emission"].max(axis=1) == 0.0) & (materials["transmission"] == 0.0)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True), plain


def _view(scene: Scene) -> CameraView:
    camera = scene.default_camera(SIZE)
    return CameraView(SIZE, camera.pose, camera.yfov, camera.ymag)


def _store(
    name: str, mean: np.ndarray, error: np.ndarray, masks: dict[str, np.ndarray], samples: int
) -> None:
    own_errors = {f"own_error_{key}": _own_error(mean, error, mask) for key, mask in masks.items()}
    np.savez_compressed(
        FOLDER / f"{name}.npz", radiance=mean.astype(np.float32), samples=samples, bounces=_BOUNCES,
        standard_error=error.mean(axis=-1).astype(np.float32), **masks, **own_errors,
    )  # fmt: skip
    print(f"  {name}: {own_errors}, {masks['whole'].mean():.0%} compared", flush=True)


def _own_error(radiance: np.ndarray, error: np.ndarray, mask: np.ndarray) -> float:
    """relMSE of noise alone over the pixels of a mask."""
    eps = 1e-3 * radiance[mask].mean() ** 2
    return float((error[mask] ** 2 / (radiance[mask] ** 2 + eps)).mean())


if __name__ == "__main__":
    main()
