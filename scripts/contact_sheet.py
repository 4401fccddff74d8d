"""Render many scenes, to be looked at: a picture of each, and all of them small on one sheet."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from PIL import Image, ImageDraw

import ispm
from ispm.io.named import open_named
from ispm.library.builtin import BUILTINS

_LINE = 14  # pixels of a caption


def main(arguments: Sequence[str] | None = None) -> int:
    """Render what the arguments name; return 1 where a scene could not be rendered."""
    example = "Example: %(prog)s --builtins room.glb -o looks --set size=640x360"
    parser = argparse.ArgumentParser(description=__doc__, epilog=example)
    parser.add_argument("scenes", nargs="*", help="files, or names of built-in scenes")
    parser.add_argument("--builtins", action="store_true", help="all built-in scenes, before the others")
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("out/contact"), metavar="FOLDER", help="for the pictures"
    )
    parser.add_argument("--columns", type=int, default=5, help="pictures beside each other on the sheet")
    parser.add_argument("--width", type=int, default=320, help="pixels across of each of them")
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE", help="a setting, as size=640x360"
    )
    given = parser.parse_args(arguments)
    if min(given.columns, given.width) < 1:
        parser.error("--columns and --width must be 1 or more")
    try:
        settings = ispm.Settings().replace(**dict(word.partition("=")[::2] for word in given.set))
    except ispm.SettingsError as error:
        parser.error(str(error))
    names = [*(BUILTINS if given.builtins else ()), *given.scenes]
    if not names:
        parser.error("no scenes were named; give files, or --builtins")
    given.output.mkdir(parents=True, exist_ok=True)
    shown = list(_pictures(names, settings, given.output))
    if shown:
        sheet = contact_sheet(shown, given.columns, given.width)
        sheet.save(given.output / "sheet.png")
        print(given.output / "sheet.png")
    return min(len(names) - len(shown), 1)


def _pictures(
    names: Sequence[str], settings: ispm.Settings, folder: Path
) -> Iterator[tuple[str, Image.Image]]:
    """Render scene by scene; yield each that could be, with its name."""
    for name in names:
        title = Path(name).stem
        started = time.perf_counter()
        try:
            frame = ispm.render(open_named(name), settings)
        except ispm.IspmError as error:
            print(f"{name}: {error}", file=sys.stderr)
            continue
        path = frame.save(folder / f"{title}.png")
        print(f"{path}  {time.perf_counter() - started:.1f} s, exposure {frame.exposure:.2f}", flush=True)
        yield title, Image.fromarray(frame.image).convert("RGB")


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


if __name__ == "__main__":
    sys.exit(main())
