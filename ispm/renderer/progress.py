"""What progressive passes have summed up: their mean, its estimated error, and its file."""

from __future__ import annotations

import dataclasses
import io
import json
import math
import zipfile
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ispm.errors import OutputError, SettingsError
from ispm.io.atomic import as_path
from ispm.io.image import ABOUT, write_npz
from ispm.optics.vector import LUMINANCE
from ispm.renderer.backdrop import ENVIRONMENT, LAYER, background_color
from ispm.renderer.layers import Layers, sum_layers
from ispm.renderer.made_of import MadeOf
from ispm.renderer.picture import Frame
from ispm.renderer.statistics import Stats
from ispm.scene.values import FARTHEST
from ispm.settings import Settings

SUMMED = ("direct", "indirect", "emission", "irradiance", "alpha")
KEPT = ("depth", "normal", "albedo", "instance", "material")  # of the first pass
_CAMERA = ("pose", "clip_from_world")
_PERSPECTIVE = ("intrinsics",)  # of the camera, unless it is orthographic
_IDS = ("instance", "material")
_FLAT = ("alpha", "depth", *_IDS)  # one number a pixel
_MIN_VALUES = {"halves": 0, "alpha": 0, "albedo": 0, "instance": -1, "material": -1, "depth": -FARTHEST}
MOST_PASSES = 1 << 32  # random numbers are numbered by them
_DARK = 1e-3  # of the square of the picture's mean: below it errors count as in relMSE


