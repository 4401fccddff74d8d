"""Bounce maps against exact ray casts, and the flux of their texels."""

from __future__ import annotations

import numpy as np
import pytest
from exact import cast, interior, map_rays, mixed_scene, packed_mixed, quad, triangles_of

from ispm.errors import SettingsError
from ispm.frame import BounceMaps
from ispm.gpu import Gpu
from ispm.lights.aim import aimed_maps
from ispm.lights.lightmap import LightMap, light_maps
from ispm.lights.plan import PlannedMap
from ispm.optics.records import NO_HIT
from ispm.scene.extent import corners_of
from ispm.scene.light import DirectionalLight, Light, PointLight, SpotLight
from ispm.scene.material import AlphaMode, Material, Texture, TextureUse
from ispm.scene.packed import Packed, pack
from ispm.scene.scene import Scene
from ispm.stages.bounce import BounceStage, _arrange
from ispm.stages.upload import Upload

SHIFTS = [(0.0, 0.0), (0.31, -0.44), (-0.5, 0.5)]
DOWN = (-(0.5**0.5), 0.0, 0.0, 0.5**0.5)
LIGHTS = {
    "cube": PointLight(),
    "square": SpotLight(outer_angle=1.0),
    "spot's cube": SpotLight(outer_angle=1.4),
    "parallel": DirectionalLight(),
}


def planned(map: LightMap, width: int, shift: tuple[float, float] = (0.0, 0.0)) -> PlannedMap:
    return PlannedMap(map, 1000, width, shift, 0.5)


def draw(gpu: Gpu, packed: Packed, plan: list[PlannedMap], near: float = 1e-3) -> list[np.ndarray]:
    upload, stage = Upload(gpu), BounceStage(gpu)
    with gpu.frame() as frame:
        maps: BounceMaps = stage(frame, upload(packed), plan, near)
    return maps.read(gpu)


def mixed_with(light: Light) -> Packed:
    scene = mixed_scene()
    scene.roots.pop()
    tilted = (-0.6, 0.15, 0.1, 0.78)
    scene.add(light, translation=(0.3, 3.0, 0.8), rotation=tilted)
    return pack(scene)


@pytest.mark.parametrize("kind", LIGHTS)
@pytest.mark.parametrize("shift", SHIFTS)
def test_bounce_map_matches_exact_rays(gpu: Gpu, kind: str, shift: tuple[float, float]) -> None:
    packed, width = mixed_with(LIGHTS[kind]), 40
    map = light_maps(packed)[0]
    (got,) = draw(gpu, packed, [planned(map, width, shift)])
    assert got.shape == (6 if "cube" in kind else 1, width, width, 2)
    triangles = triangles_of(packed)
    starts, directions = map_rays(map, width, shift)
    row, *_ = cast(triangles, starts.reshape(-1, 3), directions.reshape(-1, 3))
    facet = row.reshape(got.shape[:3])
    instance = np.where(facet >= 0, triangles.instance[facet], NO_HIT)
    primitive = np.where(facet >= 0, triangles.primitive[facet], 0)
    same = (got[..., 0] == instance) & ((got[..., 1] == primitive) | (instance == NO_HIT))
    inside = np.stack([interior(face) for face in facet])
    assert same[inside].all() and (~same).mean() < 0.03  # edges may snap to the sub-pixel grid
    assert {0, 1, 2} <= set(np.unique(instance))


def test_crop_of_a_parallel_map_sees_what_stands_before_it(gpu: Gpu) -> None:
    """The lower of two quads, in a crop around it, is hidden by the upper."""
    scene = Scene()
    for height in (0.0, 5.0):
        scene.add(quad(1.0), translation=(0.0, height, 0.0))
    scene.add(quad(1.0), translation=(9.0, 0.0, 0.0))
    scene.add(DirectionalLight(), rotation=DOWN)
    packed = pack(scene)
    (map,) = light_maps(packed)
    part = aimed_maps(map, packed.lights[0], corners_of(packed.boxes[:1]), 8)[0]
    assert part.measure == pytest.approx(4.0 * 1.02**2, rel=1e-6)
    (got,) = draw(gpu, packed, [planned(part, 16)])
    assert (got[..., 0] == 1).all()


