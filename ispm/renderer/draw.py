"""The frame: photons from the lights to the picture, in one function one can read aloud."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ispm.frame import GBuffer, GpuScene, LitFrame, Receivers
from ispm.gpu import Texture
from ispm.photons.walk import Walk
from ispm.renderer.caustics import PhotonClasses, classify_photons
from ispm.renderer.gather import PhotonLight
from ispm.renderer.light import EmissionPlan, plan_emission, trace_photons
from ispm.renderer.live import History
from ispm.renderer.one_pass import Pass
from ispm.renderer.shadows import ShadowRays, join_pixels
from ispm.renderer.specular import light_missed, specular_light
from ispm.renderer.stages import Stages
from ispm.renderer.watch import Watch

_NEAR = 1e-4  # of the scene's diagonal; reversed depth has precision to spare


@dataclass(frozen=True, eq=False)
class Sight:
    """What the eye and the lights see first.

    scene      on the device, where the G-buffer is too
    receivers  the picture at low resolution
    mirrors    (n,) SEEN pixels from which eye paths go on
    texels     of each map of the lights, (F, width, width, 2) uint32; none where photons leave as rays
    """

    scene: GpuScene
    gbuffer: GBuffer
    receivers: Receivers
    mirrors: np.ndarray
    texels: list[np.ndarray]


@dataclass(frozen=True, eq=False)
class Drawn:
    """A frame's light on the device, and what it came from; kernels of the path's photons are measured.

    parts  these photons by the ways that they take to the picture
    """

    lit: LitFrame
    sight: Sight
    plan: EmissionPlan
    path: Walk
    parts: PhotonClasses


def draw(this: Pass, stages: Stages, watch: Watch, history: History | None = None) -> Drawn:
    """Draw one pass: what is seen, direct light, photons, their light at receivers, all of it in pixels.

    history  of the frames that this one goes on from; None: there are none
    """
    gpu, view = stages.gpu, this.view
    plan = plan_emission(this, gpu.is_software)
    sight = _see(this, stages, plan, watch)
    scene, gbuffer = sight.scene, sight.gbuffer
    direct = _light_directly(this, stages, sight, watch)
    with watch("trace"):
        path = trace_photons(this, plan, sight.texels)
    with watch("radiance"):
        light = history.light(this, path) if history else PhotonLight(this, classify_photons(this, path))
        raw, filtered = light.at_receivers(sight.receivers, stages.estimator)
    with watch.record(gpu) as frame:
        frame.stage("radiance")
        sharp = stages.caustic(frame, scene, gbuffer, view, light.caustics.sharp_kernels)
        frame.stage("upsample")
        receivers = stages.downsample.receivers
        indirect, irradiance, emission = stages.upsample(
            frame, scene, gbuffer, view, receivers, filtered, sharp
        )
    with watch("direct"):
        brought = sight.mirrors["pixel"], specular_light(this, sight.mirrors, light)
        shadows = ShadowRays(this).light(stages.direct.doubts())
        pixels, added = join_pixels(brought, shadows)
    with watch("upsample"):
        _light_missed(this, stages, sight, light, raw, sharp)
    with watch.record(gpu) as frame:
        frame.stage("compose")
        through = stages.chains.patch(frame, pixels, added, direct, indirect, emission)
        lit = LitFrame(gbuffer, direct, indirect, irradiance, emission, through)
        if this.settings.antialias:
            stages.antialias(frame, scene, lit, view)
    return Drawn(lit, sight, plan, replace(path, photons=light.parts.photons), light.parts)


def _see(this: Pass, stages: Stages, plan: EmissionPlan, watch: Watch) -> Sight:
    gpu, view = stages.gpu, this.view
    with watch.record(gpu) as frame:
        scene = stages.upload(this.packed)
        frame.stage("direct")
        gbuffer = stages.gbuffer(frame, scene, view)
        frame.stage("upsample")
        stages.downsample(frame, scene, gbuffer, view)
        stages.chains(frame, scene, gbuffer)
        frame.stage("bounce_map")
        maps = stages.bounce(frame, scene, plan.drawn, _NEAR * this.packed.diagonal, this.index)
    with watch("copy"):
        receivers = Receivers(stages.downsample.read(gpu, view), stages.downsample.size(view))
        texels = maps.read(gpu)
        return Sight(scene, gbuffer, receivers, stages.chains.read(), texels)


def _light_directly(this: Pass, stages: Stages, sight: Sight, watch: Watch) -> Texture:
    """The light of lamps at pixels, but where shadow maps leave it in doubt."""
    points = sight.receivers.points
    with watch.record(stages.gpu) as frame:
        frame.stage("direct")
        near = _NEAR * this.packed.diagonal
        shadows = stages.shadow(frame, sight.scene, points[points["valid"] > 0], this.view, near)
        return stages.direct(frame, sight.scene, sight.gbuffer, shadows, this.view)


def _light_missed(
    this: Pass,
    stages: Stages,
    sight: Sight,
    light: PhotonLight,
    raw: np.ndarray,
    sharp: tuple[Texture, Texture] | None,
) -> None:
    """Light the pixels that upsampling could not serve: by the filter, else by an image of their own."""
    missed, points = stages.upsample.missed()
    if not len(missed):
        return
    order = np.argsort(missed["pixel"])  # the GPU lists them as they come
    points = points[order]
    found = light_missed(this, points, missed[order], sight.receivers, raw, light)
    found += light.wide.estimate(points, this.threads)
    found[order] = found.copy()
    with stages.gpu.frame() as frame:
        stages.upsample.patch(frame, sight.scene, sight.gbuffer, this.view, found, sharp)
