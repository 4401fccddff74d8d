"""Contact sheets: many pictures small on one, each with a line below."""

from __future__ import annotations

from collections.abc import Sequence

from PIL import Image, ImageDraw

_LINE = 14  # pixels of a caption


def contact_sheet(pictures: Sequence[tuple[str, Image.Image]], columns: int, width: int) -> Image.Image:
    """Return named pictures, each `width` pixels across with its name below, in rows of `columns`."""
    height = max(round(width * picture.height / picture.width) for _, picture in pictures)
    columns = min(columns, len(pictures))
    rows = -(-len(pictures) // columns)
    sheet = Image.new("RGB", (columns * width, rows * (height + _LINE)), (32, 32, 32))
    draw = ImageDraw.Draw(sheet)
    for k, (name, picture) in enumerate(pictures):
        x, y = k % columns * width, k // columns * (height + _LINE)
        size = width, round(width * picture.height / picture.width)
        sheet.paste(picture.resize(size, Image.Resampling.LANCZOS), (x, y))
        draw.text((x + 3, y + height + 1), name, fill=(224, 224, 224))
    return sheet
