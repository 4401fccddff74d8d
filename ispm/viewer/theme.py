"""The colors of the window: those of the page's style, for Dear ImGui."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import imgui

Rgb = tuple[float, float, float]

ACCENT, BRIGHT, SHADE = (0.914, 0.722, 0.447), (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
DIM, TEXT, QUIET = (0.302, 0.259, 0.188), (0.847, 0.855, 0.871), (0.6, 0.62, 0.65)
_PANEL, _RAISED, _LINE = (0.106, 0.114, 0.129), (0.145, 0.157, 0.176), (0.18, 0.196, 0.216)
_SIZE = 15.0  # units of the font


def color(rgb: Rgb, alpha: float = 1.0) -> int:
    """Return a color as draw lists take it."""
    return int(imgui.color_convert_float4_to_u32((*rgb, alpha)))


def style(font: Path) -> None:
    """Give Dear ImGui the page's colors and a font that reads well."""
    look, colors = imgui.get_style(), imgui.Col_
    imgui.style_colors_dark()
    look.window_border_size = 0.0
    look.window_rounding = look.child_rounding = 0.0
    look.frame_rounding = look.grab_rounding = look.popup_rounding = 5.0
    look.frame_padding, look.item_spacing = imgui.ImVec2(8.0, 4.0), imgui.ImVec2(6.0, 5.0)
    look.window_padding = imgui.ImVec2(10.0, 8.0)
    for name, rgb in {
        "window_bg": _PANEL,
        "popup_bg": _PANEL,
        "title_bg": _PANEL,
        "title_bg_active": _PANEL,
        "frame_bg": _RAISED,
        "frame_bg_hovered": _LINE,
        "frame_bg_active": DIM,
        "button": _RAISED,
        "button_hovered": _LINE,
        "button_active": DIM,
        "header": DIM,
        "header_hovered": _LINE,
        "header_active": DIM,
        "check_mark": ACCENT,
        "slider_grab": ACCENT,
        "slider_grab_active": ACCENT,
        "separator": _LINE,
        "text": TEXT,
        "text_disabled": QUIET,
    }.items():
        look.set_color_(getattr(colors, name), (*rgb, 1.0))
    imgui.get_io().fonts.add_font_from_file_ttf(str(font), _SIZE)
