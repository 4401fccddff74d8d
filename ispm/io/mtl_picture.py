"""Textures of MTL files: what a statement such as `map_Kd -s 2 2 -clamp on wood.png` names."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ispm.errors import SceneError
from ispm.io.folder import read_inside
from ispm.io.notes import Notes
from ispm.io.picture import decode, shrunk
from ispm.scene.material import Texture, TextureUse, Wrap
from ispm.settings import LoadLimits

MORE_FORMATS = ("BMP", "TGA", "GIF", "TIFF")
WORDS = {"-blendu": 1, "-blendv": 1, "-bm": 1, "-boost": 1, "-cc": 1, "-clamp": 1, "-imfchan": 1,
         "-mm": 2, "-texres": 1, "-type": 1}  # fmt: skip
VECTORS = {"-o": 0.0, "-s": 1.0, "-t": 0.0}  # one to three numbers, and what stands for the others


@dataclass(frozen=True)
class MapUse:
    """A picture's name, how it repeats, and where it lies: uv * scale + offset, v upwards."""

    name: str
    clamp: bool = False
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)


def parse_map(text: str) -> MapUse:
    """Return what the arguments of a map statement say; names may hold blanks."""
    words = text.split()
    clamp, vectors = False, {"-o": (0.0, 0.0), "-s": (1.0, 1.0), "-t": (0.0, 0.0)}
    while len(words) > 1 and words[0].lower() in (*WORDS, *VECTORS):
        option = words.pop(0).lower()
        if option in WORDS:
            values, words = words[: WORDS[option]], words[WORDS[option] :]
            clamp = clamp or (option == "-clamp" and values == ["on"])
            continue
        numbers: list[float] = []
        while len(numbers) < 3 and len(words) > 1 and _is_number(words[0]):
            numbers.append(float(words.pop(0)))
        u, v = (numbers + [VECTORS[option]] * 2)[:2]
        vectors[option] = u, v
    return MapUse(" ".join(words).strip("\"'").replace("\\", "/"), clamp, vectors["-s"], vectors["-o"])


def _is_number(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False


class Pictures:
    """The pictures of an MTL file's folder, each decoded once."""

    def __init__(self, folder: Path, notes: Notes, limits: LoadLimits) -> None:
        self._folder, self._notes, self._limits = folder, notes, limits
        self._pixels: dict[str, np.ndarray | None] = {}
        self._textures: dict[tuple[tuple[str, ...], bool, bool], Texture] = {}

    def pixels(self, name: str) -> np.ndarray | None:
        """Return a picture as (height, width, 4) uint8; None, with a note, where it cannot be shown."""
        if name not in self._pixels:
            try:
                self._pixels[name] = decode(self._read(name), self._limits, MORE_FORMATS)
            except (SceneError, OSError) as error:
                self._notes.add(f"picture '{name[:80]}' is left out: {error}")
                self._pixels[name] = None
        return self._pixels[name]

    def _read(self, name: str) -> memoryview:
        """The bytes of a picture; one named by where it once lay is looked for beside the MTL file."""
        beside = name.rpartition("/")[2]
        if beside != name and (self._folder / beside).is_file():
            try:
                return read_inside(name, self._folder, self._limits)
            except SceneError:
                return read_inside(beside, self._folder, self._limits)
        return read_inside(name, self._folder, self._limits)

    def use(self, what: MapUse, pixels: np.ndarray, names: tuple[str, ...], *, srgb: bool) -> TextureUse:
        """Return `pixels` as a texture that repeats and lies as `what` says.

        names  of the pictures that they are made of
        """
        key = names, what.clamp, srgb
        if key not in self._textures:
            wrap = Wrap.CLAMP if what.clamp else Wrap.REPEAT
            texture = Texture(pixels, srgb, wrap, wrap, name=what.name)
            self._textures[key] = shrunk(texture, self._limits.max_texture)
        (su, sv), (ou, ov) = what.scale, what.offset
        # v points down in our coordinates: 1 - ((1 - v) s + o)
        return TextureUse(self._textures[key], 0, ((su, 0.0, ou), (0.0, sv, 1.0 - sv - ov)))


def stacked(layers: list[tuple[np.ndarray | None, int]], order: tuple[int, ...]) -> np.ndarray:
    """Return one picture of channels of several, as large as the largest; 255 where there is none.

    layers  (picture, channel)
    order   which layer each of R, G, B, A takes; -1: none
    """
    from PIL import Image

    height = max(p.shape[0] for p, _ in layers if p is not None)
    width = max(p.shape[1] for p, _ in layers if p is not None)
    result = np.full((height, width, 4), 255, np.uint8)
    for target, source in enumerate(order):
        picture, channel = layers[source] if source >= 0 else (None, 0)
        if picture is not None:
            image = Image.fromarray(np.ascontiguousarray(picture[..., channel]))
            result[..., target] = np.asarray(image.resize((width, height)))
    return result
