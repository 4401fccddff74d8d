"""What the lights' maps do in a frame, as its settings ask."""

from __future__ import annotations

from ispm.scene.packed import Packed
from ispm.settings import Settings
from ispm.tracer.plan import PlannedMap, plan_maps, share_photons


def map_plan(packed: Packed, settings: Settings, pass_index: int) -> list[PlannedMap]:
    """Return the maps that emit photons, light by light; none where nothing is to be traced."""
    counts = share_photons(packed, settings.photons if settings.bounces else 0)
    return plan_maps(packed, counts, settings.caustic_photons, settings.seed, pass_index)
