"""What the panels show of settings, nodes, lights and materials, and how a field is given a value.

A field is a dict that canvases draw as they can: `name`, `label`, `kind` (number, vector, color, switch,
choice, text), `value`, and where they apply `least`, `most`, `unit`, `help`, `choices`, `words`.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from ispm.errors import SceneError, SettingsError
from ispm.scene.light import (
    DirectionalLight,
    DiskLight,
    Light,
    PointLight,
    RectLight,
    SpotLight,
    SurfaceLight,
)
from ispm.scene.material import RANGES, AlphaMode, Material
from ispm.scene.node import Node
from ispm.settings import Settings
from ispm.viewer import actions
from ispm.viewer.edits import Assign, Edit

Field = dict[str, Any]

KINDS = {made: kind for kind, made in actions.LIGHTS.items()}
NOT_LIVE = ("size", "passes", "time_limit", "target_error")
"""Settings that are not shown: canvases say how large pictures are, the viewer how many passes."""
MOST = {"photons": 1_000_000, "gather": 64, "shadow_resolution": 4096}
"""What a viewer grants of settings at most, so that no one asks it for hours."""

_ANGLES = ("inner_angle", "outer_angle")
_COLORS = ("base_color", "specular_color", "attenuation_color", "sheen_color", "diffuse_transmission_color")


def settings_fields(settings: Settings) -> list[Field]:
    """Return the fields of all settings that canvases may change, from their one definition."""
    return [
        _knob(f, getattr(settings, f.name)) for f in dataclasses.fields(settings) if f.name not in NOT_LIVE
    ]


def _knob(f: dataclasses.Field[Any], value: Any) -> Field:
    about = f.metadata
    made: Field = dict(name=f.name, label=f.name.replace("_", " "), help=about["help"], unit=about["unit"])
    if about["choices"]:
        return {**made, "kind": "choice", "choices": list(about["choices"]), "value": value}
    if isinstance(f.default, bool):
        return {**made, "kind": "switch", "value": value}
    least, most = about["within"]
    made |= dict(least=least, most=min(most, MOST.get(f.name, most)), words=list(about["words"]))
    made |= dict(whole=about["whole"] or isinstance(f.default, int))
    if isinstance(f.default, tuple):
        return {**made, "kind": "vector", "value": list(value) if isinstance(value, tuple) else value}
    return {**made, "kind": "number", "value": value}


def granted(settings: Settings) -> None:
    """Raise SettingsError for settings that ask for more than a viewer grants."""
    for name, most in MOST.items():
        value = getattr(settings, name)
        if not isinstance(value, str) and value > most:
            raise SettingsError(f"{name}: {value:,} is more than {most:,}, the most that a viewer grants")


def node_fields(node: Node, hidden: bool) -> list[Field]:
    """Return what can be changed of a node itself."""
    made = [
        _field("name", "text", node.name),
        _field("hidden", "switch", hidden),
        _field("translation", "vector", _plain(actions.translation_of(node)), label="position", unit="m"),
        _field("rotation", "vector", _plain(actions.angles_of(node)), unit="°"),
    ]
    if node.light is None or isinstance(node.light, SurfaceLight):
        made.append(_field("scale", "vector", _plain(actions.scale_of(node))))
    return made


def light_fields(light: Light) -> list[Field]:
    """Return what can be changed of a light."""
    color, strength = _split(light.intensity)
    unit = "lx" if isinstance(light, DirectionalLight) else "cd"
    about = dict(unit="cd/m²" if isinstance(light, SurfaceLight) else unit, scale="log")
    made = [
        _field("kind", "choice", KINDS[type(light)], choices=list(actions.LIGHTS)),
        _field("color", "color", color),
        _field("strength", "number", strength, label="intensity", least=0.0, most=1e12, **about),
    ]
    if isinstance(light, SpotLight):
        for name in _ANGLES:
            degrees = round(math.degrees(getattr(light, name)), 4)
            made.append(_field(name, "number", degrees, least=0.0, most=90.0, unit="°"))
    if isinstance(light, PointLight | SpotLight):
        made.append(_field("range", "number", _finite(light.range), least=0.0, unit="m"))
    for name in _sizes(light):
        made.append(_field(name, "number", float(getattr(light, name)), least=0.0, unit="m"))
    if isinstance(light, RectLight | DiskLight):
        made.append(_field("two_sided", "switch", light.shines_both_ways))
    return made


def _sizes(light: Light) -> tuple[str, ...]:
    """The fields that say how large a light is."""
    if isinstance(light, SurfaceLight):
        return light.SIZES
    return ("radius",) if isinstance(light, PointLight | SpotLight) else ()


def _field(name: str, kind: str, value: Any, *, label: str = "", **about: Any) -> Field:
    return {"name": name, "label": label or name.replace("_", " "), "kind": kind, "value": value, **about}


def material_fields(material: Material) -> list[Field]:
    """Return what can be changed of a material, as glTF has it."""
    made: list[Field] = []
    for name, (least, most, *counts) in RANGES.items():
        value = getattr(material, name)
        about: Field = dict(least=least, most=_finite(most))
        if name == "base_color":
            made.append(_field(name, "color", _plain(value[:3])))
            made.append(_field("opacity", "number", float(value[3]) if len(value) > 3 else 1.0, **about))
        elif name in _COLORS and most <= 1.0:
            made.append(_field(name, "color", _plain(value)))
        elif counts:
            made.append(_field(name, "vector", _plain(value), **about))
        elif isinstance(most, bool):
            made.append(_field(name, "switch", bool(value)))
        else:
            made.append(_field(name, "number", _finite(value), **about))
    modes = [mode.name.lower() for mode in AlphaMode]
    made.append(_field("alpha_mode", "choice", material.alpha_mode.name.lower(), choices=modes))
    return made


def node_edit(node: Node, field: str, value: Any, gesture: object) -> Edit:
    """Return the edit that gives a node's own field a value. Raises SceneError where it cannot."""
    if field == "name":
        return Edit("rename", (Assign(node, "name", _text(value)),), gesture)
    numbers = three(field, value)
    if field == "translation":
        return Edit(f"move {node.name or 'a node'}", actions.placed(node, np.array(numbers)), gesture)
    if field == "rotation":
        return actions.turn(node, numbers, gesture)
    if field == "scale":
        return actions.scale(node, numbers, gesture)
    raise SceneError(f"a node has no field '{field}'")


