"""Files that canvases save and open: the edited scene, the picture, scenes that are dropped on them."""

from __future__ import annotations

import tempfile
from pathlib import Path

from ispm.errors import SceneError
from ispm.scene.scene import Scene
from ispm.viewer.pictures import encoded
from ispm.viewer.session import Session

MOST_UPLOADED = 64 << 20  # bytes of a file that is dropped on a canvas


def saved(session: Session) -> bytes:
    """Return the scene, as it was edited, as a .glb."""
    from ispm.io.save import save

    with tempfile.TemporaryDirectory(prefix="ispm-") as folder:
        return save(session.scene, Path(folder) / "scene.glb").read_bytes()


def screenshot(session: Session) -> bytes:
    """Return the picture as a PNG. Raises SceneError where there is none yet."""
    if session.picture is None:
        raise SceneError("there is no picture yet")
    return encoded(session.picture.image, moving=False, lossless=True)[1]


def ending_of(name: str) -> str:
    """Return the ending of a scene file's name, in small letters. Raises SceneError where none reads it."""
    from ispm.io.load import READERS

    ending = Path(name).suffix.lower()
    if ending not in READERS:
        raise SceneError(f"{name[:80]}: is none of {' '.join(READERS)}")
    return ending


def loaded(path: Path, name: str) -> Scene:
    """Return the scene in a file, called `name` where it does not say how. Raises SceneError."""
    from ispm.io.load import load

    scene = load(path, max_file_bytes=MOST_UPLOADED)
    if scene.name == path.stem:
        scene.name = name
    return scene


def dropped(data: bytes, name: str) -> Scene:
    """Return the scene in the bytes of a file of that name. Raises SceneError."""
    if len(data) > MOST_UPLOADED:
        raise SceneError(f"{name[:80]}: is larger than {MOST_UPLOADED >> 20} MiB")
    with tempfile.TemporaryDirectory(prefix="ispm-") as folder:
        path = Path(folder) / f"scene{ending_of(name)}"
        path.write_bytes(data)
        return loaded(path, Path(name).stem)
