"""Shadows' edges: where the maps leave in doubt whether a light reaches a pixel, rays tell."""

from __future__ import annotations

import numpy as np

from ispm.lights.passed import passed_light
from ispm.optics.records import take
from ispm.renderer.gather import clearance
from ispm.renderer.one_pass import Pass
from ispm.renderer.specular import SAMPLES
from ispm.stages.camera import CameraView

_WIDE = 1.5  # pixels: texels that are wider leave in doubt all pixels beside an edge
_ASIDE = 8.0  # pixels' sides that a sample lies from its pixel's centre at most, on surfaces seen aslant


class ShadowRays:
    """Rays from the eye's pixels to lights; with antialiasing, those on edges send four more."""

    def __init__(self, this: Pass) -> None:
        self._this, self._view = this, this.view

    def light(self, doubts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return pixels' numbers, (m,) sorted, and the radiance that was in doubt there, (m, 3) float32.

        doubts  (n,) DOUBT, by light and pixel
        """
        if not len(doubts):
            return np.zeros(0, np.uint32), np.zeros((0, 3), np.float32)
        starts = self._raised(doubts["position"], doubts["ng"])
        seen = self._seen(doubts, starts)
        if self._this.settings.antialias:
            edges = np.flatnonzero(_on_edges(doubts, seen, self._view))
            seen[edges] = self._sampled(take(doubts, edges), starts[edges], seen[edges])
        pixels, rows = np.unique(doubts["pixel"], return_inverse=True)
        radiance = doubts["radiance"] * seen
        sums = [np.bincount(rows, channel, len(pixels)) for channel in radiance.T]
        return pixels, np.stack(sums, axis=1).astype(np.float32)

    def _raised(self, points: np.ndarray, ng: np.ndarray) -> np.ndarray:
        """Where rays start that leave points, (n, 3) float32."""
        return np.asarray(points + clearance(points, self._view.eye)[:, None] * ng)

    def _seen(self, doubts: np.ndarray, starts: np.ndarray) -> np.ndarray:
        """(n, 3) float32 share of light that comes from each doubt's light to where a ray starts."""
        this = self._this
        return passed_light(this.packed, this.world, this.surfaces, starts, doubts["light"])

    def _sampled(self, doubts: np.ndarray, starts: np.ndarray, seen: np.ndarray) -> np.ndarray:
        """(n, 3) float32 mean of the share over four places of each pixel, on the plane of its surface.

        starts, seen  of its middle
        Passes spread over the pixel themselves, so theirs lie closer. A place that something parts from the
        middle is of another surface, and has the middle's share.
        """
        right, down = self._across(doubts)
        near = np.square(_ASIDE * self._view.pixel_widths(doubts["position"]))
        total = np.zeros_like(seen)
        spread = np.float32(1.0 / np.sqrt(1.0 + self._this.index))
        for x, y in spread * SAMPLES.astype(np.float32):
            aside = x * right + y * down
            same = (_dot(aside, aside) < near) & ~self._this.world.occluded(starts, aside, 1.0)
            rows = np.flatnonzero(same)
            total += seen
            total[rows] += self._seen(take(doubts, rows), starts[rows] + aside[rows]) - seen[rows]
        return np.asarray(total / np.float32(len(SAMPLES)))

    def _across(self, doubts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Ways on the planes of surfaces to the next pixel right and below, (n, 3) float32 m each."""
        points, ng = doubts["position"], doubts["ng"]
        pose, eye = (a.astype(np.float32) for a in (self._view.pose, self._view.eye_or_direction))
        ways = points - eye[:3] if eye[3] else -eye[:3]
        slope = _dot(ways, ng)
        widths = self._view.pixel_widths(points)[:, None]
        flat = ways / np.where(slope == 0.0, np.float32(1e-30), slope)[:, None]
        right, down = (widths * (axis - (ng @ axis)[:, None] * flat) for axis in (pose[:3, 0], -pose[:3, 1]))
        return right, down


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(np.einsum("...k,...k->...", a, b))


def _on_edges(doubts: np.ndarray, seen: np.ndarray, view: CameraView) -> np.ndarray:
    """(n,) whether the pixel right, left, above or below has another share of the light, or may have."""
    wide = view.size[0] + 1  # so that a row's last pixel is not beside the next one's first
    pixels = doubts["pixel"].astype(np.int64)
    places = doubts["light"] * np.int64(wide * (view.size[1] + 1)) + pixels + pixels // view.size[0]
    edges = doubts["texel"] < _WIDE * view.pixel_widths(doubts["position"])
    for step in (1, wide):
        beside = np.minimum(np.searchsorted(places, places + step), len(places) - 1)
        pairs = np.flatnonzero(places[beside] == places + step)
        differ = pairs[(seen[pairs] != seen[beside[pairs]]).any(axis=1)]
        edges[differ] = edges[beside[differ]] = True
    return np.asarray(edges)


def join_pixels(
    chains: tuple[np.ndarray, np.ndarray], shadows: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return pixels, (m,) sorted, and what to add there, (m, c) float32.

    chains   (n,) pixels, none of them twice, and (n, c) what eye paths bring, direct light first; last the
             share of other light that a coat hides
    shadows  likewise, and (n, 3) direct light that was in doubt
    """
    pixels, rows = np.unique(np.concatenate([chains[0], shadows[0]]), return_inverse=True)
    light = np.zeros((len(pixels), chains[1].shape[1]), np.float32)
    light[rows[: len(chains[0])]] = chains[1]
    own = rows[len(chains[0]) :]
    light[own, :3] += (1.0 - light[own, -1:]) * shadows[1]
    return pixels, light
