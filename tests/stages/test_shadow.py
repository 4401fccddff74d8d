"""Shadow maps against exact visibility."""

from __future__ import annotations

import math

import numpy as np
import pytest
from exact import cast, mixed_scene, quad, triangles_of, view_of
from lit import Lamp, seen_surfaces

from ispm.accel.world import World
from ispm.gpu import Gpu
from ispm.library.shapes import box
from ispm.scene.camera import look_at_pose
from ispm.scene.light import DirectionalLight, Light, PointLight, SpotLight
from ispm.scene.material import AlphaMode, Material
from ispm.scene.packed import Packed, pack
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView
from ispm.stages.shadow import shared_indices

LAMPS: dict[str, tuple[Light, tuple[float, float, float]]] = {
    "point": (PointLight((10.0, 20.0, 30.0)), (0.3, 3.0, 0.8)),
    "far point": (PointLight((1e5, 2e5, 3e5)), (60.0, 600.0, 160.0)),
    "spot": (SpotLight((10.0, 20.0, 30.0), outer_angle=1.0), (0.3, 4.0, 2.8)),
    "wide spot": (SpotLight((10.0, 20.0, 30.0), outer_angle=1.5), (0.3, 3.0, 0.8)),
    "directional": (DirectionalLight((1.0, 2.0, 3.0)), (0.0, 0.0, 0.0)),
}
ALONG = (-0.6, 0.1, 0.05, 0.78)  # a rotation that turns -Z downwards, a little aside
SNAP = 2.0**-4  # texels; subPixelPrecisionBits is 4 at least
SNAPPED = [(x * SNAP, y * SNAP) for x in (0.0, -1.0, 1.0) for y in (0.0, -1.0, 1.0)]
REACH = 2.0  # texels from a shadow's edge within which the filter and the bias may err, of the widest


@pytest.fixture(scope="module")
def lamp(gpu: Gpu) -> Lamp:
    return Lamp(gpu)


def flat_scene(kind: str, scale: float) -> Scene:
    """`mixed_scene` with a box on its floor and flat normals: smooth ones that face away from the eye are
    black, lit or not."""
    scene = mixed_scene()
    scene.roots = [node for node in scene.roots if node.light is None]
    scene.add(box((0.4, 0.0, 1.0), (0.9, 0.5, 1.4)))
    light, place = LAMPS[kind]
    node = scene.add(light, translation=place, rotation=ALONG if kind != "spot" else (-0.5, 0.0, 0.0, 0.866))
    for each in scene.roots:
        for part in each.parts:
            part.mesh.normals = None
        each.translation = tuple(scale * np.array(each.translation))
        if each is not node:
            each.scale = tuple(scale * np.array(each.scale))
    return scene


