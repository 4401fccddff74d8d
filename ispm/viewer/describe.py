"""What panels show, as JSON: the scene's tree, what is selected, settings, time line, history."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ispm.optics.vector import LUMINANCE
from ispm.renderer.light_paths import LightPaths
from ispm.scene.light import DirectionalLight
from ispm.scene.node import Node
from ispm.settings import VIEWS, Settings
from ispm.viewer import fields
from ispm.viewer.command import command_of
from ispm.viewer.orbit import AXES
from ispm.viewer.session import Picture, Session

_MOST_ROWS = 3000  # of the tree
_MOST_LIGHTS = 64  # drawn into the picture
_MOST_PARTS = 8  # whose materials are shown
_STAGES = ("direct", "bounce_map", "copy", "trace", "radiance", "upsample", "compose")


def describe(session: Session) -> dict[str, dict[str, Any]]:
    """Return all that panels show, by panel; canvases need what changed alone."""
    return {
        "scene": session.once("rows", lambda: _scene(session)),
        "selection": _selection(session),
        "settings": _settings(session),
        "time": _time(session),
        "inspected": _inspected(session.inspected),
        "history": {
            "undo": session.history.undos[-1].label if session.history.undos else "",
            "redo": session.history.redos[-1].label if session.history.redos else "",
        },
        "about": {
            "line": session.line,
            "command": command_of(session),
            "view": session.view,
            "up": session.orbit.up,
            "size": list(session.settings.size),
        },
    }


def header(session: Session, picture: Picture, fps: float) -> dict[str, Any]:
    """Return what goes with a picture: its camera, handles in it, and what it cost."""
    stats = picture.frame.stats
    height, width = picture.image.shape[:2]
    return {
        "number": picture.number,
        "size": [width, height],
        "full": list(session.settings.size),
        "still": picture.still,
        "clip": [round(float(v), 9) for v in np.asarray(picture.frame.camera["clip_from_world"]).ravel()],
        "lights": session.once("lights", lambda: _lights(session), session.selected),
        "handle": session.once("handle", lambda: _handle(session), session.selected),
        "time": session.timeline.time,
        "stats": {
            "fps": round(fps, 2),
            "ms": round(stats.total_ms, 1),
            "stages": {name: round(getattr(stats, f"{name}_ms"), 2) for name in _STAGES},
            "photons": stats.stored_photons,
            "emitted": stats.emitted_photons,
            "passes": stats.passes,
            "error": None if math.isnan(stats.error) else round(stats.error, 4),
            "exposure": round(picture.frame.exposure, 2),
            "adapter": stats.adapter,
        },
    }


def _scene(session: Session) -> dict[str, Any]:
    tree = session.scene.tree()
    rows: list[list[Any]] = []
    depths: list[int] = []
    for node, parent in zip(tree.nodes, tree.parents, strict=True):
        depths.append(0 if parent < 0 else depths[parent] + 1)
        if len(rows) < _MOST_ROWS:
            rows.append(
                [session.numbering.of(node), node.name, _kind(node), depths[-1], node in session.hidden.nodes]
            )
    cameras = [node.name or f"camera {k}" for k, node in enumerate(session.scene.cameras)]
    return {
        "name": session.scene.name,
        "source": session.source,
        "rows": rows,
        "more": len(tree.nodes) - len(rows),
        "cameras": cameras,
        "triangles": session.scene.triangle_count,
    }


def _kind(node: Node) -> str:
    if node.light is not None:
        return "light"
    if node.camera is not None:
        return "camera"
    return "object" if node.parts else "group"


def _selection(session: Session) -> dict[str, Any]:
    node = session.selected
    if node is None:
        return {"node": None, "groups": []}
    own = fields.node_fields(node, node in session.hidden.nodes)
    groups: list[dict[str, Any]] = [dict(title="object", what="node", part=0, fields=own)]
    if node.light is not None:
        groups.append(dict(title="light", what="light", part=0, fields=fields.light_fields(node.light)))
    for part, each in enumerate(node.parts[:_MOST_PARTS]):
        title = f"material {each.material.name}".strip()
        groups.append(
            dict(title=title, what="material", part=part, fields=fields.material_fields(each.material))
        )
    kind = _kind(node)
    return {"node": session.numbering.of(node), "kind": kind, "name": node.name, "groups": groups}


def _settings(session: Session) -> dict[str, Any]:
    initial = Settings().replace(preset=session.settings.preset)
    return {
        "fields": fields.settings_fields(session.settings),
        "defaults": {f["name"]: f["value"] for f in fields.settings_fields(initial)},
        "views": list(VIEWS),
        "axes": list(AXES),
    }


def _time(session: Session) -> dict[str, Any]:
    line = session.timeline
    return {
        "animations": [[a.name, a.duration] for a in session.scene.animations],
        "animation": line.animation or "",
        "duration": line.duration,
        "playing": line.playing,
        "speed": line.speed,
    }


def _inspected(found: LightPaths | None) -> dict[str, Any]:
    """The photons at a point: each with its places, m, its flux there, lm, and the light it brings, lx; flux
    and light by their luminance."""
    if found is None:
        return {"point": None, "paths": []}
    weights = np.array(LUMINANCE)
    return {
        "point": _rounded(found.position),
        "light": _short(found.irradiance @ weights),
        "photons": found.photons,
        "paths": [
            {
                "bounce": path.bounce,
                "light": _short(path.irradiance @ weights),
                "flux": [_short(flux) for flux in path.flux @ weights],
                "places": [_rounded(place) for place in path.positions],
                "events": list(path.events),
            }
            for path in found.paths
        ],
    }


def _lights(session: Session) -> list[list[Any]]:
    """Number, place in the world and kind of the lights that have a place."""
    found: list[list[Any]] = []
    scene = session.scene
    tree = session.shown().tree()
    for index, node in enumerate(scene.nodes):
        if node.light is None or len(found) >= _MOST_LIGHTS:
            continue
        kind = fields.KINDS[type(node.light)]
        place = tree.world(index)[:3, 3]
        if not isinstance(node.light, DirectionalLight) or node is session.selected:
            found.append([session.numbering.of(node), *_rounded(place), kind])
    return found


def _handle(session: Session) -> dict[str, Any] | None:
    """Where the selected node can be dragged: its number, the middle of it, and from its origin to there."""
    node = session.selected
    if node is None or node not in session.scene:
        return None
    nodes = session.scene.nodes
    index = next(k for k, each in enumerate(nodes) if each is node)
    place = session.shown().tree().world(index)[:3, 3]
    offset = np.zeros(3)
    if node.light is None and node.camera is None:
        offset = session.bounds_of(node).mean(axis=0) - session.scene.world_matrix(node)[:3, 3]
    return {
        "node": session.numbering.of(node),
        "place": _rounded(place + offset),
        "offset": _rounded(offset),
    }


def _short(value: float) -> float:
    return float(f"{value:.4g}")


def _rounded(point: np.ndarray) -> list[float]:
    return [float(f"{v:.7g}") for v in point]
