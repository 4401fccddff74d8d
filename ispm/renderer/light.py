"""What the lights' photons do in a pass, as its settings ask."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ispm.accel.surface import SurfaceTable
from ispm.accel.world import World
from ispm.lights.emission import emit_rays, emit_texels
from ispm.lights.lightmap import light_maps
from ispm.lights.plan import PlannedMap, plan_maps, share_photons
from ispm.photons.walk import Walk, walk
from ispm.renderer.gather import bright_limit
from ispm.scene.packed import Packed
from ispm.settings import Settings
from ispm.stages.camera import CameraView

_COARSE = 48, 27  # rays of the eye, across and down
_FEW = 1000  # photons of which one is stored: of fewer, light is noise


def map_plan(
    packed: Packed, settings: Settings, pass_index: int, seen: np.ndarray | None = None
) -> list[PlannedMap]:
    """Return the maps that emit photons, light by light; none where nothing is to be traced.

    seen  as `seen_places` returns them; None: unknown
    """
    counts = share_photons(packed, settings.photons if settings.bounces else 0)
    return plan_maps(packed, counts, settings.caustic_photons, settings.seed, pass_index, seen)


def seen_places(packed: Packed, world: World, view: CameraView) -> np.ndarray | None:
    """Return what a coarse picture shows, (n, 3) m world space; None where no light asks for it."""
    if not any(map.orthographic for map in light_maps(packed)):
        return None
    width, height = view.size
    x, y = ((np.arange(n) + 0.5) / n for n in _COARSE)
    origins, directions = (each.reshape(-1, 3) for each in view.rays_through(width * x, height * y[:, None]))
    t = world.trace(origins.astype(np.float32), directions.astype(np.float32))["t"]
    met = np.isfinite(t)
    return np.asarray(origins[met] + t[met, None] * directions[met])


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


def trace_photons(
    packed: Packed, world: World, surfaces: SurfaceTable, plan: Sequence[PlannedMap],
    texels: Sequence[np.ndarray] | None, settings: Settings, pass_index: int, threads: int,
) -> Walk:  # fmt: skip
    """Emit the photons and follow them; texels: what the bounce maps hold, None: by rays."""
    seed = settings.seed
    if texels is None:
        emitted = emit_rays(packed, world, surfaces, plan, seed, pass_index, threads)
    else:
        emitted = emit_texels(packed, surfaces, plan, texels)
    return walk(
        packed, world, surfaces, emitted, settings.bounces, seed, pass_index, threads,
        bright_limit(packed, settings),
    )  # fmt: skip


def remarks(packed: Packed, path: Walk) -> Iterator[str]:
    """Yield what a user should know of a picture's light, a line each."""
    if packed.materials["emission"].any():
        yield "emissive materials glow, but do not light the scene yet"
    landed = path.absorbed.any() and len(packed.instances) > 1  # an object alone mostly lights nothing
    if landed and len(path.photons) * _FEW < path.photon_count:
        yield (
            "not one photon in a thousand met a second surface, so indirect light is missing or noise; if "
            "there should be some, give more photons, or less ground about what is seen"
        )
