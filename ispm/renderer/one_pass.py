"""One pass of a picture: what all steps of the frame are told."""

from __future__ import annotations

from dataclasses import dataclass

from ispm.accel.surface import SurfaceTable
from ispm.accel.world import World
from ispm.scene.packed import Packed
from ispm.settings import Settings
from ispm.stages.camera import CameraView


@dataclass(frozen=True, eq=False)
class Pass:
    """What one pass is made of; every step of the frame is handed it whole.

    packed    the scene with its lights
    world     its trees, for rays
    surfaces  what is known of the places that rays meet
    view      what the eye sees it through
    settings  those of this pass, whose kernels get narrower from pass to pass
    threads   of the CPU
    photon_seed  of the random numbers of photons and gather rays: others in each live frame, which shows the
                 mean of several. All else has the same in all, or what stands still would flicker
    """

    packed: Packed
    world: World
    surfaces: SurfaceTable
    view: CameraView
    settings: Settings
    threads: int
    photon_seed: int

    @property
    def index(self) -> int:
        """Its number, from 0."""
        return self.view.pass_index
