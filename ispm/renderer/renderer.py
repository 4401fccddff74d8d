"""The frame: photons from the lights to the picture, in one function one can read aloud."""

from __future__ import annotations

import gc
import math
import time as clock
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from operator import attrgetter
from types import TracebackType

import numpy as np

from ispm.errors import IspmError, SceneError, SceneWarning, SettingsError
from ispm.estimators import make_estimator
from ispm.frame import GBuffer, GpuScene
from ispm.gpu import Gpu, Texture, open_gpu, within_memory
from ispm.optics.records import MATERIAL_UNLIT, PHOTON, RECEIVER
from ispm.optics.texture import TextureTable
from ispm.renderer import layers as make
from ispm.renderer.chains import eye_rays, light_ends, light_points
from ispm.renderer.framing import default_camera, default_light, find_camera
from ispm.renderer.last import LastFrame
from ispm.renderer.light import emission_of, map_plan
from ispm.renderer.motion import moved
from ispm.renderer.picture import Frame
from ispm.renderer.statistics import Stats, collect
from ispm.renderer.watch import Watch
from ispm.scene.camera import Camera
from ispm.scene.packed import Packed, pack
from ispm.scene.scene import Scene
from ispm.settings import Settings
from ispm.stages.antialias import Antialias
from ispm.stages.bounce import BounceStage
from ispm.stages.camera import CameraView
from ispm.stages.caustic import CausticStage
from ispm.stages.chain import ChainStage
from ispm.stages.direct import DirectStage
from ispm.stages.downsample import Downsample
from ispm.stages.filter import filter_estimate
from ispm.stages.gbuffer import GBufferStage
from ispm.stages.shadow import ShadowStage
from ispm.stages.tonemap import auto_exposure, tonemap, tonemap_transparent
from ispm.stages.upload import Upload
from ispm.stages.upsample import Upsample
from ispm.tracer.density import measure_caustic_radii, measure_radii
from ispm.tracer.emission import emit_rays, emit_texels
from ispm.tracer.eye import trace_eye
from ispm.tracer.grid import PhotonGrid
from ispm.tracer.hint import hint_radii
from ispm.tracer.plan import PlannedMap
from ispm.tracer.surface import SurfaceTable
from ispm.tracer.threads import thread_count
from ispm.tracer.walk import Walk, walk
from ispm.tracer.world import World

_NEAR = 1e-4  # of the scene's diagonal; reversed depth has precision to spare
_TEXTURE_FOOTPRINT = 0.005  # of the diagonal: over which photons see textures averaged
_PASS = 0  # of one
_SHARP = 3.0  # low-resolution pixels: caustic kernels of a larger radius are not drawn at full resolution
_ROW = 0xFFFFFF  # of a material, in a word of the G-buffer
_ESTIMATOR_KNOBS = attrgetter("estimator", "kernel", "talk_errors")
_OWNED = (
    "_upload", "_gbuffer", "_bounce", "_direct", "_caustic", "_chains", "_antialias", "_shadow",
    "_downsample", "_upsample", "_estimator", "_world", "_last", "_packed", "_textures",
)  # fmt: skip


