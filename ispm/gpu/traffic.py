"""How many bytes were sent to devices and read from them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Traffic:
    """Bytes from numpy to devices, and back."""

    sent: int = 0
    read: int = 0

    def since(self, before: Traffic) -> Traffic:
        """Return what came to this after `before`."""
        return Traffic(self.sent - before.sent, self.read - before.read)


_total = Traffic()


def traffic() -> Traffic:
    """Return the bytes since the process began."""
    return _total


def count(sent: int = 0, read: int = 0) -> None:
    """Add bytes."""
    global _total
    _total = Traffic(_total.sent + sent, _total.read + read)