@dataclass
class Progress:
    """The passes so far.

    sums     new after each pass: direct, indirect, emission, irradiance (h, w, 3), alpha (h, w), float32, and
             of a colored background its share, of an environment that is seen behind likewise
    halves   (2, h, w) float64: sums of the luminance of all light, of the passes of either half, see `_half`
    first    layers and camera of the first pass
    stats    of the last pass
    made_of  scene, camera and settings as passes began
    file     that they were read from
    """

    passes: int
    sums: dict[str, np.ndarray] = field(repr=False)
    halves: np.ndarray = field(repr=False)
    first: Mapping[str, np.ndarray] = field(repr=False)
    camera: dict[str, np.ndarray] = field(repr=False)
    scene: str
    stats: Stats = field(repr=False)
    made_of: MadeOf = field(repr=False)
    file: str = ""

    @classmethod
    def start(cls, frame: Frame, made_of: MadeOf) -> Progress:
        """Begin with the frame of pass 0."""
        sums = {
            name: np.zeros_like(frame[name]) for name in (*SUMMED, LAYER, ENVIRONMENT) if name in frame.layers
        }
        halves = np.zeros((2, *frame["depth"].shape))
        progress = cls(0, sums, halves, frame.layers, frame.camera, frame.scene, frame.stats, made_of)
        progress.add(frame)
        return progress

    def add(self, frame: Frame) -> None:
        """Add the frame of the next pass."""
        self.sums = {name: total + frame[name] for name, total in self.sums.items()}
        light = _luminance(frame["direct"] + frame["indirect"] + frame["emission"])
        self.halves[_half(self.passes)] += light
        self.passes += 1
        self.stats = frame.stats

    def error(self) -> float:
        """Return the estimated relative error of the mean that is left: noise, as its halves differ.

        The root of the mean over the pixels of sigma^2 / (L^2 + 0.001 mean(L)^2), L the luminance of all
        light, sigma its standard error: the difference of the means of both halves of the passes, times the
        root of their numbers' product, over the number of all. So what passes draw evenly counts by how
        evenly halves of them do. What all passes have in common, the bias of their kernels, does not show in
        it. Not a number after one pass.
        """
        n = self.passes
        if n < 2:
            return math.nan
        odd = n // 2 if n % 2 == 0 or not _half(n - 1) else n // 2 + 1
        first, second = self.halves
        variance = np.square(first / (n - odd) - second / odd) * (odd * (n - odd) / n**2)
        light = (first + second) / n
        floor = max(_DARK * float(light.mean()) ** 2, 1e-300)
        return math.sqrt(float((variance / (light * light + floor)).mean()))

    def frame(self, settings: Settings, threads: int) -> Frame:
        """Return the mean of the passes as a frame, whose layers are made when asked for."""
        share = np.float32(1.0 / self.passes)
        makers: dict[str, Callable[[], np.ndarray]]
        makers = {name: partial(np.multiply, total, share) for name, total in self.sums.items()}
        makers["full"] = lambda: sum_layers(mean["direct"], mean["indirect"], mean["emission"], threads)
        makers |= {name: partial(self.first.__getitem__, name) for name in KEPT}
        mean = Layers(makers)
        stats = dataclasses.replace(self.stats, passes=self.passes, error=self.error())
        return Frame(mean, stats, settings, self.camera, self.scene)

    def save(self, path: str | Path) -> Path:
        """Write an .npz that `load` reads. Raises OutputError."""
        target = as_path(path)
        if target.suffix.lower() != ".npz":
            raise OutputError(f"{target}: passes are kept in an .npz; name it so")
        arrays = {f"sum.{name}": total for name, total in self.sums.items()}
        arrays |= {f"first.{name}": self.first[name] for name in KEPT}
        arrays |= {f"camera.{name}": array for name, array in self.camera.items()}
        about = {"version": _version(), "passes": self.passes, "scene": self.scene, "error": self.error()}
        about |= {"made_of": self.made_of.to_json(), "stats": dataclasses.asdict(self.stats)}
        arrays["halves"] = self.halves
        write_npz(target, arrays, {"ispm:progress": json.dumps(about)}, compressed=False)  # noise stays long
        return target

    @classmethod
    def load(cls, path: str | Path) -> Progress:
        """Read what `save` wrote. Raises OutputError for a file that is none of these, saying why."""
        try:
            return cls._read(Path(path))
        except OSError as error:
            raise OutputError(f"{path}: cannot be read: {error.strerror or error}") from None
        except _SpoiledError as error:
            why = str(error)
        except zipfile.BadZipFile:
            why = "it is no .npz, or cut short, or damaged"
        except Exception:  # what damaged files make the libraries raise is not documented
            why = "it is damaged"
        raise OutputError(f"{path}: does not hold passes to continue: {why}; name another file, or remove it")

    @classmethod
    def _read(cls, path: Path) -> Progress:
        """Raises what it will for a file that holds no passes."""
        arrays = _arrays(path)
        if ABOUT not in arrays:
            raise _SpoiledError("it was not written by --resume")
        about = json.loads(str(arrays.pop(ABOUT))).get("ispm:progress")
        if about is None:
            raise _SpoiledError("it is a picture")
        about = json.loads(about)
        if about.get("version") != _version():
            raise _SpoiledError(
                f"they are of ispm {str(about.get('version'))[:20]}, and this is {_version()}"
            )
        try:
            made_of = MadeOf.from_json(about.get("made_of"))
        except ValueError as error:
            raise _SpoiledError(str(error)) from None
        behind = {f"sum.{LAYER}"} if background_color(made_of.settings) is not None else set()
        _require_names(arrays, behind, {f"sum.{ENVIRONMENT}"})
        sums, first, camera = (_part(arrays, prefix) for prefix in ("sum.", "first.", "camera."))
        progress = cls(
            about.get("passes"),
            sums,
            arrays["halves"].copy(),
            first,
            camera,
            about.get("scene"),
            _stats(about.get("stats")),
            made_of,
            str(path),
        )
        progress._check()
        return progress

    def _check(self) -> None:
        """Raise _SpoiledError where these cannot be passes."""
        if type(self.passes) is not int or not 1 <= self.passes <= MOST_PASSES:
            raise _SpoiledError("their number makes no sense")
        if type(self.scene) is not str:
            raise _SpoiledError("the scene has no name")
        size = self.made_of.settings.size[::-1]
        shapes: dict[str, tuple[int, ...]] = dict.fromkeys(_FLAT, size)
        shapes |= {"halves": (2, *size), "pose": (4, 4), "clip_from_world": (4, 4), "intrinsics": (3, 3)}
        kinds = dict.fromkeys(("halves", "pose", "clip_from_world", "intrinsics"), "f8")
        kinds |= dict.fromkeys(_IDS, "i4")
        for name, array in {**self.sums, **self.first, **self.camera, "halves": self.halves}.items():
            shape, kind = shapes.get(name, (*size, 3)), np.dtype(kinds.get(name, "f4"))
            if array.shape != shape or array.dtype != kind:
                raise _SpoiledError(f"{name} is {_form(array.dtype, array.shape)}, not {_form(kind, shape)}")
            least = _MIN_VALUES.get(name, -math.inf)
            if not (array >= least).all():  # NaN is not
                raise _SpoiledError(f"{name} has values that are no number, or below {least:g}")
            if name != "depth" and not np.isfinite(array).all():  # infinite where nothing is
                raise _SpoiledError(f"{name} has values that are not finite")

    def require(self, made_of: MadeOf, scene: str) -> None:
        """Raise SettingsError, which says what differs, where these are passes of something else.

        scene  the name of the one to be rendered
        """
        if self.made_of == made_of:
            return
        renamed = self.scene != scene and self.made_of.scene != made_of.scene
        found = [f"scene '{self.scene}' (here '{scene}')"] * renamed + self.made_of.differences(made_of)
        raise SettingsError(
            f"{self.file}: holds {self.passes} pass{'es' * (self.passes > 1)} of another picture, with "
            f"{', '.join(found)}; continue with the same, or name another file"
        )


