"""Whether a window can be opened here, asked before anything is loaded for it."""

from __future__ import annotations

from importlib.util import find_spec

from ispm.renderer.show import has_display

_NEEDED = "glfw", "imgui_bundle", "rendercanvas"


def why_no_window() -> str:
    """Return why no window can be opened here, in one line; empty: nothing speaks against it."""
    if not has_display():
        return "no window can be opened: there is no display"
    if any(find_spec(name) is None for name in _NEEDED):
        return "no window can be opened: two packages are missing; in the checkout run: pip install '.[view]'"
    import glfw

    if not glfw.init():
        return "no window can be opened: glfw finds no display"
    return ""
