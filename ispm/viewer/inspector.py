"""The photon inspector of the window: the ways of the photons that light a place, drawn and listed.

The page has the same in page/inspector.js.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import groupby, pairwise
from typing import Any

import numpy as np
from imgui_bundle import imgui

from ispm.viewer import messages as m
from ispm.viewer.gizmo import Glass, Place
from ispm.viewer.messages import Message
from ispm.viewer.theme import BRIGHT, DIM, QUIET, SHADE, Rgb, color

_NOTHING: dict[str, Any] = {"point": None, "paths": []}
_COLORS: tuple[Rgb, ...] = (  # by bounce; the last for all more
    (0.4, 0.816, 0.902),
    (0.941, 0.69, 0.31),
    (0.561, 0.808, 0.498),
    (0.78, 0.608, 0.949),
    (0.941, 0.529, 0.624),
)
_WIDEST = 3.5  # units of the screen, of the way that brings most light; none is narrower than 1
_HIGHEST = 264.0  # of the list, which scrolls beyond
_MARGIN, _TOLD = 6.0, 276.0  # units of the screen: right of the list, and the width of what is told of a way
_DASH, _GAP = 2.0, 4.0
_ROWS = imgui.TableFlags_.scroll_y | imgui.TableFlags_.sizing_fixed_fit | imgui.TableFlags_.no_host_extend_x
_ROW = imgui.SelectableFlags_.span_all_columns


class Inspector:
    """What a place in the picture is lit by, once it is asked for.

    post   sends a message
    on     whether a click asks
    found  the "inspected" of `describe`; set by the thread that draws pictures
    """

    def __init__(self, post: Callable[[Message], object]) -> None:
        self._post = post
        self.on = False
        self.found = _NOTHING
        self._chosen = -1  # the row under the mouse

    def toggle(self, place: Place | None = None) -> None:
        """Begin, with a place in parts of the picture if there is one, or end."""
        self.on = not self.on
        if not self.on:
            self._post(m.Inspect())
            self.found = _NOTHING
        elif place is not None:
            self._post(m.Inspect(*place))

    def key(self, name: str, under: Place | None) -> bool:
        """Do what a key asks of it; whether it did. under: the place in the picture under the mouse."""
        if name != "i" and not (name == "escape" and self.on):
            return False
        self.toggle(under)
        return True

    def button(self) -> None:
        """Draw the button that begins and ends it."""
        if self.on:
            imgui.push_style_color(imgui.Col_.button, color(DIM))
        pressed = imgui.button("Inspect")
        if self.on:
            imgui.pop_style_color()
        imgui.set_item_tooltip("the photons that light a place (I)")
        if pressed:
            self.toggle()

    # -- the list --------------------------------------------------------------------------------------------

    def panel(self) -> None:
        """Draw what was found, while it is on or anything is."""
        found, self._chosen = self.found, -1
        if not self.on and found["point"] is None:
            return
        imgui.separator_text("Light at a place")
        if found["point"] is None:
            imgui.push_text_wrap_pos(0.0)
            imgui.text_disabled("Click a place in the picture: the photons that light it are drawn.")
            imgui.pop_text_wrap_pos()
            return
        photons, paths = found["photons"], found["paths"]
        imgui.text(f"{short(found['light'])} lx of indirect light")
        many = f", the {len(paths)} strongest" if len(paths) < photons else ""
        imgui.text_disabled(f"by {photons:,} photon{'' if photons == 1 else 's'}{many}")
        if paths:
            self._list(paths)

    def _list(self, paths: list[dict[str, Any]]) -> None:
        top, line = imgui.get_cursor_screen_pos(), imgui.get_text_line_height_with_spacing()
        if not imgui.begin_table("ways", 4, _ROWS, (-_MARGIN, min(line * (len(paths) + 1), _HIGHEST))):
            return
        imgui.table_setup_scroll_freeze(0, 1)
        columns = imgui.TableColumnFlags_
        for name, width in (("", 16.0), ("ways", 0.0), ("lm", 52.0), ("lx", 46.0)):
            imgui.table_setup_column(name, columns.width_fixed if width else columns.width_stretch, width)
        imgui.table_next_row()
        for name in ("", "ways", "lm", "lx"):
            imgui.table_next_column()
            _cell(name, QUIET, right=name in ("lm", "lx"))
        for k, path in enumerate(paths):
            imgui.table_next_row()
            imgui.table_next_column()
            imgui.selectable(f"##{k}", False, _ROW)
            if imgui.is_item_hovered():
                self._chosen = k
                _tell(path, (top.x, top.y))
            imgui.same_line(0.0, 0.0)
            _cell(str(path["bounce"]), _color_of(path))
            imgui.table_next_column()
            imgui.text(together(path["events"][1:-1]))
            for value in (path["flux"][-1], path["light"]):
                imgui.table_next_column()
                _cell(short(value), right=True)
        imgui.end_table()

    # -- over the picture ------------------------------------------------------------------------------------

    def draw(self, glass: Glass, lines: Any) -> None:
        """Draw the ways over the picture, the weakest first. lines: a draw list."""
        point, paths = self.found["point"], self.found["paths"]
        if point is None:
            return
        chosen = self._chosen if self._chosen < len(paths) else -1
        most = max([path["light"] for path in paths], default=0.0) or 1.0
        lines.push_clip_rect((glass.x, glass.y), (glass.x + glass.width, glass.y + glass.height), True)
        for k in reversed(range(len(paths))):
            if k != chosen:
                _way(lines, glass, paths[k], most, 0.7 if chosen < 0 else 0.13)
        place = glass.project(np.array(point))
        if chosen >= 0:
            _way(lines, glass, paths[chosen], most, 1.0, alone=True)
            _reach(lines, glass.project(np.array(paths[chosen]["places"][-1])), place)
        if place is not None:
            lines.add_circle(place, 6.0, color(SHADE, 0.8), 0, 4.0)
            lines.add_circle(place, 6.0, color(BRIGHT), 0, 1.8)
        lines.pop_clip_rect()


def short(value: float) -> str:
    """Return three digits of a number, two of a very small or large one."""
    if value >= 1e4 or 0.0 < value < 1e-3:
        digits, power = f"{value:.1e}".split("e")
        return f"{digits}e{int(power)}"
    return f"{float(f'{value:.3g}'):g}"


def together(words: list[str]) -> str:
    """Return the words of a way, equal ones in a row counted: "diffuse ×3"."""
    runs = [(word, len(list(run))) for word, run in groupby(words)]
    return " · ".join(f"{word} ×{n}" if n > 1 else word for word, n in runs)


def _color_of(path: dict[str, Any]) -> Rgb:
    return _COLORS[min(path["bounce"], len(_COLORS) - 1)]


def _cell(text: str, rgb: Rgb | None = None, *, right: bool = False) -> None:
    """Write into a cell of a table, at its right where figures are to stand below each other."""
    if right:
        gap = imgui.get_content_region_avail().x - imgui.calc_text_size(text).x
        imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(gap, 0.0))
    if rgb is None:
        imgui.text(text)
    else:
        imgui.text_colored((*rgb, 1.0), text)


def _tell(path: dict[str, Any], place: Place) -> None:
    """Show what happens on a way, and the flux there, above a place, where neither list nor picture are."""
    imgui.set_next_window_pos(place, 0, (0.0, 1.0))
    imgui.set_next_window_size_constraints((_TOLD, 0.0), (_TOLD, 1e4))
    imgui.push_style_var(imgui.StyleVar_.window_padding, (8.0, 3.0))
    imgui.begin_tooltip()
    imgui.push_text_wrap_pos(_TOLD - 8.0)
    imgui.text(" > ".join(path["events"]))
    imgui.text(f"lm: {' > '.join(map(short, path['flux']))}")
    imgui.pop_text_wrap_pos()
    imgui.end_tooltip()
    imgui.pop_style_var()


def _way(
    lines: Any, glass: Glass, path: dict[str, Any], most: float, alpha: float, alone: bool = False
) -> None:
    """Draw a way: lines as wide as what it brings, and dots where it meets surfaces."""
    width, tint = 1.0 + (_WIDEST - 1.0) * (path["light"] / most) ** 0.5, _color_of(path)
    places = [np.array(place) for place in path["places"]]
    seen = [ends for a, b in pairwise(places) if (ends := glass.segment(a, b)) is not None]
    strokes = [(color(SHADE, 0.73), 2.5), (color(tint), 0.8)] if alone else [(color(tint, alpha), 0.0)]
    for stroke, more in strokes:
        for start, end in seen:
            lines.add_line(start, end, stroke, width + more)
    for place in places[1:-1]:
        at = glass.project(place)
        if at is not None:
            radius = 3.2 if alone else 0.6 * width + 1.2
            lines.add_circle_filled(at, radius, color(BRIGHT if alone else tint, alpha))


def _reach(lines: Any, stored: Place | None, place: Place | None) -> None:
    """Draw dashes between where a photon is stored and the place that its kernel lights."""
    if stored is None or place is None:
        return
    start, far = np.array(place), np.subtract(stored, place)
    length = float(np.linalg.norm(far))
    for at in np.arange(0.0, min(length, 4000.0), _DASH + _GAP):  # no screen is wider
        ends = [start + far * (min(t, length) / length) for t in (at, at + _DASH)]
        lines.add_line(tuple(ends[0]), tuple(ends[1]), color(BRIGHT), 1.2)
