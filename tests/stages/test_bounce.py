"""Bounce maps against exact ray casts, and the flux of their texels."""

from __future__ import annotations

import numpy as np
import pytest
from exact import cast, cube_direction, interior, mixed_scene, packed_mixed, quad, triangles_of

from ispm.frame import BounceMaps
from ispm.gpu import Gpu
from ispm.optics.records import NO_HIT
from ispm.scene.light import PointLight
from ispm.scene.material import AlphaMode, Material, Texture, TextureUse
from ispm.scene.packed import Packed, pack
from ispm.scene.scene import Scene
from ispm.stages.bounce import BounceStage
from ispm.stages.upload import Upload

SHIFTS = [(0.0, 0.0), (0.31, -0.44), (-0.5, 0.5)]


def draw(
    gpu: Gpu, packed: Packed, widths: list[int], shifts: list[tuple[float, float]], near: float = 1e-3
) -> list[np.ndarray]:
    upload, stage = Upload(gpu), BounceStage(gpu)
    with gpu.frame() as frame:
        maps: BounceMaps = stage(frame, upload(packed), widths, shifts, near)
    result = maps.read(gpu)
    stage.close()
    upload.close()
    return result


def texel_rays(width: int, shift: tuple[float, float]) -> np.ndarray:
    face, y, x = np.mgrid[:6, :width, :width]
    return cube_direction(face, x, y, width, shift)


@pytest.mark.parametrize("shift", SHIFTS)
def test_bounce_map_matches_exact_rays(gpu: Gpu, shift: tuple[float, float]) -> None:
    packed, width = packed_mixed(), 40
    (got,) = draw(gpu, packed, [width], [shift])
    triangles = triangles_of(packed)
    directions = texel_rays(width, shift).reshape(-1, 3)
    origin = packed.lights["position"][0].astype(float)
    row, distance, _ = cast(triangles, np.broadcast_to(origin, directions.shape), directions)
    distance[row < 0] = 0.0
    hit = row >= 0
    instance = np.where(hit, triangles.instance[row], NO_HIT).reshape(6, width, width)
    primitive = np.where(hit, triangles.primitive[row], 0).reshape(6, width, width)
    same = (got[..., 0] == instance) & ((got[..., 1] == primitive) | (instance == NO_HIT))
    facet = row.reshape(6, width, width)
    inside = np.stack([interior(face) for face in facet])
    assert same[inside].all() and (~same).mean() < 0.02  # edges may snap to the sub-pixel grid
    assert set(np.unique(instance)) == {0, 1, 2, 3, NO_HIT}
    hits = same & (instance != NO_HIT)
    found = np.ascontiguousarray(got[..., 2:]).view(np.float32).astype(float)
    # the point that the barycentrics give, against the exact one: a thousandth of a texel across the ray
    corners = triangles.corners[facet]
    points = corners[..., 0, :] + sum(
        found[..., k, None] * (corners[..., k + 1, :] - corners[..., 0, :]) for k in (0, 1)
    )
    exact = (origin + directions * distance[:, None]).reshape(6, width, width, 3)
    d = directions.reshape(6, width, width, 3)
    off = (points - exact)[hits]
    across = off - d[hits] * (off * d[hits]).sum(-1, keepdims=True)
    texel = 2.0 / width * distance.reshape(6, width, width)[hits]
    assert (np.linalg.norm(across, axis=1) / texel).max() < 1e-3
    assert (found >= 0.0).all() and (found.sum(-1) <= 1.0 + 1e-6)[hits].all()


def test_bounce_map_does_not_depend_on_near(gpu: Gpu) -> None:
    packed = packed_mixed()
    first, second = (draw(gpu, packed, [32], [(0.1, 0.1)], near)[0] for near in (1e-5, 1e-2))
    assert (first[..., :2] == second[..., :2]).mean() > 0.999


def test_range_ends_the_map(gpu: Gpu) -> None:
    scene = Scene()
    scene.add(quad(4.0))
    scene.add(PointLight(range=2.0), translation=(0.0, 1.0, 0.0))
    (got,) = draw(gpu, pack(scene), [32], [(0.0, 0.0)])
    down = texel_rays(32, (0.0, 0.0))[..., 1]
    hit = got[..., 0] == 0
    distance = 1.0 / np.maximum(-down, 1e-9)
    clear = np.abs(distance - 2.0) > 1e-4
    assert (hit == (distance < 2.0))[clear].all() and hit.any()


def test_masked_texels_let_photons_through(gpu: Gpu) -> None:
    """A quad with a hole in one quarter, above a floor."""
    pixels = np.full((2, 2, 4), 255, np.uint8)
    pixels[0, 0, 3] = 0
    holed = Material(
        alpha_mode=AlphaMode.MASK,
        base_color_texture=TextureUse(Texture(pixels, linear=False, mipmaps=False)),
    )
    scene = Scene()
    scene.add(quad(1.0), material=holed, translation=(0.0, 1.0, 0.0))
    scene.add(quad(9.0))
    scene.add(PointLight(), translation=(0.0, 2.0, 0.0))
    packed = pack(scene)
    (got,) = draw(gpu, packed, [64], [(0.0, 0.0)])
    d = texel_rays(64, (0.0, 0.0))[3]  # downwards; the upper quad fills it just so
    through = (d[..., 0] < 0.0) & (d[..., 2] < 0.0)
    assert (got[3, ..., 0] == np.where(through, 1, 0)).all()


def test_blended_surface_stops_its_share(gpu: Gpu) -> None:
    scene = Scene()
    scene.add(quad(9.0), material=Material(base_color=(1, 1, 1, 0.3), alpha_mode=AlphaMode.BLEND))
    scene.add(PointLight(), translation=(0.0, 1.0, 0.0))
    (got,) = draw(gpu, pack(scene), [128], [(0.0, 0.0)])
    # 16 384 texels: standard deviation 0.0036; 5 of them
    assert (got[3, ..., 0] == 0).mean() == pytest.approx(0.3, abs=0.018)


def test_each_light_has_its_own_map(gpu: Gpu) -> None:
    scene = mixed_scene()
    scene.add(PointLight(), translation=(-3.0, 2.0, 0.0))
    scene.add(PointLight(), translation=(0.0, 5.0, 0.0))
    packed = pack(scene)
    shifts = [(0.0, 0.0), (0.2, 0.2), (0.1, -0.1)]
    together = draw(gpu, packed, [16, 0, 24], shifts)
    assert [m.shape for m in together] == [(6, 16, 16, 4), (6, 24, 24, 4)]
    (alone,) = draw(gpu, packed, [0, 0, 24], shifts)
    assert (together[1] == alone).all()
