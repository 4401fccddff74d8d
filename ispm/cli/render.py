"""`ispm render`: one picture."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from ispm.cli.console import Console, to_json
from ispm.cli.options import command, loading_from, settings_from
from ispm.cli.passes import render_passes
from ispm.cli.picture import Kind
from ispm.cli.scene import choose_camera, open_scene, require_not_input, surround
from ispm.cli.viewpoint import Viewpoint
from ispm.errors import OutputError, SettingsError
from ispm.settings import LOADING, RENDERER_VIEWS, Settings

_TELLING = ("polygons", "emitters", "stored_photons", "passes", "error", "total_ms", "peak_memory", "adapter")


@dataclass(frozen=True)
class Asked:
    """What a user asks of a picture, besides settings."""

    output: Annotated[
        str | None, Parameter(name=("--output", "-o"), help="the picture; default SCENE.png", metavar="FILE")
    ] = None
    stats: Annotated[
        str | None,
        Parameter(
            help="write all statistics as JSON; -: show them all", metavar="FILE", allow_leading_hyphen=True
        ),
    ] = None
    list_adapters: Annotated[
        bool, Parameter(help="list the adapters and stop", negative="", show_default=False)
    ] = False
    resume: Annotated[
        str | None,
        Parameter(
            help="passes are kept in FILE.npz, each half minute, and continued where it exists",
            metavar="FILE.npz",
        ),
    ] = None
    print_config: Annotated[
        bool,
        Parameter(help="print the settings as TOML on stdout and stop", negative="", show_default=False),
    ] = False


# what of it makes a picture again
_AROUND = ("environment", "environment_rotation", "environment_intensity")
_VIEW = ("camera", "look_from", "look_at", "fov", "animation", "time", *_AROUND, "show", "adapter")
_FILE = ("layers", "float", "bits")


@command(Settings, *LOADING)
def render(
    console: Console,
    scene: str | None = None,
    /,
    *,
    look: Viewpoint,
    asked: Asked,
    kind: Kind,
    **given: Any,
) -> None:
    """Render one picture.

    Example: ispm render cornell-box -o room.png --photons 100k --size 640x360

    SCENE is a file (.glb .gltf .obj .ply .stl) or the name of a built-in scene. The settings may also come
    from the environment (ISPM_PHOTONS=100k) or from --config.
    """
    settings = settings_from(given, look.config)
    loading = loading_from(given, look.config)
    if asked.print_config:
        _print_config(console, settings, loading)
        return
    if asked.list_adapters:
        _list_adapters(console)
        return
    if not scene:
        raise SettingsError("no scene was named; give a file or a built-in scene, such as cornell-box")
    target, saved = _checked(scene, look, asked, kind)

    from ispm.kernels import background, store

    background.say = console.say
    if store.is_empty():
        background.start()  # while the scene is read

    world = open_scene(console, scene, loading)
    surround(world, look)
    if look.time is not None or look.animation is not None:
        if not world.animations and look.animation is None:
            console.warn(f"--time: nothing moves in {scene}, which is the same at all times")
        world = world.at(look.time or 0.0, look.animation)
    camera = choose_camera(world, look.camera, look.look_from, look.look_at, look.fov)

    from ispm.renderer import Renderer
    from ispm.renderer.command_line import command_line

    background.finish()
    background.bar = False  # below, something else moves on the terminal
    with (
        console.step(
            f"rendering {settings.size[0]}x{settings.size[1]}, {settings.photons:,} photons",
            spin=settings.most_passes == 1,
        ),
        Renderer(world, settings, camera=camera, adapter=look.adapter, threads=look.threads) as renderer,
    ):
        frame, interrupted, not_kept = render_passes(console, renderer, asked.resume)
        if look.show in RENDERER_VIEWS:
            frame.image, saved["show"] = renderer.view(look.show), "full"
    options = {
        name: getattr(owner, name) for owner, names in ((look, _VIEW), (kind, _FILE)) for name in names
    }
    if not world.animations:
        options["time"] = None
    frame.command = command_line(scene, options, settings, loading, output=str(target))
    frame.save(target, **saved)
    console.written(target)
    _report(console, frame.stats, target, asked.stats)
    if interrupted:
        console.say(f"interrupted: {target} is the mean of {frame.stats.passes} passes")
    if not_kept:
        raise not_kept
    if interrupted:
        raise KeyboardInterrupt


def _checked(scene: str, look: Viewpoint, asked: Asked, kind: Kind) -> tuple[Path, dict[str, Any]]:
    """Find out before the work whether what is asked makes sense; return the picture's path, and how it is
    saved."""
    look.check()
    target = _target(scene, asked.output)
    saved = kind.checked(target, look.show)
    resume, stats = asked.resume, None if asked.stats == "-" else asked.stats
    if resume is not None and Path(resume).suffix.lower() != ".npz":
        raise OutputError(f"--resume: {resume} would be an .npz; name it so")
    outputs = [Path(path) for path in (target, stats, resume) if path is not None]
    _require_writable(outputs, scene, look.environment)
    return target, saved


def _target(scene: str, output: str | None) -> Path:
    """The picture's path, its ending checked."""
    from ispm.io.image import require_ending

    target = Path(output) if output is not None else Path((Path(scene).stem or "picture") + ".png")
    require_ending(target)
    return target


def _require_writable(outputs: list[Path], scene: str, environment: str | None) -> None:
    """Find out before the work whether its results can be written."""
    from ispm.io.atomic import require_writable

    for path in outputs:
        require_not_input(path, scene, environment)
        require_writable(path)
    if len({path.resolve() for path in outputs}) < len(outputs):
        raise OutputError(
            f"{outputs[0]}: is to hold two results; name a file each for the picture, --stats and --resume"
        )


def _print_config(console: Console, settings: Settings, loading: Mapping[str, Any]) -> None:
    values = {**dataclasses.asdict(settings), **loading}
    if console.as_json:
        console.result(values)
        return
    for name, value in values.items():
        print(f"{name} = {to_json(value) if not isinstance(value, tuple) else list(value)}")


def _list_adapters(console: Console) -> None:
    from ispm.gpu.device import list_adapters, open_gpu

    found = list_adapters()
    if not found:
        open_gpu()  # says why there is none, and the cure
    console.table("adapters", [(a.name, a.backend, a.type, a.driver) for a in found])
    console.result({"adapters": found})


def _report(console: Console, stats: Any, target: Path, file: str | None) -> None:
    """Show the statistics that tell most, all where `file` is -; else write all where it is named."""
    values = {f.name: getattr(stats, f.name) for f in dataclasses.fields(stats)}
    telling = [(name, values[name]) for name in _TELLING if name in values and values[name] == values[name]]
    console.table("statistics", list(values.items()) if file == "-" else telling)
    if file not in (None, "-"):
        from ispm.io.atomic import write_whole

        write_whole(file, [(to_json(values) + "\n").encode()])
        console.written(file)
    console.result({"output": str(target), "stats": values})
