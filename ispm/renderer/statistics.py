"""The numbers of a frame: the columns of McGuire and Luebke's talk, then ours."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ispm.estimators import estimator_name
from ispm.photons.walk import Walk
from ispm.renderer.one_pass import Pass
from ispm.renderer.watch import peak_memory
from ispm.stages.camera import CameraView

_STAGES = ("direct", "bounce_map", "copy", "trace", "radiance", "upsample", "compose")
_COUNTED = 16384  # photons at most that overdraw is taken from
_INDIRECT = ("bounce_map", "copy", "trace", "radiance", "upsample")  # what direct light does without


@dataclass(frozen=True)
class Stats:
    """Numbers of one frame. Times in ms, flux in lumen (sum of RGB), memory in bytes.

    total_ms        until its light is there: tone mapping comes when the picture is first asked for
    direct_only_ms  the frame without what indirect light adds
    passes, error   whose mean the frame is; the relative error that their noise leaves, root mean square, as
                    halves of the passes differ; not a number of one
    overdraw        kernels that cover a pixel of the full picture, in the mean
    """

    polygons: int = 0
    static_polygons: int = 0
    dynamic_polygons: int = 0
    dynamic_objects: int = 0
    emitters: int = 0
    emitted_photons: int = 0
    indirect_photons: int = 0  # bounces, as the talk's column has it
    width: int = 0
    height: int = 0
    subsampling: int = 0
    photon_hits: int = 0
    stored_photons: int = 0
    direct_ms: float = 0.0
    bounce_map_ms: float = 0.0
    copy_ms: float = 0.0
    trace_ms: float = 0.0
    radiance_ms: float = 0.0
    upsample_ms: float = 0.0
    compose_ms: float = 0.0
    total_ms: float = 0.0
    direct_only_ms: float = 0.0
    fps_direct: float = 0.0
    fps_full: float = 0.0
    flux_emitted: float = 0.0
    flux_absorbed: float = 0.0
    flux_escaped: float = 0.0
    flux_dropped: float = 0.0
    flux_stored: float = 0.0
    overdraw: float = 0.0
    peak_memory: int = 0
    adapter: str = ""
    tracer: str = "cpu"
    estimator: str = ""
    emission: str = ""
    kernel: str = ""
    passes: int = 1
    error: float = math.nan
    seed: int = 0
    timing: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Return the statistics by name."""
        return dataclasses.asdict(self)


def collect(this: Pass, path: Walk, times: Mapping[str, float], total_ms: float, moved: np.ndarray) -> Stats:
    """Return a frame's statistics, but for what only its maker knows: adapter, emission and timing.

    times  ms of the stages by name;  total_ms of the whole frame
    moved  (I,) bool: the instances that stand elsewhere than in the frame before
    """
    packed, settings = this.packed, this.settings
    dynamic = packed.instances[moved]
    dynamic_polygons = int(dynamic["triangle_count"].sum())
    spent: dict[str, Any] = {f"{name}_ms": times.get(name, 0.0) for name in _STAGES}
    direct_only = max(total_ms - sum(spent[f"{name}_ms"] for name in _INDIRECT), spent["direct_ms"], 1e-3)
    for name in ("emitted", "absorbed", "escaped", "dropped", "stored"):
        spent[f"flux_{name}"] = float(getattr(path, name).sum())
    return Stats(
        **spent,
        polygons=packed.triangle_count,
        static_polygons=packed.triangle_count - dynamic_polygons,
        dynamic_polygons=dynamic_polygons,
        dynamic_objects=len(np.unique(dynamic["node"])),
        emitters=len(packed.lights),
        emitted_photons=path.photon_count,
        indirect_photons=settings.bounces,
        width=settings.size[0],
        height=settings.size[1],
        subsampling=settings.subsampling,
        photon_hits=path.photon_count + path.rays,
        stored_photons=len(path.photons),
        total_ms=total_ms,
        direct_only_ms=direct_only,
        fps_direct=1e3 / direct_only,
        fps_full=1e3 / max(total_ms, 1e-3),
        overdraw=overdraw(path.photons, this.view),
        peak_memory=peak_memory(),
        estimator=estimator_name(settings),
        kernel="footprint" if settings.kernel == "auto" else settings.kernel,
        seed=settings.seed,
    )


def overdraw(photons: np.ndarray, view: CameraView) -> float:
    """Return how many kernels cover a pixel in the mean, of the photons whose centers the eye's view holds.

    A disc of radius r at depth z, its normal at an angle to the eye, covers pi r^2 cos / (z footprint)^2
    pixels; occlusion is not counted.
    """
    if not len(photons):
        return 0.0
    step = -(-len(photons) // _COUNTED)
    photons = photons[::step]
    position = photons["position"].astype(np.float64)
    clip = position @ view.clip_from_world[:, :3].T + view.clip_from_world[:, 3]
    seen = (np.abs(clip[:, :2]) <= np.abs(clip[:, 3:])).all(axis=1) & (clip[:, 3] > 0.0)
    eye = view.eye_or_direction
    wo = eye[:3] - eye[3] * position[seen]
    wo /= np.maximum(np.linalg.norm(wo, axis=1, keepdims=True), 1e-30)
    cosine = np.abs(np.einsum("ij,ij->i", wo, photons["normal"][seen]))
    depth = clip[seen, 3] if view.ymag is None else 1.0
    area = math.pi * (photons["radius"][seen] / (depth * view.footprint)) ** 2 * cosine
    return step * float(area.sum() / (view.size[0] * view.size[1]))
