"""Lights of a glTF file (KHR_lights_punctual)."""

from __future__ import annotations

import math

from ispm.errors import SceneError
from ispm.io import gltf_schema as schema
from ispm.io.gltf_file import GltfFile, item
from ispm.scene.light import DirectionalLight, Light, PointLight, SpotLight
from ispm.scene.values import BRIGHTEST, LEAST

NARROWEST = 1e-3  # rad from the axis, and between the cones
RADIUS = "radius"  # in the extras of lights: Blender's exporter writes custom properties there


def read_light(file: GltfFile, index: int, node: str) -> Light | None:
    """Return a light; None, with a note, where its kind is unknown.

    node  name of the node where it stands, for messages
    Raises SceneError where the file has no such light.
    """
    record = item(file.gltf.extensions.lights.lights, index, "light")
    where = f"light '{node or record.name or index}'"
    if record.type not in ("point", "spot", "directional"):
        file.notes.add(f"{where} is left out: its type '{record.type}' is unknown")
        return None
    intensity = _intensity(file, record, where)
    if record.type == "directional":
        return DirectionalLight(intensity, record.name)
    reach, radius = _range(file, record, where), _radius(file, record, intensity, where)
    if radius > 0.0 and not math.isinf(reach):
        file.notes.add(f"{where}: its range is passed over, as it has a radius")
        reach = math.inf
    if record.type == "point":
        return PointLight(intensity, reach, record.name, radius=radius)
    return SpotLight(intensity, reach, *_cones(file, record.spot, where), record.name, radius=radius)


def _intensity(file: GltfFile, record: schema.Light, where: str) -> tuple[float, float, float]:
    given = [record.intensity * c for c in record.color]
    r, g, b = (min(max(value, 0.0), BRIGHTEST) for value in given)
    if [r, g, b] != given:
        unit = "lx" if record.type == "directional" else "cd"
        file.notes.add(f"{where}: its intensity is clamped to 0..{BRIGHTEST:g} {unit}")
    return r, g, b


def _range(file: GltfFile, record: schema.Light, where: str) -> float:
    if record.range is None or record.range >= LEAST:
        return math.inf if record.range is None else record.range
    file.notes.add(f"{where}: a range of {record.range:g} lights nothing; it counts as infinite")
    return math.inf


def _radius(file: GltfFile, record: schema.Light, intensity: tuple[float, float, float], where: str) -> float:
    """A light's `radius` in its extras, m; 0 where it has none, or, with a note, none that can be."""
    given = record.extras.get(RADIUS, 0.0) if isinstance(record.extras, dict) else 0.0
    try:
        return PointLight(intensity, radius=given).radius
    except SceneError as error:
        file.notes.add(f"{where}: its radius is passed over: {error}")
        return 0.0


def _cones(file: GltfFile, spot: schema.Spot, where: str) -> tuple[float, float]:
    """The inner and outer angle, 0 <= inner < outer <= pi / 2."""
    wanted_inner, wanted_outer = spot.inner_cone_angle, spot.outer_cone_angle
    outer = min(max(wanted_outer, NARROWEST), math.pi / 2.0)
    inner = min(max(wanted_inner, 0.0), outer - NARROWEST)
    if max(abs(inner - wanted_inner), abs(outer - wanted_outer)) > 1e-6:  # files round pi / 2
        file.notes.add(
            f"{where}: its cones of {wanted_inner:g} and {wanted_outer:g} rad break 0 <= inner < outer <= "
            f"pi / 2; {inner:.3g} and {outer:.3g} are used"
        )
    return inner, outer
