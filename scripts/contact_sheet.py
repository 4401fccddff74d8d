"""Render many scenes, to be looked at: a picture of each, and all of them small on sheets."""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from PIL import Image

import ispm
from ispm.film.sheet import contact_sheet
from ispm.io.load import READERS
from ispm.io.named import open_named
from ispm.library.builtin import BUILTINS

_SIZE = "320x240"


def main(arguments: Sequence[str] | None = None) -> int:
    """Render what the arguments name; return 1 where a scene could not be rendered."""
    example = "Example: %(prog)s --builtins models/ room.glb -o looks --set size=640x360 --set light=sky"
    parser = argparse.ArgumentParser(description=__doc__, epilog=example)
    parser.add_argument("scenes", nargs="*", help="files, folders of them, or names of built-in scenes")
    parser.add_argument("--builtins", action="store_true", help="all built-in scenes, before the others")
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("out/contact"), metavar="FOLDER", help="for the pictures"
    )
    parser.add_argument("--columns", type=int, default=4, help="pictures beside each other on a sheet")
    parser.add_argument("--rows", type=int, default=3, help="pictures below each other on a sheet")
    parser.add_argument("--width", type=int, default=320, help="pixels across of each of them")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help=f"a setting, as size=640x360; default {_SIZE}",
    )
    parser.add_argument(
        "--up", choices=["y", "z"], help="which way is up in meshes that do not say; default y"
    )
    given = parser.parse_args(arguments)
    if min(given.columns, given.rows, given.width) < 1:
        parser.error("--columns, --rows and --width must be 1 or more")
    try:
        settings = ispm.Settings(size=_SIZE).replace(**dict(word.partition("=")[::2] for word in given.set))
    except ispm.SettingsError as error:
        parser.error(str(error))
    names = [*(BUILTINS if given.builtins else ()), *(each for name in given.scenes for each in _files(name))]
    if not names:
        parser.error("no scenes were named; give files, folders of some, or --builtins")
    given.output.mkdir(parents=True, exist_ok=True)
    shown = list(_pictures(names, settings, given.output, {"up": given.up} if given.up else {}))
    page = given.columns * given.rows
    for first in range(0, len(shown), page):
        path = given.output / ("sheet.png" if len(shown) <= page else f"sheet-{first // page + 1}.png")
        contact_sheet(shown[first : first + page], given.columns, given.width).save(path)
        print(path)
    return min(len(names) - len(shown), 1)


def _files(name: str) -> list[str]:
    """The scene files in a folder and those below, in order; else what was named."""
    if not Path(name).is_dir():
        return [name]
    return sorted(str(path) for path in Path(name).rglob("*") if path.suffix.lower() in READERS)


def _titles(names: Sequence[str]) -> list[str]:
    """What each is called on the sheet: a file by its name, more fully where others are called so too."""
    stems = [Path(name).stem for name in names]
    met = Counter(stems)
    whole = (re.sub(r"[^\w.]+", "-", name).strip("-.") for name in names)
    return [stem if met[stem] == 1 else full for stem, full in zip(stems, whole, strict=True)]


def _pictures(
    names: Sequence[str], settings: ispm.Settings, folder: Path, options: dict[str, str]
) -> Iterator[tuple[str, Image.Image]]:
    """Render scene by scene, loaded with these options; yield each that could be, with its name."""
    for name, title in zip(names, _titles(names), strict=True):
        started = time.perf_counter()
        try:
            frame = ispm.render(open_named(name, **options), settings)
        except ispm.IspmError as error:
            print(f"{name}: {error}", file=sys.stderr)
            continue
        path = frame.save(folder / f"{title}.png")
        print(f"{path}  {time.perf_counter() - started:.1f} s, exposure {frame.exposure:.2f}", flush=True)
        yield title, Image.fromarray(frame.image).convert("RGB")


if __name__ == "__main__":
    sys.exit(main())
