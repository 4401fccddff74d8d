"""Cameras of a glTF file, and what glTF has no words for: their own pose, shape and principal point."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np

from ispm.errors import SettingsError
from ispm.io.gltf_file import GltfFile
from ispm.io.gltf_record import Matrix, Vec2
from ispm.scene.camera import Camera

_NEAR, _FAR = 0.01, 1e4  # m; glTF wants them, this program finds its own


class _Own(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """What stands in a camera's `extras` under "ispm": fields of Camera."""

    pose: Matrix | None = None  # by columns, as all matrices of glTF
    aspect: float | None = None
    principal: Vec2 = (0.0, 0.0)


def camera_record(camera: Camera) -> dict[str, Any]:
    """Return a camera as glTF has it. Raises SettingsError where it makes no sense."""
    camera.check()
    aspect = None if camera.aspect is None else float(camera.aspect)
    if camera.ymag is None:
        shape: dict[str, Any] = {"yfov": float(camera.yfov), "znear": _NEAR}
        shape |= {} if aspect is None else {"aspectRatio": aspect}
        record: dict[str, Any] = {"type": "perspective", "perspective": shape}
    else:
        xmag = float(camera.ymag) * (aspect or 1.0)
        shape = {"xmag": xmag, "ymag": float(camera.ymag), "znear": 0.0, "zfar": _FAR}
        record = {"type": "orthographic", "orthographic": shape}
    pose = None if camera.pose is None else [float(x) for x in np.asarray(camera.pose).T.ravel()]
    x, y = camera.principal
    principal = float(x), float(y)
    own = msgspec.to_builtins(_Own(pose, aspect, principal))
    named = {"name": camera.name} if camera.name else {}
    return {**named, **record, **({"extras": {"ispm": own}} if own else {})}


def with_extras(camera: Camera, extras: Any, file: GltfFile, where: str) -> Camera:
    """Return `camera` with what its `extras` say of it; what makes no sense is passed over with a note."""
    own = extras.get("ispm") if isinstance(extras, dict) else None
    if own is None:
        return camera
    try:
        known = msgspec.convert(own, _Own)
        pose = None if known.pose is None else np.array(known.pose).reshape(4, 4).T.copy()
        return Camera(camera.yfov, camera.ymag, pose, known.aspect, known.principal, camera.name)
    except (msgspec.ValidationError, SettingsError) as error:
        file.notes.add(f"{where}: its extras are passed over: {error}")
        return camera