def light_edit(node: Node, field: str, value: Any, distance: float, gesture: object) -> Edit:
    """Return the edit that gives a field of a node's light a value.

    distance  m, at which it stays as bright where it becomes a light of another kind
    Raises SceneError where it cannot.
    """
    light = node.light
    if light is None:
        raise SceneError(f"node '{node.name}' has no light")
    if field == "kind":
        if value not in actions.LIGHTS:
            raise SceneError(f"a light's kind is one of {', '.join(actions.LIGHTS)}")
        return actions.as_kind(node, str(value), distance)
    color, strength = _split(light.intensity)
    given: Any
    if field == "color":
        given, field = tuple(strength * c for c in _color(field, value)), "intensity"
    elif field == "strength":
        strength, field = _number(field, value), "intensity"
        given = tuple(strength * c for c in color)
    elif field in _ANGLES and isinstance(light, SpotLight):
        given = math.radians(_number(field, value))
    elif field == "range" and isinstance(light, PointLight | SpotLight):
        given = math.inf if value == "" else _number(field, value)
    elif field in _sizes(light):
        given = _number(field, value)
    elif field == "two_sided" and hasattr(light, field):
        given = bool(value)
    else:
        raise SceneError(f"a {KINDS[type(light)]} light has no field '{field}'")
    made = dataclasses.replace(light, **{field: given})  # checked as it is made
    return Edit(f"{field} of {node.name or 'a light'}", (Assign(node, "light", made),), gesture)


def material_edit(material: Material, field: str, value: Any, gesture: object) -> Edit:
    """Return the edit that gives a field of a material a value. Raises SceneError where it cannot."""
    shown = {f["name"]: f for f in material_fields(material)}
    if field not in shown:
        raise SceneError(f"a material has no field '{field}'")
    before, kind = material.base_color, shown[field]["kind"]
    name, given = field, value
    if field == "opacity":
        name, given = "base_color", (*before[:3], _number(field, value))
    elif field == "base_color":
        given = (*_color(field, value), *before[3:])
    elif field == "alpha_mode":
        if value not in shown[field]["choices"]:
            raise SceneError(f"alpha mode: '{value}' is not one of {', '.join(shown[field]['choices'])}")
        given = AlphaMode[str(value).upper()]
    elif kind in ("color", "vector"):
        given = three(field, value)
    elif kind == "switch":
        given = bool(value)
    else:
        given = math.inf if value == "" else _number(field, value)
    label = f"{field.replace('_', ' ')} of {material.name or 'a material'}"
    return Edit(label, (Assign(material, name, given),), gesture)


def _split(intensity: tuple[float, float, float]) -> tuple[list[float], float]:
    """A color whose largest channel is 1, and the strength."""
    strength = max(float(v) for v in intensity)
    return ([float(v) / strength for v in intensity] if strength > 0.0 else [1.0] * 3), strength


def _plain(values: Any) -> list[float]:
    return [round(float(v), 7) + 0.0 for v in values]


def _finite(value: float) -> float | None:
    """None stands for infinite, which JSON cannot say."""
    return float(value) if math.isfinite(value) else None


def _text(value: Any) -> str:
    if not isinstance(value, str) or not value.isprintable():
        raise SceneError("name: must be a line of text")
    return value


def _number(field: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise SceneError(f"{field}: must be a number")
    return float(value)


def three(field: str, value: Any) -> tuple[float, float, float]:
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        raise SceneError(f"{field}: must be three numbers")
    x, y, z = (_number(field, each) for each in value)
    return x, y, z


def _color(field: str, value: Any) -> tuple[float, float, float]:
    color = three(field, value)
    if not all(0.0 <= c <= 1.0 for c in color):
        raise SceneError(f"{field}: must be three numbers of 0 to 1")
    return color
