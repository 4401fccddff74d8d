"""`ispm view`: a scene, live."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from ispm.cli.console import Console
from ispm.cli.interrupts import interrupts
from ispm.cli.options import WHOLE, command, loading_from, settings_from
from ispm.cli.scene import choose_camera, open_scene, surround
from ispm.cli.viewpoint import Viewpoint
from ispm.errors import IspmError, SettingsError
from ispm.settings import LOADING, Settings

if TYPE_CHECKING:
    from ispm.viewer.running import Running
    from ispm.viewer.session import Session

_SWITCH = Parameter(negative="", show_default=False)
_HERE = "127.0.0.1"


@dataclass(frozen=True)
class Shown:
    """Where a view is shown."""

    web: Annotated[
        bool, _SWITCH, Parameter(help="in a browser, at an address that is printed, not in a window")
    ] = False
    terminal: Annotated[bool, _SWITCH, Parameter(help="in this terminal, two pixels to a character")] = False
    port: Annotated[
        int | None,
        WHOLE,
        Parameter(
            help="where the page is served; 0: any that is free", metavar="N", show_default=lambda _: 0
        ),
    ] = None
    host: Annotated[
        str | None,
        Parameter(help="the address that it is served at", metavar="ADDRESS", show_default=lambda _: _HERE),
    ] = None
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

    @property
    def of_page(self) -> str:
        """The option given that means the page; empty: none."""
        given = {
            "--web": self.web,
            "--port": self.port is not None,
            "--host": self.host is not None,
            "--allow-remote": self.allow_remote,
            "--public-url": self.public_url,
        }
        return next((name for name, value in given.items() if value), "")


@command(Settings, *LOADING)
def view(console: Console, scene: str, /, *, shown: Shown, look: Viewpoint, **given: Any) -> None:
    """Show a scene live: move the camera, lights and objects, and the light follows.

    Example: ispm view cornell-box

    A window opens; with --web, --port, --host, --allow-remote or --public-url, or where none can be opened, a
    page is served for browsers. SCENE is a file (.glb .gltf .obj .ply .stl) or the name of a built-in scene.
    Settings as of render; the preset is live where none is given. Ctrl-C ends it.
    """
    look.check()
    host, port = shown.host or _HERE, shown.port or 0
    if not 0 <= port <= 65535:
        raise SettingsError(f"--port: {port} is not within 0 to 65535")

    from ispm.viewer.drawing import PRESET
    from ispm.viewer.screen import why_no_window

    settings = settings_from(given, look.config, preset=PRESET)
    loading = loading_from(given, look.config)

    if shown.terminal:
        if shown.of_page:
            raise SettingsError(f"--terminal and {shown.of_page} exclude each other")
        from ispm.viewer.terminal import require_terminal

        require_terminal()
    why = "" if shown.of_page or shown.terminal else why_no_window()
    page = bool(shown.of_page or why)
    if page:
        from ispm.viewer.server import require_web

        if why:
            console.say(f"{why}; the page is served instead")
        require_web()
    from ispm.kernels import background
    from ispm.viewer.access import require_host
    from ispm.viewer.messages import Play
    from ispm.viewer.running import live

    require_host(host, shown.allow_remote)
    background.say = console.say
    world = open_scene(console, scene, loading)
    surround(world, look)
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
        shown.host or _HERE,
        shown.port or 0,
        allow_remote=shown.allow_remote,
        public=shown.public_url,
        spent=lambda: console.say(f"for another browser: {server.access.url()}"),
    )
    url = server.access.url()
    console.written(url)
    console.result({"url": url})
    running.wait(asked)
