"""Pictures by a path tracer that is not ours (Mitsuba 3), to compare with.

Small ones lie beside this file: `scenes.py` builds the scenes, `to_mitsuba.py` hands them over, `make.py`
renders and stores them. Larger ones are kept outside the project.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

SMALL = 160, 90  # width and height
FOLDER = Path(__file__).parent
_BESIDE = FOLDER.parents[2] / "shared" / "refs"


@dataclass(frozen=True)
class Reference:
    """A picture and how far it can be trusted.

    radiance        (h, w, 3) float32
    masks           by name, (h, w) bool: `whole`, pixels without an edge in them; `caustic`, those of them
                    where caustics are over a tenth of the light
    own_errors      likewise: relMSE of the reference's noise there, from the spread of independent parts
    standard_error  (h, w) float32 of the mean of the channels; None: not kept
    samples         paths per pixel
    bounces         non-specular scatters of light at most, as the setting has it; None: no limit
    """

    radiance: np.ndarray
    masks: dict[str, np.ndarray]
    own_errors: dict[str, float]
    standard_error: np.ndarray | None = None
    samples: int | None = None
    bounces: int | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.radiance.shape[1], self.radiance.shape[0]


def stored(name: str) -> Reference:
    """Return the small reference called `name`, one of `names()`."""
    with np.load(FOLDER / f"{name}.npz") as kept:
        masks = {key: kept[key] for key in ("whole", "caustic") if key in kept}
        own_errors = {key: float(kept[f"own_error_{key}"]) for key in masks}
        return Reference(
            kept["radiance"].astype(np.float32), masks, own_errors,
            kept["standard_error"].astype(np.float32), int(kept["samples"]), int(kept["bounces"]),
        )  # fmt: skip


def names() -> list[str]:
    """Return what `stored` has."""
    return sorted(path.stem for path in FOLDER.glob("*.npz"))


def larger(name: str) -> Reference:
    """Return the picture A, B or C of `outside()`, 640 x 360."""
    with np.load(outside() / f"ref_{name}.npz") as kept:
        masks = {"whole": kept["metric_mask"] != 0}
        if "caustic_mask" in kept:
            masks["caustic"] = kept["caustic_mask"] != 0
        own_errors = dict.fromkeys(masks, float(kept["ref_relmse"]))
        return Reference(kept["R"].astype(np.float32), masks, own_errors)


def outside() -> Path:
    """Return the folder of larger scenes and pictures: ISPM_REFS, else ../shared/refs.

    Raises FileNotFoundError where it has none.
    """
    folder = Path(os.environ.get("ISPM_REFS") or _BESIDE)
    if not (folder / "ref_A.npz").is_file():
        raise FileNotFoundError(f"no reference pictures in {folder}; ISPM_REFS says where they are")
    return folder


def references() -> Path:
    """Return `outside()`; skip the test where it has none."""
    import pytest

    try:
        return outside()
    except FileNotFoundError as error:
        pytest.skip(str(error))
