"""Renderers beside ours: seconds until their pictures of A, B and C have the same error.

Each module renders one scene in a process of its own, `python -m references.peers.NAME A FOLDER SECONDS`, and
leaves pictures with their times in the folder; `__main__.py` starts them, compares and tabulates. The folder
holds the scene as `scene.json` (`describe.py`), so that an interpreter with numpy alone can read it.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

SIZE = 640, 360  # width and height of all pictures
_APART = 1.4  # ratio of the times of two pictures kept, at least


@dataclass
class Recorder:
    """Where a renderer leaves what it has done; `limit` seconds of rendering are wanted."""

    folder: Path
    limit: float
    kept: int = 0
    last: float = 0.0

    def ready(self, title: str, start_up: float | None = None) -> None:
        """Say that rendering begins: the time until now went to start-up, or `start_up` seconds did."""
        told = {"title": title, "at": time.time(), "start_up": start_up}
        (self.folder / "ready.json").write_text(json.dumps(told), "utf-8")

    def due(self, seconds: float) -> bool:
        """Return whether a picture of that age is worth keeping."""
        return seconds >= min(self.last * _APART, self.limit)

    def add(self, seconds: float, radiance: np.ndarray) -> None:
        """Keep a picture, (h, w, 3) linear radiance, and the seconds of rendering that it took."""
        np.savez(self.folder / f"{self.kept:03}.npz", seconds=seconds, radiance=radiance.astype(np.float32))
        self.kept, self.last = self.kept + 1, seconds

    def scene(self) -> dict[str, Any]:
        """Return the scene as `describe` has it."""
        found: dict[str, Any] = json.loads((self.folder / "scene.json").read_text("utf-8"))
        return found


def work(render: Callable[[str, Recorder], None]) -> None:
    """Render as the command line says."""
    name, folder, limit = sys.argv[1:4]
    render(name, Recorder(Path(folder), float(limit)))