class Renderer:
    """Renders a scene again and again; owns the adapter's objects. Belongs to one thread.

    scene     may change between frames in any way; nothing is precomputed
    settings  may be replaced at any time: `renderer.settings = renderer.settings.replace(...)`
    camera    a Camera with a pose, or the name or index of one of the scene's; None: the first
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
        if not isinstance(scene, Scene):
            raise SceneError(f"a Renderer takes a Scene, not a {type(scene).__name__}; see ispm.load")
        self._closed = False
        self.scene, self.camera = scene, camera
        self.threads = thread_count(threads)
        self._gpu, self._owns_gpu = gpu or open_gpu(adapter), gpu is None
        self._world = World(self.threads)
        self._upload = Upload(self._gpu)
        self._gbuffer = GBufferStage(self._gpu)
        self._bounce = BounceStage(self._gpu)
        self._direct = DirectStage(self._gpu)
        self._caustic = CausticStage(self._gpu)
        self._chains = ChainStage(self._gpu)
        self._antialias = Antialias(self._gpu)
        self._packed: Packed | None = None
        self._textures: TextureTable | None = None
        self._photons = np.zeros(0, PHOTON)
        self._instances: np.ndarray | None = None  # of the last frame
        self._last: LastFrame | None = None
        self._said: set[str] = set()
        self._settings: Settings | None = None
        self.settings = settings or Settings()

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
        self._closed = True
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
        old, limit = self._settings, self._gpu.max_texture
        if max(new.size) > limit:
            raise SettingsError(
                f"size: {new.size[0]}x{new.size[1]} is larger than {self._gpu.name} can draw, "
                f"{limit} pixels a side"
            )
        receivers = math.prod(-(-side // new.subsampling) for side in new.size)
        if receivers * RECEIVER.itemsize > self._gpu.max_binding:
            raise SettingsError(
                f"size: {new.size[0]}x{new.size[1]} at subsampling {new.subsampling} needs more memory at "
                f"once than {self._gpu.name} can bind; use a larger subsampling or a smaller size"
            )
        if old is None or old.subsampling != new.subsampling:
            self._downsample = Downsample(self._gpu, new.subsampling)
            self._upsample = Upsample(self._gpu, new.subsampling)
        if old is None or old.shadow_resolution != new.shadow_resolution:
            self._shadow = ShadowStage(self._gpu, new.shadow_resolution)
        if old is None or _ESTIMATOR_KNOBS(old) != _ESTIMATOR_KNOBS(new):
            self._estimator = make_estimator(new, self._gpu, self.threads)
        self._settings = new

    def render(self) -> Frame:
        """Render one picture.

        Raises SceneError for a scene without a surface, SettingsError for more than memory can hold.
        """
        if self._closed:
            raise IspmError("this renderer is closed; make another one")
        width, height = self.settings.size
        with within_memory(f"a picture of {width}x{height} pixels and {self.settings.photons:,} photons"):
            return self._render()

    def _render(self) -> Frame:
        started = clock.perf_counter()
        self._last = None  # so that its memory can be used again
        watch = Watch()
        packed, view = self._prepare()
        plan = map_plan(packed, self.settings, _PASS)
        surfaces = self._surfaces(packed)
        by = emission_of(plan, packed, self.settings, self._gpu.is_software)

        with self._gpu.frame() as first:
            scene = self._upload(packed)
            first.stage("direct")
            gbuffer = self._gbuffer(first, scene, view)
            first.stage("upsample")
            receivers = self._downsample(first, scene, gbuffer, view)
            self._chains(first, scene, gbuffer)
            first.stage("bounce_map")
            drawn = plan if by == "map" else []
            maps = self._bounce(first, scene, drawn, _NEAR * packed.diagonal, _PASS)
        with watch("copy"):
            points = self._downsample.read(self._gpu, view)
            texels = maps.read(self._gpu)
            mirrors = self._chains.read()
        with self._gpu.frame() as second:
            second.stage("direct")
            seen = points["position"][points["valid"] > 0]
            shadows = self._shadow(second, scene, seen, view.eye_or_direction, _NEAR * packed.diagonal, _PASS)
            direct = self._direct(second, scene, gbuffer, shadows, view)

        with watch("trace"):
            path = self._trace(packed, surfaces, plan, texels, by)
        with watch("radiance"):
            photons, smooth, wide, sharp = self._part(path.photons, packed, view)
            estimate, light = self._gather(points, smooth, packed, view)
            if len(wide):
                size = self._downsample.size(view)
                light = light + self._estimator(points, wide, view.clip_from_world, size)

        with self._gpu.frame() as third:
            third.stage("radiance")
            caustic = self._caustic(third, scene, gbuffer, view, sharp)
            third.stage("upsample")
            indirect, irradiance, emission = self._upsample(
                third, scene, gbuffer, view, receivers, light, caustic
            )
        grid = cache(lambda: PhotonGrid(smooth))
        with watch("upsample"):
            self._light_missed(points, estimate, grid, wide, scene, gbuffer, view, caustic)
        with watch("eye"):
            focused = photons[len(smooth) :]
            brought = self._follow_chains(packed, surfaces, mirrors, grid, focused, view)
        with self._gpu.frame() as fourth:
            fourth.stage("compose")
            self._chains.patch(fourth, mirrors["pixel"], brought, direct, indirect, emission)
            if self.settings.antialias:
                self._antialias(fourth, scene, gbuffer, view, direct, indirect, emission)
        with watch("readback"):
            frame = self._compose(gbuffer, (direct, indirect, emission), irradiance, view)

        for recording in (first, second, third, fourth):
            for name, spent in recording.milliseconds().items():
                watch.add(name, spent)
        total = (clock.perf_counter() - started) * 1e3
        frame.stats = collect(
            packed, replace(path, photons=photons), view, self.settings, watch.milliseconds, total,
            adapter=self._gpu.name, emission=by, timing=first.timing,
            moved=moved(packed.instances, self._instances),
        )  # fmt: skip
        self._photons = photons
        self._last = LastFrame(
            frame, view, packed, surfaces, photons, points, self._downsample.size(view),
            plan, texels, self.threads,
        )  # fmt: skip
        self._instances = packed.instances
        return frame

    def photons(self) -> np.ndarray:
        """Return the last frame's photon map, (N,) PHOTON: a structured array, world space, lumen."""
        return self._photons

    def view(self, name: str) -> np.ndarray:
        """Return a view of the last frame as uint8 sRGB, also those that need the renderer."""
        if self._last is None:
            self.render()
        assert self._last is not None
        return self._last.show(name)

    def _prepare(self) -> tuple[Packed, CameraView]:
        """Pack the scene, place it in the tracer, and find its camera and lights."""
        scene = self.scene
        packed = self._pack(scene)
        if not packed.triangle_count:
            raise SceneError(f"{scene.name or 'the scene'}: has no surface to render")
        self._world.update(packed)
        camera, pose = self._find_camera(packed)
        if not len(packed.lights):
            node, line = default_light(packed, self._world, pose[:3, 3])
            self._say(line)
            scene = Scene([*scene.roots, node], scene.animations, scene.name)
            packed = self._pack(scene)
        if any(material.emissive for material in scene.materials):
            self._say("emissive materials glow, but do not light the scene yet")
        size, diagonal = self.settings.size, packed.diagonal
        reach = float(np.abs(packed.bounds - pose[:3, 3]).max()) + diagonal
        near = _NEAR * diagonal if camera.ymag is None else 0.0
        view = CameraView(
            size, pose, camera.yfov, camera.ymag, near, reach,
            pass_index=_PASS, aspect=camera.aspect, principal=camera.principal,
        )  # fmt: skip
        return packed, view

    def _pack(self, scene: Scene) -> Packed:
        old = self._packed
        packed = pack(scene, old.geometry if old else None)
        same = old is not None and [*map(id, old.textures)] == [*map(id, packed.textures)]
        if not same or self._textures is None:
            self._textures = TextureTable.pack(packed.textures)
        self._packed = packed
        return packed

    def _find_camera(self, packed: Packed) -> tuple[Camera, np.ndarray]:
        if isinstance(self.camera, Camera):
            if self.camera.pose is None:
                raise SettingsError("camera: it has no pose; give one, or add it to the scene")
            return self.camera, np.asarray(self.camera.pose, np.float64)
        found = find_camera(self.scene, self.camera)
        if found is None:
            width, height = self.settings.size
            return default_camera(packed, self._world, width / height)
        return found

    def _say(self, line: str) -> None:
        """Warn once in this renderer's life."""
        if line not in self._said:
            self._said.add(line)
            warnings.warn(line, SceneWarning, stacklevel=4)

    def _trace(
        self, packed: Packed, surfaces: SurfaceTable, plan: list[PlannedMap], texels: list[np.ndarray],
        by: str,
    ) -> Walk:  # fmt: skip
        """Emit the photons, by 'map' or by 'rays', and follow them."""
        settings = self.settings
        if by == "rays":
            emitted = emit_rays(packed, self._world, surfaces, plan, settings.seed, _PASS, self.threads)
        else:
            emitted = emit_texels(packed, plan, texels)
        return walk(
            packed, self._world, surfaces, emitted, settings.bounces, settings.seed, _PASS, self.threads
        )

    def _part(self, photons: np.ndarray, packed: Packed, view: CameraView) -> list[np.ndarray]:
        """Return the photons in a new order, and its parts: those to be filtered; caustic ones whose kernels
        are so wide that low resolution shows them as well; and those to be drawn at full resolution.

        The hint's kernels are as narrow as caustics need: with them all photons go the first way.
        """
        if self.settings.kernel == "hint":
            return [photons, photons, photons[:0], photons[:0]]
        caustic = photons[photons["bounce"] == 0]
        pixel = view.footprint * view.clip_from_world[3]
        measure_caustic_radii(
            caustic, packed.diagonal, self.settings.smoothing, pixel, packed.widths, view.eye_or_direction,
            threads=self.threads,
        )  # fmt: skip
        seen = caustic["position"] @ pixel[:3] + pixel[3]
        wide = caustic["radius"] > _SHARP * self.settings.subsampling * seen
        parts = [photons[photons["bounce"] > 0], caustic[wide], caustic[~wide]]
        parted = np.concatenate(parts)
        return [parted, *np.split(parted, np.cumsum([len(part) for part in parts[:2]]))]

    def _surfaces(self, packed: Packed) -> SurfaceTable:
        assert self._textures is not None
        return SurfaceTable(packed, self._textures, _TEXTURE_FOOTPRINT * packed.diagonal)

    def _gather(
        self, points: np.ndarray, photons: np.ndarray, packed: Packed, view: CameraView
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the light that photons bring to the receivers, (n, 16), as estimated and as filtered."""
        if not len(photons):
            dark = np.zeros((len(points), 16), np.float32)
            return dark, dark
        settings, size = self.settings, self._downsample.size(view)
        if settings.kernel == "hint":
            hint_radii(photons, packed.diagonal, settings.photons, settings.smoothing)
            estimate = self._estimator(points, photons, view.clip_from_world, size)
            return estimate, estimate
        pixel = settings.subsampling * view.footprint * view.clip_from_world[3]
        measure_radii(
            photons, packed.diagonal, settings.smoothing, pixel, packed.widths, view.eye_or_direction
        )
        estimate = self._estimator(points, photons, view.clip_from_world, size)
        return estimate, filter_estimate(
            points, estimate, size, packed.diagonal, settings.smoothing, self.threads
        )

    def _light_missed(
        self,
        points: np.ndarray,
        estimate: np.ndarray,
        grid: Callable[[], PhotonGrid],
        wide: np.ndarray,
        scene: GpuScene,
        gbuffer: GBuffer,
        view: CameraView,
        caustic: tuple[Texture, Texture] | None,
    ) -> None:
        """Light the pixels that upsampling could not serve: by the filter, else by the photons near.

        wide  caustic photons at low resolution, which are not filtered
        """
        missed, receivers = self._upsample.missed()
        if not len(missed):
            return
        light = light_points(
            receivers, missed["low"], points, estimate, self._downsample.size(view),
            scene.packed.diagonal, self.settings.smoothing, grid, self.threads,
        )  # fmt: skip
        if len(wide):
            light += PhotonGrid(wide).estimate(receivers, self.threads)
        with self._gpu.frame() as frame:
            self._upsample.patch(frame, scene, gbuffer, view, light, caustic)

    def _follow_chains(
        self,
        packed: Packed,
        surfaces: SurfaceTable,
        mirrors: np.ndarray,
        grid: Callable[[], PhotonGrid],
        focused: np.ndarray,
        view: CameraView,
    ) -> np.ndarray:
        """Return the light that mirrors and glass bring to their pixels, (n, 9), of (n,) SEEN."""
        settings = self.settings
        if not len(mirrors):
            return np.zeros((0, 9), np.float32)
        background = (0.0, 0.0, 0.0) if isinstance(settings.background, str) else settings.background
        rays = eye_rays(mirrors, view)
        paths = trace_eye(packed, self._world, surfaces, rays, background, settings.seed, _PASS, self.threads)
        return light_ends(
            paths, rays.keys, grid, PhotonGrid(focused), view, settings, packed.diagonal, self.threads
        )

    def _compose(
        self, gbuffer: GBuffer, light: tuple[Texture, Texture, Texture], irradiance: Texture, view: CameraView
    ) -> Frame:
        """Read the picture's parts back, add them, expose and tone map."""
        f2, f4, u4 = np.float16, np.float32, np.uint32
        assert self._packed is not None
        background = self.settings.background
        shines = not isinstance(background, str) and any(background)
        glow = [(light[2], f4, 4)] if shines or _glows(self._packed) else []
        d, i, irr, base, normals, ids, depth, *rest = self._gpu.read_many([
            (light[0], f4, 4), (light[1], f4, 4), (irradiance, f4, 4), (gbuffer.base, f2, 4),
            (gbuffer.normals, f2, 4), (gbuffer.ids, u4, 2), (gbuffer.depth, f4), *glow,
        ])  # fmt: skip
        e = rest[0] if rest else np.zeros(d.shape, f4)  # untouched pages: zeros_like would write them
        alpha = i[..., 3]
        if shines:
            e[..., :3] += (1.0 - alpha[..., None]) * np.array(background, f4)
        nodes = np.append(np.int32(-1), self._packed.instances["node"].astype(np.int32))
        full = make.sum_layers(d, i, e, self.threads)
        layers = make.Layers({
            "full": lambda: full, "direct": lambda: make.rgb(d), "indirect": lambda: make.rgb(i),
            "emission": lambda: make.rgb(e), "alpha": lambda: np.ascontiguousarray(alpha),
            "irradiance": lambda: make.rgb(irr),
            "depth": lambda: make.linear_depth(depth, view),
            "normal": lambda: make.decode_normals(normals, depth),
            "albedo": lambda: base[..., :3].astype(f4), "instance": lambda: nodes[ids[..., 0]],
            "material": lambda: np.where(ids[..., 0] > 0, ids[..., 1] & _ROW, -1).astype(np.int32),
        })  # fmt: skip
        settings = self.settings
        exposure = auto_exposure(full) if settings.exposure == "auto" else float(settings.exposure)
        if background == "transparent":
            image = tonemap_transparent(full, alpha, exposure, settings.tonemap, self.threads)
        else:
            image = tonemap(full, exposure, settings.tonemap, self.threads)
        camera = {"pose": view.pose, "clip_from_world": view.clip_from_world}
        return Frame(image, layers, Stats(), settings, camera, exposure, self.scene.name)


def _glows(packed: Packed) -> bool:
    """Whether any material emits light or shows its color unlit."""
    unlit = packed.materials["flags"] & MATERIAL_UNLIT
    return bool(packed.materials["emission"].any() or unlit.any())
