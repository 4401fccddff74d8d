"""Where the test assets are, which are kept outside the project."""

import os
from pathlib import Path

import pytest


def assets() -> Path:
    """Return the folder of test assets: ISPM_ASSETS, else ../shared/assets; skip the test without either."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "assets"
    folder = Path(os.environ.get("ISPM_ASSETS") or beside)
    if not (folder / "manifest.json").is_file():
        pytest.skip(f"no test assets in {folder}; ISPM_ASSETS says where they are")
    return folder
