"""What a picture is made of: passes of one are never taken for another's, and what differs is said."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

from ispm.optics.texture import TextureTable
from ispm.scene.packed import Packed
from ispm.settings import Settings
from ispm.stages.camera import CameraView

_FREE = ("passes", "time_limit", "target_error", "exposure", "tonemap", "preset")  # may differ when resumed
_KNOBS = tuple(f.name for f in dataclasses.fields(Settings) if f.name not in _FREE)
_CAMERA = ("pose", "yfov", "ymag", "aspect", "principal")
_SCENE = ("meshes", "places of nodes", "materials", "textures", "lights", "environment")
_PARTS = {"settings": _KNOBS, "camera": _CAMERA, "scene": _SCENE}


@dataclass(frozen=True)
class MadeOf:
    """All that passes of one picture share.

    settings  that change the light; the others are at their defaults
    camera    its fields by name, of the kinds that JSON has
    scene     digests, by what of it they tell
    """

    settings: Settings
    camera: Mapping[str, Any]
    scene: Mapping[str, str]

    @classmethod
    def of(cls, packed: Packed, textures: TextureTable, view: CameraView, settings: Settings) -> MadeOf:
        """Return what a packed scene, seen so and with these settings, is made of."""
        tables = (
            packed.geometry.digest,
            packed.instances.tobytes(),
            packed.materials.tobytes(),
            textures.digest,
            packed.lit.still.tobytes(),
            packed.surround.digest,
        )
        camera = {name: getattr(view, name) for name in _CAMERA}
        camera |= {"pose": view.pose.tolist(), "principal": list(view.principal)}
        digests = {name: sha256(data).hexdigest() for name, data in zip(_SCENE, tables, strict=True)}
        return cls(Settings(**{name: getattr(settings, name) for name in _KNOBS}), camera, digests)

    def lit_as(self, other: MadeOf) -> bool:
        """Whether its settings are the other's but for the picture's size: light found there holds here."""
        return self.settings.replace(size=other.settings.size) == other.settings

    def to_json(self) -> dict[str, dict[str, Any]]:
        """Return what `from_json` reads, of the kinds that JSON has."""
        knobs = {name: getattr(self.settings, name) for name in _KNOBS}
        return {"settings": knobs, "camera": dict(self.camera), "scene": dict(self.scene)}

    @classmethod
    def from_json(cls, value: Any) -> MadeOf:
        """Return what `to_json` gave. Raises ValueError that names what is missing or no setting."""
        for part, names in _PARTS.items():
            held = value.get(part) if isinstance(value, dict) else None
            if not isinstance(held, dict) or held.keys() != set(names):
                raise ValueError(f"it does not say the {part} they were made with")
        return cls(Settings(**value["settings"]), value["camera"], value["scene"])

    def differences(self, here: MadeOf) -> list[str]:
        """Return what is not the same here, each in a few words."""
        found = []
        for name in _KNOBS:
            there, now = getattr(self.settings, name), getattr(here.settings, name)
            if there != now:
                found.append(f"{name} {_shown(name, there)} (here {_shown(name, now)})")
        seen = [name for name in _CAMERA if self.camera[name] != here.camera[name]]
        if seen:
            found.append(f"another camera ({', '.join(seen)})")
        return found + [f"other {name}" for name in _SCENE if self.scene[name] != here.scene[name]]


def _shown(name: str, value: Any) -> str:
    """A setting as users write it."""
    joint = "x" if name == "size" else ","
    return joint.join(f"{v:g}" for v in value) if isinstance(value, tuple) else str(value)
