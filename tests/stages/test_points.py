"""Points come from triangles and rays alone, whatever grid a rasteriser snaps corners to."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from exact import Triangles, cast, map_rays, mixed_scene, packed_mixed, triangles_of, view_of

from ispm.accel.surface import SurfaceTable
from ispm.frame import GBuffer
from ispm.gpu import Gpu
from ispm.library.shapes import polygons
from ispm.lights.emission import place_photons
from ispm.lights.lightmap import light_maps
from ispm.lights.plan import PlannedMap
from ispm.optics.records import EMITTED, NO_HIT
from ispm.optics.texture import TextureTable
from ispm.renderer.specular import eye_rays
from ispm.scene.light import DirectionalLight, PointLight
from ispm.scene.packed import Packed, pack
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView
from ispm.stages.downsample import Downsample
from ispm.stages.gbuffer import GBufferStage
from ispm.stages.specular import SEEN
from ispm.stages.upload import Upload

ULP = 2.0**-24
VIEWS: dict[str, dict[str, Any]] = {
    "perspective": {},
    "orthographic": dict(ymag=2.5, near=0.1, far=20.0),
    "jittered": dict(jitter=(0.37, -0.21)),
}


class Drawn:
    """A G-buffer, the scene's triangles and the rays of its pixels."""

    def __init__(self, gpu: Gpu, packed: Packed, view: CameraView) -> None:
        self.gpu, self.packed, self.view = gpu, packed, view
        self.upload, self.stage = Upload(gpu), GBufferStage(gpu)
        with gpu.frame() as frame:
            self.scene = self.upload(packed)
            self.gbuffer: GBuffer = self.stage(frame, self.scene, view)
        self.triangles = triangles_of(packed)
        self.first = np.searchsorted(self.triangles.instance, np.arange(len(packed.instances)))
        self.origins, self.directions = (a.reshape(-1, 3) for a in view.rays())

    def ids(self) -> np.ndarray:
        """(n, 2) instance + 1 and primitive."""
        return self.gpu.read_texture(self.gbuffer.ids, np.uint32, 2).reshape(-1, 2)

    def points(self) -> np.ndarray:
        """(n, 3) float64."""
        words = self.gpu.read_texture(self.gbuffer.points, np.uint32, 4).reshape(-1, 4)
        return np.ascontiguousarray(words[:, :3]).view(np.float32).astype(float)

    def place(self, ids: np.ndarray) -> np.ndarray:
        """The points where pixels show other triangles, (n, 2)."""
        width, height = self.view.size
        changed = self.gpu.texture("ids", "rg32uint", usage=["sampled"]).sized((width, height))
        changed.write(ids.reshape(height, width, 2))
        bumps = self.gpu.texture("bumps", "rgba16float", usage=["sampled"]).sized((width, height))
        bumps.write(np.zeros((height, width, 4), np.float16))
        targets = [self.gbuffer.points, self.gbuffer.normals, self.gbuffer.depth]
        resolve = self.stage._resolve[0]
        with self.gpu.frame() as frame, frame.draw_into(*targets) as canvas:
            (window,) = self.scene.windows
            corners = self.scene.corners(frame, window)
            shown = dict(camera=self.view.uniform(), ids=changed, bumps=bumps)
            canvas.use(resolve, resolve.bind(0, frame, **shown, **corners))
            canvas.draw(3)
        return self.points()

    def corners(self, ids: np.ndarray) -> np.ndarray:
        """(n, 3, 3) of (n, 2) ids."""
        return self.triangles.corners[self.first[ids[:, 0].astype(int) - 1] + ids[:, 1]]


def barycentrics(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n, 3) of points' feet on triangles."""
    e1, e2, w = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    n = np.cross(e1, e2)
    square = (n * n).sum(1)
    u, v = (np.cross(w, e2) * n).sum(1) / square, (np.cross(e1, w) * n).sum(1) / square
    return np.stack([1.0 - u - v, u, v], axis=1)


def off_plane(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n,) m."""
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    return np.abs(((points - corners[:, 0]) * n).sum(1))


def off_ray(points: np.ndarray, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(n,) m from the rays."""
    return np.linalg.norm(np.cross(points - origins, directions), axis=1)


def largest(drawn: Drawn, points: np.ndarray) -> float:
    """The largest number on the way to a point: coordinates, edges, distances and the view's depth, m."""
    away = np.abs(points - drawn.view.eye).max()
    span = drawn.view.far if drawn.view.ymag is not None else 0.0
    return 2.0 * max(np.abs(drawn.triangles.corners).max(), np.abs(drawn.view.eye).max(), away, span)


