"""A sky in glTF, which has none: what it is in the scene's `extras`, where only this program reads it."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import msgspec

from ispm.errors import SceneError
from ispm.io.gltf_file import GltfFile
from ispm.scene.sky import Sky

_EXTRAS = "ispm_sky"  # in the extras of scenes


def sky_extras(sky: Sky) -> dict[str, Any]:
    """Return the extras of a scene under a sky. Raises SceneError for a value out of range."""
    sky.check()
    record = {f.name: getattr(sky, f.name) for f in fields(sky)}
    return {_EXTRAS: {name: v if isinstance(v, bool) else float(v) for name, v in record.items()}}


def read_sky(file: GltfFile, extras: Any) -> Sky | None:
    """Return the sky that a scene's extras tell of; None where none is, or, with a note, none can be."""
    record = extras.get(_EXTRAS) if isinstance(extras, dict) else None
    if record is None:
        return None
    try:
        known: dict[str, Any] = msgspec.convert(record, dict[str, float | bool])
        return Sky(**known)
    except (msgspec.ValidationError, SceneError, TypeError) as error:
        file.notes.add(f"the scene's {_EXTRAS} is passed over: {error}")
        return None
