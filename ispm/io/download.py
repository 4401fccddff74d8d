"""Scenes that are downloaded at their first use: the only thing in this package that uses the network."""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path

from ispm.cache import cache_folder
from ispm.errors import SceneError

_SECONDS = 30.0  # that a server may be silent
_MAX_BYTES = 1 << 28  # bytes of a file; the largest that is known has 10 MB
_PIECE = 1 << 16


@dataclass(frozen=True)
class Download:
    """A scene of one or more files on a server.

    about     what it is, how much is downloaded, and what one may do with it
    address   of the folder that holds the files, as they were at one time
    scene     the file to load
    registry  SHA-256 of each file by name
    """

    about: str
    address: str
    scene: str
    registry: Callable[[], Mapping[str, str]]


@cache
def _sponza() -> dict[str, str]:
    lines = (files("ispm.io") / "sponza.txt").read_text("utf-8").splitlines()
    return {name: checksum for checksum, name in map(str.split, lines)}


_RAW = "https://raw.githubusercontent.com"
DOWNLOADS: dict[str, Download] = {
    "bunny": Download(
        "The Stanford bunny, 16,301 triangles; a download of 0.7 MB, not for commercial use.",
        f"{_RAW}/mikedh/trimesh/ec0cef4a74a21f78fd0a52490c036911a6df3190/models/",
        "bunny.ply",
        lambda: {"bunny.ply": "8faa052bb08cf1625eec97b6508baceee11eec9cf28f83f6a9d4547ab15d7761"},
    ),
    "sponza": Download(
        "The atrium of Sponza by Crytek, 262,267 triangles; a download of 53 MB, CRYENGINE's license.",
        f"{_RAW}/KhronosGroup/glTF-Sample-Assets/bf2bb4a81c73a7ceb53e80df3dec0105c5a3fdef/Models/Sponza/glTF/",
        "Sponza.gltf",
        _sponza,
    ),
}
"""Name to what is downloaded."""


def fetch(name: str) -> Path:
    """Return the file of a downloaded scene, from the folder ISPM_ASSETS, the cache, or the network.

    ISPM_DOWNLOADS, where it is set, is the address of a folder with a folder for each scene, to be used
    instead of the scenes' own.
    Files whose checksum is not the known one are not kept; whole files alone are.
    Raises SceneError where the files cannot be had.
    """
    wanted = DOWNLOADS[name]
    given = _given(name, wanted.scene)
    if given is not None:
        return given
    root = cache_folder()
    cure = f"put {wanted.scene} and what it needs into a folder '{name}' in the one that ISPM_ASSETS names"
    if root is None:
        raise SceneError(f"'{name}' has no cache folder to be downloaded to: set ISPM_CACHE, or {cure}")
    mirror = os.environ.get("ISPM_DOWNLOADS")
    if mirror and not mirror.lower().startswith(("http://", "https://")):
        raise SceneError(
            f"'{name}': ISPM_DOWNLOADS is '{_shown(mirror)}'; the address of a mirror begins with http:// or "
            f"https://; or {cure}"
        )
    address = f"{mirror.rstrip('/')}/{name}/" if mirror else wanted.address
    try:
        _fetch(root / "scenes" / name, address, wanted.registry())
    except (OSError, ValueError) as error:  # requests' errors are OSErrors, a wrong checksum a ValueError
        why = _reason(error)
        raise SceneError(f"'{name}' cannot be downloaded from {_shown(address)}: {why}; {cure}") from None
    return root / "scenes" / name / wanted.scene


def _reason(error: Exception) -> str:
    if not isinstance(error, OSError):
        return "a file is not the one that is known: its checksum differs, and it was not kept"
    kinds = {
        "ConnectionError": "there is no connection",
        "ConnectTimeout": "nobody answers",
        "InvalidURL": "this is no address",
    }
    return kinds.get(type(error).__name__, _shown(" ".join(str(error).split())))


def _shown(text: str) -> str:
    """`text` without names and passwords in the addresses that it holds."""
    return re.sub(r"(?<=//)\S*@", "", text)[:200]


def _given(name: str, scene: str) -> Path | None:
    """Where the user keeps the scene, if so."""
    assets = os.environ.get("ISPM_ASSETS")
    places = [Path(assets, name, scene), Path(assets, scene)] if assets else []
    return next((place for place in places if place.is_file()), None)


def _fetch(folder: Path, address: str, registry: Mapping[str, str]) -> None:
    import pooch

    pooch.get_logger().setLevel(logging.ERROR)
    shelf = pooch.create(path=folder, base_url=address, registry=dict(registry), retry_if_failed=1)
    for file in registry:
        shelf.fetch(file, downloader=_download)


def _download(url: str, output_file: str, pooch: object) -> None:
    """Write what a server sends, as pooch wants it. Raises OSError where it is too much, or not sent."""
    import requests

    with requests.get(url, stream=True, timeout=_SECONDS) as answer, open(output_file, "wb") as file:
        answer.raise_for_status()
        received = 0
        for piece in answer.iter_content(_PIECE):
            received += len(piece)
            if received > _MAX_BYTES:
                raise OSError(f"a file has more than {_MAX_BYTES:,} bytes")
            file.write(piece)
