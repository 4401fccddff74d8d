"""When memory on devices was last allocated, for those who keep what refers to it."""

from __future__ import annotations

from itertools import count

_counter = count(1)
_generation = 0


def changed() -> None:
    """Say that a texture or a buffer is allocated, perhaps in place of another."""
    global _generation
    _generation = next(_counter)


def generation() -> int:
    """Return a number that is another one after each allocation."""
    return _generation
