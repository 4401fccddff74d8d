"""What the lights' photons do in a pass, as its settings ask."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ispm.lights.aim import aims_at_seen
from ispm.lights.emission import emit_rays, emit_texels
from ispm.lights.environment_emission import emit_from_environment, environment_flux
from ispm.lights.lamp_maps import LampMaps, emit_from_lamp_maps, plan_lamp_maps
from ispm.lights.lightmap import light_maps
from ispm.lights.openings import NO_OPENINGS, Openings
from ispm.lights.plan import PlannedMap, plan_maps, share_photons
from ispm.lights.sunlit import find_sunlit
from ispm.lights.surface_emission import emissive_flux, emit_from_surfaces
from ispm.lights.survey import find_openings
from ispm.photons.walk import Walk, walk
from ispm.renderer.gather import bright_limit
from ispm.renderer.one_pass import Pass
from ispm.scene.packed import Packed
from ispm.settings import Settings

_COARSE = 48, 27  # rays of the eye, across and down
_PHOTONS_PER_STORED = 1000  # photons of which one is stored: of fewer, light is noise


@dataclass(frozen=True, eq=False)
class EmissionPlan:
    """How photons leave the lights in a pass.

    maps      that emit them, of punctual lights, light by light
    by        "map": they are drawn, and photons come from their texels; or "rays": rays are sent through them
    lamps     maps of points of emissive surfaces, which are drawn; None: photons leave these as rays
    surfaces  how many leave emissive surfaces as rays, and
    surround  how many come from the environment, always as rays
    seen      (n, 3) m, places that the picture shows, at which some of these are aimed; None: unknown
    openings  through which the environment lights these
    """

    maps: list[PlannedMap]
    by: str
    lamps: LampMaps | None = None
    surfaces: int = 0
    surround: int = 0
    seen: np.ndarray | None = None
    openings: Openings = NO_OPENINGS

    @property
    def mostly(self) -> str:
        """How photons leave the lights, "map" or "rays", in a word."""
        return "rays" if not self.drawn and self.surfaces + self.surround else self.by

    @property
    def drawn(self) -> list[PlannedMap]:
        """Those maps that are drawn."""
        return [*(self.maps if self.by == "map" else []), *(self.lamps.maps if self.lamps else [])]


@dataclass(frozen=True, eq=False)
class Traced:
    """The photons of a pass: how they left the lights, and where they went.

    this    the pass that traced them; a live frame may show those of an earlier one
    texels  of each map of the lights, (F, width, width, 2) uint32; none where photons left as rays
    """

    this: Pass
    plan: EmissionPlan
    texels: Sequence[np.ndarray]
    path: Walk

    def emitted(self) -> np.ndarray:
        """Return the photons as they left the lights, (N,) EMITTED."""
        return emit_photons(self.this, self.plan, self.texels)


def map_plan(
    packed: Packed, settings: Settings, pass_index: int, seen: np.ndarray | None = None
) -> list[PlannedMap]:
    """Return the maps that emit photons, light by light; none where nothing is to be traced.

    seen  (n, 3) m, places that the picture shows; None: unknown
    """
    counts = share_photons(packed, settings.photons if settings.bounces else 0)
    return plan_maps(packed, counts, settings.caustic_photons, settings.seed, pass_index, seen)


def plan_emission(this: Pass, software: bool) -> EmissionPlan:
    """Return how the photons of a pass leave the lights; software: see `emission_of`."""
    packed, settings = this.packed, this.settings
    counts = share_photons(
        packed,
        settings.photons if settings.bounces else 0,
        [emissive_flux(packed, this.surfaces), environment_flux(packed)],
    )
    told = settings.caustic_photons, this.photon_seed, this.index
    seen, openings, sunlit = None, NO_OPENINGS, list[np.ndarray]()
    if aims_by_view(packed):
        scene, rays = (packed, this.world, this.surfaces), _coarse_rays(this)
        seen, openings = find_openings(*scene, rays, settings.seed, this.index)
        if counts[: len(packed.lights)].any():
            sunlit = find_sunlit(*scene, rays, settings.seed, this.index)
    maps = plan_maps(packed, counts, *told, seen, sunlit)
    by = emission_of(maps, packed, settings, software)
    surfaces, surround = map(int, counts[-2:])
    if settings.emission == "map":
        lamps = plan_lamp_maps(packed, this.surfaces, surfaces, *told)
        return EmissionPlan(maps, by, lamps, 0, surround, seen, openings)
    return EmissionPlan(maps, by, None, surfaces, surround, seen, openings)


def aims_by_view(packed: Packed) -> bool:
    """Whether some light sends its photons to where the picture needs them."""
    return environment_flux(packed) > 0.0 or any(map(aims_at_seen, light_maps(packed)))


def _coarse_rays(this: Pass) -> tuple[np.ndarray, np.ndarray]:
    """Origins, m, and directions, unit, of rays of the eye, (n, 3) each, even over the picture."""
    width, height = this.view.size
    x, y = ((np.arange(n) + 0.5) / n for n in _COARSE)
    origins, directions = this.view.rays_through(width * x, height * y[:, None])
    return origins.reshape(-1, 3), directions.reshape(-1, 3)


def emission_of(plan: list[PlannedMap], packed: Packed, settings: Settings, software: bool) -> str:
    """Return how photons leave the lights, 'map' or 'rays'.

    software  the adapter is a program on the CPU, which takes about as long to draw a triangle into a face,
              its texels included, as a ray takes
    """
    if settings.emission != "auto":
        return settings.emission
    drawn = packed.triangle_count * sum(len(each.map.axes) for each in plan)
    traced = sum(each.photons for each in plan)
    return "rays" if software and drawn > traced else "map"


def trace_photons(this: Pass, plan: EmissionPlan, texels: Sequence[np.ndarray]) -> Traced:
    """Emit the photons and follow them; texels: what the bounce maps hold, where there are any."""
    packed, settings = this.packed, this.settings
    emitted = emit_photons(this, plan, texels)
    limit = bright_limit(packed, this.surfaces, settings)
    told = settings.bounces, this.photon_seed, this.index, limit, plan.openings.ways
    path = walk(packed, this.world, this.surfaces, emitted, *told)
    return Traced(this, plan, texels, path)


def emit_photons(this: Pass, plan: EmissionPlan, texels: Sequence[np.ndarray]) -> np.ndarray:
    """Return the photons that leave the lights, (N,) EMITTED; texels as of `trace_photons`."""
    scene, settings = (this.packed, this.world, this.surfaces), this.settings
    if plan.by == "rays":
        emitted = emit_rays(*scene, plan.maps, this.photon_seed, this.index)
    else:
        emitted = emit_texels(this.packed.lights, this.surfaces, plan.maps, texels)
    if plan.lamps:
        seen = texels[len(texels) - len(plan.lamps.maps) :]
        first_key = int(emitted["key"].max(initial=0)) + 1
        emitted = np.concatenate([emitted, emit_from_lamp_maps(plan.lamps, this.surfaces, seen, first_key)])
    told = settings.caustic_photons, this.photon_seed, this.index
    if plan.surfaces:
        first_key = int(emitted["key"].max(initial=0)) + 1
        emitted = np.concatenate([emitted, emit_from_surfaces(*scene, plan.surfaces, *told, first_key)])
    if plan.surround:
        first_key = int(emitted["key"].max(initial=0)) + 1
        found = emit_from_environment(*scene, plan.surround, *told, first_key, plan.seen, plan.openings.ways)
        emitted = np.concatenate([emitted, found])
    return emitted


def light_warnings(packed: Packed, path: Walk) -> Iterator[str]:
    """Yield what a user should know of a picture's light, a line each."""
    landed = path.absorbed.any() and len(packed.instances) > 1  # an object alone mostly lights nothing
    if landed and len(path.photons) * _PHOTONS_PER_STORED < path.photon_count:
        yield (
            "not one photon in a thousand met a second surface, so indirect light is missing or noise; if "
            "there should be some, give more photons, or less ground about what is seen"
        )
