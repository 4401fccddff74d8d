"""What a rendered frame gives: its layers as arrays, its statistics, its files."""

from __future__ import annotations

import dataclasses
import json
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from ispm.errors import SceneWarning, SettingsError
from ispm.io import image as files
from ispm.io.atomic import as_path
from ispm.io.png import encode_png
from ispm.renderer.backdrop import metered, shown
from ispm.renderer.show import show_picture
from ispm.renderer.statistics import Stats
from ispm.renderer.views import display
from ispm.scene.names import Names
from ispm.scene.values import strict_call
from ispm.settings import Settings, nearest
from ispm.stages.tonemap import auto_exposure, tonemap, tonemap_transparent

_LAYERED = (".exr", ".npz")


@dataclass(eq=False)
class Frame:
    """One picture: its layers as arrays (height, width, channels), row 0 on top, linear, float32 unless said.

    Each layer is an attribute, and comes by its name: `frame["indirect"]`; loops and `in` go through names.
    A notebook shows a frame as it is.

    layers      all of them by name, each made at its first use
    stats       numbers of this frame: photons, flux, milliseconds
    settings    that it was made with
    camera      by name, float64: its `pose` (4, 4) camera-to-world, the matrix `clip_from_world` (4, 4) and,
                unless it is orthographic, `intrinsics` (3, 3), K in pixels as of `Camera.intrinsics`
    scene       the scene's name
    command     the command line that makes this frame, where one did
    names       what the ids in `instance` and `material` stand for
    """

    layers: Mapping[str, np.ndarray] = field(repr=False)
    stats: Stats
    settings: Settings
    camera: dict[str, np.ndarray] = field(repr=False)
    scene: str = ""
    command: str = ""
    names: Names = field(default_factory=Names)

    def __repr__(self) -> str:
        height, width = self.radiance.shape[:2]
        return f"<Frame {width}x{height} of '{self.scene}', {self.settings.photons:,} photons>"

    @cached_property
    def exposure(self) -> float:
        """Stops that `image` is made with: the settings', or found for it, without its background.

        Where nothing but the environment is seen, they are found for that.
        """
        wanted = self.settings.exposure
        if not isinstance(wanted, str):
            return wanted
        return auto_exposure(metered(self.layers, self.radiance), self.layers.get("emission"))

    @cached_property
    def image(self) -> np.ndarray:
        """(h, w, 3) uint8 sRGB, tone mapped when first asked for; (h, w, 4) with a transparent background."""
        return self._toned(8)

    @property
    def radiance(self) -> np.ndarray:
        """(h, w, 3) cd/m2, the whole picture: (direct + indirect) + emission, in this order. Layer `full`."""
        return self._named("full")

    @property
    def direct(self) -> np.ndarray:
        """(h, w, 3) cd/m2: light that comes to the surface from the lights themselves, that of an environment
        also through clear glass."""
        return self._named("direct")

    @property
    def indirect(self) -> np.ndarray:
        """(h, w, 3) cd/m2: light that comes by way of other surfaces; what mirrors and glass show."""
        return self._named("indirect")

    @property
    def emission(self) -> np.ndarray:
        """(h, w, 3) cd/m2: glow of the surface itself, the background, the environment where it is seen."""
        return self._named("emission")

    @property
    def irradiance(self) -> np.ndarray:
        """(h, w, 3) lx: incident indirect light before the surface."""
        return self._named("irradiance")

    @property
    def depth(self) -> np.ndarray:
        """(h, w) metres along the view axis, infinite where nothing is."""
        return self._named("depth")

    @property
    def normal(self) -> np.ndarray:
        """(h, w, 3) unit shading normal, world space, on the side that is seen; 0 where nothing is."""
        return self._named("normal")

    @property
    def albedo(self) -> np.ndarray:
        """(h, w, 3) base color, linear, 0 to 1."""
        return self._named("albedo")

    @property
    def instance(self) -> np.ndarray:
        """(h, w) int32: which copy of which part of which node is seen, -1 where nothing is; see `names`."""
        return self._named("instance")

    @property
    def material(self) -> np.ndarray:
        """(h, w) int32: which material is seen, an index of `names.materials`, -1 where nothing is."""
        return self._named("material")

    @property
    def alpha(self) -> np.ndarray:
        """(h, w) share of the pixel that something covers, 0 to 1."""
        return self._named("alpha")

    def _named(self, name: str) -> np.ndarray:
        if name not in self.layers:  # AttributeError, for hasattr and getattr
            raise AttributeError(f"this frame has no layer '{name}'; it has {', '.join(self.layers)}")
        return self.layers[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.layers)

    def __contains__(self, layer: object) -> bool:
        return layer in self.layers

    def __getitem__(self, layer: str) -> np.ndarray:
        """Return a layer by name. Raises KeyError naming the nearest."""
        if layer not in self.layers:
            raise KeyError(f"there is no layer '{layer}'{nearest(layer, self.layers)}")
        return self.layers[layer]

    def show(self, view: str = "full") -> None:
        """Show a view of this frame: in the notebook, else in the system's window for pictures.

        Without a display, warn in one line and go on; `view` has the picture as an array, `save` writes it.
        Raises SettingsError for a view it does not have.
        """
        show_picture(self.view(view), f"{self.scene or 'scene'}, {view}")

    def view(self, view: str = "full", bits: int = 8) -> np.ndarray:
        """Return a view of this frame, (h, w, 3) sRGB for the eye: uint8 or with 16 bits uint16.

        view  `full` (`image` with its background), `direct`, `indirect`, `emission`, `irradiance`, `albedo`,
              `normal`, `depth`, `instance`, `material`; `ambient`: direct light and a constant, to compare;
              `split`: direct light alone on the left. Those with photons: `renderer.view`
        bits  8 or 16 a channel
        Raises SettingsError for a view it does not have.
        """
        if bits not in (8, 16):
            raise SettingsError(f"bits: {bits} is not possible; a picture has 8 or 16")
        if view == "full" and bits == 8:
            return self.image
        if view == "full":
            return self._toned(bits)
        return display(self.layers, view, self.exposure, self.settings.tonemap, bits)

    @strict_call
    def save(
        self,
        path: str | Path,
        *,
        show: str = "full",
        layers: list[str] | None = None,
        float32: bool = False,
        bits: int = 8,
    ) -> Path:
        """Write the picture; the ending picks PNG, JPEG, EXR, NPY or NPZ. Return the path.

        show     the view that PNG and JPEG show, and the layer of NPY
        layers   of an EXR or NPZ; None: all
        float32  EXR: full precision instead of half
        bits     PNG: 8 or 16 a channel
        All but NPY hold how they were made, which `ispm info` tells; EXR and NPZ hold `names` as well, which
        `ispm.read_names` reads. A JPEG has black where a PNG is transparent, with a SceneWarning. Nothing is
        left half written: the file is replaced when the new one is on the disk, and keeps its mode; of a link
        to a file, that file is. Devices and the like are not.
        Raises OutputError; SettingsError for an unknown layer or number of bits, and for what a file of this
        kind does not have.
        """
        path = as_path(path)
        ending = files.require_ending(path)
        if bits != 8 and (bits != 16 or ending != ".png"):
            raise SettingsError(f"bits: {bits} is not possible in a {ending}; a PNG has 8 or 16, others 8")
        if layers is not None and (not isinstance(layers, (list, tuple)) or not layers):
            raise SettingsError(f"layers: {layers!r} is not a list of names, as ['full', 'depth']")
        if layers is not None and ending not in _LAYERED:
            raise SettingsError(
                f"layers: a {ending} holds one picture; choose it with show, or write .exr or .npz"
            )
        if show != "full" and ending in _LAYERED:
            raise SettingsError(f"show: choose what a {ending} holds with layers, as layers=['{show}']")
        if float32 and ending != ".exr":
            raise SettingsError(f"float32: is for .exr, not '{ending}'")
        if ending == ".png":
            files.write_png(path, self.view(show, bits), self._about())
        elif ending in (".jpg", ".jpeg"):
            files.write_jpeg(path, self._opaque(show), self._about())
        elif ending == ".npy":
            files.write_npy(path, self._layer(show))
        else:
            chosen = {name: self._layer(name) for name in (layers or self.layers)}
            if ending == ".exr":
                about = {**self._about(), files.EXR_NAMES: self.names.to_json()}
                files.write_exr(path, chosen, {**about, **self.camera}, float32)
            else:
                table = {files.NAMES: np.array(self.names.to_json())}
                files.write_npz(path, {**chosen, **table}, self._about())
        return path

    def _toned(self, bits: int) -> np.ndarray:
        """The picture with its background."""
        mode = self.settings.tonemap
        if self.settings.background == "transparent":
            return tonemap_transparent(self.radiance, self["alpha"], self.exposure, mode, bits=bits)
        return shown(self.layers, self.radiance, self.exposure, mode, bits)

    def _opaque(self, view: str) -> np.ndarray:
        shown = self.view(view)
        if shown.shape[2] == 3:
            return shown
        line = "a JPEG has no transparency: the background is black; use .png"
        warnings.warn(line, SceneWarning, stacklevel=3)
        return tonemap(self.radiance, self.exposure, self.settings.tonemap)

    def _layer(self, name: str) -> np.ndarray:
        if name not in self.layers:
            raise SettingsError(f"there is no layer '{name}'{nearest(name, self.layers)}")
        return self.layers[name]

    def _about(self) -> dict[str, str]:
        """How this frame was made, in words that every kind of file can hold."""
        from ispm import __version__

        pose, intrinsics = (self.camera.get(name) for name in ("pose", "intrinsics"))
        about = {
            "Software": f"ispm {__version__}",
            "ispm:scene": self.scene,
            "ispm:command": self.command,
            "ispm:settings": json.dumps(dataclasses.asdict(self.settings)),
            "ispm:exposure": f"{self.exposure:.6g}",
            "ispm:seed": str(self.settings.seed),
            "ispm:camera": "" if pose is None else json.dumps(np.asarray(pose).tolist()),
            "ispm:intrinsics": "" if intrinsics is None else json.dumps(np.asarray(intrinsics).tolist()),
        }
        # names of files may hold what is no text
        return {key: value.encode(errors="replace").decode() for key, value in about.items() if value}

    def _repr_png_(self) -> bytes:
        """How a notebook shows the frame."""
        return encode_png(self.image)
