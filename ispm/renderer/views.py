"""Pictures of a frame's layers, for the eye."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ispm.errors import SettingsError
from ispm.renderer.backdrop import shown
from ispm.settings import RENDERER_VIEWS, VIEWS, nearest
from ispm.stages.camera import CameraView
from ispm.stages.tonemap import auto_exposure, tonemap

_PHOTON_DIM = 0.15  # of the direct picture behind the photons


def display(
    layers: Mapping[str, np.ndarray], view: str, exposure: float, mode: str, bits: int = 8
) -> np.ndarray:
    """Return a view as (h, w, 3) sRGB, uint8 or with 16 bits uint16.

    Light is shown at the full picture's exposure, irradiance at its own, depth near to far as bright
    to dark, normals as color (n + 1) / 2, ids as colors of their own.
    Raises SettingsError for a view that is made elsewhere or does not exist.
    """
    if view in ("full", "emission"):
        return shown(layers, layers[view], exposure, mode, bits)
    if view in ("direct", "indirect"):
        return tonemap(layers[view], exposure, mode, bits=bits)
    if view == "ambient":
        return shown(layers, _ambient(layers), exposure, mode, bits)
    if view == "irradiance":
        return tonemap(layers[view], auto_exposure(layers[view]), mode, bits=bits)
    if view == "albedo":
        return tonemap(layers[view], 0.0, "none", bits=bits)
    if view == "split":
        half = layers["full"].shape[1] // 2
        picture = shown(layers, layers["full"], exposure, mode, bits)
        picture[:, :half] = tonemap(layers["direct"], exposure, mode, bits=bits)[:, :half]
        picture[:, half : half + 1] = 2**bits - 1
        return picture
    if view in RENDERER_VIEWS:
        raise SettingsError(f"a frame has no view '{view}': it shows photons, so ask renderer.view('{view}')")
    if view not in VIEWS:
        raise SettingsError(f"there is no view '{view}'{nearest(view, VIEWS)}")
    picture = _drawn(layers, view)
    return picture if bits == 8 else picture.astype(np.uint16) * np.uint16(257)


def _drawn(layers: Mapping[str, np.ndarray], view: str) -> np.ndarray:
    """A view of what is no light, uint8."""
    if view == "normal":
        seen = np.isfinite(layers["depth"])[..., None]
        return np.where(seen, np.rint((layers[view] + 1.0) * 127.5), 0.0).astype(np.uint8)
    return _depth(layers[view]) if view == "depth" else _ids(layers[view])


def _ambient(layers: Mapping[str, np.ndarray]) -> np.ndarray:
    """The picture with a constant ambient term, of the same mean as the indirect light per channel."""
    albedo = layers["albedo"]
    amount = layers["indirect"].mean(axis=(0, 1), dtype=np.float64) / np.maximum(
        albedo.mean(axis=(0, 1), dtype=np.float64), 1e-30
    )
    return np.asarray(layers["direct"] + albedo * amount.astype(np.float32) + layers["emission"])


def photon_points(
    photons: np.ndarray, layers: Mapping[str, np.ndarray], seen_by: CameraView, exposure: float, mode: str
) -> np.ndarray:
    """Return the photons as points of their own color over the dimmed direct picture, uint8 sRGB.

    photons  (N,) PHOTON; one is drawn where the eye sees its surface
    """
    picture = tonemap(layers["direct"] * np.float32(_PHOTON_DIM), exposure, mode)
    height, width = layers["depth"].shape
    position = np.ones((len(photons), 4))
    position[:, :3] = photons["position"]
    clip = position @ seen_by.clip_from_world.T
    ahead = clip[:, 3] > 0.0
    ndc = clip[ahead] / clip[ahead, 3:]
    x = np.floor((ndc[:, 0] * 0.5 + 0.5) * width).astype(np.int64)
    y = np.floor((0.5 - ndc[:, 1] * 0.5) * height).astype(np.int64)
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height) & (ndc[:, 2] > 0.0)
    x, y = x[inside], y[inside]
    distance = clip[ahead, 3][inside] if clip[ahead, 3].std() > 0.0 else np.zeros(len(x))
    seen = distance <= layers["depth"][y, x] * 1.01 + seen_by.near
    flux = photons["flux"][ahead][inside][seen].astype(np.float64)
    color = flux / np.maximum(flux.max(axis=1, keepdims=True), 1e-30)
    picture[y[seen], x[seen]] = np.rint(color ** (1 / 2.2) * 255.0).astype(np.uint8)
    return picture


def _depth(depth: np.ndarray) -> np.ndarray:
    """Nearest white, farthest dark, nothing black; by the logarithm, as eyes judge distance."""
    seen = np.isfinite(depth)
    picture = np.zeros((*depth.shape, 3), np.uint8)
    if seen.any():
        logs = np.log(np.maximum(depth[seen], 1e-6))
        span = max(float(np.ptp(logs)), 1e-6)
        picture[seen] = np.rint(255.0 - 215.0 * (logs - logs.min()) / span).astype(np.uint8)[:, None]
    return picture


def _ids(ids: np.ndarray) -> np.ndarray:
    """A color for each id, far apart for ids that are near; black for none."""
    hue = (ids.astype(np.float64) * 0.618033988749895) % 1.0
    sixths = (hue[..., None] * 6.0 + np.array([0.0, 4.0, 2.0])) % 6.0
    color = np.clip(np.abs(sixths - 3.0) - 1.0, 0.0, 1.0)
    value = 0.55 + 0.45 * ((ids * 7 % 5) / 4.0)[..., None]
    return np.where(ids[..., None] >= 0, np.rint((0.25 + 0.75 * color) * value * 255.0), 0).astype(np.uint8)