def test_bounce_map_does_not_depend_on_near(gpu: Gpu) -> None:
    packed = packed_mixed()
    plan = [planned(light_maps(packed)[0], 32, (0.1, 0.1))]
    first, second = (draw(gpu, packed, plan, near)[0] for near in (1e-5, 1e-2))
    assert (first[..., :2] == second[..., :2]).mean() > 0.999


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
    (got,) = draw(gpu, packed, [planned(light_maps(packed)[0], 64)])
    d = map_rays(light_maps(packed)[0], 64)[1][3]  # downwards; the upper quad fills it just so
    through = (d[..., 0] < 0.0) & (d[..., 2] < 0.0)
    assert (got[3, ..., 0] == np.where(through, 1, 0)).all()


def test_blended_surface_stops_its_share(gpu: Gpu) -> None:
    scene = Scene()
    scene.add(quad(9.0), material=Material(base_color=(1, 1, 1, 0.3), alpha_mode=AlphaMode.BLEND))
    scene.add(PointLight(), translation=(0.0, 1.0, 0.0))
    packed = pack(scene)
    (got,) = draw(gpu, packed, [planned(light_maps(packed)[0], 128)])
    # 16 384 texels: standard deviation 0.0036; 5 of them
    assert (got[3, ..., 0] == 0).mean() == pytest.approx(0.3, abs=0.018)


def test_opacity_is_that_of_the_finest_texels(gpu: Gpu) -> None:
    """A quad with the opaque corner of a picture: seen small, the rest of the picture makes no holes in it.
    A texel as wide as the quad would have an opacity of 0.7 by mips: 40 are full by a chance of 1e-6."""
    pixels = np.zeros((256, 256, 4), np.uint8)
    pixels[:26, :26, 3] = 255
    use = TextureUse(Texture(pixels), transform=((0.09, 0.0, 0.005), (0.0, 0.09, 0.005)))
    scene = Scene()
    scene.add(quad(1.0), material=Material(alpha_mode=AlphaMode.BLEND, base_color_texture=use))
    scene.add(PointLight(), translation=(0.0, 1.0, 0.0))
    packed = pack(scene)
    got = draw(gpu, packed, 40 * [planned(light_maps(packed)[0], 1)])
    assert all(map[3, 0, 0, 0] == 0 for map in got)


def test_maps_lie_side_by_side_without_touching(gpu: Gpu) -> None:
    """Each is what it would be alone, wherever its faces come to lie."""
    scene = mixed_scene()
    scene.add(SpotLight(), translation=(0.0, 4.0, 0.0), rotation=DOWN)
    scene.add(DirectionalLight(), rotation=DOWN)
    packed = pack(scene)
    of_light = light_maps(packed)
    plan = [
        planned(of_light[0], 16),
        planned(of_light[1], 2100, (0.3, 0.1)),
        planned(of_light[2], 100, (0.2, 0.2)),
        planned(of_light[0], 24, (0.1, -0.1)),
    ]
    together = draw(gpu, packed, plan)
    for each, got in zip(plan, together, strict=True):
        (alone,) = draw(gpu, packed, [each])
        same = (got[..., :2] == alone[..., :2]).all(axis=-1)
        assert same.mean() > 0.995  # a viewport's place rounds
    assert draw(gpu, packed, []) == []


def test_faces_do_not_overlap() -> None:
    packed = packed_mixed()
    random = np.random.default_rng(0)
    for count, widest in ((1, 9), (64, 40), (30, 900), (5, 3000)):
        plan = [planned(light_maps(packed)[0], int(w)) for w in random.integers(1, widest + 1, count)]
        maps, size = _arrange(plan, 8192)
        taken = np.zeros(size[::-1], np.uint8)
        for each in maps:
            for x, y in each.corners:
                part = taken[y : y + each.width, x : x + each.width]
                assert part.shape == (each.width, each.width)
                part += 1
        assert taken.max() == 1 and (count == 1 or taken.mean() > 0.4)


def test_maps_beyond_the_adapter_name_the_cure(gpu: Gpu) -> None:
    packed = packed_mixed()
    with pytest.raises(SettingsError, match=r"photons: 1000 .*fewer.*rays"):
        draw(gpu, packed, [planned(light_maps(packed)[0], gpu.max_texture // 2 + 1)])
