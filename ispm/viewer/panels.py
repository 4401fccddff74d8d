"""The panels of the window, drawn by Dear ImGui from what `describe` says."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from imgui_bundle import imgui

from ispm.viewer import messages as m
from ispm.viewer.controls import HELP, gestures
from ispm.viewer.fields import Field
from ispm.viewer.inspector import Inspector
from ispm.viewer.messages import Message
from ispm.viewer.theme import ACCENT

LEFT, RIGHT, HEAD, FOOT = 232.0, 316.0, 42.0, 32.0  # units of the screen
_MOST_COSTS = 120  # pictures in the plot
_PLOT = 64.0
_FIRST = ("preset", "exposure", "tonemap", "photons", "bounces")
_SPEEDS = (-1.0, 0.25, 0.5, 1.0, 2.0)
_LIGHTS = {
    "point": "Point",
    "spot": "Spot",
    "directional": "Sun",
    "rect": "Panel",
    "disk": "Disk",
    "sphere": "Ball",
}
_MARKS = {"light": "*", "camera": "o", "object": "-", "group": ">"}
_STAGES = (0xFFF0A86F, 0xFF7FCE8F, 0xFFE8A6C3, 0xFF72B8E9, 0xFF6D7AEE, 0xFFC8CF6F, 0xFF99908B)  # ABGR
_HEAD = 674.0  # of what stands at its right

Say = Callable[[Message], None]


class Panels:
    """What stands around the picture.

    post  sends a message; file: saves "scene" or "picture"; copy: puts a text on the clipboard
    inspector  whose button and list are among them
    state  as of `describe`; set by the thread that draws pictures
    """

    def __init__(
        self, post: Say, file: Callable[[str], None], copy: Callable[[str], None], inspector: Inspector
    ) -> None:
        self._post, self._file, self._copy, self._inspector = post, file, copy, inspector
        self.state: dict[str, dict[str, Any]] = {}
        self.left = self.right = True
        self.help = self.flying = False
        self.line = ""
        self._about: dict[str, Any] | None = None
        self._history: deque[dict[str, float]] = deque(maxlen=_MOST_COSTS)
        self._gesture = 0
        self._filter = ""

    @property
    def name(self) -> str:
        """The scene's name."""
        scene = self.state.get("scene", {})
        return str(scene.get("name") or scene.get("source") or "scene")

    @property
    def has_time(self) -> bool:
        """Whether there is a time line."""
        return bool(self.state and self.state["time"]["animations"])

    def costs(self, about: dict[str, Any]) -> None:
        """Take the header of another picture."""
        self._about = about
        if not about["still"]:
            self._history.append(about["stats"]["stages"])

    def key(self, name: str) -> bool:
        """Do what a key asks of the panels; whether it did."""
        if name == "?":
            self.help = not self.help
        elif name == "escape" and self.help:
            self.help = False
        elif name == "s":
            self._file("picture")
        elif name == "c":
            self._copy(self.state["about"]["command"])
        elif name == "[":
            self.left = not self.left
        elif name == "]":
            self.right = not self.right
        else:
            return False
        return True

    def draw(self, width: float, height: float) -> None:
        """Draw all of them in a window of that size."""
        if not self.state:
            return
        foot = FOOT * (2 if self.has_time else 1)
        self._box("head", (0, 0, width, HEAD), self._head)
        if self.left:
            self._box("left", (0, HEAD, LEFT, height - HEAD - foot), self._left)
        if self.right:
            self._box("right", (width - RIGHT, HEAD, RIGHT, height - HEAD - foot), self._right)
        self._box("foot", (0, height - foot, width, foot), self._foot)
        if self.help:
            self._help(width, height)

    def _box(self, name: str, place: tuple[float, float, float, float], inside: Callable[[], None]) -> None:
        x, y, width, height = place
        imgui.set_next_window_pos((x, y))
        imgui.set_next_window_size((width, height))
        flags = imgui.WindowFlags_
        kept = flags.no_title_bar | flags.no_resize | flags.no_move | flags.no_collapse
        bar = flags.no_scrollbar if name in ("head", "foot") else 0
        imgui.begin(name, None, kept | flags.no_saved_settings | bar)
        inside()
        imgui.end()

    # -- head and foot ---------------------------------------------------------------------------------------

    def _head(self) -> None:
        state, post = self.state, self._post
        if imgui.button("Scene"):
            self.left = not self.left
        imgui.same_line()
        imgui.align_text_to_frame_padding()
        imgui.text(self.name)
        imgui.same_line()
        at = max(imgui.get_window_width() - _HEAD, 226.0)
        count = f"{state['scene']['triangles']:,} triangles"
        if imgui.get_cursor_pos_x() + imgui.calc_text_size(count).x < at:
            imgui.text_disabled(count)
        imgui.same_line(at)
        views, now = state["settings"]["views"], state["about"]["view"]
        imgui.set_next_item_width(130)
        changed, index = imgui.combo("##view", views.index(now), views)
        if changed:
            post(m.Show(views[index]))
        for label, what, message in (
            ("Undo", "undo", m.Undo()),
            ("Redo", "redo", m.Redo()),
        ):
            imgui.same_line()
            imgui.begin_disabled(not state["history"][what])
            if imgui.button(label):
                post(message)
            imgui.end_disabled()
        imgui.same_line()
        self._inspector.button()
        for label, do in (
            ("Screenshot", lambda: self._file("picture")),
            ("Command", lambda: self._copy(state["about"]["command"])),
            ("Save scene", lambda: self._file("scene")),
            ("?", lambda: self.key("?")),
            ("Properties", lambda: self.key("]")),
        ):
            imgui.same_line()
            if imgui.button(label):
                do()

    def _foot(self) -> None:
        if self.has_time:
            self._time()
        line = self.state["about"]["line"]
        imgui.align_text_to_frame_padding()
        if line:
            imgui.text_colored((0.91, 0.5, 0.45, 1.0), line)
        else:
            imgui.text_disabled(self.line)
        if self._about is not None:
            (w, h), stats = self._about["size"], self._about["stats"]
            rate = "at rest" if self._about["still"] else f"{stats['fps']:.1f} fps"
            text = f"{w} × {h}    {rate}    {stats['ms']:.0f} ms"
            imgui.same_line(imgui.get_window_width() - imgui.calc_text_size(text).x - 12.0)
            imgui.text_disabled(text)

    def _time(self) -> None:
        time, post = self.state["time"], self._post
        if imgui.button("Pause" if time["playing"] else "Play"):
            post(m.Play(playing=not time["playing"]))
        imgui.same_line()
        imgui.set_next_item_width(imgui.get_window_width() - 330.0)
        now = 0.0 if self._about is None else float(self._about["time"])
        changed, value = imgui.slider_float("##time", now, 0.0, float(time["duration"]), "%.2f s")
        if changed:
            post(m.Play(time=max(value, 0.0), playing=False))
        imgui.same_line()
        imgui.set_next_item_width(80)
        speeds = [f"{speed:g} ×" for speed in _SPEEDS]
        at = _SPEEDS.index(time["speed"]) if time["speed"] in _SPEEDS else 3
        changed, index = imgui.combo("##speed", at, speeds)
        if changed:
            post(m.Play(speed=_SPEEDS[index]))
        names = ["", *(name for name, _ in time["animations"])]
        imgui.same_line()
        imgui.set_next_item_width(120)
        at = names.index(time["animation"]) if time["animation"] in names else 0
        changed, index = imgui.combo("##animation", at, ["all", *names[1:]])
        if changed:
            post(m.Play(animation=names[index]))

    # -- the scene -------------------------------------------------------------------------------------------

    def _left(self) -> None:
        scene, post = self.state["scene"], self._post
        imgui.separator_text("Scene")
        imgui.set_next_item_width(-1)
        _, self._filter = imgui.input_text_with_hint("##find", "find", self._filter)
        imgui.begin_child("tree", (0, max(imgui.get_content_region_avail().y - 190.0, 80.0)))
        wanted, chosen = self._filter.lower(), self.state["selection"]["node"]
        for node, name, kind, depth, away in scene["rows"]:
            if wanted and wanted not in name.lower():
                continue
            imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + 12.0 * min(depth, 8))
            label = f"{_MARKS[kind]} {name or kind}{'  (hidden)' if away else ''}##{node}"
            pressed, _ = imgui.selectable(label, node == chosen, imgui.SelectableFlags_.allow_double_click)
            if pressed:
                twice = imgui.is_mouse_double_clicked(0)
                post(m.FrameAll(node) if twice else m.Select(node))
        if scene["more"] > 0:
            imgui.text_disabled(f"and {scene['more']:,} more")
        imgui.end_child()
        imgui.separator_text("Add a light")
        for index, (kind, label) in enumerate(_LIGHTS.items()):
            if index % 3:
                imgui.same_line()
            if imgui.button(label, (64, 0)):
                post(m.Add(kind))  # type: ignore[arg-type]
        imgui.separator_text("Camera")
        if imgui.button("Home"):
            post(m.UseCamera())
        imgui.same_line()
        if imgui.button("Frame all"):
            post(m.FrameAll())
        for index, name in enumerate(scene["cameras"]):
            if index % 2:
                imgui.same_line()
            if imgui.button(f"{name}##camera{index}"):
                post(m.UseCamera(index))
        axes = self.state["settings"]["axes"]
        imgui.set_next_item_width(64)
        changed, index = imgui.combo("up axis", axes.index(self.state["about"]["up"]), axes)
        if changed:
            post(m.Up(axes[index]))

    # -- properties ------------------------------------------------------------------------------------------

    def _right(self) -> None:
        imgui.begin_child("properties", (0, max(imgui.get_content_region_avail().y - 236.0, 80.0)))
        self._inspector.panel()
        selection = self.state["selection"]
        node = selection["node"]
        imgui.separator_text("Nothing selected" if node is None else selection["kind"].capitalize())
        if node is None:
            imgui.text_disabled("Click something in the picture.")
        for group in selection["groups"]:
            what, part = group["what"], group["part"]
            if what != "node":
                imgui.separator_text(group["title"])
            for field in group["fields"]:
                given = self._field(field, f"{node}{what}{part}")
                if given is not None:
                    self._post(m.Change(what, node, field["name"], given[0], part, given[1]))
        if node is not None:
            for label, message in (
                ("Focus", m.FrameAll(node)),
                ("Duplicate", m.Duplicate(node)),
                ("Delete", m.Delete(node)),
            ):
                if imgui.button(label):
                    self._post(message)
                imgui.same_line()
            imgui.new_line()
        if imgui.collapsing_header("Settings", imgui.TreeNodeFlags_.default_open):
            fields = self.state["settings"]["fields"]
            order = lambda f: _FIRST.index(f["name"]) if f["name"] in _FIRST else len(_FIRST)  # noqa: E731
            for field in sorted(fields, key=order):
                given = self._field(field, "setting")
                if given is not None:
                    self._post(m.Setting(field["name"], *given))
        imgui.end_child()
        self._costs()

    def _field(self, field: Field, where: str) -> tuple[Any, int] | None:
        """Draw a field; return its next value, and which drag it belongs to; None: it stays."""
        imgui.align_text_to_frame_padding()
        imgui.text_disabled(field["label"])
        if imgui.is_item_hovered() and field.get("help"):
            imgui.set_tooltip(field["help"])
        imgui.same_line(112.0)
        imgui.set_next_item_width(-1)
        changed, value = _control(field, f"##{where}{field['name']}")
        if imgui.is_item_activated():
            self._gesture = next(gestures)
        return (value, self._gesture if imgui.is_item_active() else 0) if changed else None

    def _costs(self) -> None:
        """Draw what pictures cost: milliseconds of the stages, stacked."""
        imgui.separator_text("Cost")
        lines, at = imgui.get_window_draw_list(), imgui.get_cursor_screen_pos()
        width = imgui.get_content_region_avail().x
        lines.add_rect_filled((at.x, at.y), (at.x + width, at.y + _PLOT), 0xFF171413, 4.0)
        imgui.dummy((width, _PLOT))
        if self._about is None:
            return
        sums = sorted(sum(stages.values()) for stages in self._history) or [1.0]
        top = 1.25 * max(sums[int(0.95 * (len(sums) - 1))], 1.0)
        step = width / _MOST_COSTS
        for k, stages in enumerate(self._history):
            x, y = at.x + width - step * (len(self._history) - k), at.y + _PLOT
            for color, ms in zip(_STAGES, stages.values(), strict=False):
                high = max(y - ms / top * _PLOT, at.y)
                lines.add_rect_filled((x, high), (x + step, y), color)
                y = high
        lines.add_text((at.x + 5, at.y + 3), 0xFF99908B, f"{top:.0f} ms")
        stats = self._about["stats"]
        for k, (color, name) in enumerate(zip(_STAGES, stats["stages"], strict=False)):
            if k % 4:
                imgui.same_line()
            imgui.text_colored(imgui.color_convert_u32_to_float4(color), name.replace("_", " "))
        error = "-" if stats["error"] is None else f"{100.0 * stats['error']:.1f} %"
        for name, value in (
            ("photons stored", f"{stats['photons']:,} of {stats['emitted']:,}"),
            ("passes, error", f"{stats['passes']}, {error}"),
            ("exposure", f"{stats['exposure']:.2f} EV"),
            ("adapter", stats["adapter"]),
        ):
            imgui.text_disabled(name)
            imgui.same_line(112.0)
            imgui.text(value)

    def _help(self, width: float, height: float) -> None:
        imgui.set_next_window_pos((width / 2, height / 2), 0, (0.5, 0.5))
        imgui.set_next_window_focus()
        flags = imgui.WindowFlags_
        kept = flags.no_collapse | flags.always_auto_resize | flags.no_saved_settings
        self.help = bool(imgui.begin("Keys", True, kept)[1])
        for name, does in HELP:
            imgui.text_colored((*ACCENT, 1.0), name)
            imgui.same_line(210.0)
            imgui.text(does)
        imgui.end()


