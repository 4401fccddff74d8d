"""`ispm info`: what is in a scene."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from ispm.cli.console import Console
from ispm.cli.options import command, loading_from
from ispm.cli.scene import open_scene
from ispm.settings import LOADING

MOST_NODES = 40  # that are listed, or lights, or cameras
DEEPEST = 12  # levels that are indented
ENDINGS = (".png", ".jpg", ".jpeg", ".exr", ".npz", ".npy")

if TYPE_CHECKING:
    import numpy as np

    from ispm.scene.material import Material
    from ispm.scene.scene import Scene


@command(*LOADING)
def info(
    console: Console,
    scene: str,
    /,
    *,
    config: Annotated[str | None, Parameter(help="options as TOML", metavar="FILE.toml")] = None,
    **given: Any,
) -> None:
    """Say what a scene holds, or how a picture was made.

    Example: ispm info room.glb

    SCENE is a file (.glb .gltf .obj .ply .stl) or the name of a built-in scene, or
    a picture (.png .jpg .exr .npz .npy): its size, its channels and the command line that makes it again, or
    a file of `render --resume`: its passes and the error they leave.
    The tables go to stderr; for programs, --json prints all of it on stdout.
    """
    if Path(scene).suffix.lower() in ENDINGS:
        _tell_picture(console, scene)
        return
    world = open_scene(console, scene, loading_from(given, config))
    contents, placed = summary(world), nodes(world)
    short = {name: v[:MOST_NODES] if isinstance(v, list) else v for name, v in contents.items()}
    console.table(scene, list(short.items()))
    for name in ("lights", "cameras", "variants", "animations"):
        _tell_more(console, len(contents[name]), name)
    if not console.as_json:
        _tell_nodes(console, placed)
    console.result({**contents, "nodes": placed})


def _tell_picture(console: Console, path: str) -> None:
    from ispm.io.about import read_about

    found = read_about(path)
    made = dict(found.made)
    if "progress" in made:
        _tell_passes(console, path, f"{found.width}x{found.height}", _read(made["progress"]))
        return
    settings = _read(made.pop("settings", ""))
    command = made.pop("command", None)
    about = {"size": f"{found.width}x{found.height}", "channels": found.channels, "bits": found.bits, **made}
    console.table(path, list(about.items()))
    if not found.made:
        console.say("it does not say how it was made" + "; no .npy does" * path.lower().endswith(".npy"))
    elif command is None:
        console.table("settings", list(settings.items()))
    else:
        console.say(f"made by: {command}")
    console.result(
        {**about, "width": found.width, "height": found.height, "command": command, "settings": settings}
    )


def _tell_passes(console: Console, path: str, size: str, kept: dict[str, Any]) -> None:
    """Say what a file of --resume holds."""
    about = {
        "passes": kept.get("passes"),
        "scene": kept.get("scene"),
        "size": size,
        "error": kept.get("error"),
    }
    console.table(path, list(about.items()))
    console.say(f"it holds passes; continue them with: ispm render ... --resume {path}")
    console.result(about)


def _read(text: str) -> dict[str, Any]:
    """The words of a file as JSON; none where they are something else."""
    try:
        words = json.loads(text or "{}")
    except ValueError:
        return {}
    return words if isinstance(words, dict) else {}


def summary(scene: Scene) -> dict[str, Any]:
    """Return counts, names and bounds (metres, world space) of a scene."""
    parts = [part for node in scene.nodes for part in node.parts]
    low, high = _bounds(scene)
    return {
        "triangles": scene.triangle_count,
        "meshes": len({id(part.mesh) for part in parts}),
        "instances": sum(node.copies * len(node.parts) for node in scene.nodes),
        "materials": len(scene.materials),
        "textures": len({id(t) for m in scene.materials for t in _textures(m)}),
        "lights": [node.name or f"light {i}" for i, node in enumerate(scene.lights)],
        "environment": _environment(scene),
        "cameras": [node.name or f"camera {i}" for i, node in enumerate(scene.cameras)],
        "variants": list(scene.variants),
        "animations": [a.name or f"animation {i}" for i, a in enumerate(scene.animations)],
        "extensions_used": list(scene.extensions_used),
        "extensions_honoured": list(scene.extensions_honoured),
        "bounds_low": low,
        "bounds_high": high,
        "warnings": list(scene.warnings),
    }


def _environment(scene: Scene) -> str | None:
    """The environment's name and size; None: there is none."""
    from ispm.scene.sky import dome_of

    around = dome_of(scene.environment)
    if around is None:
        return None
    height, width = around.image.shape[:2]
    return f"{around.name or '(no name)'}, {width} x {height}"


