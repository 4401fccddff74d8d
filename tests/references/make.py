"""Render the small references with Mitsuba 3 and store them beside this file.

python -m references.make [NAME...]   # in tests/; a quarter of an hour on two cores

Each is the mean of independent pictures, whose spread gives its standard error. Paths start at the eye;
where mirrors and glass throw caustics they start at the light, and direct light comes from the eye: the light
tracer's own, of the same random numbers, is taken off again. Needs the extra `references`, and LLVM 17 or
newer for Mitsuba (DRJIT_LIBLLVM_PATH says where).
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

import mitsuba as mi
import numpy as np

from ispm.scene.scene import Scene
from references import FOLDER, SMALL
from references.rooms import ROOMS
from references.scenes import DIM, SCENES, dimmed
from references.to_mitsuba import to_mitsuba

_BOUNCES = 8  # of the older references
_ALL = 100  # as many as the setting takes: no limit
_ROULETTE = 8  # scatters before it, where there is no limit
_PARTS = 16
_SAMPLES = 256  # per pixel and part
_MORE = {
    "door": 4,
    "sun": 2,
    "cornell-box": 2,
    "two-rooms": 8,
    "sunlit": 4,
    "level": 2,
}  # times as many, where there is more noise
_CAUSTICS = "glass-ball", "mirror-ring"
_GRID = 8  # rays along a pixel's side that look for edges
_SAME_FACE = 0.97  # cosine of two normals

Estimates = dict[str, tuple[np.ndarray, int]]
"""By what is left out: a picture and its limit of bounces."""
Parts = Callable[[int, int], Estimates]
"""Of a seed and samples per pixel."""


def main() -> None:
    """Make those named, or all."""
    mi.set_variant("llvm_ad_rgb")
    for name in sys.argv[1:] or SCENES:
        started = time.perf_counter()
        samples = _SAMPLES * _MORE.get(name, 1)
        parts = _caustic_parts(name) if name in _CAUSTICS else _path_parts(name)
        means, errors = _mean(parts, samples)
        whole = _even_pixels(SCENES[name]())
        for split, mean in means.items():
            masks = {"whole": whole}
            if name in _CAUSTICS and split != "-direct":
                masks["caustic"] = whole & _caustic_pixels(
                    {key: picture for key, (picture, _) in means.items()}
                )
            _store(name + split, mean, errors[split], masks, samples * _PARTS)
        print(f"{name}: {time.perf_counter() - started:.0f} s", flush=True)


def _path_parts(name: str) -> Parts:
    limits = {"": _ALL if name in ROOMS else _BOUNCES}
    if name == "cornell-box":
        limits |= {"-direct": 0, "-one-bounce": 1}
    scenes = {split: _path(SCENES[name](), bounces) for split, bounces in limits.items()}
    return lambda seed, samples: {
        split: (_render(scene, seed, samples), limits[split]) for split, scene in scenes.items()
    }


def _caustic_parts(name: str) -> Parts:
    make = SCENES[name]
    direct = _path(make(), 0)
    light = {"type": "ptracer", "rr_depth": 12, "max_depth": -1}
    full, dim = to_mitsuba(make(), SMALL, light), to_mitsuba(dimmed(make(), DIM), SMALL, light)
    shot = to_mitsuba(make(), SMALL, {**light, "max_depth": 2})

    def parts(seed: int, samples: int) -> Estimates:
        straight = _render(direct, seed, samples)
        rest = straight - _render(shot, seed, samples)
        caustic = rest + _render(dim, seed, samples) / DIM
        whole = rest + _render(full, seed, samples)
        return {"-direct": (straight, 0), "-caustic": (caustic, _ALL), "": (whole, _ALL)}

    return parts


def _path(scene: Scene, bounces: int) -> Any:
    depth = bounces + 2  # the way from the light, and that to the eye
    roulette = _ROULETTE if bounces == _ALL else 1000
    return to_mitsuba(scene, SMALL, {"type": "path", "max_depth": depth, "rr_depth": roulette})


def _render(scene: Any, seed: int, samples: int) -> np.ndarray:
    return np.array(mi.render(scene, spp=samples, seed=seed)).astype(np.float64)


def _mean(parts: Parts, samples: int) -> tuple[Estimates, dict[str, np.ndarray]]:
    """Means with their limits of bounces, and (h, w, 3) standard errors, by split."""
    found = [parts(seed, samples) for seed in range(_PARTS)]
    means, errors = {}, {}
    for split, (_, bounces) in found[0].items():
        stack = np.stack([part[split][0] for part in found])
        means[split] = np.maximum(stack.mean(axis=0), 0.0), bounces
        errors[split] = stack.std(axis=0, ddof=1) / np.sqrt(_PARTS)
    return means, errors


def _store(
    name: str, mean: tuple[np.ndarray, int], error: np.ndarray, masks: dict[str, np.ndarray], samples: int
) -> None:
    radiance, bounces = mean
    own_errors = {f"own_error_{key}": _own_error(radiance, error, mask) for key, mask in masks.items()}
    np.savez_compressed(
        FOLDER / f"{name}.npz", radiance=radiance.astype(np.float16), samples=samples, bounces=bounces,
        standard_error=error.mean(axis=-1).astype(np.float16), **masks, **own_errors,
    )  # fmt: skip
    print(f"  {name}: {own_errors}, {masks['whole'].mean():.0%} compared", flush=True)


def _own_error(radiance: np.ndarray, error: np.ndarray, mask: np.ndarray) -> float:
    """relMSE of noise alone over the pixels of a mask."""
    eps = 1e-3 * radiance[mask].mean() ** 2
    return float((error[mask] ** 2 / (radiance[mask] ** 2 + eps)).mean())


def _caustic_pixels(means: dict[str, np.ndarray]) -> np.ndarray:
    """(h, w): where caustics are over a tenth of the light."""
    caustic, whole = means["-caustic"] - means["-direct"], means[""]
    return np.asarray(caustic.mean(axis=-1) > 0.1 * whole.mean(axis=-1))


def _even_pixels(scene: Scene) -> np.ndarray:
    """(h, w): pixels that show one flat face, not a mirror nor glass, all of it lit directly or not by the
    same lights, as are the eight round it."""
    traced = to_mitsuba(scene, SMALL, {"type": "direct"})
    width, height = SMALL[0] * _GRID, SMALL[1] * _GRID
    y, x = np.mgrid[0:height, 0:width] + 0.5
    place = mi.Point2f(np.stack([x.ravel() / width, y.ravel() / height]).astype(np.float32))
    rays, _ = traced.sensors()[0].sample_ray(0.0, 0.5, place, mi.Point2f(0.5))
    seen = traced.ray_intersect(rays)
    smooth = mi.has_flag(seen.bsdf().flags(), mi.BSDFFlags.Delta)
    even = _all(np.array(seen.is_valid() & ~smooth))
    normals = np.stack([np.array(axis) for axis in (seen.n.x, seen.n.y, seen.n.z)], axis=-1)
    even &= (_split(normals) @ _split(normals)[:, :, :1].swapaxes(-1, -2) > _SAME_FACE).all(axis=(2, 3))
    depth = 1.0 / np.where(np.array(seen.is_valid()), np.array(seen.t), 1e9)
    return even & _flat(_split(depth)) & _evenly_lit(traced, seen)


def _evenly_lit(traced: Any, seen: Any) -> np.ndarray:
    even = np.ones(SMALL[::-1], bool)
    for emitter in traced.emitters():
        to, value = emitter.sample_direction(seen, mi.Point2f(0.5))
        clear = ~traced.ray_test(seen.spawn_ray_to(to.p)) & (value.x > 0.0)
        lit = _split(np.array(clear)).mean(axis=2)
        low, high = _around(lit, np.minimum), _around(lit, np.maximum)
        even &= (low == high) & ((low == 0.0) | (low == 1.0))
    return even


def _flat(depth: np.ndarray) -> np.ndarray:
    """Whether the inverse depths of a pixel's rays, (h, w, k), are linear over the picture, as of a plane."""
    rows = depth.reshape(*depth.shape[:2], _GRID, _GRID)
    bends = [np.abs(np.diff(rows, 2, axis=axis)).max(axis=(2, 3)) for axis in (2, 3)]
    return np.maximum(*bends) < 0.01 * depth.mean(axis=2)


def _split(values: np.ndarray) -> np.ndarray:
    """One row per ray as (h, w, rays of a pixel, ...)."""
    grid = values.reshape(SMALL[1], _GRID, SMALL[0], _GRID, *values.shape[1:]).swapaxes(1, 2)
    return grid.reshape(SMALL[1], SMALL[0], _GRID**2, *values.shape[1:])


def _all(values: np.ndarray) -> np.ndarray:
    return np.asarray(_split(values).all(axis=2))


def _around(values: np.ndarray, extreme: Any) -> np.ndarray:
    """The least or greatest of each pixel and the eight round it."""
    padded = np.pad(values, 1, mode="edge")
    height, width = values.shape
    shifted = [padded[y : y + height, x : x + width] for y in range(3) for x in range(3)]
    return np.asarray(extreme.reduce(shifted))


if __name__ == "__main__":
    main()
