"""How photons are shared out to the maps of lights."""

import numpy as np
import pytest

from ispm.library.shapes import box, icosphere
from ispm.lights.lightmap import texel_measures
from ispm.renderer.light import emission_of, map_plan
from ispm.scene.light import PointLight
from ispm.scene.material import Material
from ispm.scene.packed import Packed, pack
from ispm.scene.scene import Scene
from ispm.settings import Settings

MIRROR = Material(metallic=1.0, roughness=0.0)


def room(light_count: int = 1, mirror: bool = True) -> Packed:
    scene = Scene()
    scene.add(box((-5, 0, -5), (5, 4, 5)))
    if mirror:
        scene.add(icosphere(0.4, 2, "ball"), material=MIRROR, translation=(2, 1, 0))
        scene.add(icosphere(0.2, 2, "bead"), material=MIRROR, translation=(-3, 1, 1))
    for k in range(light_count):
        scene.add(PointLight(), translation=(0.01 * k, 3, 0))
    return pack(scene)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5, 0.95, 1.0])
def test_a_share_of_the_photons_is_aimed(share):
    plan = map_plan(room(), Settings(photons=40_000, caustic_photons=share), 0)
    base, *aimed = plan
    assert len(base.map.axes) == 6 and all(len(each.map.axes) == 1 for each in aimed)
    assert len(aimed) == (2 if share else 0)
    assert base.photons == pytest.approx(40_000 * max(1 - share, 0.05), abs=3)
    assert sum(each.photons for each in plan) == 40_000
    if aimed:  # alike in flux
        densities = [each.photons / each.map.measure for each in aimed]
        assert densities[0] == pytest.approx(densities[1], rel=0.01)


def test_nothing_is_aimed_where_nothing_casts_caustics():
    assert len(map_plan(room(mirror=False), Settings(), 0)) == 1


def test_lights_with_few_photons_have_few_maps():
    """A map that is aimed is drawn for at least a hundred photons."""
    for light_count, most in ((64, 128), (256, 256)):
        plan = map_plan(room(light_count), Settings(photons=40_000), 0)
        assert light_count <= len(plan) <= light_count + most
        assert sum(each.photons for each in plan) == pytest.approx(40_000, abs=light_count)
    assert len(map_plan(room(), Settings(photons=200), 0)) == 1


def test_no_bounces_and_no_photons_need_no_maps():
    assert map_plan(room(), Settings(bounces=0), 0) == []
    assert map_plan(room(), Settings(photons=0), 0) == []


def test_shifts_differ_from_map_to_map_and_pass_to_pass():
    packed = room(3)
    plans = [map_plan(packed, Settings(seed=seed), p) for seed in (0, 1) for p in (0, 1)]
    shifts = np.array([(*each.shift, each.offset) for plan in plans for each in plan])
    assert len(np.unique(shifts)) == shifts.size
    assert (np.abs(shifts[:, :2]) <= 0.5).all() and (shifts[:, 2] >= 0).all() and (shifts[:, 2] < 1).all()


def test_large_scenes_are_traced_where_drawing_is_dear():
    packed = room(16, mirror=False)
    packed.instances["triangle_count"] = 6000
    settings = Settings(photons=40_000)
    plan = map_plan(packed, settings, 0)
    assert emission_of(plan, packed, settings, software=True) == "rays"
    assert emission_of(plan, packed, settings, software=False) == "map"
    small = room(mirror=False)
    assert emission_of(map_plan(small, settings, 0), small, settings, software=True) == "map"
    for way in ("map", "rays"):
        assert emission_of(plan, packed, settings.replace(emission=way), software=True) == way


def test_photons_are_a_choice_among_the_texels_of_a_map():
    """Not a grid, which mirrors would fold into rings: at most half of the texels emit one."""
    packed = room()
    for each in map_plan(packed, Settings(photons=40_000), 0):
        expected = texel_measures(each.map, packed.lights[0], each.width, each.shift)
        expected *= each.photons / each.map.measure
        assert 0.2 < expected.mean() < 0.6 and expected.max() <= 1.0
