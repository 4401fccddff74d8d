"""Indirect light of one frame on the CPU: photons emitted, traced, and gathered at the receivers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ispm.frame import BounceMaps
from ispm.optics.records import EMITTED
from ispm.scene.lightmap import texel_measures
from ispm.scene.packed import Packed
from ispm.settings import Settings
from ispm.tracer.emission import map_shift, map_width, share_photons, thin


def map_plan(
    lights: np.ndarray, settings: Settings, pass_index: int
) -> tuple[list[int], list[tuple[float, float]]]:
    """Return the width of each light's bounce map (0: none) and its sub-texel shift.

    lights  (L,) LIGHT
    """
    shares = share_photons(lights, settings.photons if settings.bounces else 0)
    widths = [
        map_width(light, int(share)) if share else 0 for light, share in zip(lights, shares, strict=True)
    ]
    return widths, [map_shift(settings.seed, pass_index, i)[:2] for i in range(len(lights))]


def photons_of_maps(
    packed: Packed,
    maps: BounceMaps,
    texels: Sequence[np.ndarray],
    settings: Settings,
    pass_index: int,
) -> np.ndarray:
    """Return the (N,) EMITTED photons that bounce maps hold, light by light, in texel order."""
    shares = share_photons(packed.lights, settings.photons)
    batches = [np.zeros(0, EMITTED)]
    first_key = 0
    for each, content in zip(maps.maps, texels, strict=True):
        light, row = each.light, packed.lights[each.light]
        offset = map_shift(settings.seed, pass_index, light)[2]
        batches.append(
            thin(
                content.reshape(-1, each.width, each.width, 4),
                texel_measures(packed.maps[light], row, each.width, each.shift),
                row, int(shares[light]), light, first_key, offset,
            )
        )  # fmt: skip
        first_key += 6 * each.width**2
    return np.concatenate(batches)


def texels_as_photons(packed: Packed, maps: BounceMaps, texels: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return each map's texels as (faces W^2,) EMITTED of the flux they stand for, before any thinning."""
    batches = []
    first_key = 0
    for each, content in zip(maps.maps, texels, strict=True):
        row, words = packed.lights[each.light], content.reshape(-1, 4)
        rows = np.zeros(len(words), EMITTED)
        rows["instance"], rows["primitive"] = words[:, 0], words[:, 1]
        rows["u"], rows["v"] = words[:, 2].view(np.float32), words[:, 3].view(np.float32)
        measures = texel_measures(packed.maps[each.light], row, each.width, each.shift)
        rows["flux"] = measures.reshape(-1, 1) * row["intensity"]
        rows["light"] = each.light
        rows["key"] = first_key + np.arange(len(rows))
        first_key += 6 * each.width**2
        batches.append(rows)
    return batches
