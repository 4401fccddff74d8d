"""`ispm animate`: a film."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from ispm.cli.console import Console
from ispm.cli.options import command, film_from, loading_from, named_as_flags, settings_from, vector
from ispm.cli.picture import Kind
from ispm.cli.scene import choose_camera, open_scene, require_not_input, surround
from ispm.cli.viewpoint import Viewpoint
from ispm.errors import SettingsError
from ispm.film.settings import Film, frames_named
from ispm.settings import LOADING, Settings

if TYPE_CHECKING:
    from ispm.film.animate import Shot
    from ispm.film.output import Output
    from ispm.film.path import CameraPath, Turntable

_EVERY = 5.0  # s from a line about the frames done to the next


@dataclass(frozen=True)
class Filmed:
    """What a user asks of a film, besides settings."""

    output: Annotated[
        str | None,
        Parameter(
            name=("--output", "-o"),
            help="the film: .mp4 .mkv .webm .mov, or pictures numbered by %04d or ####; default SCENE.mp4",
            metavar="FILE",
        ),
    ] = None
    turntable: Annotated[
        str | None,
        Parameter(
            help="the camera goes round the scene, or what --look-at says, in so many frames",
            metavar="DEGREES/FRAMES",
            allow_leading_hyphen=True,
        ),
    ] = None
    path: Annotated[
        str | None, Parameter(help="key frames of the camera, docs/films.md", metavar="FILE.toml")
    ] = None
    frames: Annotated[
        str,
        Parameter(
            help="these alone, from the first up to but not with the last, or one by number; default: all",
            metavar="FIRST:END",
            allow_leading_hyphen=True,
            show_default=False,
        ),
    ] = ":"
    history: Annotated[
        bool,
        Parameter(
            help="light goes on from the frames before, as in the live view: steadier and faster, less exact",
            negative="",
            show_default=False,
        ),
    ] = False
    contact_sheet: Annotated[
        str | None, Parameter(help="all frames, small and with their numbers", metavar="FILE.png")
    ] = None


@command(Settings, Film, *LOADING)
def animate(
    console: Console, scene: str, /, *, look: Viewpoint, filmed: Filmed, kind: Kind, **given: Any
) -> None:
    """Render a film.

    Example: ispm animate cornell-box -o box.mp4 --turntable 360/120 --size 640x360

    SCENE is a file (.glb .gltf .obj .ply .stl) or the name of a built-in scene. The file's animations play,
    and the camera is still, goes round the scene, or goes by --path. Settings are as of render; the exposure
    is the first frame's where none is given. Finished frames are kept in FILE.frames until the film is
    whole: a film that was stopped goes on with the same command.
    """
    look.check()
    film, loading = film_from(given, look.config), loading_from(given, look.config)
    settings = settings_from(given, look.config, exposure="hold")
    if filmed.history:
        settings = settings.replace(live=True)
    from ispm.film.possible import require_possible

    output, saved = _checked(scene, look, filmed, kind)
    path = _path(look, filmed)
    with named_as_flags("turntable", "frames"):
        turn = _turntable(filmed.turntable, look.look_at)
        frames_named(filmed.frames)
    require_possible(output, film, settings, saved)

    from ispm.film.animate import animate as shoot
    from ispm.kernels import background, store

    background.say = console.say
    if store.is_empty():
        background.start()  # while the scene is read
    world = open_scene(console, scene, loading)
    surround(world, look)
    camera: Any = path or choose_camera(world, look.camera, look.look_from, look.look_at, look.fov)
    if turn is not None:
        camera = replace(turn, camera=camera)
    background.finish()
    background.bar = False

    with _progress(console, output) as told, named_as_flags("frames", "duration"):
        shoot(
            world,
            output.path,
            settings,
            film=film,
            camera=camera,
            animation=look.animation,
            time=look.time or 0.0,
            frames=filmed.frames,
            saved=saved,
            contact_sheet=filmed.contact_sheet,
            on_frame=told,
            adapter=look.adapter,
            threads=look.threads,
        )
    for file in _files(output, filmed):
        console.written(file)
    sheet = filmed.contact_sheet
    console.result({"output": str(output.path), "frames": told.count, "contact_sheet": sheet})


def _checked(scene: str, look: Viewpoint, filmed: Filmed, kind: Kind) -> tuple[Output, dict[str, Any]]:
    """Return what is written to, and how pictures are saved. Raises an IspmError for what makes no sense."""
    from ispm.film.output import Output

    output = Output.of(filmed.output or (Path(scene).stem or "film") + ".mp4")
    if output.is_film and kind != Kind():
        raise SettingsError("--layers, --float, --bits: are for numbered pictures; leave them out")
    saved = {"show": look.show} if output.is_film else kind.checked(output.path, look.show)
    for path in _files(output, filmed):
        require_not_input(path, scene, look.environment)
    return output, saved


def _files(output: Output, filmed: Filmed) -> list[Path]:
    """What is written besides numbered pictures."""
    film = [output.path] if output.is_film else []
    return film if filmed.contact_sheet is None else [*film, Path(filmed.contact_sheet)]


def _path(look: Viewpoint, filmed: Filmed) -> CameraPath | None:
    """The camera's path. Raises SettingsError for a bad one, and beside others that say where it is."""
    if filmed.path is None:
        return None
    for name in ("camera", "look_from", "look_at", "fov"):
        if getattr(look, name) is not None:
            raise SettingsError(f"--path and --{name.replace('_', '-')} exclude each other; give one")
    if filmed.turntable is not None:
        raise SettingsError("--path and --turntable exclude each other; give one")
    from ispm.film.path import CameraPath

    return CameraPath.load(filmed.path)


