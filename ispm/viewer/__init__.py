"""The live view: one application, whose faces are canvases.

In come a scene, and messages from whoever looks at it; out go pictures, what the panels show, and the scene
as it was edited. `Session` is the state and needs no network; `Viewer` runs it in a thread of its own;
`Server` shows it in browsers, `Window` in a window, `Widget` in notebooks, `Terminal` in a terminal. The page
and the notebook's cell share page/, the window has `controls`, `gizmo` and `panels` of its own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ispm.viewer.viewer import Viewer
    from ispm.viewer.viewer import view as view

__all__ = ["Viewer", "view"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'ispm.viewer' has no attribute '{name}'")
    from ispm.viewer import viewer

    return getattr(viewer, name)
