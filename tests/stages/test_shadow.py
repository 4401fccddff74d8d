"""Shadow maps and direct light against exact visibility and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from exact import cast, cube_direction, mixed_scene, quad, triangles_of, view_of

from ispm.frame import GBuffer, ShadowMaps
from ispm.gpu import Gpu
from ispm.scene.camera import look_at_pose
from ispm.scene.light import PointLight
from ispm.scene.material import AlphaMode, Material
from ispm.scene.packed import Packed, pack
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView
from ispm.stages.direct import DirectStage
from ispm.stages.gbuffer import GBufferStage
from ispm.stages.shadow import ShadowStage, shadow_side
from ispm.stages.upload import Upload

LAMBERT = dict(specular=0.0, roughness=1.0)


def shade(
    gpu: Gpu, packed: Packed, view: CameraView, resolution: int = 256, near: float = 1e-3
) -> tuple[np.ndarray, np.ndarray]:
    """Direct radiance (h, w, 3) and instance ids (h, w)."""
    upload, gbuffer, shadow = Upload(gpu), GBufferStage(gpu), ShadowStage(gpu, resolution)
    direct = DirectStage(gpu)
    with gpu.frame() as frame:
        scene = upload(packed)
        seen: GBuffer = gbuffer(frame, scene, view)
        maps: ShadowMaps = shadow(frame, scene, near)
        radiance = direct(frame, scene, seen, maps, view)
    pixels, ids = gpu.read_many([(radiance, np.float32, 4), (seen.ids, np.uint32, 2)])
    for stage in (upload, gbuffer, shadow, direct):
        stage.close()
    return pixels[..., :3], ids[..., 0]


def test_shadow_map_holds_the_nearest_depth(gpu: Gpu) -> None:
    packed, near = pack(mixed_scene()), 1e-3
    upload, stage = Upload(gpu), ShadowStage(gpu, 32)
    with gpu.frame() as frame:
        maps = stage(frame, upload(packed), near)
    depth = gpu.read_texture(maps.cubes, np.float32)
    side = maps.side
    face, y, x = np.mgrid[:6, :side, :side]
    d = cube_direction(face, x, y, side).reshape(-1, 3)
    origin = packed.lights["position"][0].astype(float)
    row, distance, _ = cast(triangles_of(packed), np.broadcast_to(origin, d.shape), d)
    expected = np.where(row >= 0, near / (distance * np.abs(d).max(axis=1)), 0.0).reshape(depth.shape)
    off = np.abs(depth - expected) > 1e-5 * expected.max()
    assert off.mean() < 0.01  # silhouettes snap to the sub-pixel grid


@pytest.mark.parametrize(("scale", "removal"), [(1.0, 1.0), (1000.0, 1.0), (1.0, 200.0)])
def test_shadows_disagree_with_exact_rays_only_at_silhouettes(gpu: Gpu, scale: float, removal: float) -> None:
    """No acne and no detached shadows, whatever the scene's scale and the light's distance: pixels that
    are lit or dark against the truth lie within three texels of the shadow's edge, seen from the light."""
    scene = mixed_scene()
    for node in scene.roots:
        for part in node.parts:  # flat: smooth normals that face away from the eye are black, lit or not
            part.mesh.normals = None
        if node.light is not None:
            node.translation = tuple(removal * np.array(node.translation))
        node.translation = tuple(scale * np.array(node.translation))
        if node.light is None:
            node.scale = tuple(scale * np.array(node.scale))
    base = view_of((200, 112))
    pose = base.pose.copy()
    pose[:3, 3] *= scale
    view = CameraView(base.size, pose, near=0.01 * scale)
    packed, side = pack(scene), 256
    lit, ids = shade(gpu, packed, view, side, near=1e-3 * scale)
    triangles = triangles_of(packed)
    origins, directions = (a.reshape(-1, 3) for a in view.rays())
    double_sided = (packed.materials["flags"][packed.instances["material"]] & 4)[triangles.instance] != 0
    seen = np.einsum("nk,tk->nt", -directions, triangles.front) > 0.0
    row, distance, _ = cast(triangles, origins, directions, seen | double_sided)
    on = (row >= 0) & (ids.ravel() == np.where(row >= 0, triangles.instance[row] + 1, 0))
    points = origins[on] + directions[on] * distance[on, None]
    light = packed.lights["position"][0].astype(float)
    texel = 2.0 * packed.maps[0].spread / side  # over the distance
    to_light = light - points
    d = np.linalg.norm(to_light, axis=1)
    facing = np.einsum("nk,nk->n", to_light, triangles.front[row[on]])
    facing *= np.sign(-np.einsum("nk,nk->n", directions[on], triangles.front[row[on]]))
    pixels = lit.reshape(-1, 3)[on].sum(-1)

    def visible(some: np.ndarray, offset: np.ndarray) -> np.ndarray:
        """Whether the light sees the point next to each of some of ours, on a sphere about it."""
        ray = points[some] + offset * d[some, None] - light
        ray /= np.linalg.norm(ray, axis=1)[:, None]
        first, t, _ = cast(triangles, np.broadcast_to(light, ray.shape), ray)
        return (first < 0) | (t > d[some] * (1.0 - 2.0 * texel))

    everywhere = np.arange(len(points))
    exact = visible(everywhere, np.zeros_like(points)) & (facing > 0.0)
    wrong = np.flatnonzero((pixels > 0.0) != exact)
    wi = to_light[wrong] / d[wrong, None]
    tangent = np.cross(wi, [0.36, 0.48, 0.8])
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    other = np.cross(wi, tangent)
    ring = [
        r * (math.cos(a) * tangent + math.sin(a) * other)
        for r in (1.25 * texel, 2.5 * texel)
        for a in np.arange(8) * math.pi / 4.0
    ]
    around = np.stack([visible(wrong, offset) for offset in ring])
    at_silhouette = around.any(axis=0) & ~around.all(axis=0)
    assert exact.mean() > 0.3 and (~exact).mean() > 0.05
    assert at_silhouette.all() and len(wrong) < 0.03 * len(points)


