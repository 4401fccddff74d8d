"""What can be drawn, and what a graphics adapter can draw at once."""

from __future__ import annotations

import math

import numpy as np

from ispm.errors import SceneError, SettingsError
from ispm.gpu import Gpu
from ispm.optics.records import MATERIAL_DOUBLE_SIDED, NO_HIT, RECEIVER
from ispm.renderer.one_pass import Pass
from ispm.scene.mesh import Mesh
from ispm.scene.packed import Geometry
from ispm.scene.scene import Scene
from ispm.settings import Settings

_SOME = 4096  # triangles looked at together
_LOOKS = 16  # rays across a picture, and down it, that look for what it does not show
_MIN_WIDTH = 1e-7  # of a triangle's longest side: its width where float32 rounds it from nothing


def require_drawable(settings: Settings, gpu: Gpu) -> None:
    """Raise SettingsError for a picture that is too large for the adapter."""
    width, height = settings.size
    if max(settings.size) > gpu.max_texture:
        raise SettingsError(
            f"size: {width}x{height} is larger than {gpu.name} can draw, {gpu.max_texture} pixels a side"
        )
    receivers = math.prod(-(-side // settings.subsampling) for side in settings.size)
    if receivers * RECEIVER.itemsize > gpu.max_binding:
        raise SettingsError(
            f"size: {width}x{height} at subsampling {settings.subsampling} needs more memory at once than "
            f"{gpu.name} can bind; use a larger subsampling or a smaller size"
        )


def require_scene(scene: object) -> Scene:
    """Return `scene`. Raises SceneError where it is none."""
    if isinstance(scene, Scene):
        return scene
    raise SceneError(f"a Renderer takes a Scene, not a {type(scene).__name__}; see ispm.load")


def way_to_see(this: Pass) -> str:
    """Return what to do where a picture shows no surface: its rays may meet the backs of some."""
    width, height = this.view.size
    across, down = (np.arange(_LOOKS) + 0.5) / _LOOKS * width, (np.arange(_LOOKS) + 0.5) / _LOOKS * height
    rays = (a.reshape(-1, 3).astype(np.float32) for a in this.view.rays_through(across, down[:, None]))
    hits = this.world.trace(*rays)
    met = hits["instance"][hits["instance"] != NO_HIT]
    flags = this.packed.materials["flags"][this.packed.instances["material"][met]]
    if len(met) and not (flags & MATERIAL_DOUBLE_SIDED).any():
        return "what is before it shows its back, which is not drawn: go round it, or set double_sided"
    return "turn it, or move it"


def without_area(geometry: Geometry, before: Geometry | None = None) -> str:
    """Return a line about meshes all of whose triangles are lines or points; else an empty one.

    before  an earlier one, of whose meshes that was asked
    """
    known = set(map(id, before.ranges)) if before else set()
    found = [piece for piece in geometry.ranges if id(piece) not in known and _is_flat(piece.mesh)]
    if not found:
        return ""
    count, more = sum(piece.triangle_count for piece in found), len(found) - 1
    others = f" and {more:,} other{'s' * (more > 1)}" * bool(more)
    return (
        f"mesh '{found[0].mesh.name}'{others}: of {count:,} triangles, none has an area, so they show nothing"
    )


def _is_flat(mesh: Mesh) -> bool:
    """Whether no triangle is wider than its corners are rounded; mostly the first ones tell."""
    for begin in range(0, len(mesh.triangles), _SOME):
        corners = mesh.positions[mesh.triangles[begin : begin + _SOME]].astype(np.float64)
        edges = corners - np.roll(corners, 1, axis=1)
        areas = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
        if (areas > _MIN_WIDTH * np.square(edges).sum(axis=-1).max(axis=-1)).any():
            return False
    return True
