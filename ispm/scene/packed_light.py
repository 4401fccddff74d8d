"""A scene's lights without a surface as the records that kernels and shaders read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ispm.optics import records
from ispm.scene.layout import Layout
from ispm.scene.light import DirectionalLight, PointLight, PunctualLight, SpotLight, light_called
from ispm.scene.values import frozen

_KINDS = {
    PointLight: records.LIGHT_POINT,
    SpotLight: records.LIGHT_SPOT,
    DirectionalLight: records.LIGHT_DIRECTIONAL,
}


@dataclass(frozen=True, eq=False)
class Lit:
    """A scene's lights.

    rows     (L,) LIGHT;  made_of  what they were made of, to be compared
    still    the rows of the first pass; those of others have a sun elsewhere on its disc
    """

    rows: np.ndarray
    made_of: list[object]
    still: np.ndarray


NO_LIGHTS = Lit(np.zeros(0, records.LIGHT), [], np.zeros(0, records.LIGHT))


def pack_lights(layout: Layout, worlds: np.ndarray, before: Lit | None = None) -> Lit:
    """Return a scene's lights: `before` itself if they are as then.

    worlds  (n, 4, 4) float64 node-to-world matrices
    Raises SceneError for a value out of range.
    """
    nodes = [(layout.nodes[index], worlds[index]) for index in layout.lights]
    # Each is asked once: another thread may take it away at any time.
    lights = [(light, node.name, at) for node, at in nodes if isinstance(light := node.light, PunctualLight)]
    made_of: list[object] = [(type(light), *frozen(light), name, at.tobytes()) for light, name, at in lights]
    if before is not None and made_of == before.made_of:
        return before
    rows = [
        light_record(light, at, light_called(light, name, number))
        for number, (light, name, at) in enumerate(lights)
    ]
    packed = np.array(rows, records.LIGHT)
    return Lit(packed, made_of, packed)


def light_record(light: PunctualLight, world: np.ndarray, called: str) -> np.ndarray:
    """Return a light as a LIGHT.

    world   (4, 4) from object to world space
    called  in messages
    Raises SceneError where it cannot be.
    """
    light.check(called)
    row = np.zeros((), records.LIGHT)
    row["position"] = world[:3, 3]
    row["kind"] = _KINDS[type(light)]
    row["intensity"] = light.intensity
    along = -world[:3, 2] / max(float(np.linalg.norm(world[:3, 2])), 1e-30)
    row["direction"], row["cone_offset"] = along, 1.0
    if isinstance(light, DirectionalLight):
        return row
    row["range"] = light.range if np.isfinite(light.range) else 0.0
    if isinstance(light, SpotLight):
        row["cone_scale"], row["cone_offset"] = light.falloff
    return row