def nodes(scene: Scene) -> list[dict[str, Any]]:
    """Return how deep each node hangs and what stands there, parents before children."""
    found = []
    stack = [(node, 0) for node in reversed(scene.roots)]
    while stack:
        node, depth = stack.pop()
        stack.extend((child, depth + 1) for child in reversed(node.children))
        meshes = [part.mesh for part in node.parts]
        found.append(
            {
                "name": node.name,
                "depth": depth,
                "parts": len(meshes),
                "triangles": sum(len(mesh.triangles) for mesh in meshes),
                "copies": node.copies,
                "light": None if node.light is None else type(node.light).__name__,
                "camera": node.camera is not None,
                "children": len(node.children),
            }
        )
    return found


def _tell_nodes(console: Console, found: list[dict[str, Any]]) -> None:
    """List the first nodes, indented below those that they hang on, and count the others."""
    rows = [
        ("· " * min(row["depth"], DEEPEST) + (row["name"] or "(no name)"), _contents(row))
        for row in found[:MOST_NODES]
    ]
    console.table("nodes", rows)
    _tell_more(console, len(found), "nodes")


def _tell_more(console: Console, count: int, what: str) -> None:
    if count > MOST_NODES:
        console.say(f"and {count - MOST_NODES:,} more {what}; --json lists all")


def _contents(row: dict[str, Any]) -> str:
    """What stands at a node, in words."""
    words = []
    if row["parts"]:
        parts = f"{row['parts']:,} parts of " if row["parts"] > 1 else ""
        words.append(f"{parts}{row['triangles']:,} triangles")
    if row["copies"] != 1:
        words.append(f"{row['copies']:,} copies")
    words += [row["light"]] * bool(row["light"]) + ["camera"] * bool(row["camera"])
    if row["children"]:
        words.append(f"{row['children']:,} {'child' if row['children'] == 1 else 'children'}")
    return ", ".join(words) or "nothing"


def _textures(material: Material) -> list[Any]:
    from ispm.scene.material import TextureUse

    return [value.texture for value in vars(material).values() if isinstance(value, TextureUse)]


def _bounds(scene: Scene) -> tuple[list[float], list[float]]:
    """The corners of the box round all meshes as placed; empty where there are none."""
    import numpy as np

    from ispm.scene.pose import shown_shapes

    corners, tree = [], scene.tree()
    for mesh, places in shown_shapes(tree.nodes, tree.worlds(), range(len(tree.nodes))):
        if len(places) == 1:
            placed = mesh.positions @ places[0, :3, :3].T + places[0, :3, 3]
        else:
            placed = _boxes(mesh.positions, places)
        corners += [placed.min(axis=0), placed.max(axis=0)]
    if not corners:
        return [], []
    return np.min(corners, axis=0).tolist(), np.max(corners, axis=0).tolist()


def _boxes(positions: np.ndarray, matrices: np.ndarray) -> np.ndarray:
    """(8 n, 3) corners of the box round (V, 3) positions, moved by (n, 4, 4) matrices."""
    from itertools import product

    import numpy as np

    ends = np.stack([positions.min(axis=0), positions.max(axis=0)])
    corners = np.array([[ends[k, i] for i, k in enumerate(pick)] for pick in product((0, 1), repeat=3)])
    placed: np.ndarray = corners @ matrices[:, :3, :3].swapaxes(1, 2) + matrices[:, None, :3, 3]
    return placed.reshape(-1, 3)
