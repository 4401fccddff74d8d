"""Lamps with a surface in glTF, which has none: meshes that emit, and what they are in the node's `extras`.

Other programs see the mesh. `EXT_lights_area`, a draft (glTF, pull request 2525), has flat lamps alone.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import msgspec
import numpy as np

from ispm.errors import SceneError
from ispm.io.gltf_file import GltfFile
from ispm.io.gltf_record import Vec3
from ispm.scene.lamp import lamp_material, lamp_mesh
from ispm.scene.light import DiskLight, RectLight, SphereLight, SurfaceLight
from ispm.scene.mesh import Mesh
from ispm.scene.node import Part

_EXTRAS = "ispm_light"  # in the extras of nodes
_KINDS: dict[str, type[SurfaceLight]] = {"rect": RectLight, "disk": DiskLight, "sphere": SphereLight}
_NAMES = {kind: name for name, kind in _KINDS.items()}


class _Lamp(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="type"):
    """What all lamps have."""

    intensity: Vec3
    name: str = ""


class _Rect(_Lamp, frozen=True, tag="rect"):
    """Fields of RectLight."""

    width: float = 1.0
    height: float = 1.0
    two_sided: bool = False


class _Disk(_Lamp, frozen=True, tag="disk"):
    """Fields of DiskLight."""

    radius: float = 0.5
    two_sided: bool = False


class _Sphere(_Lamp, frozen=True, tag="sphere"):
    """Fields of SphereLight."""

    radius: float = 0.5


def lamp_extras(lamp: SurfaceLight) -> dict[str, Any]:
    """Return the extras of a node that holds a lamp."""
    record = {f.name: _plain(getattr(lamp, f.name)) for f in fields(lamp) if f.name != "name"}
    named = {"name": lamp.name} if lamp.name else {}
    return {_EXTRAS: {"type": _NAMES[type(lamp)], **record, **named}}


def lamp_part(lamp: SurfaceLight) -> Part:
    """Return a mesh of a lamp's size that emits as it does. Raises SceneError for a value out of range."""
    material = lamp_material(lamp)
    unit = lamp_mesh(lamp)
    positions = unit.positions.astype(np.float64) * lamp.stretch
    return Part(Mesh(positions, unit.triangles, unit.normals, name=unit.name), material)


def read_lamp(file: GltfFile, extras: Any, where: str) -> SurfaceLight | None:
    """Return the lamp that a node's extras tell of; None where there is none, or, with a note, none can be.

    where  the node, for messages
    """
    record = extras.get(_EXTRAS) if isinstance(extras, dict) else None
    if record is None:
        return None
    try:
        known = msgspec.convert(record, _Rect | _Disk | _Sphere)
        given = msgspec.structs.asdict(known)
        return _KINDS[str(record["type"])](**given)
    except (msgspec.ValidationError, SceneError) as error:
        file.notes.add(f"{where}: its {_EXTRAS} is passed over, and its mesh stays: {error}")
        return None


def _plain(value: Any) -> Any:
    """A field's value as JSON has it."""
    if isinstance(value, bool | np.bool_):
        return bool(value)
    return float(value) if np.ndim(value) == 0 else [float(v) for v in value]
