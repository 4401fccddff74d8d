"""The live view in a window of the system: glfw and Dear ImGui, on a device of its own."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import glfw
import imgui_bundle
import numpy as np
import wgpu
from imgui_bundle import imgui
from rendercanvas.glfw import RenderCanvas, loop
from wgpu.utils.imgui import ImguiRenderer

from ispm.errors import IspmError
from ispm.viewer import controls
from ispm.viewer import messages as m
from ispm.viewer.controls import Drag
from ispm.viewer.describe import describe, header
from ispm.viewer.files import saved, screenshot
from ispm.viewer.gizmo import Glass, Place
from ispm.viewer.inspector import Inspector
from ispm.viewer.messages import Message
from ispm.viewer.packets import Rate
from ispm.viewer.panels import FOOT, HEAD, LEFT, RIGHT, Panels
from ispm.viewer.running import Running
from ispm.viewer.session import Picture, Session
from ispm.viewer.theme import ACCENT, BRIGHT, SHADE, Rgb, color, style

_SIZE = 1280, 800
_AXES = ((0.93, 0.48, 0.43), (0.56, 0.81, 0.5), (0.44, 0.66, 0.94))
_LINGER = 4  # frames drawn after the last event, in which Dear ImGui settles
_HOLDING = 0.1  # s between messages of a mouse that moves
_STILL = 0.15  # s that a size stands before pictures of it are asked for
_FONT = Path(imgui_bundle.__file__).parent / "assets" / "fonts" / "Roboto" / "Roboto-Regular.ttf"
_EVENTS = ("pointer_move", "pointer_down", "pointer_up", "wheel", "key_down", "key_up", "char", "resize")


class Window:
    """Shows a session that runs in a window, from the thread that the program began with.

    size  of the window, in units of the screen
    Raises IspmError where none can be opened.
    """

    def __init__(self, running: Running, size: tuple[int, int] = _SIZE) -> None:
        self._running, self._rate = running, Rate()
        try:
            self.canvas = RenderCanvas(size=size, title="ispm", update_mode="ondemand", max_fps=60)
            adapter = wgpu.gpu.request_adapter_sync(canvas=self.canvas)
            self._device = adapter.request_device_sync()
            self._imgui = ImguiRenderer(self._device, self.canvas, "bgra8unorm")
        except Exception as error:  # whatever the system lacks for it
            raise IspmError(f"no window can be opened: {error}") from None
        style(_FONT)
        self.inspector = Inspector(self._post)
        self.panels = Panels(self._post, self._file, self._copy, self.inspector)
        self._latest: tuple[Picture, dict[str, Any]] | None = None  # set by the drawing thread
        self._about: dict[str, Any] | None = None
        self._texture: tuple[wgpu.GPUTexture, Any] | None = None
        self._drag: Drag | None = None
        self._asked, self._wanted, self._since = (0, 0), (0, 0), 0.0
        self._left, self._cursor = _LINGER, "default"
        self._imgui.set_gui(self._draw)
        self._typed: list[str] = []
        self._held = 0.0  # when the last Hold was sent
        self.canvas.add_event_handler(self._event, *_EVENTS, order=-100)
        self.canvas.request_draw(self._paint)
        running.listen(self, self._show, self._tell)
        running.ask(self._tell)

    def run(self, asked: Callable[[], bool] = lambda: False) -> None:
        """Draw until the window is closed, the session ends, or `asked` says so."""

        async def watch() -> None:
            from rendercanvas.utils.asyncs import sleep

            while not (asked() or self._running.closed or self.canvas.get_closed()):
                await sleep(0.1)
            self.canvas.close()

        loop.add_task(watch, name="watch")
        try:
            loop.run()
        finally:
            self._running.leave(self)
            self.canvas.close()

    # -- from the drawing thread -----------------------------------------------------------------------------

    def _show(self, picture: Picture, session: Session) -> None:
        self._latest = picture, header(session, picture, self._rate.now())
        self._tell(session)

    def _tell(self, session: Session) -> None:
        self.panels.state = state = describe(session)
        self.inspector.found = state["inspected"]
        self._wake()

    def _wake(self) -> None:
        self._left = _LINGER
        self.canvas.request_draw()

    def _event(self, event: dict[str, Any]) -> None:
        """Draw after events, and keep the keys that the renderer of Dear ImGui does not know."""
        if event["event_type"] == "key_down" and event["key"] in _SIGNS:
            self._typed.append(event["key"])
        self._wake()

    # -- what the panels ask for -----------------------------------------------------------------------------

    def _post(self, message: Message) -> None:
        self._running.post(message, self)

    def _file(self, what: str) -> None:
        """Save the scene or the picture beside where the program runs, under a name that is free."""
        kind, make = {"scene": (".glb", saved), "picture": (".png", screenshot)}[what]
        name = Path(self.panels.name).stem or what
        number, path = 1, Path(name + kind)
        while path.exists():
            number, path = number + 1, Path(f"{name}-{number}{kind}")

        def job(session: Session) -> None:
            try:
                path.write_bytes(make(session))
                self.panels.line = f"saved {path}"
            except (IspmError, OSError) as error:
                self.panels.line = str(error)
            self._wake()

        self._running.ask(job)

    def _copy(self, text: str) -> None:
        glfw.set_clipboard_string(None, text)  # type: ignore[arg-type]  # which window does not matter
        self.panels.line = f"copied: {text}"

    # -- drawing ---------------------------------------------------------------------------------------------

    def _paint(self) -> None:
        self._imgui.render()
        self._left -= 1
        if self._left > 0 or self._drag is not None or self.panels.flying:
            self.canvas.request_draw()

    def _draw(self) -> None:
        self._take()
        width, height = self.canvas.get_logical_size()
        panels = self.panels
        panels.draw(width, height)
        x, y = (LEFT if panels.left else 0.0), HEAD
        foot = FOOT * (2 if panels.has_time else 1)
        stage = x, y, max(width - x - (RIGHT if panels.right else 0.0), 1.0), max(height - y - foot, 1.0)
        self._ask(stage)
        self._stage(stage)

    def _take(self) -> None:
        """Put the latest picture into the texture."""
        latest, self._latest = self._latest, None
        if latest is None:
            return
        picture, self._about = latest
        self.panels.costs(self._about)
        rows, columns = picture.image.shape[:2]
        texture = None if self._texture is None else self._texture[0]
        if texture is None or texture.size[:2] != (columns, rows):
            if self._texture is not None:
                self._imgui.backend.unregister_texture(self._texture[1])
            usage = wgpu.TextureUsage.COPY_DST | wgpu.TextureUsage.TEXTURE_BINDING
            texture = self._device.create_texture(size=(columns, rows, 1), format="rgba8unorm", usage=usage)
            self._texture = texture, self._imgui.backend.register_texture(texture.create_view())
        pixels = np.full((rows, columns, 4), 255, np.uint8)
        pixels[..., :3] = picture.image
        layout = {"offset": 0, "bytes_per_row": 4 * columns}
        self._device.queue.write_texture({"texture": texture}, pixels, layout, (columns, rows, 1))

    def _ask(self, stage: tuple[float, float, float, float]) -> None:
        """Ask for pictures of the stage's size once it stands."""
        ratio, now = self.canvas.get_pixel_ratio(), time.monotonic()
        size = round(stage[2] * ratio), round(stage[3] * ratio)
        if size != self._wanted:
            self._wanted, self._since = size, now
        if size != self._asked:
            if now - self._since >= _STILL or self._asked == (0, 0):
                self._asked = size
                self._post(m.Resize(*size))
            self._left = _LINGER

    def _stage(self, stage: tuple[float, float, float, float]) -> None:
        x, y, width, height = stage
        imgui.set_next_window_pos((x, y))
        imgui.set_next_window_size((width, height))
        flags = imgui.WindowFlags_
        imgui.push_style_var(imgui.StyleVar_.window_padding, (0.0, 0.0))
        imgui.begin(
            "stage", None, flags.no_decoration | flags.no_background | flags.no_bring_to_front_on_focus
        )
        imgui.pop_style_var()
        under: Place | None = None
        if self._about is None or self._texture is None:
            imgui.set_cursor_pos((width / 2 - 80, height / 2))
            imgui.text_disabled("waiting for the first picture")
        else:
            columns, rows = self._about["size"]
            scale = min(width / columns, height / rows)
            seen = columns * scale, rows * scale
            left, top = round(x + (width - seen[0]) / 2), round(y + (height - seen[1]) / 2)
            clip = np.reshape(self._about["clip"], (4, 4))
            glass = Glass(clip, float(left), float(top), *seen)
            imgui.set_cursor_screen_pos((left, top))
            imgui.image(self._texture[1], seen)
            over = imgui.is_window_hovered()
            self._mouse(glass, over)
            self._overlay(glass)
            if over:
                mouse = imgui.get_io().mouse_pos
                under = controls.inside(glass, (mouse.x, mouse.y))
        imgui.end()
        self._point("crosshair" if under is not None and self.inspector.on else "default")
        self._keys(under)

    def _point(self, cursor: str) -> None:
        if cursor != self._cursor:
            self._cursor = cursor
            self.canvas.set_cursor(cursor)

    def _mouse(self, glass: Glass, over: bool) -> None:
        io = imgui.get_io()
        at = io.mouse_pos.x, io.mouse_pos.y
        assert self._about is not None
        if self._drag is None and over:
            self._hold(io.mouse_delta.x != 0.0 or io.mouse_delta.y != 0.0)
            if io.mouse_wheel:
                self._post(controls.zoomed(io.mouse_wheel))
            if imgui.is_mouse_double_clicked(0):
                if (place := controls.inside(glass, at)) is not None:
                    self._post(m.Focus(*place))
                return
            for button in range(3):
                if imgui.is_mouse_clicked(button):
                    imgui.set_window_focus()
                    self._drag = controls.begun(at, button, io.key_shift, self._about, glass)
                    self._button = button
        elif self._drag is not None:
            message = controls.dragged(self._drag, at, glass.height)
            if message is not None:
                self._post(message)
            if not imgui.is_mouse_down(self._button):
                message = controls.released(self._drag, glass, self.inspector.on)
                if message is not None:
                    self._post(message)
                self._drag = None

    def _hold(self, moved: bool) -> None:
        """Hold better pictures back where the mouse moves: a drag may begin."""
        now = time.monotonic()
        if moved and now - self._held > _HOLDING:
            self._held = now
            self._post(m.Hold())

    def _keys(self, under: Place | None) -> None:
        """Do what keys ask for. under: the place in the picture under the mouse."""
        io, panels = imgui.get_io(), self.panels
        typed, self._typed, panels.flying = self._typed, [], False
        if io.want_text_input or not panels.state:
            return
        held = [step for name, step in controls.FLY.items() if imgui.is_key_down(_KEYS[name])]
        turning = self._drag is not None and self._drag.how == "turn"
        if turning:
            held += [step for name, step in controls.FLY_HELD.items() if imgui.is_key_down(_KEYS[name])]
        if held and not io.key_ctrl:
            panels.flying = True
            message = controls.flown(held, io.delta_time)
            if message is not None:
                self._post(message)
        if not turning:
            typed += [name for name, number in _KEYS.items() if imgui.is_key_pressed(number, False)]
        for name in typed:
            if io.key_ctrl or not (panels.key(name) or self.inspector.key(name, under)):
                message = controls.key(name, io.key_ctrl, io.key_shift, panels.state)
                if message is not None:
                    self._post(message)

    def _overlay(self, glass: Glass) -> None:
        """Draw marks of lights, and handles of what is selected."""
        about, drag, lines = self._about, self._drag, imgui.get_window_draw_list()
        assert about is not None
        handle = about["handle"]
        moved = drag.place if drag is not None and drag.how == "handle" else None
        for number, *place, kind in about["lights"]:
            chosen = handle is not None and handle["node"] == number
            at = glass.project(moved if chosen and moved is not None else np.array(place))
            if at is not None:
                _mark(lines, at, kind, BRIGHT if chosen else ACCENT)
        self.inspector.draw(glass, lines)
        if handle is None:
            return
        point = np.array(handle["place"]) if moved is None else moved
        base = glass.project(point)
        if base is None:
            return
        mouse = imgui.get_io().mouse_pos
        over = (
            drag.part if drag is not None and moved is not None else glass.part_at(point, (mouse.x, mouse.y))
        )
        for k, tip in enumerate(glass.tips(point)):
            if tip is not None:
                tint = color(BRIGHT if over == k else _AXES[k])
                lines.add_line(base, tip, color(SHADE, 0.6), 5.0)
                lines.add_line(base, tip, tint, 2.5)
                lines.add_circle_filled(tip, 5.0, tint)
        low, high = (base[0] - 4, base[1] - 4), (base[0] + 4, base[1] + 4)
        lines.add_rect_filled(low, high, color(BRIGHT if over == "free" else (0.85, 0.86, 0.87)))


