"""Where the reference pictures are, which are kept outside the project."""

from pathlib import Path

import pytest


def references() -> Path:
    """Return the folder of reference scenes and pictures, ../shared/refs; skip the test without it."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "refs"
    if not (folder / "ref_A.npz").is_file():
        pytest.skip(f"no reference pictures in {folder}")
    return folder
