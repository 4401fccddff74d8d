"""The frame: photons from the lights to the picture, in one function one can read aloud."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from operator import attrgetter
from pathlib import Path
from types import TracebackType
from typing import Any, Literal

import numpy as np

from ispm.errors import IspmError, SettingsError, warn_caller
from ispm.estimators import make_estimator
from ispm.frame import GBuffer, GpuScene
from ispm.gpu import Gpu, Texture, open_gpu, within_memory
from ispm.kernels.threads import thread_count
from ispm.optics.records import PHOTON
from ispm.photons.grid import PhotonGrid
from ispm.renderer.caustics import part_photons
from ispm.renderer.chains import chain_light, light_missed
from ispm.renderer.compose import compose
from ispm.renderer.converge import converge, of_pass
from ispm.renderer.gather import PhotonLight
from ispm.renderer.last import LastFrame
from ispm.renderer.light import emission_of, map_plan, remarks, seen_places, trace_photons
from ispm.renderer.limits import require_drawable, require_scene
from ispm.renderer.made_of import MadeOf
from ispm.renderer.motion import moved
from ispm.renderer.picture import Frame
from ispm.renderer.progress import MOST_PASSES, Progress
from ispm.renderer.ready import Ready
from ispm.renderer.shadows import ShadowRays, join_pixels
from ispm.renderer.statistics import collect
from ispm.renderer.watch import Watch, rendering_seconds
from ispm.scene.camera import Camera
from ispm.scene.names import Names
from ispm.scene.packed import Packed
from ispm.scene.scene import Scene
from ispm.settings import Settings
from ispm.stages.antialias import Antialias
from ispm.stages.bounce import BounceStage
from ispm.stages.camera import CameraView
from ispm.stages.caustic import CausticStage
from ispm.stages.chain import ChainStage
from ispm.stages.direct import DirectStage
from ispm.stages.downsample import Downsample
from ispm.stages.gbuffer import GBufferStage
from ispm.stages.shadow import ShadowStage
from ispm.stages.upload import Upload
from ispm.stages.upsample import Upsample

_NEAR = 1e-4  # of the scene's diagonal; reversed depth has precision to spare
_ESTIMATOR_KNOBS = attrgetter("estimator", "kernel", "talk_errors")
_OWNED = (
    "_upload", "_gbuffer", "_bounce", "_direct", "_caustic", "_chains", "_antialias", "_shadow",
    "_downsample", "_upsample", "_estimator", "_world", "_ready", "chosen",
)  # fmt: skip


class Renderer:
    """Renders a scene again and again; owns the adapter's objects. Belongs to one thread.

    scene     may change between frames in any way, or be replaced; nothing is precomputed
    settings  may be replaced at any time: `renderer.settings = renderer.settings.replace(...)`
    camera    a Camera with a pose, or the name or index of one of the scene's; None: the first, or one that
              frames the scene, held while the scene changes; so is the light of a scene that has none
    adapter   part of a graphics adapter's name
    threads   of the CPU; None: all
    gpu       an open device to share, which stays open; None: one of its own, on `adapter`
    Raises AdapterError where no adapter serves.
    """

    def __init__(
        self,
        scene: Scene,
        settings: Settings | None = None,
        camera: Camera | str | int | None = None,
        *,
        adapter: str | None = None,
        threads: int | None = None,
        gpu: Gpu | None = None,
    ) -> None:
        self._closed = False
        self.scene = require_scene(scene)
        self.threads = thread_count(threads)
        self._gpu, self._owns_gpu = gpu or open_gpu(adapter), gpu is None
        self._ready = Ready(self.threads, self._say)
        self._world, self.chosen = self._ready.world, self._ready.chosen
        self.camera = camera
        self._upload = Upload(self._gpu)
        self._gbuffer = GBufferStage(self._gpu)
        self._bounce = BounceStage(self._gpu)
        self._direct = DirectStage(self._gpu)
        self._caustic = CausticStage(self._gpu)
        self._chains = ChainStage(self._gpu)
        self._antialias = Antialias(self._gpu)
        self._photons = np.zeros(0, PHOTON)
        self._instances: np.ndarray | None = None  # of the last frame
        self._last: LastFrame | None = None
        self.progress: Progress | None = None
        self.names = Names()
        self._said: set[str] = set()
        self._settings: Settings | None = None
        self.settings = Settings() if settings is None else settings

    def __repr__(self) -> str:
        if self._closed:
            return "<Renderer, closed>"
        width, height = self.settings.size
        return f"<Renderer of {self.scene!r} at {width}x{height} on {self._gpu.name}>"

    def __enter__(self) -> Renderer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Free the adapter's memory; frames that were rendered stay whole. Closing twice does no harm."""
        if self._closed:
            return
        self._closed, self._last = True, None
        if self._owns_gpu:
            self._gpu.close()
        for name in _OWNED:
            vars(self).pop(name, None)
        gc.collect()  # device objects refer to each other, and each holds memory that Python does not see

    @property
    def settings(self) -> Settings:
        """The knobs of the next frame."""
        assert self._settings is not None
        return self._settings

    @settings.setter
    def settings(self, new: Settings) -> None:
        if not isinstance(new, Settings):
            raise SettingsError(f"settings must be ispm.Settings, not a {type(new).__name__}")
        require_drawable(new, self._gpu)
        old = self._settings
        if old is None or old.subsampling != new.subsampling:
            self._downsample = Downsample(self._gpu, new.subsampling)
            self._upsample = Upsample(self._gpu, new.subsampling)
        if old is None or old.shadow_resolution != new.shadow_resolution:
            self._shadow = ShadowStage(self._gpu, new.shadow_resolution)
        if old is None or _ESTIMATOR_KNOBS(old) != _ESTIMATOR_KNOBS(new):
            self._estimator = make_estimator(new, self._gpu, self.threads)
        self._settings = new

    @property
    def camera(self) -> Camera:
        """The next picture's camera, with its pose: the one given, the scene's, or the one that is held.

        May be set as in `Renderer`; None has the camera and the light that are held chosen anew.
        Raises SceneError as `render` does.
        """
        self._require_open()
        camera, pose = self.chosen.eye(require_scene(self.scene), self.settings.size)
        return replace(camera, pose=pose)

    @camera.setter
    def camera(self, wanted: Camera | str | int | None) -> None:
        self._require_open()
        self.chosen.want(wanted)

    @property
    def exposure(self) -> float:
        """Stops: the settings', the one that is held, or with "auto" that of the last pass.

        A pass is rendered where it is not known yet. May be set as the setting; "hold" finds it anew.
        """
        self._require_open()
        wanted = self.settings.exposure
        held = self.chosen.exposure if wanted == "hold" else wanted
        if isinstance(held, float):
            return held
        last = self._last.frame if self._last and wanted == "auto" else self.render_pass(0)
        return last.exposure

    @exposure.setter
    def exposure(self, wanted: float | Literal["auto", "hold"]) -> None:
        self.settings, self.chosen.exposure = self.settings.replace(exposure=wanted), None

    def render(self) -> Frame:
        """Render one picture, of as many passes as the settings say.

        Raises SceneError for a scene without a surface, SettingsError for more than memory can hold.
        """
        if self.settings.most_passes == 1:
            return self.render_pass(0)
        *_, last = self.converge()
        return last

    def converge(
        self,
        passes: int | None = None,
        *,
        time_limit: float | None = None,
        target_error: float | None = None,
        resume: str | Path | None = None,
    ) -> Iterator[Frame]:
        """Render passes with ever smaller kernels, and yield the mean of all so far after each.

        passes, time_limit, target_error  None: what the settings say
        resume  a file of `save_progress`, which is continued as if it had never been left: the same bytes
        Each pass has photons and places in the pixels of its own. Memory does not grow with their number.
        Errors as of `render`; SettingsError for a file that is of another scene, camera or settings, and
        SceneError where these change between passes: what was summed up stays in `progress`.
        """
        wanted: dict[str, Any] = dict(passes=passes, time_limit=time_limit, target_error=target_error)
        goal = self.settings.replace(**{name: value for name, value in wanted.items() if value is not None})
        self.progress = Progress.load(resume) if resume is not None else None
        return converge(self, goal)

    def save_progress(self, path: str | Path) -> Path:
        """Write what `converge` has summed up so far, to be continued with `resume`.

        path  an .npz
        Raises IspmError where there is none, OutputError where it cannot be written.
        """
        if self.progress is None:
            raise IspmError("no passes were rendered; call converge first")
        return self.progress.save(path)

    def render_pass(self, index: int) -> Frame:
        """Render pass `index`, from 0, alone; what `converge` takes the mean of."""
        self._require_open()
        if not isinstance(index, int) or not 0 <= index < MOST_PASSES:
            raise SettingsError(f"pass {index!r}: passes are numbered from 0")
        width, height = self.settings.size
        with within_memory(f"a picture of {width}x{height} pixels and {self.settings.photons:,} photons"):
            return self._draw(index)

    def _draw(self, index: int) -> Frame:
        settings = of_pass(self.settings, index)
        started = rendering_seconds()
        self._last = None  # so that its memory can be used again
        watch = Watch()
        packed, view = self._prepare(index)
        plan = map_plan(packed, settings, index, seen_places(packed, self._world, view))
        surfaces = self._ready.surfaces(packed)
        by = emission_of(plan, packed, settings, self._gpu.is_software)

        with self._gpu.frame() as first:
            scene = self._upload(packed)
            first.stage("direct")
            gbuffer = self._gbuffer(first, scene, view)
            first.stage("upsample")
            receivers = self._downsample(first, scene, gbuffer, view)
            self._chains(first, scene, gbuffer)
            first.stage("bounce_map")
            drawn = plan if by == "map" else []
            maps = self._bounce(first, scene, drawn, _NEAR * packed.diagonal, index)
        with watch("copy"):
            points = self._downsample.read(self._gpu, view)
            texels = maps.read(self._gpu)
            mirrors = self._chains.read()
        with self._gpu.frame() as second:
            second.stage("direct")
            shadows = self._shadow(second, scene, points[points["valid"] > 0], view, _NEAR * packed.diagonal)
            direct = self._direct(second, scene, gbuffer, shadows, view)

        with watch("trace"):
            path = trace_photons(
                packed, self._world, surfaces, plan, texels if by == "map" else None, settings, index,
                self.threads,
            )  # fmt: skip
        for line in remarks(packed, path):
            self._say(line)
        with watch("radiance"):
            parts = part_photons(path, packed, self._world, surfaces, view, settings, self.threads)
            size = self._downsample.size(view)
            estimator = partial(self._estimator, points, clip_from_world=view.clip_from_world, size=size)
            light = PhotonLight(packed, self._world, surfaces, parts, view, settings, self.threads)
            raw, filtered = light.at_receivers(points, size, estimator)
            wide = PhotonGrid(parts.wide, parts.kernels[: len(parts.wide)])
            if len(parts.wide):
                filtered = filtered + wide.estimate(points, self.threads)

        with self._gpu.frame() as third:
            third.stage("radiance")
            caustic = self._caustic(third, scene, gbuffer, view, parts.kernels[len(parts.wide) :])
            third.stage("upsample")
            indirect, irradiance, emission = self._upsample(
                third, scene, gbuffer, view, receivers, filtered, caustic
            )
        with watch("direct"):
            brought = chain_light(
                packed, self._world, surfaces, mirrors, light, PhotonGrid(parts.caustic, parts.kernels), view,
                settings, index, self.threads,
            )  # fmt: skip
            rays = ShadowRays(packed, self._world, surfaces, view, settings, self.threads)
            lit = join_pixels((mirrors["pixel"], brought), rays.light(self._direct.doubts()))
        with watch("upsample"):
            self._light_missed(points, raw, light, wide, scene, gbuffer, view, caustic, settings)
        with self._gpu.frame() as fourth:
            fourth.stage("compose")
            through = self._chains.patch(fourth, *lit, direct, indirect, emission)
            if settings.antialias:
                self._antialias(fourth, scene, gbuffer, view, direct, indirect, emission, through)
        with watch("readback"):
            frame = compose(
                self._gpu, packed, gbuffer, (direct, indirect, emission), through, irradiance, view,
                settings, self.threads,
            )  # fmt: skip
            if not points["valid"].any() and frame.instance.max() < 0:
                self._say("the camera sees nothing, so the picture is empty; turn it, or move it")
            frame.scene = self.scene.name
            self.chosen.expose(frame)

        for recording in (first, second, third, fourth):
            for name, spent in recording.milliseconds().items():
                watch.add(name, spent)
        total = (rendering_seconds() - started) * 1e3
        frame.stats = collect(
            packed, replace(path, photons=parts.photons), view, settings, watch.milliseconds, total,
            adapter=self._gpu.name, emission=by, timing=first.timing,
            moved=moved(packed.instances, self._instances),
        )  # fmt: skip
        self._photons = parts.photons
        self._last = LastFrame(
            frame, view, packed, surfaces, parts.photons, points, self._downsample.size(view),
            plan, texels, self.threads,
        )  # fmt: skip
        self._instances = packed.instances
        return frame

    def made_of(self) -> MadeOf:
        """Return what tells this scene, camera and settings, as they are now, from others."""
        return self._made_of(*self._prepare(0))

    def last_made_of(self) -> MadeOf:
        """Return likewise what the last frame was made of."""
        assert self._last is not None
        return self._made_of(self._last.packed, self._last.view)

    def _made_of(self, packed: Packed, view: CameraView) -> MadeOf:
        return MadeOf.of(packed, self._ready.textures, view, self.settings)

    def photons(self) -> np.ndarray:
        """Return the last frame's photon map, (N,), world space: `position` (3,) m, `flux` (3,) lm, `normal`,
        `wi` (3,) to where it came from, `bounce` (scatters before), a kernel's `radius` and `height`, m."""
        return self._photons

    def view(self, name: str) -> np.ndarray:
        """Return a view of the last frame, (h, w, 3) uint8 sRGB. Raises SettingsError where it has none.

        name  as of `Frame.view`, or `photons`: the stored ones over the dimmed direct picture; `bounce-map`:
              what each light's map saw; `overdraw`: how many kernels cover a pixel
        """
        if self._last is None:
            self.render()
        assert self._last is not None
        return self._last.show(name)

    def _require_open(self) -> None:
        if self._closed:
            raise IspmError("this renderer is closed; make another one")

    def _prepare(self, index: int) -> tuple[Packed, CameraView]:
        """Pack the scene, place it in the tracer, and find its camera and lights."""
        self._require_open()
        packed, view = self._ready(require_scene(self.scene), self.settings.size, index)
        self.names = packed.names
        return packed, view

    def _say(self, line: str) -> None:
        """Warn once in this renderer's life."""
        if line not in self._said:
            self._said.add(line)
            warn_caller(line)

    def _light_missed(
        self, points: np.ndarray, raw: np.ndarray, light: PhotonLight, wide: PhotonGrid, scene: GpuScene,
        gbuffer: GBuffer, view: CameraView, caustic: tuple[Texture, Texture] | None, settings: Settings,
    ) -> None:  # fmt: skip
        """Light the pixels that upsampling could not serve: by the filter, else by an image of their own.

        wide  caustic photons at low resolution, which are not filtered
        """
        missed, receivers = self._upsample.missed()
        if not len(missed):
            return
        order = np.argsort(missed["pixel"])  # the GPU lists them as they come
        receivers = receivers[order]
        found = light_missed(
            receivers, missed[order], points, raw, self._downsample.size(view), light, view, settings,
            scene.packed.diagonal, self.threads,
        )  # fmt: skip
        found += wide.estimate(receivers, self.threads)
        found[order] = found.copy()
        with self._gpu.frame() as frame:
            self._upsample.patch(frame, scene, gbuffer, view, found, caustic)
