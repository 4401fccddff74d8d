"""What a rendered frame gives: its layers as arrays, its statistics, its files."""

from __future__ import annotations

import dataclasses
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ispm.errors import SettingsError
from ispm.io import image as files
from ispm.renderer.statistics import Stats
from ispm.renderer.views import display
from ispm.settings import Settings, nearest


@dataclass(eq=False)
class Frame:
    """One picture. Arrays are (height, width, channels), row 0 on top, linear, float32 unless said.

    image       uint8 sRGB, tone mapped; with a fourth channel where the background is transparent
    radiance    cd/m2: (direct + indirect) + emission, in this order
    direct, indirect, emission   cd/m2
    irradiance  lx: incident indirect light before the surface
    depth       (h, w) m along the view axis, infinite where nothing is
    normal      shading normal, world space
    albedo      base color
    instance, material   (h, w) int32 ids, -1 where nothing is
    camera      its pose (4, 4) camera-to-world and clip_from_world matrix
    exposure    stops that `image` was made with
    """

    image: np.ndarray = field(repr=False)
    layers: Mapping[str, np.ndarray] = field(repr=False)
    stats: Stats
    settings: Settings
    camera: dict[str, np.ndarray] = field(repr=False)
    exposure: float

    @property
    def radiance(self) -> np.ndarray:
        """The whole picture, cd/m2."""
        return self.layers["full"]

    def __getattr__(self, name: str) -> np.ndarray:
        layers = self.__dict__.get("layers", {})
        if name in layers:
            return np.asarray(layers[name])
        raise AttributeError(f"a Frame has no '{name}'; it has {', '.join(layers)}")

    def __getitem__(self, layer: str) -> np.ndarray:
        """Return a layer by name. Raises KeyError naming the nearest."""
        if layer not in self.layers:
            raise KeyError(f"there is no layer '{layer}'{nearest(layer, self.layers)}")
        return self.layers[layer]

    def show(self, view: str = "full") -> np.ndarray:
        """Return a view of this frame as uint8 sRGB. Raises SettingsError for one it does not have."""
        if view == "full":
            return self.image
        return display(self.layers, view, self.exposure, self.settings.tonemap)

    def save(
        self,
        path: str | Path,
        *,
        show: str = "full",
        layers: list[str] | None = None,
        float32: bool = False,
    ) -> Path:
        """Write the picture; the ending picks PNG, JPEG, EXR, NPY or NPZ. Return the path.

        show     the view that PNG and JPEG show, and the layer of NPY
        layers   of an EXR or NPZ; None: all
        float32  EXR: full precision instead of half
        Nothing is left half written. Raises OutputError, or SettingsError for an unknown layer.
        """
        path = Path(path)
        ending = files.require_ending(path)
        if ending == ".png":
            files.write_png(path, self.show(show), self._metadata())
        elif ending in (".jpg", ".jpeg"):
            files.write_jpeg(path, self.show(show))
        elif ending == ".npy":
            files.write_npy(path, self._layer(show))
        else:
            chosen = {name: self._layer(name) for name in (layers or self.layers)}
            if ending == ".exr":
                files.write_exr(path, chosen, {**self._metadata(), **self.camera}, float32)
            else:
                files.write_npz(path, chosen)
        return path

    def _layer(self, name: str) -> np.ndarray:
        if name not in self.layers:
            raise SettingsError(f"there is no layer '{name}'{nearest(name, self.layers)}")
        return self.layers[name]

    def _metadata(self) -> dict[str, str]:
        from ispm import __version__

        settings = dataclasses.asdict(self.settings)
        return {"Software": f"ispm {__version__}", "ispm:settings": json.dumps(settings),
                "ispm:seed": str(self.settings.seed)}  # fmt: skip

    def _repr_png_(self) -> bytes:
        """How a notebook shows the frame."""
        from PIL import Image

        out = io.BytesIO()
        Image.fromarray(self.image).save(out, format="png")
        return out.getvalue()
