"""The renderer: a scene, settings and a camera, and pictures of them as often as wanted."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Literal

import numpy as np

from ispm.errors import IspmError, SettingsError, warn_caller
from ispm.gpu import Gpu, open_gpu, within_memory
from ispm.kernels.threads import thread_count
from ispm.optics.records import PHOTON
from ispm.renderer.compose import compose
from ispm.renderer.converge import converge, of_pass
from ispm.renderer.draw import draw
from ispm.renderer.last import LastFrame
from ispm.renderer.light import light_warnings
from ispm.renderer.light_paths import LightPaths, light_paths
from ispm.renderer.limits import require_drawable, require_scene, way_to_see
from ispm.renderer.live import History
from ispm.renderer.made_of import MadeOf
from ispm.renderer.motion import moved
from ispm.renderer.one_pass import Pass
from ispm.renderer.picture import Frame
from ispm.renderer.progress import MOST_PASSES, Progress
from ispm.renderer.ready import Ready
from ispm.renderer.rest import Rest
from ispm.renderer.stages import Stages
from ispm.renderer.statistics import collect
from ispm.renderer.watch import Watch
from ispm.scene.camera import Camera
from ispm.scene.names import Names
from ispm.scene.packed_instance import Placed
from ispm.scene.scene import Scene
from ispm.settings import Settings


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
        self.chosen = self._ready.chosen
        self.camera = camera
        self._stages = Stages(self._gpu, self.threads)
        self._photons = np.zeros(0, PHOTON)
        self._placed: Placed | None = None  # of the last frame
        self._last: LastFrame | None = None
        self._history = History()
        self._rest: Rest | None = None
        self._live_scene: Scene | None = None
        self.antialias_live = False  # a view that moves has no time for it
        self.progress: Progress | None = None
        self.names = Names()
        self._warned: set[str] = set()
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
        del self._stages, self._ready, self.chosen, self._gpu
        if self._owns_gpu:
            gc.collect()  # wgpu's device and queue refer to each other, and hold memory Python does not see

    @property
    def adapter(self) -> str:
        """The name of the graphics adapter."""
        self._require_open()
        return self._gpu.name

    @property
    def settings(self) -> Settings:
        """The knobs of the next frame."""
        assert self._settings is not None
        return self._settings

    @settings.setter
    def settings(self, new: Settings) -> None:
        if not isinstance(new, Settings):
            raise SettingsError(f"settings must be ispm.Settings, not a {type(new).__name__}")
        self._require_open()
        require_drawable(new, self._gpu)
        self._stages.fit(new)
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

        With setting `live` it is the next frame of those since `reset`, and goes on from them: the same
        frames in the same order have the same bytes. While nothing changes it becomes that of `converge`.
        Raises SceneError for a scene without a surface, SettingsError for more than memory can hold.
        """
        if self.settings.live:
            return self._render_live()
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
        with self._enough_memory():
            return self._draw(self._prepare(index))

    def _enough_memory(self) -> AbstractContextManager[None]:
        width, height = self.settings.size
        return within_memory(f"a picture of {width}x{height} pixels and {self.settings.photons:,} photons")

    def _say_nothing_is_seen(self, this: Pass) -> None:
        if not this.packed.surround.background:
            self._say(f"the camera sees nothing, so the picture is empty; {way_to_see(this)}")
        elif this.packed.triangle_count:
            self._say(f"the camera sees nothing but the environment; {way_to_see(this)}")

    def _draw(self, this: Pass, history: History | None = None) -> Frame:
        watch = Watch()
        self._last = None  # so that its memory can be used again
        drawn = draw(this, self._stages, watch, history)
        for line in light_warnings(this.packed, drawn.path):
            self._say(line)
        with watch("readback"):
            frame = compose(self._gpu, this, drawn.lit)
            if not drawn.sight.receivers.points["valid"].any() and frame.instance.max() < 0:
                self._say_nothing_is_seen(this)
            frame.scene = self.scene.name
            self.chosen.expose(frame)
        total = watch.stop()
        placed, self._placed = self._placed, this.packed.placed
        stats = collect(this, drawn.path, watch.milliseconds, total, moved(this.packed.placed, placed))
        frame.stats = replace(
            stats, adapter=self._gpu.name, emission=drawn.traced.plan.mostly, timing=watch.timing
        )
        self._photons = drawn.path.photons
        self._last = LastFrame(
            frame,
            this,
            this.world.trees,
            drawn.parts,
            drawn.sight.receivers,
            drawn.traced,
        )
        return frame

    def reset(self) -> None:
        """Forget the frames so far: with setting `live` the next one is as a new renderer's first."""
        self._history.reset()
        self._rest = None

    def _render_live(self) -> Frame:
        this = self._prepare(0)
        now, rest = self._made_of(this), self._rest
        if rest and (self.scene is not self._live_scene or not rest.made_of.lit_as(now)):
            self.reset()
            rest = None
        self._live_scene = self.scene
        with self._enough_memory():
            if rest and rest.made_of == now:
                frame = self._draw(self._prepare(rest.passes))
                shown = rest.add(frame, self.settings, self.threads)
                shown.scene = frame.scene
                return self.chosen.expose(shown)
            changes = rest is None or rest.made_of.scene != now.scene
            try:
                antialias = self.antialias_live and self.settings.antialias
                frame = self._draw(self._history.begin(this, changes, antialias), self._history)
            except BaseException:  # what is kept may be of this frame in part
                self.reset()
                raise
        frame.settings = self.settings
        self._rest = Rest(frame, now)
        return frame

    def made_of(self) -> MadeOf:
        """Return what tells this scene, camera and settings, as they are now, from others."""
        return self._made_of(self._prepare(0))

    def last_made_of(self) -> MadeOf:
        """Return likewise what the last frame was made of."""
        assert self._last is not None
        return self._made_of(self._last.made)

    def _made_of(self, this: Pass) -> MadeOf:
        return MadeOf.of(this.packed, self._ready.textures, this.view, self.settings)

    def photons(self) -> np.ndarray:
        """Return the last frame's photon map, (N,), world space: `position` (3,) m, `flux` (3,) lm, `normal`,
        `wi` (3,) to where it came from, `bounce` (scatters before), a kernel's `radius` and `height`, m."""
        return self._photons

    def light_paths(self, x: float, y: float, count: int = 32) -> LightPaths | None:
        """Return the photons of the last frame that light what pixel x, y shows, and the ways that the
        `count` strongest came from the lights; None where nothing is seen.

        x, y  pixels right and down from the top left corner
        It shows the photon map at the point: all indirect light. Where gather rays find most of that light
        for the picture (setting `gather`), it is the same light, less finely resolved. With several passes
        it is the last one's, and with setting `live` this frame's alone.
        Raises SettingsError for a pixel outside the picture and a count beyond 1000, IspmError before the
        first frame, and where the scene was changed after it.
        """
        if self._last is None:
            raise IspmError("nothing was rendered yet; call render first")
        return light_paths(self._last, x, y, count)

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

    def _prepare(self, index: int) -> Pass:
        """Pack the scene, place it in the tracer, and find its camera and lights."""
        self._require_open()
        packed, view = self._ready(require_scene(self.scene), self.settings, index)
        self.names = packed.names
        settings = of_pass(self.settings, index)
        return Pass(
            packed, self._ready.world, self._ready.surfaces, view, settings, self.threads, settings.seed
        )

    def _say(self, line: str) -> None:
        """Warn once in this renderer's life."""
        if line not in self._warned:
            self._warned.add(line)
            warn_caller(line)
