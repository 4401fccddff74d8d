"""The stages that a renderer has on its device."""

from __future__ import annotations

from operator import attrgetter

from ispm.estimators import make_estimator
from ispm.gpu import Gpu
from ispm.settings import Settings
from ispm.stages.antialias import Antialias
from ispm.stages.bounce import BounceStage
from ispm.stages.caustic import CausticStage
from ispm.stages.direct import DirectStage
from ispm.stages.downsample import Downsample
from ispm.stages.gbuffer import GBufferStage
from ispm.stages.shadow import ShadowStage
from ispm.stages.specular import SpecularStage
from ispm.stages.upload import Upload
from ispm.stages.upsample import Upsample

_ESTIMATOR_KNOBS = attrgetter("estimator", "kernel", "talk_errors")


class Stages:
    """All stages on one device, by name; they keep their memory from frame to frame."""

    def __init__(self, gpu: Gpu, threads: int) -> None:
        self.gpu, self._threads = gpu, threads
        self.upload = Upload(gpu)
        self.gbuffer = GBufferStage(gpu)
        self.bounce = BounceStage(gpu)
        self.direct = DirectStage(gpu)
        self.caustic = CausticStage(gpu)
        self.chains = SpecularStage(gpu)
        self.antialias = Antialias(gpu)
        self._settings: Settings | None = None

    def fit(self, new: Settings) -> None:
        """Make those stages anew that other settings want otherwise."""
        old = self._settings
        if old is None or old.subsampling != new.subsampling:
            self.downsample = Downsample(self.gpu, new.subsampling)
            self.upsample = Upsample(self.gpu, new.subsampling)
        if old is None or old.shadow_resolution != new.shadow_resolution:
            self.shadow = ShadowStage(self.gpu, new.shadow_resolution)
        if old is None or _ESTIMATOR_KNOBS(old) != _ESTIMATOR_KNOBS(new):
            self.estimator = make_estimator(new, self.gpu, self._threads)
        self._settings = new
