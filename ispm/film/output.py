"""Where a film goes: one file, or numbered pictures."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from ispm.errors import OutputError
from ispm.io.atomic import as_path
from ispm.io.image import ENDINGS as PICTURES
from ispm.io.image import require_ending

FILMS = (".mp4", ".mkv", ".webm", ".mov")
_PRINTF = re.compile(r"%0?(\d*)d")
_NUMBER = re.compile(_PRINTF.pattern + "|#+")  # as C's printf, and as other renderers


@dataclass(frozen=True)
class Output:
    """What a film is written to.

    path    as it was given; with `number`, the place of the number in it
    number  where in the file's name the number of a picture goes: first character, end, digits; None: a film
    """

    path: Path
    number: tuple[int, int, int] | None

    @classmethod
    def of(cls, path: object) -> Output:
        """Return what a path names: a film by its ending, else pictures numbered by %04d or ####.

        Raises OutputError where it names neither.
        """
        given = as_path(path)
        if len(_NUMBER.findall(given.name)) > 1:
            raise OutputError(f"{given}: has a place for a number twice; leave one")
        if _PRINTF.search(str(given.parent)):
            raise OutputError(f"{given}: a folder cannot be numbered; number the pictures in it")
        match, ending = _NUMBER.search(given.name), given.suffix.lower()
        if match is None:
            if ending in FILMS:
                return cls(given, None)
            if ending in PICTURES:
                named = given.with_name(f"{given.stem}-%04d{ending}")
                raise OutputError(f"{given}: is one picture; number them, as {named}")
            problem = f"films cannot be written as '{ending}'" if ending else "the name has no ending"
            raise OutputError(
                f"{given}: {problem}; use one of {', '.join(FILMS)}, or numbers, as film/%04d.png"
            )
        if not ending:
            given = given.with_name(given.name + ".png")
        require_ending(given)
        digits = int(match[1] or 1) if match[0].startswith("%") else len(match[0])
        return cls(given, (*match.span(), digits))

    @property
    def is_film(self) -> bool:
        """Whether it is one file."""
        return self.number is None

    def picture(self, frame: int) -> Path:
        """Return the path of a numbered picture."""
        assert self.number is not None
        first, end, digits = self.number
        name = self.path.name
        return self.path.with_name(f"{name[:first]}{frame:0{digits}d}{name[end:]}")

    @property
    def beside(self) -> Path:
        """The folder where finished frames are kept until the film is whole."""
        return self.path.with_name(self.path.name + ".frames")