class _SpoiledError(Exception):
    """Why a file holds no passes."""


def _version() -> str:
    from ispm import __version__

    return __version__


def _arrays(path: Path) -> dict[str, np.ndarray]:
    """The arrays of an .npz that is not compressed: no more bytes than the file has. Raises what it will."""
    with zipfile.ZipFile(path) as archive:
        entries = archive.infolist()
        if any(entry.compress_type != zipfile.ZIP_STORED for entry in entries):
            raise _SpoiledError("it is compressed, which passes are not")
        if sum(entry.file_size for entry in entries) > path.stat().st_size:
            raise _SpoiledError("its parts are larger than the file")
        twice = [name for name, count in Counter(e.filename for e in entries).items() if count > 1]
        if twice:
            raise _SpoiledError(f"it has {twice[0]} twice")
        return {e.filename.removesuffix(".npy"): _array(e.filename, archive.read(e)) for e in entries}


def _array(name: str, data: bytes) -> np.ndarray:
    """The array that the bytes of an .npy are, of no more bytes than these."""
    file = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(file)
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(file)
    except Exception:  # the header is an expression of Python
        raise _SpoiledError(f"{name} is no array") from None
    if version != (1, 0) or dtype.hasobject:
        raise _SpoiledError(f"{name} is an array of another kind")
    if math.prod(shape) * dtype.itemsize != len(data) - file.tell():
        raise _SpoiledError(f"{name} is longer or shorter than it says")
    return np.frombuffer(data, dtype, offset=file.tell()).reshape(shape, order="F" if fortran else "C")


def _require_names(found: Mapping[str, Any], behind: set[str], may: set[str]) -> None:
    """Raise _SpoiledError where arrays are missing or too many. `behind`: those of the background; `may`:
    those that may be there."""
    wanted = {f"sum.{name}" for name in SUMMED} | {f"first.{name}" for name in KEPT} | behind
    wanted |= {f"camera.{name}" for name in _CAMERA} | {"halves"}
    optional = {f"camera.{name}" for name in _PERSPECTIVE} | may
    missing, strange = sorted(wanted - found.keys()), sorted(found.keys() - wanted - optional)
    if missing:
        raise _SpoiledError(f"{missing[0]} is missing")
    if strange:
        raise _SpoiledError(f"it has {strange[0]}, which no passes have")


def _form(dtype: np.dtype[Any], shape: tuple[int, ...]) -> str:
    return f"{dtype} of shape {shape}"


def _stats(values: Any) -> Stats:
    """Statistics of which each is of its kind. Raises _SpoiledError where one is not."""
    known = dataclasses.asdict(Stats())
    if not isinstance(values, dict) or values.keys() != known.keys():
        raise _SpoiledError("its statistics are incomplete, or of another kind")
    for name, default in known.items():
        value, kind = values[name], type(default)
        fits = type(value) is kind or (kind is float and type(value) is int)
        if not fits or (kind is int and value < 0):
            raise _SpoiledError(f"the number {name} of its statistics makes no sense")
    return Stats(**values)


def _half(index: int) -> int:
    """The half, 0 or 1, that pass `index` counts to: of each two one to either, and neither half is ahead of
    the other in what changes steadily (Thue and Morse)."""
    return index.bit_count() % 2


def _luminance(light: np.ndarray) -> np.ndarray:
    return np.asarray(light @ np.array(LUMINANCE, np.float32), np.float64)


def _part(arrays: Mapping[str, np.ndarray], prefix: str) -> dict[str, np.ndarray]:
    return {name.removeprefix(prefix): a for name, a in arrays.items() if name.startswith(prefix)}
