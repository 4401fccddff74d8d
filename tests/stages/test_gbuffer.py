"""The G-buffer against exact ray casts."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from exact import cast, interior, mixed_scene, packed_mixed, quad, triangles_of, view_of
from transport import Tracer

from ispm.accel.glow import glow
from ispm.accel.records import Hit
from ispm.gpu import Gpu
from ispm.optics.jit import jit
from ispm.optics.records import PIXEL_BACK
from ispm.scene.camera import look_at_pose
from ispm.scene.color import linear
from ispm.scene.material import AlphaMode, Material, Texture, TextureUse, Wrap
from ispm.scene.packed import Packed, pack
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView
from ispm.stages.gbuffer import GBufferStage
from ispm.stages.upload import Upload

# Pixels whose sample lies within the rasteriser's snapping of an edge may fall on either side of it.
# Sub-pixel precision is at least 4 bits; only pixels away from edges are compared exactly, and in all
# others the two may differ in at most this share.
EDGE_SHARE = 0.01


def draw(gpu: Gpu, packed: Packed, view: CameraView) -> dict[str, np.ndarray]:
    upload, stage = Upload(gpu), GBufferStage(gpu)
    with gpu.frame() as frame:
        out = stage(frame, upload(packed), view)
    ids, points, normals, base, emission, depth = gpu.read_many([
        (out.ids, np.uint32, 2), (out.points, np.uint32, 4), (out.normals, np.int16, 4),
        (out.base, np.float16, 4), (out.emission, np.float16, 4), (out.depth, np.float32),
    ])  # fmt: skip
    n, ng = (decode(normals[..., k : k + 2] / 32767.0) for k in (0, 2))
    return dict(ids=ids, points=points, n=n, ng=ng, base=base, emission=emission, depth=depth)


def decode(p: np.ndarray) -> np.ndarray:
    z = 1.0 - np.abs(p).sum(-1)
    folded = (1.0 - np.abs(p[..., ::-1])) * np.where(p >= 0, 1.0, -1.0)
    v = np.concatenate([np.where((z < 0)[..., None], folded, p), z[..., None]], -1)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.degrees(2.0 * np.arcsin(np.clip(np.linalg.norm(a - b, axis=-1) / 2.0, 0.0, 1.0)))


VIEWS = {
    "perspective": {},
    "orthographic": dict(ymag=2.5, near=0.1, far=20.0),
    "jittered": dict(jitter=(0.37, -0.21)),
}


@pytest.mark.parametrize("options", VIEWS.values(), ids=VIEWS)
def test_gbuffer_matches_exact_rays(gpu: Gpu, options: dict) -> None:
    packed, view = packed_mixed(), view_of(**options)
    got = draw(gpu, packed, view)
    triangles = triangles_of(packed)
    origins, directions = (a.reshape(-1, 3) for a in view.rays())
    double_sided = (packed.materials["flags"][packed.instances["material"]] & 4)[triangles.instance] != 0
    to_eye = np.einsum("nk,tk->nt", -directions, triangles.front) > 0.0
    row, distance, uv = cast(triangles, origins, directions, to_eye | double_sided)
    shape = got["depth"].shape
    instance = np.where(row >= 0, triangles.instance[row] + 1, 0).reshape(shape)
    same = got["ids"][..., 0] == instance
    assert same[interior(instance)].all() and (~same).mean() < EDGE_SHARE
    assert {0, 1, 2, 3} <= set(np.unique(instance)) and len(packed.instances) not in np.unique(instance)

    facet = row.reshape(shape)
    inside = interior(facet) & (facet >= 0)
    points = (origins + directions * distance[:, None]).reshape(*shape, 3)
    rebuilt = rebuild(view, got["depth"])
    # depth has 24 bits over the whole range, and the matrices are float32: 1e-5 of the distance
    assert np.abs(rebuilt - points)[inside].max() < 1e-5 * distance[row >= 0].max()
    material = packed.instances["material"][np.maximum(instance, 1) - 1]
    assert (got["ids"][..., 1] == triangles.primitive[facet])[inside].all()
    assert ((got["points"][..., 3] & (PIXEL_BACK - 1)) - 1 == material)[inside].all()
    assert ((got["points"][..., 3] > 0) == (got["ids"][..., 0] > 0)).all()

    ng = triangles.front[facet]
    ng *= np.where((ng * directions.reshape(*shape, 3)).sum(-1) < 0.0, 1.0, -1.0)[..., None]
    # 16 bits a coordinate round by 2^-16, which folding and normalising make 2.6 times as much
    assert angle(got["ng"], ng)[inside].max() < 0.004
    expected = shading_normals(packed, triangles, facet, uv.reshape(*shape, 2), ng)
    assert angle(got["n"], expected)[inside].max() < 0.004
    assert ((got["n"] * got["ng"]).sum(-1) > 0.0)[facet >= 0].all()


def rebuild(view: CameraView, depth: np.ndarray) -> np.ndarray:
    """World positions, by the formula of camera.wgsl in float64."""
    height, width = depth.shape
    ndc = np.ones((height, width, 4))
    ndc[..., 0] = 2.0 * (np.arange(width) + 0.5) / width - 1.0
    ndc[..., 1] = 1.0 - 2.0 * (np.arange(height)[:, None] + 0.5) / height
    ndc[..., 2] = np.where(depth > 0.0, depth, 1.0)
    world = ndc @ view.world_from_clip.T
    return world[..., :3] / world[..., 3:]


def shading_normals(packed: Packed, triangles, facet, uv, ng) -> np.ndarray:
    record = packed.instances[triangles.instance[facet]]
    first = record["first_index"].astype(np.int64) + 3 * triangles.primitive[facet]
    rows = packed.geometry.indices[first[..., None] + np.arange(3)]
    weights = np.concatenate([1.0 - uv.sum(-1, keepdims=True), uv], -1)
    local = np.einsum("...c,...ck->...k", weights, packed.geometry.vertices["normal"][rows].astype(float))
    cofactors = np.stack([record[f"normal{k}"][..., :3] for k in range(3)], -2).astype(float)
    n = np.einsum("...ij,...j->...i", cofactors, local)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    return n * np.where((n * ng).sum(-1) < 0.0, -1.0, 1.0)[..., None]


def test_gbuffer_holds_the_material(gpu: Gpu) -> None:
    scene = Scene()
    colors = np.array([[1.0, 0.5, 0.25, 1.0]] * 4)
    mesh = quad(2.0)
    mesh.colors = colors.astype(np.float32)
    scene.add(mesh, material=Material(
        base_color=(0.5, 0.5, 1.0), metallic=0.25, roughness=0.75, emission=(1.0, 2e5, 3.0)
    ))  # fmt: skip
    pixel = {k: v[45, 80] for k, v in draw(gpu, pack(scene), from_above()).items()}
    # vertex colors are bytes: 128/255 and 64/255; halves truncate by 2^-10 at most
    assert pixel["base"] == pytest.approx([0.5, 0.5 * 128 / 255, 64 / 255, 0.25], rel=2**-10)
    assert pixel["emission"] == pytest.approx([1.0, -math.sqrt(2e5), 3.0, 0.75], rel=2**-10)


def from_above(size: tuple[int, int] = (160, 90)) -> CameraView:
    return CameraView(size, look_at_pose(np.array([0.0, 3.0, 0.0]), np.zeros(3)), near=0.01)


def test_unlit_material_glows_and_reflects_nothing(gpu: Gpu) -> None:
    scene = Scene()
    scene.add(quad(2.0), material=Material(base_color=(0.5, 0.25, 1.0), unlit=True))
    pixel = {k: v[45, 80] for k, v in draw(gpu, pack(scene), from_above()).items()}
    assert (pixel["emission"][:3] == [0.5, 0.25, 1.0]).all() and (pixel["base"][:3] == 0.0).all()


@jit
def _glow(tables, dx, dy, dz):
    return glow(tables, Hit(np.uint32(0), np.uint32(0), np.float32(0.25), np.float32(0.25)), (dx, dy, dz))


GLOW, GLOW_AS_COLOR = (1.0, 2.0, 4.0), (0.25, 0.5, 1.0)


@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (-1.0, 1.0, 1.0), (1.0, -1.0, 1.0), (-2.0, -1.0, -1.0)])
@pytest.mark.parametrize("material, both", [
    (Material(emission=GLOW), False),
    (Material(emission=GLOW, emission_texture=Texture(np.full((1, 1, 4), 255, np.uint8))), False),
    (Material(emission=GLOW, double_sided=True), True),
    (Material(base_color=GLOW_AS_COLOR, unlit=True, double_sided=True), True),
])  # fmt: skip
def test_backs_of_one_sided_materials_do_not_glow(
    gpu: Gpu, scale: tuple[float, ...], material: Material, both: bool
) -> None:
    # glTF: counter-clockwise is the front, clockwise where a node mirrors. The quad faces +Y, scaled by y.
    scene = Scene()
    scene.add(quad(2.0), material=material, scale=scale)
    shown = np.array(material.base_color[:3] if material.unlit else GLOW)
    tracer = Tracer(scene)
    for side in (1.0, -1.0):
        expected = shown * (both or side == np.sign(scale[1]))
        view = CameraView((160, 90), look_at_pose(np.array([0.0, 3.0 * side, 0.0]), np.zeros(3)), near=0.01)
        drawn = draw(gpu, tracer.packed, view)
        assert (drawn["emission"][45, 80, :3] == expected).all()
        is_back = bool(drawn["points"][45, 80, 3] & PIXEL_BACK)
        assert is_back == (side != np.sign(scale[1])) or not expected.any()  # backs of others are not seen
        down = np.array([0.1, -side, 0.2], np.float32) / np.float32(1.05**0.5)
        assert (np.array(_glow(tracer.tables, *down)) == expected).all()


def test_textures_multiply_factors_by_their_own_uv(gpu: Gpu) -> None:
    def flat(*color: int, srgb: bool) -> TextureUse:
        return TextureUse(Texture(np.full((2, 2, 4), color, np.uint8), srgb=srgb))

    pixels = np.zeros((2, 2, 4), np.uint8)
    pixels[..., 3] = 255
    pixels[0, 1] = pixels[1, 0] = 188, 255, 255, 255  # sRGB 188 is 0.5029
    checker = Texture(pixels, linear=False, mipmaps=False, wrap_u=Wrap.REPEAT)
    scene = Scene()
    scene.add(quad(2.0), material=Material(
        metallic=0.5, roughness=0.5, emission=(2.0, 2.0, 2.0), normal_scale=0.5,
        base_color_texture=TextureUse(checker, 0, ((2.0, 0.0, 0.5), (0.0, 2.0, 0.0))),
        metallic_roughness_texture=flat(0, 51, 102, 255, srgb=False),
        emission_texture=flat(255, 0, 255, 255, srgb=True),
        normal_texture=flat(255, 127, 255, 255, srgb=False),
    ))  # fmt: skip
    view = from_above()
    got = draw(gpu, pack(scene), view)
    origins, directions = view.rays()
    points = origins + directions * (-origins[..., 1:2] / directions[..., 1:2])
    inside = (np.abs(points[..., [0, 2]]) < 1.9).all(-1)
    cell = np.floor(2.0 * (2.0 * (points[..., [0, 2]] / 4.0 + 0.5) + (0.5, 0.0))) % 2
    edge = np.abs(points[..., [0, 2]] / 0.5 - np.rint(points[..., [0, 2]] / 0.5)).min(-1) < 0.1
    light = (cell.sum(-1) == 1.0) & inside & ~edge
    dark = (cell.sum(-1) != 1.0) & inside & ~edge
    assert light.sum() > 500 and dark.sum() > 500
    assert np.abs(got["base"][light][:, 0] - 0.5029).max() < 2e-3 and (got["base"][light][:, 1] == 1.0).all()
    assert (got["base"][dark][:, :3] == 0.0).all()
    assert got["base"][inside][:, 3] == pytest.approx(0.5 * 102 / 255, abs=1e-3)
    assert got["emission"][inside][0] == pytest.approx([2.0, 0.0, 2.0, 0.5 * 51 / 255], abs=1e-3)
    # (1 * 0.5, ~0, 1) in the frame tangent = +x (u grows with x), n = +y
    expected = np.array([0.5, 1.0, 0.0]) / np.hypot(0.5, 1.0)
    assert angle(got["n"][inside], expected).max() < 0.3
    assert angle(got["ng"][inside], np.array([0.0, 1.0, 0.0])).max() < 0.004


def test_textures_of_specular_reflection_are_seen_where_they_are(gpu: Gpu) -> None:
    """As the same picture for base color and roughness, where the quad is seen, not before it."""
    random = np.random.default_rng(7)
    pixels = random.integers(0, 256, (4, 4, 4), np.uint8)
    colors = Texture(pixels, linear=False, mipmaps=False)
    twin = np.stack([pixels[..., 3]] * 4, axis=-1)
    scene = Scene()
    scene.add(quad(2.0), material=Material(
        base_color_texture=colors, specular_color_texture=colors, specular_texture=colors,
        metallic_roughness_texture=Texture(twin, srgb=False, linear=False, mipmaps=False),
    ))  # fmt: skip
    scene.add(quad(0.7), material=Material(base_color=(0.1, 0.2, 0.3)), translation=(0.3, 0.2, -0.4))
    packed, upload, stage = pack(scene), Upload(gpu), GBufferStage(gpu)
    with gpu.frame() as frame:
        out = stage(frame, upload(packed), from_above())
    ids, base, emission, specular = gpu.read_many([
        (out.ids, np.uint32, 2), (out.base, np.float16, 4), (out.emission, np.float16, 4),
        (out.specular, np.uint8, 4),
    ])  # fmt: skip
    shown = ids[..., 0] == 1
    assert 2000 < shown.sum() < (ids[..., 0] > 0).sum() - 500
    # Direct3D lets cards err by half a code of sRGB as they decode (data conversion rules); halves by 2^-11
    code, seen = specular[shown, :3].astype(np.float64), base[shown, :3].astype(np.float64)
    assert (seen >= linear((code - 0.5) / 255.0) - 2.0**-11 * seen).all()
    assert (seen <= linear((code + 0.5) / 255.0) + 2.0**-11 * seen).all()
    assert np.abs(specular[shown, 3] / 255.0 - emission[shown, 3]).max() < 1e-3
    assert len(np.unique(specular[shown], axis=0)) >= 12
    plain = pack(Scene(scene.nodes[1:]))
    with gpu.frame() as frame:
        out = stage(frame, upload(plain), from_above())
    assert out.specular.size == (1, 1)


def test_normal_map_is_mirrored_with_its_instance(gpu: Gpu) -> None:
    """A bump towards +u of a mesh points to -x where the mesh is mirrored in x; v's sense stays."""
    texture = Texture(np.full((1, 1, 4), (200, 180, 240, 255), np.uint8), srgb=False)
    results = []
    for sign in (1.0, -1.0):
        scene = Scene()
        scene.add(quad(2.0), scale=(sign, 1.0, 1.0), material=Material(normal_texture=TextureUse(texture)))
        results.append(draw(gpu, pack(scene), from_above())["n"][45, 80])
    assert angle(results[0] * (-1.0, 1.0, 1.0), results[1]) < 0.1 and results[0][0] > 0.1
    # glTF: +Y of a normal map is up in the picture, against v, which grows with z here
    assert results[0][2] < -0.1


