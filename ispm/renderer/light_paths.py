"""What lights a point of the last picture: the photons whose kernels hold it, and the ways that they came."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from ispm.errors import IspmError, SettingsError
from ispm.optics.records import (
    INNER,
    INSTANCE_MIRRORED,
    LIGHT_DIRECTIONAL,
    MATERIAL_HAS_INNER,
    RECEIVER,
    take,
)
from ispm.optics.vector import LUMINANCE
from ispm.photons.grid import PhotonGrid
from ispm.photons.retrace import retrace
from ispm.photons.steps import EVENTS
from ispm.photons.walk import all_steps
from ispm.renderer.gather import bright_limit, keep_all_light, series_of
from ispm.renderer.last import CHANGED, LastFrame
from ispm.renderer.one_pass import Pass
from ispm.scene.packed import to_world

_SHORT = 1e-3  # share of the way from the eye before a surface from which it is met again
MOST_PATHS = 1000


@dataclass(frozen=True, eq=False)
class PhotonPath:
    """How a photon came from its light to where it lights a point.

    positions   (n, 3) float32 m, world space: the light, all surfaces that the photon met, and last where it
                is stored. A directional light is shown as far before the first surface as the scene is large
    flux        (n, 3) float32 lm, of the photon as it arrives there; the first one is as it was emitted
    events      what happened there, n words: `light`; `diffuse`, `gloss` (of a metal), `mirror`: reflected
                so; `glass`: into a solid or out of it; `sheet`: through a thin one; `stored`
    bounce      scatters before it was stored; mirrors, clear glass and clear sheets do not count
    irradiance  (3,) float32 lx that it brings to the point
    """

    positions: np.ndarray
    flux: np.ndarray
    events: tuple[str, ...]
    bounce: int
    irradiance: np.ndarray


@dataclass(frozen=True, eq=False)
class LightPaths:
    """What the photon map brings to a point of a surface, as `Renderer.light_paths` returns it.

    position    (3,) float32 m, world space
    normal      (3,) float32, of the surface there, as it is shaded, on the eye's side
    irradiance  (3,) float32 lx, of all photons whose kernels hold the point: its indirect light
    photons     how many these are
    paths       PhotonPath of the strongest, which come first
    """

    position: np.ndarray
    normal: np.ndarray
    irradiance: np.ndarray
    photons: int
    paths: list[PhotonPath]


def light_paths(last: LastFrame, x: float, y: float, count: int) -> LightPaths | None:
    """Return what lights a pixel's surface, with the paths of at most `count` photons; None: there is none.

    x, y  pixels right and down, within the picture
    Raises SettingsError for places outside, IspmError where the scene has changed in the meantime.
    """
    width, height = last.made.view.size
    if not (0 <= x < width and 0 <= y < height):
        raise SettingsError(f"pixel {x:g}, {y:g}: is not in the picture of {width}x{height}")
    if not 0 <= count <= MOST_PATHS:
        raise SettingsError(f"count {count}: of 0 to {MOST_PATHS} photons")
    last.require_as_drawn()
    point = receiver_at(last, int(x), int(y))
    if point is None:
        return None
    rows, brought = _photons_at(last, point)
    order = np.argsort(-brought @ np.array(LUMINANCE), kind="stable")
    rows, brought = rows[order], brought[order]
    paths = _paths(last, rows[:count], brought[:count])
    total = brought.sum(axis=0, dtype=np.float64).astype(np.float32)
    return LightPaths(point["position"][0], point["n"][0], total, len(rows), paths)


def receiver_at(last: LastFrame, column: int, row: int) -> np.ndarray | None:
    """Return what a pixel's middle shows as a RECEIVER without gloss, (1,); None: nothing."""
    made, frame = last.made, last.frame
    depth = float(frame.depth[row, column])
    if not np.isfinite(depth):
        return None
    (origin,), (direction,) = made.view.rays_through(np.array([column + 0.5]), np.array([row + 0.5]))
    forward = made.view.forward
    along = (depth + (made.view.eye - origin) @ forward) / (direction @ forward)
    point = np.zeros(1, RECEIVER)
    normal = frame.normal[row, column].astype(np.float64)
    point["wo"], point["valid"] = -direction, 1
    point["position"], point["n"], point["ng"] = origin + along * direction, normal, normal
    # Where the triangle is met again its plane is exact, which kernels may be as flat as.
    start = origin + (1.0 - _SHORT) * along * direction
    start32, direction32 = np.array([start, direction], np.float32)[:, None]
    hit = made.world.trace(start32, direction32, 2.0 * _SHORT * along)[0]
    if np.isfinite(hit["t"]):
        point["position"] = start + float(hit["t"]) * direction
        ng = _face_normal(made, int(hit["instance"]), int(hit["primitive"]))
        back = ng @ direction >= 0.0
        point["ng"] = -ng if back else ng
        point["valid"] = 1 | _inner_side(made, int(hit["instance"]), bool(back))
    return point