def towards(packed: Packed, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit directions to the light and how far it is; 10 times the scene for a directional one."""
    row = packed.lights[0]
    if row["kind"] == 2:
        far = np.full(len(points), 10.0 * packed.diagonal)
        return np.broadcast_to(-row["direction"].astype(float), points.shape), far
    way = row["position"].astype(float) - points
    distance = np.linalg.norm(way, axis=1)
    return way / distance[:, None], distance


def lightable(packed: Packed, points: np.ndarray) -> np.ndarray:
    """Whether points lie in a spot's cone."""
    row = packed.lights[0]
    cosine = -towards(packed, points)[0] @ row["direction"].astype(float)
    return np.asarray(cosine * row["cone_scale"] + row["cone_offset"] > 1e-4)


@pytest.mark.parametrize("kind", LAMPS)
@pytest.mark.parametrize("scale", [0.01, 1.0, 1000.0])
def test_shadows_disagree_with_traced_rays_only_at_their_edges(lamp: Lamp, kind: str, scale: float) -> None:
    """No acne and no detached shadows, at any scale, for every kind of light: pixels that are lit or dark
    against traced rays lie within two texels of the shadow's edge, seen from the light."""
    packed = pack(flat_scene(kind, scale))
    base = view_of((160, 90))
    pose = base.pose.copy()
    pose[:3, 3] *= scale
    lit = lamp(packed, CameraView(base.size, pose, near=0.01 * scale), 512, near=1e-3 * scale)
    world = World(2)
    world.update(packed)
    triangles = triangles_of(packed)
    points, normals, pixels = seen_surfaces(lit, triangles, pose[:3, 3])
    wi, distance = towards(packed, points)
    facing = np.einsum("nk,nk->n", wi, normals) > 0.0
    raised = points + 1e-5 * scale * normals
    exact = facing & lightable(packed, points) & ~world.occluded(raised, wi, distance * (1.0 - 1e-5))
    # a plane that light grazes nears it within a texel by as much as that over the sine: what shades is lost
    told = np.abs(np.einsum("nk,nk->n", wi, normals)) > 2.0 * lit.texels(points) / distance
    wrong = np.flatnonzero(((pixels > 0.0) != exact) & (told | (packed.lights[0]["kind"] == 2)))
    around = np.stack([
        exact_beside(world, packed, points[wrong], offset, lit.texels(points[wrong])) for offset in RING
    ])  # fmt: skip
    at_edge = around.any(axis=0) & ~around.all(axis=0)
    assert exact.mean() > 0.15 and (~exact & facing).mean() > 0.02
    assert at_edge.all() and len(wrong) < 0.001 * len(points)


RING = [
    r * np.array([math.cos(a), math.sin(a)]) for r in (0.75, 1.4, REACH) for a in np.arange(8) * math.pi / 4
]


def exact_beside(
    world: World, packed: Packed, points: np.ndarray, offset: np.ndarray, texels: np.ndarray
) -> np.ndarray:
    """Whether the light sees the point that lies `offset` texels beside each of ours, across its rays."""
    wi, distance = towards(packed, points)
    tangent = np.cross(wi, [0.36, 0.48, 0.8])
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    aside = (offset[0] * tangent + offset[1] * np.cross(wi, tangent)) * texels[:, None]
    origins = points + distance[:, None] * wi
    if packed.lights[0]["kind"] == 2:
        origins = origins + aside
    rays = points + aside - origins
    length = np.linalg.norm(rays, axis=1)
    t = world.trace(origins, rays / length[:, None])["t"]
    return np.asarray(~(t < length - 1.5 * texels))


@pytest.mark.parametrize("kind", LAMPS)
def test_tiles_hold_the_nearest_depth(gpu: Gpu, lamp: Lamp, kind: str) -> None:
    """Vulkan lets rasterisers snap corners to 1/16 of a texel: a texel then has what lies as far beside its
    centre, and the depth of a plane that its corners move by as much. A triangle that reaches behind the
    light moves with them in proportion to how far ahead or behind they are; see `lookup` in direct.wgsl."""
    packed, near = pack(flat_scene(kind, 1.0)), 1e-3
    lit = lamp(packed, view_of((32, 18)), 32, near)
    stored = gpu.read_texture(lit.shadows.depth, np.float32)
    row = lit.shadows.maps[0]
    turn = np.stack([row["x"], row["y"], row["z"]]).astype(float)
    triangles, off, count = triangles_of(packed), 0, 0
    for index in np.flatnonzero(lit.shadows.tiles["size"][:, 0] > 0.0):
        tile = lit.shadows.tiles[index]
        width, height = (int(side) for side in tile["size"])
        x0, y0 = (int(c) for c in tile["corner"])
        y, x = np.mgrid[:height, :width] + 0.5
        uv = (np.stack([x + x0, y + y0], -1).reshape(-1, 2) - tile["shift"]) / tile["scale"]
        axes = CUBE[index] if row["faces"] == 6 else CUBE[4]
        right, down, ahead = axes @ turn
        across = uv[:, :1] * right + uv[:, 1:] * down
        if row["parallel"]:
            origins, rays = row["origin"] + across - 100.0 * ahead, np.broadcast_to(ahead, across.shape)
        else:
            origins, rays = np.broadcast_to(row["origin"].astype(float), across.shape), across + ahead
        got = stored[y0 : y0 + height, x0 : x0 + width].ravel()
        fits = np.zeros(len(got), bool)
        for x, y in SNAPPED:
            aside = x / tile["scale"][0] * right + y / tile["scale"][1] * down
            starts, ways = (origins + aside, rays) if row["parallel"] else (origins, rays + aside)
            hit, _, weights = cast(triangles, starts, ways)
            corners, normals = triangles.corners[hit], triangles.front[hit]
            # where the middle's own ray meets that triangle's plane, and by how much the depth of a plane
            # that is moved by SNAP texels differs there
            gap = np.einsum("nk,nk->n", normals, corners[:, 0] - origins)
            moves = sum(
                np.abs(normals @ axis) / scale
                for axis, scale in zip((right, down), tile["scale"], strict=True)
            )
            if row["parallel"]:
                along = normals @ ahead
                depth, slope = (
                    row["near"] - row["slope"] * (gap / along - 100.0),
                    row["slope"] * moves / along,
                )
            else:
                depth = near * np.einsum("nk,nk->n", normals, rays) / gap
                parts = np.concatenate([1.0 - weights.sum(-1, keepdims=True), weights], -1)
                parts = parts * ((corners - row["origin"]) @ ahead)
                slope = near * moves / gap * np.abs(parts).sum(-1) / parts.sum(-1)
            allowed = SNAP * np.abs(slope) + 1e-5 * max(got.max(), 1e-30)
            fits |= np.where(hit >= 0, np.abs(got - depth) <= allowed, got == 0.0)
        off += int((~fits).sum())
        count += width * height
    assert count >= 32 * 32 and off == 0


CUBE = np.array(
    [
        [(0, 0, -1), (0, -1, 0), (1, 0, 0)], [(0, 0, 1), (0, -1, 0), (-1, 0, 0)],
        [(1, 0, 0), (0, 0, 1), (0, 1, 0)], [(1, 0, 0), (0, 0, -1), (0, -1, 0)],
        [(1, 0, 0), (0, -1, 0), (0, 0, 1)], [(-1, 0, 0), (0, -1, 0), (0, 0, -1)],
    ],
    float,
)  # fmt: skip


@pytest.mark.parametrize("elevation", [0.3, 2.0, 20.0, 88.0])
@pytest.mark.parametrize("kind", ["point", "far point", "spot", "directional"])
def test_a_plane_shades_itself_nowhere(lamp: Lamp, kind: str, elevation: float) -> None:
    """elevation  degrees of the light above the middle of the plane"""
    angle = math.radians(elevation)
    up = np.array([math.cos(angle) * 0.6, math.sin(angle), math.cos(angle) * 0.8])
    scene = Scene()
    scene.add(quad(20.0), material=Material(specular=0.0, roughness=1.0), rotation=(0.1, 0.0, 0.2, 0.95**0.5))
    tilt = scene.roots[0].local_matrix()[:3, :3]
    place = tilt @ (up * {"point": 3.0, "far point": 900.0, "spot": 3.0, "directional": 1.0}[kind])
    lights = {
        "point": PointLight(), "far point": PointLight((1e5, 1e5, 1e5)),
        "spot": SpotLight(inner_angle=0.6, outer_angle=0.9), "directional": DirectionalLight(),
    }  # fmt: skip
    node = scene.add(lights[kind], translation=tuple(place))
    pose = look_at_pose(place, np.zeros(3))
    set_rotation(node, pose)
    packed = pack(scene)
    view = CameraView((160, 90), look_at_pose(tilt @ np.array([0.0, 4.0, 6.0]), np.zeros(3)), near=0.01)
    lit = lamp(packed, view, 128)
    on = lit.ids > 0
    points = lit.points[on]
    wi, _ = towards(packed, points)
    bright = lightable(packed, points) & (wi @ tilt[:, 1] > 2e-3)
    expected = exact_radiance(packed, points, tilt[:, 1])
    got = lit.radiance[on][:, 0]
    assert bright.sum() > 500
    # a shadow of one of four texels takes a quarter; rounded normals change little but at grazing angles
    assert (got[bright] > 0.8 * expected[bright]).all()


def exact_radiance(packed: Packed, points: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """cd/m2 of a white Lambertian plane, first channel; KHR_lights_punctual."""
    row = packed.lights[0]
    wi, distance = towards(packed, points)
    cosine = -wi @ row["direction"].astype(float)
    cone = np.clip(cosine * row["cone_scale"] + row["cone_offset"], 0.0, 1.0) ** 2
    square = 1.0 if row["kind"] == 2 else distance**2
    return np.asarray(row["intensity"][0] * cone * np.maximum(wi @ normal, 0.0) / (math.pi * square))


def set_rotation(node: object, pose: np.ndarray) -> None:
    from scipy.spatial.transform import Rotation

    node.rotation = tuple(Rotation.from_matrix(pose[:3, :3]).as_quat())


@pytest.mark.parametrize("thickness", [1.0, 0.02])
def test_a_shadow_begins_at_the_foot(lamp: Lamp, thickness: float) -> None:
    """Behind a wall all floor is dark from two texels off its foot on, however thin it is."""
    scene = Scene()
    scene.add(quad(4.0), material=Material(specular=0.0))
    scene.add(box((-3.0, 0.0, -thickness), (3.0, 1.0, 0.0)), material=Material(specular=0.0))
    node = scene.add(DirectionalLight())
    set_rotation(node, look_at_pose(np.array([0.0, 1.0, -1.0]), np.zeros(3)))
    view = CameraView(
        (200, 100), look_at_pose(np.array([0.0, 3.0, 2.0]), np.array([0.0, 0.0, 0.5])), near=0.01
    )
    lit = lamp(pack(scene), view, 128)
    floor = lit.ids == 1
    x, z = lit.points[..., 0], lit.points[..., 2]
    texel = 2.0**0.5 * lit.texels(np.zeros((1, 3)))[0]  # 45 degrees, on the floor
    shaded = floor & (np.abs(x) < 2.5) & (z > 0.0) & (z < 1.0 - 2.0 * texel)
    wrong = shaded & (lit.radiance.sum(-1) > 0.0)
    assert shaded.sum() > 2000 and (not wrong.any() or z[wrong].max() < 2.0 * texel)
    beyond = floor & (np.abs(x) < 2.5) & (z > 1.0 + 2.0 * texel)
    assert beyond.sum() > 500 and (lit.radiance[beyond].sum(-1) > 0.0).all()


def test_direct_light_does_not_depend_on_near(lamp: Lamp) -> None:
    packed = pack(mixed_scene())
    results = [
        lamp(packed, view_of((160, 90), near=near), near=shadow_near).radiance
        for near, shadow_near in ((1e-3, 1e-4), (0.05, 1e-2))
    ]
    differ = np.abs(results[0] - results[1]).max(-1) > 1e-3 * results[0].max()
    assert differ.mean() < 2e-3  # single pixels at silhouettes and shadow edges round otherwise


def test_blend_casts_a_partial_shadow(lamp: Lamp) -> None:
    scene = Scene()
    scene.add(quad(5.0), material=Material(specular=0.0, roughness=1.0))
    scene.add(
        quad(1.0), translation=(0.0, 1.0, 0.0),
        material=Material(base_color=(1, 1, 1, 0.25), alpha_mode=AlphaMode.BLEND),
    )  # fmt: skip
    scene.add(PointLight(), translation=(0.0, 2.0, 0.0))
    view = CameraView((96, 96), look_at_pose(np.array([0.0, 0.9, 0.01]), np.zeros(3)), 0.8, near=0.01)
    part = lamp(pack(scene), view).radiance
    scene.roots.pop(1)
    free = lamp(pack(scene), view).radiance
    # the view covers about 50 x 50 texels of the shadow: standard deviation 0.009; 5 of them
    assert float((part / free).mean()) == pytest.approx(0.75, abs=0.045)


def test_shared_corners_are_where_they_were() -> None:
    """And flat meshes need as many vertices as they have places, smooth ones what they had."""
    scene = mixed_scene()
    scene.roots[1].parts[0].mesh.normals = None
    geometry = pack(scene).geometry
    shared = shared_indices(geometry)
    for field in ("position", "uv0", "color"):
        assert (geometry.vertices[field][shared] == geometry.vertices[field][geometry.indices]).all()
    for kept in geometry.ranges:
        corners = slice(kept.first_index, kept.first_index + 3 * kept.triangle_count)
        assert len(np.unique(shared[corners])) == len(np.unique(kept.mesh.triangles))