def _mark(lines: Any, at: tuple[float, float], kind: str, rgb: Rgb) -> None:
    """Draw a light: a circle with rays, of which those of a point light go all ways."""
    for shade, width in ((color(SHADE, 0.6), 4.0), (color(rgb), 1.6)):
        lines.add_circle(at, 4.0, shade, 0, width)
        for angle in np.arange(8) * np.pi / 4:
            if kind == "point" or round(angle * 4 / np.pi) % 2:
                x, y = float(np.cos(angle)), float(np.sin(angle))
                near, far = (at[0] + 6.5 * x, at[1] + 6.5 * y), (at[0] + 9 * x, at[1] + 9 * y)
                lines.add_line(near, far, shade, width)


_KEYS = {chr(97 + k): getattr(imgui.Key, chr(97 + k)) for k in range(26)}
_KEYS |= {str(k): getattr(imgui.Key, f"_{k}") for k in range(10)}
_KEYS |= {"right": imgui.Key.right_arrow, "left": imgui.Key.left_arrow, "up": imgui.Key.up_arrow}
_KEYS |= {"down": imgui.Key.down_arrow, "pageup": imgui.Key.page_up, "pagedown": imgui.Key.page_down}
_KEYS |= {"delete": imgui.Key.delete, "escape": imgui.Key.escape}
_SIGNS = " ?[]"