def test_light_over_a_plane_follows_the_inverse_square(gpu: Gpu) -> None:
    """V4: L = rho I h / (pi (h^2 + x^2)^1.5) on a Lambertian plane, per channel, and no self-shadow."""
    rho, intensity, h = np.array([0.5, 0.25, 0.75]), np.array([10.0, 20.0, 40.0]), 1.5
    scene = Scene()
    scene.add(quad(20.0), material=Material(base_color=tuple(rho), **LAMBERT))
    scene.add(PointLight(tuple(intensity)), translation=(0.0, h, 0.0))
    view = CameraView((160, 90), look_at_pose(np.array([0.0, 4.0, 6.0]), np.zeros(3)), near=0.01)
    lit, ids = shade(gpu, pack(scene), view)
    origins, directions = view.rays()
    points = origins + directions * (-origins[..., 1:2] / directions[..., 1:2])
    square = (points[..., [0, 2]] ** 2).sum(-1, keepdims=True)
    expected = rho * intensity * h / (math.pi * (h * h + square) ** 1.5)
    on = ids == 1
    # base color and normal are halves: 2^-10 each, the normal's times the tangent of the light's angle
    tangent = np.sqrt(square[..., 0]) / h
    error = np.abs(lit / expected - 1.0).max(-1)
    assert on.mean() > 0.5 and (error[on] < 2.0**-10 * (1.5 + tangent[on])).all()