def _turntable(text: str | None, look_at: str | None) -> Turntable | None:
    """The way of a camera that goes round, without the camera; None: it does not."""
    if text is None:
        return None
    from ispm.film.path import Turntable

    center = None if look_at is None else vector("--look-at", look_at)
    return replace(Turntable.parse(text), center=center)


class _Told:
    """Takes what is told of frames: how far the film is.

    count  finished frames
    """

    def __init__(self, console: Console, output: Output) -> None:
        self._console, self._output = console, output
        self._begun, self._first, self._said = time.monotonic(), 0.0, 0.0
        self._rendered = self.count = 0
        self.show: Callable[[Shot, str], object] = self._line

    def __call__(self, shot: Shot) -> None:
        self.count = shot.done
        now = time.monotonic()
        self._rendered += not shot.found
        if not self._rendered:
            self._begun = now  # finding frames takes less than rendering them
        elif self._rendered == 1 and not shot.found:
            self._first, self._begun = now - self._begun, now
        if not (shot.found or self._output.is_film):
            self._console.written(shot.path)
        told = f"frame {shot.frame}, {shot.done} of {shot.count}"
        if self._rendered > 1:
            each = (now - self._begun) / (self._rendered - 1)
            told += f", {each:.1f} s each, {as_duration(each * shot.left)} left"
        elif self._rendered:  # which makes ready what all frames share
            told += f", {self._first:.1f} s, at most {as_duration(self._first * shot.left)} left"
        self.show(shot, told)
        if shot.done == shot.count and self._output.is_film:
            self._console.say(f"writing {self._output.path}")

    def _line(self, shot: Shot, told: str) -> None:
        """Say it now and then."""
        now = time.monotonic()
        if now - self._said >= _EVERY or shot.done == shot.count:
            self._said = now
            self._console.say(f"  {told}")


@contextmanager
def _progress(console: Console, output: Output) -> Iterator[_Told]:
    """Yield what is told of frames, shown by a bar on a terminal; an interrupt says what is kept."""
    told = _Told(console, output)
    try:
        if console.is_live:
            with _bar(told):
                yield told
        else:
            yield told
    except KeyboardInterrupt:
        if not told.count:
            raise
        raise KeyboardInterrupt(
            f"{told.count} frames are finished and kept; the same command goes on after them"
        ) from None


@contextmanager
def _bar(told: _Told) -> Iterator[None]:
    """Have what is told move a bar on stderr."""
    from rich.console import Console as Rich
    from rich.progress import BarColumn, Progress, TextColumn

    columns, bar = (TextColumn("  {task.description}"), BarColumn()), Rich(stderr=True, highlight=False)
    with Progress(*columns, console=bar, redirect_stdout=sys.stdout.isatty()) as shown:
        task = shown.add_task("frame", total=None)
        told.show = lambda shot, line: shown.update(
            task, description=line, completed=shot.done, total=shot.count
        )
        yield


def as_duration(seconds: float) -> str:
    """Return a time as users read it: 40 s, 12 min, 3.5 h."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"
