"""Pictures of how a frame was made, with their numbers and labels drawn in."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw

# Black, violet, red, orange, pale yellow: brightness grows evenly, so the order also shows in grey.
_HEAT = np.array([(0, 0, 4), (87, 16, 110), (188, 55, 84), (249, 142, 9), (252, 255, 164)], float)
_MARGIN = 6  # pixels
_BAR_WIDTH, _BAR_HEIGHT = 128, 8  # of a scale
_CELL_WIDTH, _CELL_HEIGHT = 240, 180  # of a map in the chart of bounce maps
_TITLE = 14  # height of a line of text
_ROWS_MAX = 8
_CROSS = ((2, 1), (0, 1), (1, 0), (1, 2), (1, 1), (3, 1))  # column and row of +x, -x, +y, -y, +z, -z


def overdraw_chart(counts: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Return kernels per pixel as a heat map with its scale, (h, w, 3) uint8.

    counts  (rows, columns) kernels that cover each receiver
    size    width and height of the picture; a receiver's block of pixels is covered as it is
    """
    width, height = size
    block = max(-(-width // counts.shape[1]), 1)
    full = counts.repeat(block, axis=0).repeat(block, axis=1)[:height, :width]
    top = _round_up(float(np.percentile(counts, 98.0)))
    picture = Image.fromarray(_heat(full / top))
    draw = ImageDraw.Draw(picture)
    text = f"kernels per pixel: mean {counts.mean():.1f}, most {int(counts.max())}"
    left, base = _MARGIN, height - _MARGIN
    draw.rectangle((0, base - 36, max(_BAR_WIDTH + 48, int(draw.textlength(text)) + 16), height), fill=0)
    scale = _heat(np.tile(np.linspace(0.0, 1.0, _BAR_WIDTH), (_BAR_HEIGHT, 1)))
    picture.paste(Image.fromarray(scale), (left, base - 20))
    draw.text((left, base - 34), text, fill="white")
    for share in (0.0, 0.5, 1.0):
        draw.text((left + share * _BAR_WIDTH, base - 10), f"{share * top:g}", fill="white")
    return np.asarray(picture)


def bounce_chart(maps: Sequence[np.ndarray], names: Sequence[str], bounds: np.ndarray) -> np.ndarray:
    """Return bounce maps in a grid, (h, w, 3) uint8: a row for each, a column for each thing they hold.

    maps    (faces, W, W, 12) `first_hits` of each map's texels; the first 8 are shown
    names   of the maps
    bounds  (2, 3) corners of the scene, which positions are colored by: x red, y green, z blue
    Cubes and hemicubes are unfolded to crosses. Power is shown relative to the map's brightest texel, by its
    square root; normals and directions as color (v + 1) / 2.
    """
    rows = len(maps[:_ROWS_MAX])
    size = (_MARGIN + 4 * (_CELL_WIDTH + _MARGIN), _TITLE + rows * (_CELL_HEIGHT + _TITLE))
    picture = Image.new("RGB", size)
    draw = ImageDraw.Draw(picture)
    for column, title in enumerate(("position", "normal", "outgoing power", "outgoing direction")):
        draw.text((_MARGIN + column * (_CELL_WIDTH + _MARGIN), 1), title, fill="white")
    for row, (content, name) in enumerate(zip(maps[:_ROWS_MAX], names, strict=False)):
        top = _TITLE + row * (_CELL_HEIGHT + _TITLE)
        draw.text((_MARGIN, top + _CELL_HEIGHT + 1), name, fill="white")
        for column, colors in enumerate(_colored(content, bounds)):
            left = _MARGIN + column * (_CELL_WIDTH + _MARGIN)
            picture.paste(_fitted(_unfolded(colors)), (left, top))
    return np.asarray(picture)


def _colored(content: np.ndarray, bounds: np.ndarray) -> list[np.ndarray]:
    """The four pictures of a map, (faces, W, W, 3) uint8 each; black where nothing is."""
    position, normal, flux, direction = (content[..., k : k + 3] for k in (0, 3, 6, 9))
    place = (position - bounds[0]) / np.maximum(bounds[1] - bounds[0], 1e-30)
    power = np.sqrt(np.maximum(flux / max(float(flux.max()), 1e-30), 0.0))
    hit, alive = ((v != 0.0).any(axis=-1, keepdims=True) for v in (normal, direction))
    shares: tuple[np.ndarray, ...] = (
        hit * place,
        hit * (normal + 1.0) / 2.0,
        power,
        alive * (direction + 1.0) / 2.0,
    )
    return [np.asarray(255.0 * np.clip(share, 0.0, 1.0) + 0.5, np.uint8) for share in shares]


def _unfolded(faces: np.ndarray) -> Image.Image:
    """One face as it is, five or six as a cross about the one that looks along +z."""
    if len(faces) == 1:
        return Image.fromarray(faces[0])
    width = faces.shape[1]
    cross = Image.new("RGB", (4 * width, 3 * width))
    for face, (column, row) in zip(faces, _CROSS, strict=False):
        cross.paste(Image.fromarray(face), (column * width, row * width))
    return cross


def _fitted(picture: Image.Image) -> Image.Image:
    """The picture as large as a cell allows."""
    scale = min(_CELL_WIDTH / picture.width, _CELL_HEIGHT / picture.height)
    size = max(round(scale * picture.width), 1), max(round(scale * picture.height), 1)
    return picture.resize(size, Image.Resampling.NEAREST if scale > 1.0 else Image.Resampling.BOX)


def _round_up(value: float) -> float:
    """The next number of 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(max(value, 1.0)))
    return float(next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= value))


def _heat(share: np.ndarray) -> np.ndarray:
    """(..., 3) uint8 colors of shares in [0, 1]."""
    place = np.clip(share, 0.0, 1.0) * (len(_HEAT) - 1)
    channels = [np.interp(place, np.arange(len(_HEAT)), _HEAT[:, c]) for c in range(3)]
    return np.asarray(np.stack(channels, axis=-1) + 0.5, np.uint8)