def test_range_windows_the_light(gpu: Gpu) -> None:
    """KHR_lights_punctual: clamp(1 - (d / range)^4, 0, 1) / d^2."""

    def lit(reach: float) -> tuple[np.ndarray, CameraView]:
        scene = Scene()
        scene.add(quad(20.0), material=Material(**LAMBERT))
        scene.add(PointLight(range=reach), translation=(0.0, 1.0, 0.0))
        view = CameraView((160, 90), look_at_pose(np.array([0.0, 4.0, 3.0]), np.zeros(3)), near=0.01)
        return shade(gpu, pack(scene), view)[0][..., 0], view

    (free, view), (bound, _) = lit(math.inf), lit(3.0)
    origins, directions = view.rays()
    points = origins + directions * (-origins[..., 1:2] / directions[..., 1:2])
    distance = np.linalg.norm(points - (0.0, 1.0, 0.0), axis=-1)
    expected = free * np.clip(1.0 - (distance / 3.0) ** 4, 0.0, 1.0)
    assert np.abs(bound - expected).max() < 1e-4 * free.max() and (bound[distance > 3.0] == 0.0).all()


def test_light_behind_a_surface_does_not_show(gpu: Gpu) -> None:
    scene = Scene()
    scene.add(quad(5.0), material=Material(double_sided=True))
    scene.add(PointLight(), translation=(0.0, -1.0, 0.0))
    view = CameraView((64, 36), look_at_pose(np.array([0.0, 4.0, 3.0]), np.zeros(3)), near=0.01)
    assert (shade(gpu, pack(scene), view)[0] == 0.0).all()


def test_direct_light_does_not_depend_on_near(gpu: Gpu) -> None:
    packed = pack(mixed_scene())
    results = [
        shade(gpu, packed, view_of((160, 90), near=near), near=shadow_near)[0]
        for near, shadow_near in ((1e-3, 1e-4), (0.05, 1e-2))
    ]
    differ = np.abs(results[0] - results[1]).max(-1) > 1e-3 * results[0].max()
    assert differ.mean() < 2e-3  # single pixels at silhouettes and shadow edges round otherwise


def test_blend_casts_a_partial_shadow(gpu: Gpu) -> None:
    scene = Scene()
    scene.add(quad(5.0), material=Material(**LAMBERT))
    scene.add(
        quad(1.0), translation=(0.0, 1.0, 0.0),
        material=Material(base_color=(1, 1, 1, 0.25), alpha_mode=AlphaMode.BLEND),
    )  # fmt: skip
    scene.add(PointLight(), translation=(0.0, 2.0, 0.0))
    view = CameraView((96, 96), look_at_pose(np.array([0.0, 0.9, 0.01]), np.zeros(3)), 0.8, near=0.01)
    full = pack(scene)
    part, _ = shade(gpu, full, view)
    scene.roots.pop(1)
    free, _ = shade(gpu, pack(scene), view)
    # the view covers about 50 x 50 texels of the shadow: standard deviation 0.009; 5 of them
    assert float((part / free).mean()) == pytest.approx(0.75, abs=0.045)


def test_many_lights_share_the_texels() -> None:
    assert [shadow_side(1024, n) for n in (0, 1, 4, 16)] == [1024, 1024, 1024, 512]
    assert shadow_side(1024, 5) == 912 and shadow_side(1024, 10_000) == 64
    assert shadow_side(32, 1) == 32


def test_lights_add_up(gpu: Gpu) -> None:
    places = [(0.3, 3.0, 0.8), (-3.0, 2.0, 2.0), (2.0, 4.0, 1.0), (0.0, 2.5, -3.0), (3.0, 1.0, 3.0)]

    def lit(chosen: list[tuple[float, float, float]]) -> np.ndarray:
        scene = mixed_scene()
        scene.roots = [node for node in scene.roots if node.light is None]
        for place in chosen:
            scene.add(PointLight((10.0, 20.0, 30.0)), translation=place)
        return shade(gpu, pack(scene), view_of((80, 45)), resolution=64)[0]

    together, apart = lit(places), sum(lit([place]) for place in places)
    assert np.abs(together - apart).max() < 1e-5 * together.max()
