"""The last frame with what it was made of, for the views that show more than its picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ispm.accel.records import Trees
from ispm.errors import IspmError, SettingsError
from ispm.frame import Receivers
from ispm.lights.emission import place_photons
from ispm.lights.lightmap import texel_measures
from ispm.lights.plan import PlannedMap
from ispm.optics.records import EMITTED, EMITTED_BY_SURFACE
from ispm.photons.first_hits import first_hits
from ispm.photons.grid import PhotonGrid
from ispm.renderer.caustics import PhotonClasses
from ispm.renderer.charts import bounce_chart, overdraw_chart
from ispm.renderer.light import Traced
from ispm.renderer.one_pass import Pass
from ispm.renderer.picture import Frame
from ispm.renderer.views import photon_points

CHANGED = "the scene has changed since the last picture; render it first"


@dataclass(frozen=True, eq=False)
class LastFrame:
    """A frame, its photons and how they came about.

    made      what it was made of
    trees     of its world, which later frames change
    parts     its photons with their kernels
    traced    how these left the lights
    """

    frame: Frame
    made: Pass
    trees: Trees
    parts: PhotonClasses
    receivers: Receivers
    traced: Traced

    @property
    def photons(self) -> np.ndarray:
        """(N,) PHOTON with their kernels."""
        return self.parts.photons

    def require_as_drawn(self) -> None:
        """Raise IspmError where the world has been placed anew since: rays would meet another scene."""
        if self.made.world.trees is not self.trees:
            raise IspmError(CHANGED)

    def show(self, name: str) -> np.ndarray:
        """Return a view as uint8 sRGB. Raises SettingsError for one that cannot be made."""
        if name == "photons":
            exposure, mode = self.frame.exposure, self.frame.settings.tonemap
            return photon_points(self.photons, self.frame.layers, self.made.view, exposure, mode)
        if name == "overdraw":
            counts = PhotonGrid(self.photons).count(self.receivers.points, self.made.threads)
            width, height = self.receivers.size
            return overdraw_chart(counts.reshape(height, width), self.made.view.size)
        if name == "bounce-map":
            return self._bounce_maps()
        return self.frame.view(name)

    def _bounce_maps(self) -> np.ndarray:
        settings = self.frame.settings
        traced = self.traced
        if not traced.texels:
            why = "photons left the lights as rays" if settings.bounces else "bounces is 0"
            raise SettingsError(f"bounce-map: there is none, {why}; use bounces 1 or more and emission 'map'")
        shown, names = [], []
        packed, surfaces = traced.this.packed, traced.this.surfaces
        for (each, _, of_lamp), batch in zip(_drawn(traced), texels_as_photons(traced), strict=True):
            found = first_hits(packed, surfaces, batch, traced.this.photon_seed, 0, traced.plan.openings.ways)
            shown.append(found.reshape(-1, each.width, each.width, 12))
            faces = f"{len(shown[-1])} faces of " if len(shown[-1]) > 1 else ""
            whose = f"{'point on lamps' if of_lamp else 'light'} {each.map.light}"
            names.append(f"{whose}: {faces}{each.width} x {each.width} texels")
        return bounce_chart(shown, names, packed.bounds)


def _drawn(traced: Traced) -> list[tuple[PlannedMap, np.void, bool]]:
    """Return the maps that were drawn, each with its LIGHT, and whether that is a point of a lamp."""
    plan, lights = traced.plan, traced.this.packed.lights
    lamps = plan.lamps.maps if plan.lamps else []
    maps = plan.drawn[: len(plan.drawn) - len(lamps)]
    drawn = [(each, lights[each.map.light], False) for each in maps]
    return drawn + [(each, plan.lamps.lights[each.map.light], True) for each in lamps if plan.lamps]


def texels_as_photons(traced: Traced) -> list[np.ndarray]:
    """Return the texels of each bounce map as (faces W^2,) EMITTED of the flux they stand for, before any
    thinning."""
    batches = []
    first_key = 0
    for (each, row, of_lamp), content in zip(_drawn(traced), traced.texels, strict=True):
        rows = np.zeros(content.size // 2, EMITTED)
        place_photons(traced.this.surfaces, each, content, rows, np.arange(len(rows)))
        measures = texel_measures(each.map, row, each.width, each.shift)
        rows["flux"] = measures.reshape(-1, 1) * row["intensity"]
        rows["light"], rows["origin"] = EMITTED_BY_SURFACE if of_lamp else each.map.light, row["position"]
        rows["key"] = first_key + np.arange(len(rows))
        first_key += len(rows)
        batches.append(rows)
    return batches
