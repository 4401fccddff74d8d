"""The frame: photons from the lights to the picture, in one function one can read aloud."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ispm.frame import BounceMaps, GBuffer, GpuScene, LitFrame, Receivers
from ispm.gpu import Texture
from ispm.lights.openings import Openings
from ispm.lights.plan import PlannedMap
from ispm.lights.surface_emission import has_area_light
from ispm.photons.walk import Walk
from ispm.renderer.by_image import light_missed
from ispm.renderer.caustics import PhotonClasses, classify_photons
from ispm.renderer.gather import PhotonLight
from ispm.renderer.ground import catch_shadows
from ispm.renderer.light import Traced, plan_emission, trace_photons
from ispm.renderer.live import History
from ispm.renderer.one_pass import Pass
from ispm.renderer.shadows import ShadowRays, join_pixels
from ispm.renderer.specular import specular_light
from ispm.renderer.stages import Stages
from ispm.renderer.watch import Watch
from ispm.stages.area_light import area_light
from ispm.stages.pixels import read_pixels
from ispm.stages.point_light import point_light, takes_rays

_NEAR = 1e-4  # of the scene's diagonal; reversed depth has precision to spare


@dataclass(frozen=True, eq=False)
class Sight:
    """What the eye sees first.

    scene      on the device, where the G-buffer is too
    receivers  the picture at low resolution
    mirrors    (n,) SEEN pixels from which eye paths go on
    """

    scene: GpuScene
    gbuffer: GBuffer
    receivers: Receivers
    mirrors: np.ndarray


@dataclass(frozen=True, eq=False)
class Drawn:
    """A frame's light on the device, and what it came from.

    path   of the photons, their kernels measured
    parts  these photons by the ways that they take to the picture
    """

    lit: LitFrame
    sight: Sight
    traced: Traced
    path: Walk
    parts: PhotonClasses


def draw(this: Pass, stages: Stages, watch: Watch, history: History | None = None) -> Drawn:
    """Draw one pass: what is seen, direct light, photons, their light at receivers, all of it in pixels.

    history  of the frames that this one goes on from; None: there are none
    """
    gpu, view = stages.gpu, this.view
    traced = history.traced if history else None
    plan = traced.plan if traced else plan_emission(this, gpu.is_software)
    scene, gbuffer, maps = _draw_first(this, stages, [] if traced else plan.drawn, watch)
    if not (traced or plan.drawn):
        with watch("trace"):  # these need nothing of what the device is drawing
            traced = trace_photons(this, plan, [])
    with watch("copy"):
        receivers = Receivers(stages.downsample.read(gpu, view), stages.downsample.size(view))
        sight = Sight(scene, gbuffer, receivers, stages.chains.read())
        texels = maps.read(gpu)
    direct = _light_directly(this, stages, sight, plan.openings, watch)
    if not traced:
        with watch("trace"):
            traced = trace_photons(this, plan, texels)
    with watch("radiance"):
        if history:
            light: PhotonLight = history.light(this, traced)
        else:
            light = PhotonLight(this, classify_photons(this, traced.path), plan.openings)
        raw, filtered = light.at_receivers(sight.receivers, stages.estimator)
    with watch.record(gpu) as frame:
        frame.stage("radiance")
        sharp = stages.caustic(frame, scene, gbuffer, view, light.caustics.sharp_kernels)
        frame.stage("upsample")
        indirect, irradiance, emission = stages.upsample(
            frame, scene, gbuffer, view, stages.downsample.receivers, filtered, sharp
        )
    with watch("direct"):
        brought = sight.mirrors["pixel"], specular_light(this, sight.mirrors, light)
        shadows = ShadowRays(this).light(stages.direct.doubts())
        pixels, added = join_pixels(brought, shadows)
    with watch("upsample"):
        _light_missed(this, stages, sight, light, raw, sharp)
    if this.settings.ground:
        with watch("compose"):
            shown = direct, indirect
            pixels, added = catch_shadows(this, gpu, gbuffer, plan.openings, shown, pixels, added)
    with watch.record(gpu) as frame:
        frame.stage("compose")
        through = stages.chains.patch(frame, pixels, added, direct, indirect, emission, irradiance)
        lit = LitFrame(gbuffer, direct, indirect, irradiance, emission, through)
        if this.settings.antialias:
            stages.antialias(frame, scene, lit, view)
    return Drawn(lit, sight, traced, replace(traced.path, photons=light.parts.photons), light.parts)


def _draw_first(
    this: Pass, stages: Stages, drawn: Sequence[PlannedMap], watch: Watch
) -> tuple[GpuScene, GBuffer, BounceMaps]:
    """Have drawn what the eye sees first, and the lights in their bounce maps."""
    view = this.view
    with watch.record(stages.gpu) as frame:
        scene = stages.upload(this.packed)
        frame.stage("direct")
        gbuffer = stages.gbuffer(frame, scene, view)
        frame.stage("upsample")
        stages.downsample(frame, scene, gbuffer, view)
        stages.chains(frame, scene, gbuffer)
        frame.stage("bounce_map")
        maps = stages.bounce(frame, scene, drawn, _NEAR * this.packed.diagonal, this.index)
    return scene, gbuffer, maps


def _light_directly(this: Pass, stages: Stages, sight: Sight, openings: Openings, watch: Watch) -> Texture:
    """The light of lamps at pixels, but where shadow maps leave it in doubt."""
    points, scene = sight.receivers.points, sight.scene
    found: list[np.ndarray] = []
    by_rays = takes_rays(this.packed, this.settings, stages.gpu.is_software)
    by_area = has_area_light(this.packed, this.surfaces)
    if by_rays or by_area:
        with watch("direct"):
            told = this.packed, this.world, this.surfaces
            pixels, view = read_pixels(stages.gpu, sight.gbuffer, this.view, this.settings.seed)
            if by_area:
                found.append(area_light(pixels, view, *told, openings, this.settings.smoothing))
            if by_rays:
                found.append(point_light(pixels, view, *told))
                scene = scene.without_lights
    others = sum(found[1:], found[0]).reshape(*reversed(this.view.size), 4) if found else None
    with watch.record(stages.gpu) as frame:
        frame.stage("direct")
        near = _NEAR * this.packed.diagonal
        shadows = stages.shadow(frame, scene, points[points["valid"] > 0], this.view, near)
        return stages.direct(frame, scene, sight.gbuffer, shadows, this.view, others)


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
