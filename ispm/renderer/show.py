"""Pictures shown to the user: in a notebook, or in the system's window for them."""

from __future__ import annotations

import os
import sys
from importlib import import_module

import numpy as np

from ispm.errors import warn_caller
from ispm.io.png import encode_png


def show_picture(picture: np.ndarray, title: str) -> None:
    """Show (h, w, 3 or 4) uint8 sRGB; warn in one line where there is nothing to show it on."""
    if in_notebook():
        page = import_module("IPython.display")
        page.display(page.Image(encode_png(picture)))
    elif not (has_display() and _opened(picture, title)):
        warn_caller("there is no display to show the picture on; use save, or view for an array")


def in_notebook() -> bool:
    """Whether a kernel of IPython runs this, and so a page that shows pictures."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return getattr(shell, "kernel", None) is not None


def in_marimo() -> bool:
    """Whether a notebook of marimo runs this."""
    return bool(getattr(sys.modules.get("marimo"), "running_in_notebook", lambda: False)())


def has_display() -> bool:
    """Whether there is a screen: on Linux, whether a server for windows is named."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _opened(picture: np.ndarray, title: str) -> bool:
    """Write a temporary file and have the system's viewer open it; False where there is none."""
    from PIL import Image, ImageShow

    return bool(ImageShow.show(Image.fromarray(picture), title))
