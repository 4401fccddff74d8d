"""The options that `render` and `animate` share: how a picture is written."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from ispm.cli.options import WHOLE
from ispm.errors import SettingsError
from ispm.settings import LAYERS, RENDERER_VIEWS, nearest

_ARRAYS = [(".npy", layer) for layer in LAYERS]


@dataclass(frozen=True)
class Kind:
    """What a picture's file holds."""

    layers: Annotated[
        str | None, Parameter(help="layers of an EXR or NPZ; default: all", metavar="A,B,...")
    ] = None
    float: Annotated[
        bool, Parameter(help="32 bits a channel in an EXR, not 16", negative="", show_default=False)
    ] = False
    bits: Annotated[int, WHOLE, Parameter(help="bits a channel in a PNG: 8 or 16", metavar="N")] = 8

    def checked(self, target: Path, show: str) -> dict[str, Any]:
        """Return the arguments of `Frame.save` for a file. Raises SettingsError where it does not hold that.

        show  the view that is asked for
        """
        layers = _layers(self.layers, target)
        _require_view(show, target)
        if self.float and target.suffix.lower() != ".exr":
            raise SettingsError(f"--float: is for .exr, not '{target.suffix}'")
        _require_bits(self.bits, show, target)
        return dict(layers=layers, show=show, float32=self.float, bits=self.bits)


def _layers(text: str | None, target: Path) -> list[str] | None:
    if text is None:
        return None
    if target.suffix.lower() not in (".exr", ".npz"):
        raise SettingsError(f"--layers: a {target.suffix} holds one picture; use .exr or .npz, or --show")
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if name not in LAYERS:
            raise SettingsError(
                f"--layers: '{name}' is not one of {', '.join(LAYERS)}{nearest(name, LAYERS)}"
            )
    return names


def _require_view(show: str, target: Path) -> None:
    ending = target.suffix.lower()
    if show != "full" and ending not in (".png", ".jpg", ".jpeg") and (ending, show) not in _ARRAYS:
        raise SettingsError(
            f"--show: is for .png and .jpg; choose what a {target.suffix} holds with --layers"
        )


def _require_bits(bits: int, show: str, target: Path) -> None:
    if bits not in (8, 16):
        raise SettingsError(f"--bits: {bits} is not possible; give 8 or 16")
    if bits == 16 and target.suffix.lower() != ".png":
        raise SettingsError(f"--bits: 16 is for .png, not '{target.suffix}'; an .exr has more")
    if bits == 16 and show in RENDERER_VIEWS:
        raise SettingsError(f"--bits: the view '{show}' has 8")