def test_mask_cuts_holes_and_what_is_blended_shows_whole(gpu: Gpu) -> None:
    def share(**material: Any) -> float:
        scene = Scene()
        scene.add(quad(5.0), material=Material(**material))
        return float((draw(gpu, pack(scene), from_above((320, 180)))["ids"][..., 0] == 1).mean())

    assert share(base_color=(1, 1, 1, 0.4), alpha_mode=AlphaMode.MASK, alpha_cutoff=0.41) == 0.0
    assert share(base_color=(1, 1, 1, 0.4), alpha_mode=AlphaMode.MASK, alpha_cutoff=0.4) == 1.0
    assert share(base_color=(1, 1, 1, 0.4)) == 1.0
    assert share(base_color=(1, 1, 1, 0.3), alpha_mode=AlphaMode.BLEND) == 1.0
    assert share(base_color=(1, 1, 1, 1e-3), alpha_mode=AlphaMode.BLEND) == 0.0


def test_depth_does_not_depend_on_near(gpu: Gpu) -> None:
    packed = packed_mixed()
    views = [view_of(near=near) for near in (1e-4, 0.1)]
    first, second = (draw(gpu, packed, view) for view in views)
    assert (first["ids"] == second["ids"]).mean() > 0.999
    both = (first["ids"] == second["ids"]).all(-1) & (first["depth"] > 0)
    depths = [got["depth"][both].astype(float) for got in (first, second)]
    ratio = (views[0].near / depths[0]) / (views[1].near / depths[1])
    assert np.abs(ratio - 1.0).max() < 1e-5


def test_stage_follows_size_and_scene(gpu: Gpu) -> None:
    upload, stage = Upload(gpu), GBufferStage(gpu)
    scene = mixed_scene()
    packed = pack(scene)
    for size in ((64, 36), (33, 17), (64, 36)):
        with gpu.frame() as frame:
            out = stage(frame, upload(packed), view_of(size))
        assert out.size == size and gpu.read_texture(out.ids, np.uint32, 2).shape == (size[1], size[0], 2)
    scene.roots.clear()
    with gpu.frame() as frame:
        out = stage(frame, upload(pack(scene)), view_of((64, 36)))
    assert (gpu.read_texture(out.ids, np.uint32, 2) == 0).all()
