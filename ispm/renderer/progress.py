"""What progressive passes have summed up: their mean, its estimated error, and its file."""

from __future__ import annotations

import dataclasses
import hashlib
import io
import json
import math
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ispm.errors import OutputError, SettingsError
from ispm.io.atomic import as_path
from ispm.io.image import ABOUT, write_npz
from ispm.optics.texture import TextureTable
from ispm.optics.vector import LUMINANCE
from ispm.renderer.backdrop import LAYER, background_color
from ispm.renderer.layers import Layers, sum_layers
from ispm.renderer.picture import Frame
from ispm.renderer.statistics import Stats
from ispm.scene.packed import Packed
from ispm.settings import Settings
from ispm.stages.camera import CameraView

_SUMMED = ("direct", "indirect", "emission", "irradiance", "alpha")
_KEPT = ("depth", "normal", "albedo", "instance", "material")  # of the first pass
_CAMERA = ("pose", "clip_from_world")
MOST_PASSES = 1 << 32  # random numbers are numbered by them
_FREE = ("passes", "time_limit", "target_error", "exposure", "tonemap", "preset")  # may differ when resumed
_DARK = 1e-3  # of the square of the picture's mean: below it errors count as in relMSE


@dataclass
class Progress:
    """The passes so far.

    sums     new after each pass: direct, indirect, emission, irradiance (h, w, 3), alpha (h, w), float32, and
             of a colored background its share
    moments  (2, h, w) float64: sums of the luminance of indirect light and of its square
    first    layers and camera of the first pass
    stats    of the last pass
    made_of  fingerprint of scene, camera and settings as passes began
    file     that they were read from
    """

    passes: int
    sums: dict[str, np.ndarray] = field(repr=False)
    moments: np.ndarray = field(repr=False)
    first: Mapping[str, np.ndarray] = field(repr=False)
    camera: dict[str, np.ndarray] = field(repr=False)
    scene: str
    stats: Stats = field(repr=False)
    made_of: str
    file: str = ""

    @classmethod
    def start(cls, frame: Frame, made_of: str) -> Progress:
        """Begin with the frame of pass 0."""
        sums = {name: np.zeros_like(frame[name]) for name in (*_SUMMED, LAYER) if name in frame.layers}
        moments = np.zeros((2, *frame["depth"].shape))
        progress = cls(0, sums, moments, frame.layers, frame.camera, frame.scene, frame.stats, made_of)
        progress.add(frame)
        return progress

    def add(self, frame: Frame) -> None:
        """Add the frame of the next pass."""
        self.sums = {name: total + frame[name] for name, total in self.sums.items()}
        luminance = _luminance(frame["indirect"])
        self.moments[0] += luminance
        self.moments[1] += np.square(luminance, dtype=np.float64)
        self.passes += 1
        self.stats = frame.stats

    def error(self) -> float:
        """Return the estimated relative error of the mean that is left: noise, as the passes differ.

        The root of the mean over the pixels of sigma^2 / (L^2 + 0.001 mean(L)^2), sigma the standard error
        of indirect light's luminance, L that of all light. What all passes have in common, the bias of their
        kernels, does not show in it; nor does direct light, which differs as the places in a pixel do, but
        they are even, not drawn. Not a number after one pass.
        """
        n = self.passes
        if n < 2:
            return math.nan
        mean = self.moments[0] / n
        variance = np.maximum(self.moments[1] / n - mean * mean, 0.0) / (n - 1)
        light = _luminance(self.sums["direct"] + self.sums["indirect"] + self.sums["emission"]) / n
        floor = max(_DARK * float(light.mean()) ** 2, 1e-300)
        return math.sqrt(float((variance / (light * light + floor)).mean()))

    def frame(self, settings: Settings, threads: int) -> Frame:
        """Return the mean of the passes as a frame, whose layers are made when asked for."""
        share = np.float32(1.0 / self.passes)
        makers: dict[str, Callable[[], np.ndarray]]
        makers = {name: partial(np.multiply, total, share) for name, total in self.sums.items()}
        makers["full"] = lambda: sum_layers(mean["direct"], mean["indirect"], mean["emission"], threads)
        makers |= {name: partial(self.first.__getitem__, name) for name in _KEPT}
        mean = Layers(makers)
        stats = dataclasses.replace(self.stats, passes=self.passes, error=self.error())
        return Frame(mean, stats, settings, self.camera, self.scene)

    def save(self, path: str | Path) -> Path:
        """Write an .npz that `load` reads. Raises OutputError."""
        target = as_path(path)
        if target.suffix.lower() != ".npz":
            raise OutputError(f"{target}: passes are kept in an .npz; name it so")
        arrays = {f"sum.{name}": total for name, total in self.sums.items()}
        arrays |= {f"first.{name}": self.first[name] for name in _KEPT}
        arrays |= {f"camera.{name}": array for name, array in self.camera.items()}
        about = {name: getattr(self, name) for name in ("passes", "scene", "made_of")}
        about |= {"error": self.error(), "stats": dataclasses.asdict(self.stats)}
        arrays["indirect_moments"] = self.moments
        write_npz(target, arrays, {"ispm:progress": json.dumps(about)}, compressed=False)  # noise stays long
        return target

    @classmethod
    def load(cls, path: str | Path) -> Progress:
        """Read what `save` wrote. Raises OutputError for a file that is none of these."""
        try:
            arrays = _read(Path(path))
            about = json.loads(json.loads(str(arrays.pop(ABOUT)))["ispm:progress"])
            parts = {prefix: _part(arrays, prefix) for prefix in ("sum.", "first.", "camera.")}
            sums, first, camera = parts.values()
            progress = cls(
                about["passes"], {name: sums[name] for name in (*_SUMMED, *sums.keys() & {LAYER})},
                arrays["indirect_moments"].copy(), {name: first[name] for name in _KEPT},
                {name: camera[name] for name in _CAMERA}, about["scene"], _stats(about["stats"]),
                about["made_of"], str(path),
            )  # fmt: skip
            progress._check()
            return progress
        except OSError as error:
            raise OutputError(f"{path}: cannot be read: {error.strerror or error}") from None
        except Exception:  # what damaged files make the libraries raise is not documented
            raise OutputError(f"{path}: does not hold passes to continue; name another file") from None

    def _check(self) -> None:
        """Raise ValueError where these cannot be passes."""
        size = self.moments.shape[1:]
        arrays = {**self.sums, **self.first, **self.camera, "moments": self.moments}
        shapes = {"moments": (2, *size), "pose": (4, 4), "clip_from_world": (4, 4)}
        shapes |= dict.fromkeys(("alpha", "depth", "instance", "material"), size)
        kinds = {"moments": "f8", "pose": "f8", "clip_from_world": "f8", "instance": "i4", "material": "i4"}
        if type(self.passes) is not int or not 1 <= self.passes <= MOST_PASSES or len(size) != 2:
            raise ValueError
        if type(self.scene) is not str or type(self.made_of) is not str:
            raise ValueError
        for name, array in arrays.items():
            if array.shape != shapes.get(name, (*size, 3)) or array.dtype != kinds.get(name, "f4"):
                raise ValueError
            far = name == "depth" and not np.isnan(array).any()  # infinite where nothing is
            if not (far or np.isfinite(array).all()):
                raise ValueError
        if (self.moments < 0.0).any():
            raise ValueError

    def require(self, made_of: str, settings: Settings) -> None:
        """Raise SettingsError where these are passes of something else."""
        colored = background_color(settings) is not None
        fits = self.moments.shape[1:] == settings.size[::-1] and (LAYER in self.sums) == colored
        if self.made_of != made_of or not fits:
            raise SettingsError(
                f"{self.file}: holds {self.passes} passes of another scene, camera or settings; continue "
                "with the same ones, or name another file"
            )


