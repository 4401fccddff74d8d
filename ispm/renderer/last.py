"""The last frame with what it was made of, for the views that show more than its picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ispm.accel.surface import SurfaceTable
from ispm.errors import SettingsError
from ispm.lights.emission import place_photons
from ispm.lights.lightmap import texel_measures
from ispm.lights.plan import PlannedMap
from ispm.optics.records import EMITTED
from ispm.photons.first_hits import first_hits
from ispm.photons.grid import PhotonGrid
from ispm.renderer.charts import bounce_chart, overdraw_chart
from ispm.renderer.picture import Frame
from ispm.renderer.views import photon_points
from ispm.scene.packed import Packed
from ispm.stages.camera import CameraView


@dataclass(frozen=True, eq=False)
class LastFrame:
    """A frame, its photons and how they came about.

    photons         (N,) PHOTON with their kernels
    points          (rows * columns,) RECEIVER, of `low` columns and rows
    plan, texels    bounce maps and what they held; no texels where photons left the lights as rays
    """

    frame: Frame
    view: CameraView
    packed: Packed
    surfaces: SurfaceTable
    photons: np.ndarray
    points: np.ndarray
    low: tuple[int, int]
    plan: list[PlannedMap]
    texels: list[np.ndarray]
    threads: int

    def show(self, name: str) -> np.ndarray:
        """Return a view as uint8 sRGB. Raises SettingsError for one that cannot be made."""
        if name == "photons":
            frame = self.frame
            return photon_points(
                self.photons, frame.layers, self.view.clip_from_world, self.view.near, frame.exposure,
                frame.settings.tonemap,
            )  # fmt: skip
        if name == "overdraw":
            counts = PhotonGrid(self.photons).count(self.points, self.threads)
            return overdraw_chart(counts.reshape(self.low[1], self.low[0]), self.view.size)
        if name == "bounce-map":
            return self._bounce_maps()
        return self.frame.view(name)

    def _bounce_maps(self) -> np.ndarray:
        settings = self.frame.settings
        if not self.texels:
            why = "photons left the lights as rays" if settings.bounces else "bounces is 0"
            raise SettingsError(f"bounce-map: there is none, {why}; use bounces 1 or more and emission 'map'")
        shown, names = [], []
        emitted = texels_as_photons(self.packed, self.surfaces, self.plan, self.texels)
        for each, batch in zip(self.plan, emitted, strict=True):
            found = first_hits(self.packed, self.surfaces, batch, settings.seed, 0)
            shown.append(found.reshape(-1, each.width, each.width, 12))
            faces = f"{len(shown[-1])} faces of " if len(shown[-1]) > 1 else ""
            names.append(f"light {each.map.light}: {faces}{each.width} x {each.width} texels")
        return bounce_chart(shown, names, self.packed.bounds)


def texels_as_photons(
    packed: Packed, surfaces: SurfaceTable, plan: list[PlannedMap], texels: list[np.ndarray]
) -> list[np.ndarray]:
    """Return each map's texels as (faces W^2,) EMITTED of the flux they stand for, before any thinning."""
    batches = []
    first_key = 0
    for each, content in zip(plan, texels, strict=True):
        row, rows = packed.lights[each.map.light], np.zeros(content.size // 2, EMITTED)
        place_photons(surfaces, each, content, rows, np.arange(len(rows)))
        measures = texel_measures(each.map, row, each.width, each.shift)
        rows["flux"] = measures.reshape(-1, 1) * row["intensity"]
        rows["light"] = each.map.light
        rows["key"] = first_key + np.arange(len(rows))
        first_key += len(rows)
        batches.append(rows)
    return batches
