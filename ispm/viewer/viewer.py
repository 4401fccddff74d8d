"""`ispm.view`: a live view for programs."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from types import TracebackType
from typing import Any

from ispm.errors import IspmError, warn_caller
from ispm.renderer.picture import Frame
from ispm.renderer.show import in_marimo, in_notebook
from ispm.scene.camera import Camera
from ispm.scene.scene import Scene
from ispm.settings import Settings
from ispm.viewer.pick import Picked
from ispm.viewer.running import Running
from ispm.viewer.server import Server


class Viewer:
    """A live view of a scene, as `ispm.view(scene, block=False)` returns it; it closes with its `with` block.

    The scene may go on to be changed: what changes shows at once. Changes that belong together are made
    within `with viewer.editing():`, which no picture sees half of.
    A notebook shows it as it is, in the cell whose last line names it.
    running         the session in its thread
    server, widget  what shows it: `ispm.view` makes one of them
    """

    def __init__(self, running: Running, server: Server | None, widget: Any = None) -> None:
        self._running, self._server, self._widget = running, server, widget

    def __repr__(self) -> str:
        return f"<Viewer of {self.scene!r}, {'closed' if self._running.closed else 'open'}>"

    def __enter__(self) -> Viewer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _repr_mimebundle_(self, **how: Any) -> Any:
        """How Jupyter and VS Code show it."""
        return {"text/plain": repr(self)} if self._widget is None else self._widget._repr_mimebundle_(**how)

    def _display_(self) -> Any:
        """How marimo shows it."""
        return repr(self) if self._widget is None else self._widget

    @property
    def widget(self) -> Any:
        """The widget that a notebook shows; None elsewhere."""
        return self._widget

    @property
    def url(self) -> str:
        """An address that opens the view in one browser; each time it is asked for it is another.

        Raises IspmError in a notebook, which shows it itself.
        """
        if self._server is None:
            raise IspmError("this view is shown in the notebook and has no address")
        return self._server.access.url()

    @property
    def scene(self) -> Scene:
        """The scene that is shown. Set it to show another; the edits of the one before are forgotten."""
        return self._running.session.scene

    @scene.setter
    def scene(self, scene: Scene) -> None:
        self._running.ask(lambda session: session.open(scene, "")).result()

    @property
    def camera(self) -> Camera:
        """What is looked through now, with its pose."""
        return self._running.session.orbit.placed

    @property
    def frame(self) -> Frame | None:
        """The last picture's Frame; None before the first: nothing is drawn for nobody."""
        picture = self._running.session.picture
        return None if picture is None else picture.frame

    def editing(self) -> AbstractContextManager[Scene]:
        """Return a context within which the scene may be changed while no picture is drawn."""
        return self._running.editing()

    def wait(self) -> None:
        """Wait until Ctrl-C, or another thread, closes the viewer."""
        self._running.wait()

    def close(self) -> None:
        """Stop serving and drawing, and free the adapter. Closing twice does no harm."""
        self._running.close()


def view(
    scene: Scene | str | Path,
    settings: Settings | None = None,
    *,
    camera: Camera | str | int | None = None,
    block: bool = True,
    host: str = "127.0.0.1",
    port: int = 0,
    allow_remote: bool = False,
    fps: float = 15.0,
    on_frame: Callable[[Frame], None] | None = None,
    on_pick: Callable[[Picked], None] | None = None,
) -> Viewer:
    """Show a scene live, in a notebook or in a browser at an address that is printed; return the viewer.

    scene         a Scene, which may go on to be changed, a file, or the name of a built-in scene
    settings      None: those of the preset for live views
    camera        a Camera with a pose, or the name or index of one of the scene's
    block         whether to wait until Ctrl-C; else, and in a notebook, go on until `viewer.close()`
    host, port    where it listens; port 0: any that is free
    allow_remote  whether `host` may be one that other machines reach
    fps           pictures a second while something moves, for which they become smaller
    on_frame      called in the drawing thread with each Frame, whether or not anyone looks
    on_pick       called there with what a click in the picture shows
    Raises SceneError, SettingsError, AdapterError; IspmError without the packages of the extra `web`.
    """
    from ispm.io.named import open_named
    from ispm.viewer.drawing import PRESET
    from ispm.viewer.running import live
    from ispm.viewer.server import require_web

    widget = _widget() if in_notebook() or in_marimo() else None
    if widget is None:
        require_web()
    source = "" if isinstance(scene, Scene) else str(scene)
    world = scene if isinstance(scene, Scene) else open_named(scene)
    chosen = settings or Settings(preset=PRESET)
    running = live(world, chosen, camera, source=source, fps=fps)
    running.on_pick = on_pick
    if on_frame is not None:
        running.listen(on_frame, lambda picture, _: on_frame(picture.frame), lambda _: None)
    if widget is not None:
        return Viewer(running, None, widget(running))
    try:
        viewer = Viewer(running, Server(running, host, port, allow_remote=allow_remote))
    except IspmError:
        running.close()
        raise
    print(viewer.url, flush=True)
    if block:
        viewer.wait()
    return viewer


def _widget() -> Callable[[Running], Any] | None:
    """What makes a notebook's widget; None, with a warning, without the package of the extra."""
    try:
        import anywidget
    except ImportError:
        warn_caller(
            "a notebook's cell needs one more package; in the checkout run: pip install '.[notebook]'"
        )
        return None
    del anywidget
    from ispm.viewer.widget import Widget

    return Widget