@pytest.mark.parametrize("options", VIEWS.values(), ids=VIEWS)
def test_points_lie_on_their_triangles_and_on_their_rays(gpu: Gpu, options: dict[str, Any]) -> None:
    """To float rounding: a dozen operations round by 2^-24 of the largest number that they meet, those of a
    ray's direction, from a matrix, twice as many. Rays that miss their triangle pass it by a grid's step."""
    drawn = Drawn(gpu, packed_mixed(), view_of(**options))
    ids, points = drawn.ids(), drawn.points()
    seen = np.flatnonzero(ids[:, 0])
    corners, points = drawn.corners(ids[seen]), points[seen]
    rounding = ULP * largest(drawn, points)
    assert off_plane(corners, points).max() < 12 * rounding
    place = barycentrics(corners, points)
    assert place.min() > -1e-5
    away = off_ray(points, drawn.origins[seen], drawn.directions[seen])
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    t = ((corners[:, 0] - drawn.origins[seen]) * n).sum(1) / (drawn.directions[seen] * n).sum(1)
    exact = drawn.origins[seen] + t[:, None] * drawn.directions[seen]
    hits = barycentrics(corners, exact).min(1) > 1e-5
    assert hits.mean() > 0.95 and away[hits].max() < 24 * rounding
    depth = (points - drawn.view.eye) @ drawn.view.forward
    pixel = drawn.view.footprint * (depth if drawn.view.ymag is None else np.ones_like(depth))
    # corners move by half a step of a sixteenth, across and down; the pixel's rays lie aslant
    assert (away / pixel)[~hits].max(initial=0.0) < 0.0625


def floor_at_the_eye(height: float) -> tuple[Packed, CameraView]:
    """A tilted floor of large triangles and an eye a little above it, which sees it at a grazing angle."""
    scene = Scene()
    corners = np.array([(-20, 0, -40), (-20, 0, 9), (20, 0, 9), (20, 0, -40)], float)
    turn = (0.1, 0.2, 0.05, (1.0 - 0.1**2 - 0.2**2 - 0.05**2) ** 0.5)
    scene.add(polygons([corners]), rotation=turn, translation=(1.3, -2.1, 0.7))
    packed = pack(scene)
    flat = triangles_of(packed)
    n = flat.front[0]
    ahead = flat.corners[0, 0] - flat.corners[0, 1]
    ahead /= np.linalg.norm(ahead)
    eye = flat.corners[0].mean(axis=0) + height * n
    pose = np.eye(4)
    pose[:3] = np.column_stack([np.cross(ahead, n), n, -ahead, eye])
    return packed, CameraView((128, 72), pose, near=1e-6)


@pytest.mark.parametrize("height", [0.02, 0.3])
def test_receivers_lie_on_a_floor_that_is_hardly_seen(gpu: Gpu, height: float) -> None:
    """From rasterised depth they hung up to a tenth of the eye's height off, and gather rays began below."""
    packed, view = floor_at_the_eye(height)
    drawn = Drawn(gpu, packed, view)
    downsample = Downsample(gpu, 2)
    with gpu.frame() as frame:
        downsample(frame, drawn.scene, drawn.gbuffer, view)
    receivers = downsample.read(gpu, view)
    points = receivers["position"][receivers["valid"] > 0].astype(float)
    corners = np.broadcast_to(drawn.triangles.corners[0], (len(points), 3, 3))
    assert len(points) > 500
    assert off_plane(corners, points).max() < 12 * ULP * largest(drawn, points)


@pytest.mark.parametrize("step", [(1, 0), (0, 1)])
def test_where_a_ray_misses_the_nearest_point_on_the_screen_is_taken(gpu: Gpu, step: tuple[int, int]) -> None:
    """As if corners had been snapped by a whole pixel: each pixel shows its neighbour's triangle."""
    drawn = Drawn(gpu, packed_mixed(), view_of())
    height, width = drawn.view.size[1], drawn.view.size[0]
    ids = np.roll(drawn.ids().reshape(height, width, 2), step, axis=(1, 0)).reshape(-1, 2)
    points = drawn.place(ids)
    seen = np.flatnonzero(ids[:, 0])
    corners, points = drawn.corners(ids[seen]), points[seen]
    rounding = ULP * largest(drawn, points)
    place = barycentrics(corners, points)
    assert off_plane(corners, points).max() < 12 * rounding and place.min() > -1e-5
    origins, d = drawn.origins[seen], drawn.directions[seen]
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    t = ((corners[:, 0] - origins) * n).sum(1) / (d * n).sum(1)
    misses = barycentrics(corners, origins + t[:, None] * d).min(1) < -1e-4
    assert misses.sum() > 500 and place[misses].min() > -ULP

    def angle(p: np.ndarray) -> np.ndarray:
        way = p - origins[misses]
        ahead = (way * d[misses]).sum(1)
        return np.where(ahead > 0.0, np.linalg.norm(np.cross(way, d[misses]), axis=1) / ahead, np.inf)

    share = np.linspace(0.0, 1.0, 2001)
    best = np.full(misses.sum(), np.inf)
    for k in range(3):
        a, b = corners[misses, k], corners[misses, (k + 1) % 3]
        for s in share:
            best = np.minimum(best, angle(a + s * (b - a)))
    # moved within by 4e-6 of the coordinates, at most half of a small triangle's circle
    assert (angle(points[misses]) < best + 1e-4 * drawn.view.footprint + 2e-5).all()


def surfaces_of(packed: Packed) -> SurfaceTable:
    return SurfaceTable(packed, TextureTable.pack(packed.textures, packed.colors), 1.0)


