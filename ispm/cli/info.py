"""`ispm info`: what is in a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from ispm.cli.console import Console
from ispm.cli.options import command, limits_from
from ispm.cli.scene import open_scene
from ispm.settings import LoadLimits

if TYPE_CHECKING:
    from ispm.scene.material import Material
    from ispm.scene.scene import Scene


@command(LoadLimits)
def info(
    console: Console,
    scene: str,
    /,
    *,
    config: Annotated[str | None, Parameter(help="limits as TOML", metavar="FILE.toml")] = None,
    **given: Any,
) -> None:
    """Say what a scene holds.

    Example: ispm info room.glb

    SCENE is a file (.glb .gltf) or the name of a built-in scene.
    """
    contents = summary(open_scene(console, scene, limits_from(given, config)))
    console.table(scene, list(contents.items()))
    console.result(contents)


def summary(scene: Scene) -> dict[str, Any]:
    """Return counts, names and bounds (metres, world space) of a scene."""
    parts = [part for node in scene.nodes for part in node.parts]
    low, high = _bounds(scene)
    return {
        "triangles": scene.triangle_count,
        "meshes": len({id(part.mesh) for part in parts}),
        "instances": len(parts),
        "materials": len(scene.materials),
        "textures": len({id(t) for m in scene.materials for t in _textures(m)}),
        "lights": [node.name or f"light {i}" for i, node in enumerate(scene.lights)],
        "cameras": [node.name or f"camera {i}" for i, node in enumerate(scene.cameras)],
        "animations": [a.name or f"animation {i}" for i, a in enumerate(scene.animations)],
        "extensions_used": list(scene.extensions_used),
        "extensions_honoured": list(scene.extensions_honoured),
        "bounds_low": low,
        "bounds_high": high,
        "warnings": list(scene.warnings),
    }


def _textures(material: Material) -> list[Any]:
    from ispm.scene.material import TextureUse

    return [value.texture for value in vars(material).values() if isinstance(value, TextureUse)]


def _bounds(scene: Scene) -> tuple[list[float], list[float]]:
    """The corners of the box round all meshes as placed; empty where there are none."""
    import numpy as np

    corners = []
    for node, world in scene.placed():
        for part in node.parts:
            if len(part.mesh.positions):
                placed = part.mesh.positions @ world[:3, :3].T + world[:3, 3]
                corners += [placed.min(axis=0), placed.max(axis=0)]
    if not corners:
        return [], []
    return np.min(corners, axis=0).tolist(), np.max(corners, axis=0).tolist()
