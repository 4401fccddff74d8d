"""What stays on the device from frame to frame."""

from __future__ import annotations

from functools import partial

from ispm.gpu.recording import Recording


class Kept:
    """Tells whether what was recorded last would be recorded again, so that it need not be."""

    def __init__(self) -> None:
        self._made_of: tuple[object, ...] | None = None

    def lacks(self, frame: Recording, *made_of: object) -> bool:
        """Return whether there is nothing made of such; who is told so has to record it in this frame.

        made_of  all that it depends on, compared by ==: what is edited in place is to be given as bytes
        """
        if self._made_of == made_of:
            return False
        self._made_of = None
        frame.afterwards(partial(setattr, self, "_made_of", made_of))
        return True
