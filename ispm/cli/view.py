"""`ispm view`: a scene, live."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from ispm.cli.console import Console
from ispm.cli.interrupts import interrupts
from ispm.cli.options import command, loading_from, settings_from
from ispm.cli.scene import choose_camera, open_scene
from ispm.cli.viewpoint import Viewpoint
from ispm.errors import IspmError, SettingsError
from ispm.settings import LOADING, Settings

if TYPE_CHECKING:
    from ispm.viewer.running import Running
    from ispm.viewer.session import Session

_SWITCH = Parameter(negative="", show_default=False)


@dataclass(frozen=True)
class Shown:
    """Where a view is shown."""

    web: Annotated[
        bool, _SWITCH, Parameter(help="in a browser, at an address that is printed, not in a window")
    ] = False
    terminal: Annotated[bool, _SWITCH, Parameter(help="in this terminal, two pixels to a character")] = False
    port: Annotated[int, Parameter(help="where the page is served; 0: any that is free", metavar="N")] = 0
    host: Annotated[str, Parameter(help="the address that it is served at", metavar="ADDRESS")] = "127.0.0.1"
    allow_remote: Annotated[
        bool, _SWITCH, Parameter(help="whether --host may be one that other machines reach")
    ] = False
    public_url: Annotated[
        str, Parameter(help="the page's address where a proxy stands before it", metavar="URL")
    ] = ""
    fps: Annotated[
        float,
        Parameter(help="pictures a second while something moves, for which they get smaller", metavar="N"),
    ] = 15.0
    watch: Annotated[bool, _SWITCH, Parameter(help="load the file again whenever it changes")] = False


@command(Settings, *LOADING)
def view(console: Console, scene: str, /, *, shown: Shown, look: Viewpoint, **given: Any) -> None:
    """Show a scene live: move the camera, lights and objects, and the light follows.

    Example: ispm view cornell-box

    A window opens; with --web, or where none can be opened, a page is served for browsers. SCENE is a file
    (.glb .gltf .obj .ply .stl) or the name of a built-in scene. Settings as of render; the preset is live
    where none is given. Ctrl-C ends it.
    """
    look.check()
    if not (math.isfinite(shown.fps) and 0.1 <= shown.fps <= 240.0):
        raise SettingsError(f"--fps: {shown.fps:g} is not within 0.1 to 240")
    if not 0 <= shown.port <= 65535:
        raise SettingsError(f"--port: {shown.port} is not within 0 to 65535")
    settings = settings_from(given, look.config)
    loading = loading_from(given, look.config)

    from ispm.viewer.screen import why_no_window

    if shown.terminal:
        if shown.web:
            raise SettingsError("--terminal and --web exclude each other")
        from ispm.viewer.terminal import require_terminal

        require_terminal()
    why = "" if shown.web or shown.terminal else why_no_window()
    page = shown.web or bool(why)
    if page:
        from ispm.viewer.server import require_web

        if why:
            console.say(f"{why}; the page is served instead")
        require_web()
    from ispm.kernels import background
    from ispm.viewer.access import require_host
    from ispm.viewer.drawing import PRESET
    from ispm.viewer.fields import granted
    from ispm.viewer.messages import Play
    from ispm.viewer.running import live

    require_host(shown.host, shown.allow_remote)
    if "preset" not in given and settings == Settings().replace(size=settings.size):
        settings = Settings(preset=PRESET, size=settings.size)
    granted(settings)
    background.say = console.say
    world = open_scene(console, scene, loading)
    camera = choose_camera(world, look.camera, look.look_from, look.look_at, look.fov)
    path = Path(scene)
    if shown.watch and not path.is_file():
        raise SettingsError(f"--watch: {scene} is no file")

    def prepare(session: Session) -> None:
        session.view = look.show
        if look.time is not None or look.animation is not None:
            session.handle(Play(time=max(look.time or 0.0, 0.0), animation=look.animation))

    running = live(
        world,
        settings,
        camera,
        source=scene,
        loading=loading,
        fps=shown.fps,
        adapter=look.adapter,
        threads=look.threads,
        watch=path if shown.watch else None,
        prepare=prepare,
    )
    try:
        with interrupts() as asked:
            if shown.terminal:
                from ispm.viewer.terminal import Terminal

                Terminal(running).run(asked)
            elif page or not _in_window(console, running, asked):
                _on_page(console, running, shown, asked)
    finally:
        running.close()
    console.say("closed")


def _in_window(console: Console, running: Running, asked: Callable[[], bool]) -> bool:
    """Show a session in a window until it is closed; False, having said why, where none opens."""
    from ispm.viewer.window import Window

    try:
        window = Window(running)
    except IspmError as error:
        console.say(f"{error}; the page is served instead")
        return False
    window.run(asked)
    return True


def _on_page(console: Console, running: Running, shown: Shown, asked: Callable[[], bool]) -> None:
    """Serve a session's page until it is asked to end."""
    from ispm.viewer.server import Server

    server = Server(
        running,
        shown.host,
        shown.port,
        allow_remote=shown.allow_remote,
        public=shown.public_url,
        spent=lambda: console.say(f"for another browser: {server.access.url()}"),
    )
    url = server.access.url()
    console.written(url)
    console.result({"url": url})
    running.wait(asked)
