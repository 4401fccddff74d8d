"""Finished frames beside a film that is not whole yet, so that a killed one goes on.

A frame counts as finished once its note is there: a small picture of it, whose text tells what it was made of
and which bytes it has. Both are written whole or not at all, the frame first.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from ispm.errors import OutputError, SettingsError
from ispm.film.output import Output
from ispm.io.atomic import remove_unfinished, write_whole
from ispm.io.image import write_png
from ispm.renderer.made_of import MadeOf

SMALL = 160  # pixels across of the small pictures, at most
_NOTE = "ispm:frame"
_ABOUT, _SMALL_ENDING = "about.json", ".small.png"
_TOLD = 4  # differences


class Kept:
    """The frames of a film that are finished.

    output  what the film is written to: numbered pictures are where they belong, a video's in the folder
    about   the film and its settings, of the kinds that JSON has: what all frames share
    Raises SettingsError where the folder holds frames of another film, OutputError where it cannot be read or
    written.
    """

    def __init__(self, output: Output, about: Mapping[str, Any]) -> None:
        self._output, self.folder = output, output.beside
        here, file = json.loads(json.dumps(about)), self.folder / _ABOUT
        try:
            there = json.loads(file.read_text("utf-8"))
        except FileNotFoundError:
            write_whole(file, [json.dumps(here, indent=1).encode()])
            return
        except (OSError, ValueError):
            raise OutputError(f"{file}: cannot be read; remove its folder, or name another output") from None
        if there != here:
            names = [name for name in {**there, **here} if there.get(name) != here.get(name)]
            told = [f"{name} {_shown(there.get(name))} (here {_shown(here.get(name))})" for name in names]
            raise self._other(
                ", ".join(told[:_TOLD]) + f" and {len(told) - _TOLD} more" * (len(told) > _TOLD)
            )

    def path(self, frame: int) -> Path:
        """Return where the picture of a frame belongs."""
        if self._output.is_film:
            return self.folder / f"{frame:06d}.png"
        return self._output.picture(frame)

    def finished(self) -> list[int]:
        """Return the numbers of the frames that have notes."""
        names = (each.name.partition(".") for each in self.folder.glob(f"*{_SMALL_ENDING}"))
        return sorted(int(number) for number, _, _ in names if number.isdigit())

    def has(self, frame: int, made_of: MadeOf) -> bool:
        """Return whether a frame is finished and its picture as it was written.

        made_of  what it would be made of now
        Raises SettingsError where it was made of something else.
        """
        try:
            note = json.loads(Image.open(self._note(frame)).info[_NOTE])
            there, digest = MadeOf.from_json(note["made_of"]), note["sha256"]
            whole = _digest(self.path(frame)) == digest
        except (OSError, ValueError, KeyError):  # there is none, or somebody spoiled it
            return False
        if there != made_of:
            raise self._other(f"{', '.join(there.differences(made_of))} in frame {frame}")
        return bool(whole)

    def keep(self, frame: int, made_of: MadeOf, pixels: np.ndarray) -> None:
        """Note that the picture of a frame was written.

        pixels  (h, w, 3 or 4) uint8 sRGB, what it shows
        """
        picture = Image.fromarray(np.ascontiguousarray(pixels[..., :3]))
        width = min(SMALL, picture.width)
        size = width, max(round(width * picture.height / picture.width), 1)
        small = np.asarray(picture.resize(size, Image.Resampling.LANCZOS))
        note = {"made_of": made_of.to_json(), "sha256": _digest(self.path(frame))}
        write_png(self._note(frame), small, {_NOTE: json.dumps(note)})

    def small(self, frame: int) -> Image.Image:
        """Return the small picture of a finished frame."""
        with Image.open(self._note(frame)) as picture:
            return picture.convert("RGB")

    def remove(self, frames: range) -> bool:
        """Remove what is not needed any more; return whether that is all: other frames than these stay."""
        finished = self.finished()
        if set(finished) - set(frames):
            return False
        for frame in finished:
            self._note(frame).unlink()
            if self._output.is_film:
                self.path(frame).unlink(missing_ok=True)
        (self.folder / _ABOUT).unlink(missing_ok=True)
        pictures = [self.path(frame) for frame in frames]
        ours = [self.folder / _ABOUT, self._output.path, *pictures, *map(self._note, frames)]
        for folder in (self.folder, self._output.path.parent):
            remove_unfinished(folder, [path.name for path in ours if path.parent == folder])
        with suppress(OSError):  # what others put there stays
            self.folder.rmdir()
        return True

    def _note(self, frame: int) -> Path:
        return self.folder / f"{frame:06d}{_SMALL_ENDING}"

    def _other(self, told: str) -> SettingsError:
        count = len(self.finished())
        return SettingsError(
            f"{self.folder}: holds {count} frame{'s' * (count != 1)} of another film, with {told}; give the "
            "same, name another output, or remove that folder"
        )


def _digest(path: Path) -> str:
    return sha256(path.read_bytes()).hexdigest()


def _shown(value: Any) -> str:
    """A setting as users write it."""
    if isinstance(value, list):
        return ",".join(map(str, value))
    return f"{value:g}" if isinstance(value, float) else str(value)
