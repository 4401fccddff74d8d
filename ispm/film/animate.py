"""`ispm.animate`: a film, frame by frame, that goes on where it was left."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from ispm.errors import OutputError, SettingsError, warn_caller
from ispm.film.kept import Kept
from ispm.film.output import Output
from ispm.film.path import CameraPath, Turntable
from ispm.film.possible import require_possible
from ispm.film.settings import Film, frame_range
from ispm.film.sheet import contact_sheet as sheet_of
from ispm.film.stage import Change, Motion, Stage
from ispm.io.atomic import as_path, require_writable
from ispm.io.image import require_ending, write_png
from ispm.io.named import open_named
from ispm.optics.rng import pcg4d
from ispm.renderer.converge import converge
from ispm.renderer.made_of import MadeOf
from ispm.renderer.picture import Frame
from ispm.renderer.renderer import Renderer
from ispm.scene.camera import Camera
from ispm.scene.scene import Scene
from ispm.settings import RENDERER_VIEWS, Changes, Settings

BLOCK, WARM_UP = 48, 16  # frames that go on from one another, and those before them that are not shown
_GOLDEN = 0.6180339887498949  # 1 / phi: its multiples modulo 1 are evenly spread, however many there are
_SHUTTER = 0x53485554  # random numbers of the shutter
_MOST_ON_SHEET, _MOST_ACROSS = 100, 8  # pictures
_SHOWN = (".png", ".jpg", ".jpeg")  # what a numbered picture of these shows is what its small one does


@dataclass(frozen=True)
class Shot:
    """A frame of a film that is finished.

    frame  its number;  path  of its picture;  found  whether it was there from before
    done   frames that are finished, of `count` in all
    left   that are still to be rendered
    """

    frame: int
    path: Path
    found: bool
    done: int
    count: int
    left: int


def animate(
    scene: Scene | str | Path,
    output: str | Path,
    settings: Settings | None = None,
    *,
    film: Film | None = None,
    camera: Camera | CameraPath | Turntable | str | int | None = None,
    animation: str | None = None,
    time: float = 0.0,
    frames: str | int = ":",
    change: Change | None = None,
    saved: Mapping[str, Any] | None = None,
    contact_sheet: str | Path | None = None,
    on_frame: Callable[[Shot], object] | None = None,
    adapter: str | None = None,
    threads: int | None = None,
    **changes: Unpack[Changes],
) -> Path:
    """Render a film; return the path that was given.

    scene      a Scene, a file, or the name of a built-in scene
    output     .mp4 .mkv .webm .mov, which need PyAV (extra `video`), or a picture's name with %04d or ####
    settings   None: the default ones, with the exposure that the first frame is found to need for all of them
    film       pictures a second, duration, shutter, codec
    camera     as of `Renderer`, or one that moves: a CameraPath or a Turntable
    animation  the name of the one to play; None: all
    time       of the scene as the film begins, s
    frames     "10:20": these alone, as Python slices, or one by its number; those of a video become one of
               their own
    change     called with the Renderer and the scene's time, s, before each pass; sets, by the time alone,
               what it changes in `renderer.scene`, `camera` and `settings`
    saved      how numbered pictures are written: arguments of `Frame.save` by name; of a video `show` alone
    contact_sheet  a .png of all frames, small and with their numbers
    on_frame   called with the Shot when a frame is finished, or found to be
    adapter, threads  as of `Renderer`
    changes    settings by name, over `settings`
    Frames are lit from scratch, as `render` does at their time, or with setting `live` go on from those
    before. Finished ones are kept in the folder `OUTPUT.frames` until the film is whole: one that was killed
    goes on when it is called again with the same arguments, and has the same bytes as if it had not been.
    Raises SceneError, SettingsError, OutputError or AdapterError, before anything is rendered where it can.
    """
    if settings is not None and not isinstance(settings, Settings):
        raise SettingsError(f"settings must be ispm.Settings, not a {type(settings).__name__}")
    chosen = (settings or Settings(exposure="hold")).replace(**changes)
    shooting = _Shooting(
        Output.of(output), film or Film(), chosen, dict(saved or {}), contact_sheet, on_frame
    )
    if not isinstance(scene, Scene):
        scene = open_named(scene)
        for line in scene.warnings:
            warn_caller(line)
    motion = Motion(scene, shooting.film, camera, animation, float(time), change)
    first = scene.at(motion.start, animation)
    numbers = frame_range(frames, motion.count)
    with Renderer(first, chosen, motion.first_camera, adapter=adapter, threads=threads) as renderer:
        renderer.antialias_live = True
        shooting.run(Stage(motion, renderer), renderer, numbers)
    return shooting.output.path


class _Shooting:
    """Renders the frames of a film that are not finished, and joins all.

    Raises what `animate` does for what cannot become one.
    """

    def __init__(
        self,
        output: Output,
        film: Film,
        settings: Settings,
        saved: dict[str, Any],
        sheet: str | Path | None,
        tell: Callable[[Shot], object] | None,
    ) -> None:
        self.output, self.film = output, film
        self._saved, self._tell = saved, tell
        self._sheet = None if sheet is None else as_path(sheet)
        require_possible(output, film, settings, saved)
        if output.is_film:
            from ispm.film.video import bits_of, codec_of

            self._codec = codec_of(output.path, film)
            self._bits = bits_of(self._codec)
        if self._sheet is not None:
            if require_ending(self._sheet) != ".png":
                raise OutputError(f"{self._sheet}: a contact sheet is a .png")
            require_writable(self._sheet)

    def run(self, stage: Stage, renderer: Renderer, frames: range) -> None:
        """Render what is missing of `frames`, write the film, and remove what was kept for it."""
        self._stage, self._renderer, settings = stage, renderer, renderer.settings
        if self.film.shutter and renderer.settings.most_passes == 1:
            warn_caller("shutter: one pass has no motion blur; ask for more, as passes=16")
        if renderer.settings.exposure == "hold":
            stage.put(0)
            found = renderer.render_pass(0).exposure
            renderer.settings = renderer.settings.replace(exposure=found)
        kept = Kept(self.output, self._about(settings))
        noted = set(kept.finished())
        for done, (frame, was_there) in enumerate(self._finish(kept, frames, noted), 1):
            if self._tell:
                left = sum(each not in noted for each in frames if each > frame)
                self._tell(Shot(frame, kept.path(frame), was_there, done, len(frames), left))
        if self.output.is_film:
            from ispm.film.video import read_png, write_video

            pictures = (read_png(kept.path(frame), self._bits) for frame in frames)
            write_video(self.output.path, pictures, self.film, self._codec)
        if self._sheet is not None:
            shown = frames[:: -(-len(frames) // _MOST_ON_SHEET)]
            small = [(str(frame), kept.small(frame)) for frame in shown]
            columns = min(math.ceil(math.sqrt(len(small))), _MOST_ACROSS)
            write_png(self._sheet, np.asarray(sheet_of(small, columns, small[0][1].width)))
        if not kept.remove(frames):
            warn_caller(f"{kept.folder}: stays, as it holds finished frames of the rest of the film")

    def _about(self, settings: Settings) -> dict[str, Any]:
        """What all frames share, besides what they are made of.

        settings  that were asked for
        """
        from ispm import __version__

        film = {name: getattr(self.film, name) for name in ("fps", "shutter")}
        kind = {"bits": self._bits} if self.output.is_film else {}
        machine = {"version": __version__, "adapter": self._renderer.adapter}
        saved = {name: str(value) for name, value in self._saved.items()}
        found = {"exposure of the first frame": self._renderer.settings.exposure}
        return {**machine, **film, **dataclasses.asdict(settings), **kind, **saved, **found}

    def _finish(self, kept: Kept, frames: range, noted: set[int]) -> Iterator[tuple[int, bool]]:
        """Yield each frame once its picture is there, and whether it was before.

        noted  those that may be
        """
        live = self._renderer.settings.live
        length = BLOCK if live else 1
        for first in range(frames.start // length * length, frames.stop, length):
            block = range(max(first, frames.start), min(first + length, frames.stop))
            there = [frame for frame in block if frame in noted and kept.has(frame, self._made_of(frame))]
            yield from ((frame, True) for frame in there)
            missing = set(block).difference(there)
            if live and missing:
                self._warm_up(first)
            for frame in range(first, max(missing, default=-1) + 1):
                made_of = self._made_of(frame)
                picture = self._render(frame)
                if frame in missing:
                    kept.keep(frame, made_of, self._write(kept.path(frame), picture))
                    yield frame, False

    def _made_of(self, frame: int) -> MadeOf:
        self._stage.put(frame)
        return self._renderer.made_of()

    def _warm_up(self, first: int) -> None:
        """Have light gather before the first frame of a block: by those before it, or after it backwards."""
        self._renderer.reset()
        for frame in range(first - WARM_UP, first):
            self._stage.put(abs(frame))
            self._renderer.render()

    def _render(self, frame: int) -> Frame:
        """One picture."""
        renderer, shutter = self._renderer, self.film.shutter
        settings = renderer.settings
        if settings.live or not shutter or settings.most_passes == 1:
            self._stage.put(frame)
            return renderer.render()
        key = np.uint32(frame), np.uint32(_SHUTTER), np.uint32(0), np.uint32(settings.seed)
        start = float(pcg4d(*key)[0]) / 2.0**32

        def move(index: int) -> None:
            self._stage.put(frame + shutter * ((start + index * _GOLDEN) % 1.0))

        renderer.progress = None
        *_, picture = converge(renderer, settings, move)
        return picture

    def _write(self, path: Path, picture: Frame) -> np.ndarray:
        """Write a picture; return what it shows, (h, w, 3 or 4) uint8."""
        saved, show = dict(self._saved), self._saved.get("show", "full")
        if show in RENDERER_VIEWS:
            picture.image, saved["show"] = self._renderer.view(show), "full"
        if not self.output.is_film:
            picture.save(path, **saved)
            return (
                picture.image
                if path.suffix.lower() not in _SHOWN
                else picture.view(saved.get("show", "full"))
            )
        view = saved.get("show", "full")
        pixels = picture.view(view)
        deep = pixels if self._bits == 8 else picture.view(view, self._bits)
        write_png(path, deep)
        return pixels