def _read(path: Path) -> dict[str, np.ndarray]:
    """The arrays of an .npz that is not compressed: no more bytes than the file has. Raises what it will."""
    with zipfile.ZipFile(path) as archive:
        entries = archive.infolist()
        if sum(entry.file_size for entry in entries) > path.stat().st_size:
            raise ValueError
        return {entry.filename.removesuffix(".npy"): _array(archive.read(entry)) for entry in entries}


def _array(data: bytes) -> np.ndarray:
    """The array that the bytes of an .npy are, of no more bytes than these."""
    file = io.BytesIO(data)
    if np.lib.format.read_magic(file) != (1, 0):
        raise ValueError
    shape, fortran, dtype = np.lib.format.read_array_header_1_0(file)
    if dtype.hasobject or math.prod(shape) * dtype.itemsize != len(data) - file.tell():
        raise ValueError
    return np.frombuffer(data, dtype, offset=file.tell()).reshape(shape, order="F" if fortran else "C")


def _stats(values: Mapping[str, Any]) -> Stats:
    """Statistics of which each is of its kind. Raises ValueError where one is not."""
    for f in dataclasses.fields(Stats):
        wanted = (int, float) if isinstance(f.default, float) else type(f.default)
        if not isinstance(values.get(f.name, f.default), wanted):
            raise ValueError
    return Stats(**values)


def _luminance(light: np.ndarray) -> np.ndarray:
    return np.asarray(light @ np.array(LUMINANCE, np.float32), np.float64)


def _part(arrays: Mapping[str, np.ndarray], prefix: str) -> dict[str, np.ndarray]:
    return {name.removeprefix(prefix): a for name, a in arrays.items() if name.startswith(prefix)}


def fingerprint(packed: Packed, textures: TextureTable, view: CameraView, settings: Settings) -> str:
    """Return what tells one picture from another: scene, camera and all settings that passes share."""
    from ispm import __version__

    knobs = {name: value for name, value in dataclasses.asdict(settings).items() if name not in _FREE}
    eye = (view.size, view.pose.tolist(), view.yfov, view.ymag, view.aspect, view.principal)
    digest = hashlib.sha256(json.dumps([__version__, knobs, eye]).encode())
    for table in (packed.instances, packed.materials, packed.lights):
        digest.update(table.tobytes())
    digest.update(packed.geometry.digest + textures.digest)
    return digest.hexdigest()
