"""Every pipeline that the program can make: seen in small pictures, and multiplied by its switches."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

from transport import box_room, lit, render

from ispm import wgsl
from ispm.bench.yardsticks import filling
from ispm.estimators.tiled import Tiled
from ispm.estimators.volumes import Volumes
from ispm.gpu import Compute, Gpu, Raster, RasterState
from ispm.gpu.device import _adapters
from ispm.library.shapes import polygons
from ispm.scene.material import AlphaMode, Material

# Values of the constants that are no switch; switches are off and on.
_VALUES: dict[str, tuple[float, ...]] = {"BLOCK": tuple(range(1, 17))}
_ENTRY = re.compile(r"@(?:vertex|fragment|compute)[^{]*?\bfn\s+(\w+)")


@dataclass(frozen=True)
class Pipeline:
    """One call of `Gpu.compute` or `Gpu.raster`."""

    method: str
    path: str
    given: tuple[Any, ...]
    named: dict[str, Any]

    @property
    def label(self) -> str:
        """The file, and all that is not as usual."""
        words = [*map(str, self.given), *(f"{key}={value}" for key, value in self.named.items())]
        return " ".join([self.path, *words])

    @property
    def entries(self) -> set[str]:
        """The entry points used."""
        if self.method == "compute":
            return {self.given[0] if self.given else "main"}
        state = next((each for each in self.given if isinstance(each, RasterState)), RasterState())
        return {state.vertex, state.fragment} - {None}

    def make(self, gpu: Gpu) -> Compute | Raster:
        """Return it, made on a device."""
        made: Compute | Raster = getattr(gpu, self.method)(self.path, *self.given, **self.named)
        return made

    def variants(self) -> Iterator[Pipeline]:
        """Yield it with each value of its constants."""
        names = [name for name in self.named if name.isupper()]
        for values in itertools.product(*(_VALUES.get(name, (False, True)) for name in names)):
            chosen = dict(zip(names, values, strict=True))
            yield Pipeline(self.method, self.path, self.given, self.named | chosen)


class _Noting(Gpu):
    """A device that keeps what it is asked to make."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.made: list[Pipeline] = []

    def compute(self, path: str, *given: Any, **named: Any) -> Compute:
        self.made.append(Pipeline("compute", path, given, named))
        return super().compute(path, *given, **named)

    def raster(self, path: str, *given: Any, **named: Any) -> Raster:
        self.made.append(Pipeline("raster", path, given, named))
        return super().raster(path, *given, **named)


def all_pipelines(adapter: Any = None) -> list[Pipeline]:
    """Return those that an adapter's device is asked for, by default the preferred one's: each once."""
    gpu = _Noting(adapter or _adapters()[0])
    room = lit(box_room())
    paper = Material((0.8, 0.8, 0.8), alpha_mode=AlphaMode.MASK)
    room.add(polygons([[(-0.2, 0, 0.1), (0.2, 0, 0.1), (0, 0.2, -0.1)]]), material=paper)
    render(gpu, room, size=(16, 9), photons=100, emission="map")
    Tiled(gpu)
    if gpu.has("float32-blendable"):
        Volumes(gpu)
    filling(gpu)
    found = {variant.label: variant for pipeline in gpu.made for variant in pipeline.variants()}
    gpu.close()
    return sorted(found.values(), key=lambda pipeline: pipeline.label)


def all_entries() -> set[tuple[str, str]]:
    """Return (file, entry point) of every shader; an included file's are of those that include it."""
    paths = [f"{folder}/{file.name}" for folder in _folders() for file in (files("ispm") / folder).iterdir()]
    sources = {path: wgsl.load(path) for path in paths if path.endswith(".wgsl")}
    included = {file for path, source in sources.items() for file, _ in source.origin if file != path}
    return {
        (path, entry) for path in sources.keys() - included for entry in _ENTRY.findall(sources[path].text)
    }


def _folders() -> list[str]:
    return [entry.name for entry in files("ispm").iterdir() if entry.is_dir()]