@pytest.mark.parametrize("options", VIEWS.values(), ids=VIEWS)
def test_the_processor_finds_the_same_points(gpu: Gpu, options: dict[str, Any]) -> None:
    """Starts of eye paths, in float64, are the G-buffer's points, wherever a ray passes its triangle."""
    drawn = Drawn(gpu, packed_mixed(), view_of(**options))
    height, width = drawn.view.size[1], drawn.view.size[0]
    ids = np.roll(drawn.ids().reshape(height, width, 2), 1, axis=1).reshape(-1, 2)
    points = drawn.place(ids)
    pixels = np.flatnonzero(ids[:, 0])
    seen = np.zeros(len(pixels), SEEN)
    seen["pixel"], seen["instance"], seen["primitive"] = pixels, ids[pixels, 0] - 1, ids[pixels, 1]
    rays = eye_rays(seen, surfaces_of(drawn.packed), drawn.view, threads=1)
    assert rays.hits is not None
    corners = drawn.corners(ids[pixels])
    u, v = rays.hits["u"][:, None].astype(float), rays.hits["v"][:, None].astype(float)
    starts = corners[:, 0] + u * (corners[:, 1] - corners[:, 0]) + v * (corners[:, 2] - corners[:, 0])
    far = np.linalg.norm(starts - drawn.origins[pixels], axis=1)
    apart = np.linalg.norm(starts - points[pixels], axis=1)
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = np.abs((n * drawn.directions[pixels]).sum(1)) / np.linalg.norm(n, axis=1)
    clear = facing > 0.02  # else rounding moves points along the ray
    rounding = ULP * largest(drawn, points[pixels])
    assert clear.mean() > 0.9 and np.median(apart) < 8 * rounding
    assert (apart[clear] < 64 * rounding / facing[clear] + 1e-6 * far[clear]).mean() > 0.999


LIGHTS = {"cube": PointLight(), "parallel": DirectionalLight()}


@pytest.mark.parametrize("kind", LIGHTS)
@pytest.mark.parametrize("step", [(0, 0), (1, 0), (0, -1)])
def test_photons_meet_what_their_texels_rays_meet(kind: str, step: tuple[int, int]) -> None:
    """Also where a rasteriser puts all triangles a texel aside, of those that one of the nine shows."""
    scene = mixed_scene()
    scene.roots.pop()
    scene.add(LIGHTS[kind], translation=(0.3, 3.0, 0.8), rotation=(-0.6, 0.15, 0.1, 0.78))
    packed, width, shift = pack(scene), 64, (0.31, -0.44)
    (map,) = light_maps(packed)
    triangles = triangles_of(packed)
    row, _, exact = nearest(triangles, *map_rays(map, width, shift))
    content = np.zeros((len(map.axes), width, width, 2), np.uint32)
    content[..., 0] = np.where(row >= 0, triangles.instance[row], NO_HIT)
    content[..., 1] = np.where(row >= 0, triangles.primitive[row], 0)
    given = np.roll(content, step, axis=(2, 1))
    rows = np.zeros(row.size, EMITTED)
    planned = PlannedMap(map, 1000, width, shift, 0.5)
    place_photons(surfaces_of(packed), planned, given, rows, np.arange(row.size))
    same = (rows["instance"] == content[..., 0].ravel()) & (rows["primitive"] == content[..., 1].ravel())
    hit = same & (rows["instance"] != NO_HIT)
    assert same.all() if step == (0, 0) else same.mean() > 0.98
    assert np.abs(np.stack([rows["u"], rows["v"]], 1) - exact.reshape(-1, 2))[hit].max() < 1e-5


def nearest(
    triangles: Triangles, origins: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    shape = directions.shape[:3]
    row, distance, place = cast(triangles, origins.reshape(-1, 3), directions.reshape(-1, 3))
    return row.reshape(shape), distance.reshape(shape), place.reshape(*shape, 2)


def test_nothing_is_met_beyond_a_light_s_range() -> None:
    scene = Scene()
    corners = np.array([(-4, 0, -4), (-4, 0, 4), (4, 0, 4), (4, 0, -4)], float)
    scene.add(polygons([corners]))
    scene.add(PointLight(range=2.0), translation=(0.0, 1.0, 0.0))
    packed = pack(scene)
    planned = PlannedMap(light_maps(packed)[0], 1000, 32, (0.0, 0.0), 0.5)
    row, distance, _ = nearest(triangles_of(packed), *map_rays(planned.map, 32))
    content = np.zeros((*row.shape, 2), np.uint32)
    content[..., 0], content[..., 1] = np.where(row >= 0, 0, NO_HIT), np.maximum(row, 0)
    rows = np.zeros(row.size, EMITTED)
    place_photons(surfaces_of(packed), planned, content, rows, np.arange(row.size))
    within = ((row >= 0) & (distance < 2.0)).ravel()
    clear = np.abs(distance.ravel() - 2.0) > 1e-6
    assert ((rows["instance"] == 0) == within)[clear].all() and within.any() and not within.all()
