"""What a film is, beside its pictures: the knobs of `ispm animate`."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal, get_args

from ispm.errors import SettingsError
from ispm.knobs import knob
from ispm.settings import Checked

Codec = Literal["auto", "h264", "av1", "vp9", "prores"]


@dataclass(frozen=True)
class Film(Checked):
    """How time goes by in a film, and how it is written.

    fps       pictures a second
    duration  s; 0: as long as what moves, the camera on its path or round the scene, else the animation
    shutter   share of the time to the next picture, 0 to 1, over which a picture's passes are spread: what
              moves is blurred; one pass alone does not
    codec     "h264", "av1", "vp9", "prores"; "auto": by the file's ending
    Raises SettingsError for a value out of range.
    """

    fps: float = knob(24.0, "pictures a second", within=(1e-3, 1e3), metavar="N")
    duration: float = knob(
        0.0,
        "how long the film lasts; 0: as long as what moves, the camera on its path or round the scene, else "
        "the animation",
        within=(0.0, 1e6),
        unit="seconds",
        metavar="SECONDS",
    )
    shutter: float = knob(
        0.0,
        "share of the time to the next picture that the shutter is open: the passes of a picture are spread "
        "over it and blur what moves; one pass alone does not",
        within=(0.0, 1.0),
        metavar="SHARE",
    )
    codec: Codec = knob(
        "auto",
        "of the video; auto: h264 in .mp4 and .mkv, vp9 in .webm, prores in .mov",
        choices=get_args(Codec),
    )


def frames_named(frames: str | int) -> slice | int:
    """Return what `frames` names: FIRST:END without END, as Python slices, or one number.

    Raises SettingsError where that is neither.
    """
    match = re.fullmatch(r"\s*(-?\d+)?\s*(:)?\s*(-?\d+)?\s*", str(frames))
    if not match or not (match[1] or match[2]) or (match[3] and not match[2]):
        raise SettingsError(f"frames: '{frames}' is not FIRST:END, as 10:20, which is 10 to 19")
    first, colon, end = match.groups()
    return slice(int(first) if first else None, int(end) if end else None) if colon else int(first)


def frame_range(frames: str | int, count: int) -> range:
    """Return which of `count` frames are named, as `frames_named` says.

    Raises SettingsError where it names none of them.
    """
    named = frames_named(frames)
    if isinstance(named, slice):
        found = range(count)[named]
    else:
        found = range(named % count, named % count + 1) if -count <= named < count else range(0)
    if not found:
        raise SettingsError(f"frames: {frames} is none of the film's {count}, which are 0 to {count - 1}")
    return found