def _control(field: Field, label: str) -> tuple[bool, Any]:
    """Draw the control of a field; return whether it changed, and its value."""
    kind, value = field["kind"], field["value"]
    if kind == "choice":
        choices = field["choices"]
        changed, index = imgui.combo(label, choices.index(value) if value in choices else 0, choices)
        return changed, choices[index]
    if kind == "switch":
        return imgui.checkbox(label, bool(value))
    if kind == "color":
        flags = imgui.ColorEditFlags_
        changed, color = imgui.color_edit3(label, list(value), flags.float | flags.hdr | flags.no_inputs)
        return changed, [min(max(float(v), 0.0), 1.0) for v in color][:3]
    if kind == "vector" and isinstance(value, list) and len(value) in (2, 3, 4):
        speed = 0.01 * max(1.0, *map(abs, value))
        drag = {2: imgui.drag_float2, 3: imgui.drag_float3, 4: imgui.drag_float4}[len(value)]
        changed, numbers = drag(label, [float(v) for v in value], speed, 0.0, 0.0, "%.4g")
        return changed, [float(v) for v in numbers]
    if isinstance(value, (int, float)):
        return _number(field, label, value)
    changed, text = imgui.input_text(
        label, "" if value is None else str(value), imgui.InputTextFlags_.enter_returns_true
    )
    return changed, text


def _number(field: Field, label: str, value: float) -> tuple[bool, Any]:
    """A number that is dragged to the sides, or typed after a double click, within what it may be."""
    least, most = field.get("least"), field.get("most")
    low, high = (-1e9 if least is None else float(least)), (1e9 if most is None else float(most))
    flags = imgui.SliderFlags_.always_clamp
    if field.get("whole"):
        low, high = max(low, -(2.0**31)), min(high, 2.0**31 - 1)
        speed = max(0.1, 0.005 * abs(value))
        return imgui.drag_int(label, int(value), speed, int(low), int(high), "%d", flags)
    speed = max(0.005 * abs(value), 0.002)
    unit = f" {field['unit']}".replace("%", "%%") if field.get("unit") else ""
    return imgui.drag_float(label, float(value), speed, low, high, f"%.4g{unit}", flags)
