"""Meshes that are larger than an adapter binds at once: here 96 vertices and 1,536 indices."""

from __future__ import annotations

import numpy as np
import pytest
from exact import mixed_scene, view_of

from ispm.gpu import Gpu
from ispm.lights.lightmap import light_maps
from ispm.lights.plan import PlannedMap
from ispm.optics.records import VERTEX
from ispm.scene import packed_vertices
from ispm.scene.material import AlphaMode, Material, Texture, TextureUse
from ispm.scene.mesh import Mesh
from ispm.scene.packed import Packed, pack
from ispm.scene.scene import Scene
from ispm.scene.windows import Window, cut_windows
from ispm.stages.bounce import BounceStage
from ispm.stages.gbuffer import GBufferStage
from ispm.stages.upload import Upload

LIMIT = 96 * VERTEX.itemsize


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch, gpu: Gpu) -> None:
    monkeypatch.setattr(packed_vertices, "MOST_VERTICES", 92)
    monkeypatch.setattr(gpu, "max_binding", LIMIT)


def wavy(n: int, seed: int, smooth: bool, uv: bool) -> Mesh:
    """A sheet of n x n vertices whose triangles come in any order."""
    rng = np.random.default_rng(seed)
    x, z = np.meshgrid(np.linspace(-1.0, 1.0, n), np.linspace(-1.0, 1.0, n))
    y = 0.2 * np.sin(3.0 * x) + 0.02 * rng.standard_normal(x.shape)
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    row = np.arange(n * n).reshape(n, n)
    a, b, c, d = (r.ravel() for r in (row[:-1, :-1], row[1:, :-1], row[1:, 1:], row[:-1, 1:]))
    triangles = rng.permutation(np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]))
    mesh = Mesh(points, triangles, uv0=points[:, ::2] * 2.0 if uv else None)
    mesh.normals = mesh.smooth_normals() if smooth else None
    return mesh


def scene_of_all_kinds() -> Scene:
    """Meshes of shared and of own vertices, with maps of normals, of holes and of specular color."""
    rng = np.random.default_rng(1)
    scene = mixed_scene()
    texels = [rng.integers(0, 255, (16, 16, 4), np.uint8) for _ in range(3)]
    texels[0][..., 2] = 255
    bumpy = Material(normal_texture=TextureUse(Texture(texels[0], srgb=False)))
    holed = Material(
        base_color_texture=TextureUse(Texture(texels[1])), alpha_mode=AlphaMode.MASK, double_sided=True
    )
    shiny = Material(specular_color_texture=TextureUse(Texture(texels[2])))
    for k, (material, smooth, uv) in enumerate(
        [
            (bumpy, True, True),
            (bumpy, False, True),
            (holed, True, True),
            (shiny, False, True),
            (Material(), False, False),
        ]
    ):
        scene.add(wavy(16, k, smooth, uv), translation=(-2.0 + k, 0.5 + 0.3 * k, -1.0), material=material)
    return scene


def drawn(gpu: Gpu, packed: Packed) -> dict[str, np.ndarray]:
    """What the stages that fetch vertices draw, in exact bits."""
    scene = Upload(gpu)(packed)
    eye, bounce = GBufferStage(gpu), BounceStage(gpu)
    plan = [PlannedMap(map, 1000, 32, (0.0, 0.0), 0.5) for map in light_maps(packed)]
    with gpu.frame() as frame:
        out = eye(frame, scene, view_of())
        maps = bounce(frame, scene, plan, 1e-3)
    wanted = dict(ids=(np.uint32, 2), points=(np.uint32, 4), normals=(np.uint32, 2), base=(np.uint16, 4),
                  emission=(np.uint16, 4), depth=(np.uint32, 1), specular=(np.uint8, 4))  # fmt: skip
    images = gpu.read_many([(getattr(out, name), *form) for name, form in wanted.items()])
    return dict(zip(wanted, images, strict=True)) | {"bounce": np.concatenate(maps.read(gpu))}


def test_pictures_of_windows_are_those_of_the_whole(gpu: Gpu, request: pytest.FixtureRequest) -> None:
    scene = scene_of_all_kinds()
    whole = drawn(gpu, pack(scene))
    assert len(np.unique(whole["ids"][..., 0])) > 8  # all are in the picture
    request.getfixturevalue("small")
    packed = pack(scene)
    assert len(packed.geometry.vertices) > len(pack_whole(scene).geometry.vertices)
    assert len(cut_windows(packed.geometry.ranges, LIMIT)) > 20
    parts = drawn(gpu, packed)
    for name, image in whole.items():
        np.testing.assert_array_equal(parts[name], image, err_msg=name)


def pack_whole(scene: Scene) -> Packed:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(packed_vertices, "MOST_VERTICES", 1 << 20)
        return pack(scene)


@pytest.mark.usefixtures("small")
def test_chunks_hold_the_same_triangles() -> None:
    scene = scene_of_all_kinds()
    packed, whole = pack(scene).geometry, pack_whole(scene).geometry
    for name in VERTEX.names or ():
        got, wanted = packed.vertices[name][packed.indices], whole.vertices[name][whole.indices]
        np.testing.assert_array_equal(got, wanted, err_msg=name)


@pytest.mark.usefixtures("small")
def test_windows_show_each_triangle_once_and_fit() -> None:
    geometry = pack(scene_of_all_kinds()).geometry
    windows = cut_windows(geometry.ranges, LIMIT)
    shown = np.zeros(len(geometry.indices), int)
    for window in windows:
        assert (window.end_vertex - window.first_vertex) * VERTEX.itemsize <= LIMIT
        assert (window.end_index - window.first_index) * 4 <= LIMIT
        assert window.first_vertex * VERTEX.itemsize % 256 == window.first_index * 4 % 256 == 0
        for mesh, (first, count) in window.corners.items():
            begin = geometry.ranges[mesh].first_index + first
            rows = geometry.indices[begin : begin + count]
            assert rows.min() >= window.first_vertex and rows.max() < window.end_vertex
            assert begin >= window.first_shown >= window.first_index and begin + count <= window.end_index
            shown[begin : begin + count] += 1
    assert (shown == 1).all()


def test_a_scene_that_fits_is_one_window() -> None:
    geometry = pack(scene_of_all_kinds()).geometry
    (window,) = cut_windows(geometry.ranges, 128 * 2**20)
    assert (window.first_vertex, window.end_vertex) == (0, len(geometry.vertices))
    assert (window.first_index, window.end_index) == (0, len(geometry.indices))
    assert cut_windows([], LIMIT) == [Window()]


@pytest.mark.usefixtures("small")
def test_meshes_that_deform_stay_in_their_chunks() -> None:
    scene = scene_of_all_kinds()
    before = pack(scene)
    mesh = scene.roots[-1].parts[0].mesh
    mesh.positions = mesh.positions * np.float32(1.5)
    now = pack(scene, before)
    assert now.geometry.indices is before.geometry.indices
    anew = pack(scene)
    assert now.geometry.vertices.tobytes() == anew.geometry.vertices.tobytes()
