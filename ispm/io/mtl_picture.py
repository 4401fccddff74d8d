"""Textures of MTL files: what a statement such as `map_Kd -s 2 2 -clamp on wood.png` names."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ispm.errors import SceneError
from ispm.io.budget import Budget
from ispm.io.folder import read_inside
from ispm.io.notes import Notes
from ispm.io.picture import STEPS_A_PIXEL, Pictures
from ispm.scene.material import Texture, TextureUse, Wrap

MORE_FORMATS = ("BMP", "TGA", "GIF", "TIFF")
_ONE_WORD = ("-blendu", "-blendv", "-bm", "-boost", "-cc", "-clamp", "-imfchan", "-texres", "-type")
WORDS = dict.fromkeys(_ONE_WORD, 1) | {"-mm": 2}
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
    words: deque[str] = deque(text.split())
    clamp, vectors = False, {"-o": (0.0, 0.0), "-s": (1.0, 1.0), "-t": (0.0, 0.0)}
    while len(words) > 1 and words[0].lower() in (*WORDS, *VECTORS):
        option = words.popleft().lower()
        if option in WORDS:
            values = [words.popleft() for _ in range(min(WORDS[option], len(words)))]
            clamp = clamp or (option == "-clamp" and values == ["on"])
            continue
        numbers: list[float] = []
        while len(numbers) < 3 and len(words) > 1 and _is_number(words[0]):
            numbers.append(float(words.popleft()))
        u, v = (numbers + [VECTORS[option]] * 2)[:2]
        vectors[option] = u, v
    return MapUse(" ".join(words).strip("\"'").replace("\\", "/"), clamp, vectors["-s"], vectors["-o"])


def _is_number(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False


class Maps:
    """The pictures of an MTL file's folder, and the textures made of them, each once."""

    def __init__(self, folder: Path, notes: Notes, budget: Budget) -> None:
        self._folder, self._notes, self._budget = folder, notes, budget
        self._pictures = Pictures(budget, notes, MORE_FORMATS)
        self._pixels: dict[tuple[str, bool], np.ndarray | None] = {}
        self._textures: dict[tuple[tuple[str, ...], bool, bool], Texture | None] = {}

    def pixels(self, name: str, *, srgb: bool) -> np.ndarray | None:
        """Return a picture as (height, width, 4) uint8; None, with a note, where it cannot be shown."""
        key = name, srgb
        if key not in self._pixels:
            try:
                self._pixels[key] = self._pictures.decode(self._read(name), srgb=srgb)
            except (SceneError, OSError) as error:
                self._notes.add(f"picture '{name[:80]}' is left out: {error}")
                self._pixels[key] = None
        return self._pixels[key]

    def _read(self, name: str) -> memoryview:
        """The bytes of a picture; one named by where it once lay is looked for beside the MTL file."""
        try:
            return read_inside(name, self._folder, self._budget)
        except SceneError as error:
            beside = name.rpartition("/")[2]
            if beside == name:
                raise
            try:
                return read_inside(beside, self._folder, self._budget)
            except SceneError:
                raise error from None

    def use(
        self, what: MapUse, names: tuple[str, ...], make: Callable[[], np.ndarray], *, srgb: bool
    ) -> TextureUse | None:
        """Return a texture that repeats and lies as `what` says; None, with a note, where it cannot be made.

        names  of the pictures that it is made of
        make   returns its pixels
        """
        key = names, what.clamp, srgb
        if key not in self._textures:
            wrap = Wrap.CLAMP if what.clamp else Wrap.REPEAT
            try:
                self._textures[key] = Texture(make(), srgb, wrap, wrap, name=what.name)
            except SceneError as error:
                self._notes.add(f"texture '{what.name[:80]}' is left out: {error}")
                self._textures[key] = None
        texture = self._textures[key]
        if texture is None:
            return None
        (su, sv), (ou, ov) = what.scale, what.offset
        # v points down in our coordinates: 1 - ((1 - v) s + o)
        return TextureUse(texture, 0, ((su, 0.0, ou), (0.0, sv, 1.0 - sv - ov)))

    def stacked(self, layers: list[tuple[np.ndarray | None, int]], order: tuple[int, ...]) -> np.ndarray:
        """Return one picture of channels of several, as large as the largest; 255 where there is none.

        layers  (picture, channel)
        order   which layer each of R, G, B, A takes; -1: none
        Raises SceneError where there is no memory for it.
        """
        from PIL import Image

        height = max(p.shape[0] for p, _ in layers if p is not None)
        width = max(p.shape[1] for p, _ in layers if p is not None)
        count = height * width
        self._budget.take("a texture of several pictures", memory=4 * count, work=STEPS_A_PIXEL * count)
        result = np.full((height, width, 4), 255, np.uint8)
        for target, source in enumerate(order):
            picture, channel = layers[source] if source >= 0 else (None, 0)
            if picture is not None:
                image = Image.fromarray(np.ascontiguousarray(picture[..., channel]))
                result[..., target] = np.asarray(image.resize((width, height)))
        return result
