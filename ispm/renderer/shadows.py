"""Shadows' edges: where the maps leave in doubt whether a light reaches a pixel, rays tell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ispm.optics.records import LIGHT_DIRECTIONAL
from ispm.renderer.chains import SAMPLES
from ispm.renderer.gather import clearance
from ispm.scene.packed import Packed
from ispm.stages.camera import CameraView
from ispm.tracer.passed import passed_light
from ispm.tracer.surface import SurfaceTable
from ispm.tracer.world import World

_WIDE = 1.5  # pixels: texels that are wider leave in doubt all pixels beside an edge
_ASIDE = 8.0  # pixels' sides that a sample lies from its pixel's centre at most, on surfaces seen aslant


@dataclass(frozen=True, eq=False)
class ShadowRays:
    """What rays from pixels to lights need.

    view  the eye's;  antialias  whether pixels on edges are sampled four times
    """

    packed: Packed
    world: World
    surfaces: SurfaceTable
    view: CameraView
    antialias: bool
    seed: int
    threads: int

    def light(self, doubts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return pixels' numbers, (m,) sorted, and the radiance that was in doubt there, (m, 3) float32.

        doubts  (n,) DOUBT, by light and pixel
        """
        if not len(doubts):
            return np.zeros(0, np.uint32), np.zeros((0, 3), np.float32)
        starts = self._raised(doubts["position"], doubts["ng"])
        seen = self._seen(doubts, starts, 0)
        if self.antialias:
            edges = np.flatnonzero(_on_edges(doubts, seen, self.view))
            seen[edges] = self._sampled(doubts[edges], starts[edges], seen[edges])
        pixels, rows = np.unique(doubts["pixel"], return_inverse=True)
        radiance = doubts["radiance"] * seen
        sums = [np.bincount(rows, channel, len(pixels)) for channel in radiance.T]
        return pixels, np.stack(sums, axis=1).astype(np.float32)

    def _raised(self, points: np.ndarray, ng: np.ndarray) -> np.ndarray:
        """Where rays start that leave points, (n, 3) float32."""
        return points + clearance(points, self.view.eye)[:, None] * ng

    def _seen(self, doubts: np.ndarray, starts: np.ndarray, sample: int) -> np.ndarray:
        """(n, 3) float32 share of light that comes from each doubt's light to where a ray starts."""
        light = self.packed.lights[doubts["light"]]
        far = light["kind"] == LIGHT_DIRECTIONAL
        ways = np.where(far[:, None], -light["direction"], light["position"] - starts)
        distances = np.linalg.norm(ways, axis=1)
        limits = np.where(far, np.float32(np.inf), distances)
        return passed_light(
            self.packed, self.world, self.surfaces, starts, ways / distances[:, None], limits,
            doubts["pixel"], sample, self.view.pass_index, self.seed, self.threads,
        )  # fmt: skip

    def _sampled(self, doubts: np.ndarray, starts: np.ndarray, seen: np.ndarray) -> np.ndarray:
        """(n, 3) float32 mean of the share over four places of each pixel, on the plane of its surface.

        starts, seen  of its middle
        Passes spread over the pixel themselves, so theirs lie closer. A place that something parts from the middle
        is of another surface, and has the middle's share.
        """
        view, total = self.view, np.zeros_like(seen)
        x, y = doubts["pixel"] % view.size[0] + 0.5, doubts["pixel"] // view.size[0] + 0.5
        point, ng = doubts["position"].astype(np.float64), doubts["ng"]
        for sample, (right, down) in enumerate(SAMPLES / np.sqrt(1.0 + view.pass_index)):
            origins, ways = view.rays_through(x + right, y + down)
            slope = np.einsum("nk,nk->n", ways, ng)
            along = np.einsum("nk,nk->n", point - origins, ng) / np.where(slope == 0.0, 1.0, slope)
            aside = (origins + along[:, None] * ways - point).astype(np.float32)
            near = np.einsum("nk,nk->n", aside, aside) < np.square(_ASIDE * view.pixel_widths(point))
            near &= ~self.world.occluded(starts, aside, 1.0)
            some = np.flatnonzero(near)
            total += seen
            total[some] += self._seen(doubts[some], starts[some] + aside[some], 1 + sample) - seen[some]
        return np.asarray(total / np.float32(len(SAMPLES)))


def _on_edges(doubts: np.ndarray, seen: np.ndarray, view: CameraView) -> np.ndarray:
    """(n,) whether a pixel lies beside one that has another share of its light, or may do."""
    wide = view.size[0] + 1  # so that a row's last pixel is not beside the next one's first
    pixels = doubts["pixel"].astype(np.int64)
    places = doubts["light"] * np.int64(wide * (view.size[1] + 1)) + pixels + pixels // view.size[0]
    edges = doubts["texel"] < _WIDE * view.pixel_widths(doubts["position"])
    for step in (1, wide - 1, wide, wide + 1):
        beside = np.minimum(np.searchsorted(places, places + step), len(places) - 1)
        differ = (places[beside] == places + step) & (seen != seen[beside]).any(axis=1)
        edges[differ] = edges[beside[differ]] = True
    return np.asarray(edges)


def join_pixels(
    chains: tuple[np.ndarray, np.ndarray], shadows: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return pixels, (m,) sorted, and direct light, indirect light and emission to add there, (m, 9) float32.

    chains   (n,) pixels, none of them twice, and (n, 9) what eye paths bring
    shadows  likewise, and (n, 3) direct light that was in doubt
    """
    pixels, rows = np.unique(np.concatenate([chains[0], shadows[0]]), return_inverse=True)
    light = np.zeros((len(pixels), 9), np.float32)
    light[rows[: len(chains[0])]] = chains[1]
    light[rows[len(chains[0]) :], :3] += shadows[1]
    return pixels, light