def _face_normal(made: Pass, instance: int, primitive: int) -> np.ndarray:
    """The unit normal of a triangle, (3,) float64, world space."""
    placed = made.packed.instances[instance]
    mesh = made.packed.geometry.ranges[placed["mesh"]].mesh
    corners = mesh.positions[mesh.triangles[primitive]] @ to_world(placed)[:, :3].T.astype(np.float64)
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    return np.asarray(normal / max(float(np.linalg.norm(normal)), 1e-300))


def _inner_side(made: Pass, instance: int, back: bool) -> int:
    """INNER where a surface that lets light through shows its back, else 0; back: as its corners run."""
    placed = made.packed.instances[instance]
    has_inner = made.packed.materials["flags"][placed["material"]] & MATERIAL_HAS_INNER
    mirrored = bool(placed["flags"] & INSTANCE_MIRRORED)
    return INNER if has_inner and back != mirrored else 0


def _photons_at(last: LastFrame, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The photons that light a point: rows of the map, (m,), and what they bring, (m, 3) lx."""
    made, parts = last.made, last.parts
    finish = (
        None
        if made.settings.is_plain
        else partial(keep_all_light, made, parts.keys, series=series_of(made.settings))
    )
    rows, brought = PhotonGrid(parts.smooth.copy(), finish=finish).each(point)
    more, others = parts.caustics.each(point)
    return np.concatenate([rows, len(parts.smooth) + more]), np.concatenate([brought, others])


def _paths(last: LastFrame, rows: np.ndarray, brought: np.ndarray) -> list[PhotonPath]:
    """How photons of the map, (m,) rows, came."""
    made = last.traced.this
    photons, settings = take(last.parts.photons, rows), made.settings
    limit = bright_limit(made.packed, made.surfaces, settings)
    ways = last.traced.plan.openings.ways

    def follow(few: np.ndarray) -> np.ndarray:
        scene = made.packed, made.world, made.surfaces
        return all_steps(*scene, few, settings.bounces, made.photon_seed, made.index, limit, ways)

    found = retrace(last.traced.emitted(), photons, last.parts.keys[rows], follow)
    if not all(map(len, found)):
        raise IspmError(CHANGED)
    return [_path(made, *each) for each in zip(found, photons, brought, strict=True)]


def _path(made: Pass, steps: np.ndarray, photon: np.void, brought: np.ndarray) -> PhotonPath:
    positions = steps["position"].copy()
    row = int(steps["light"][0])
    light = made.packed.lights[row] if row < len(made.packed.lights) else None
    if light is not None and light["kind"] == LIGHT_DIRECTIONAL:
        positions[0] = positions[1] - np.float32(made.packed.diagonal) * light["direction"]
    events = (*(EVENTS[event] for event in steps["event"][:-1]), "stored")
    return PhotonPath(positions, steps["flux"].copy(), events, int(photon["bounce"]), brought)
