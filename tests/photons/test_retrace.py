"""The ways of photons, found again: exact places, the flux that is stored, and whose they are."""

import math

import numpy as np
import pytest
from transport import Tracer, aim, box_room, lit

import ispm
from ispm.library.common import lambert
from ispm.library.shapes import icosphere, polygons
from ispm.lights.bright import SPLIT_COUNT
from ispm.photons.retrace import retrace
from ispm.photons.steps import EVENTS
from ispm.photons.walk import EVENT_STEP, all_steps
from ispm.scene.material import Material

FLOOR = polygons([np.array([(-2, 0, -2), (-2, 0, 2), (2, 0, 2), (2, 0, -2)], float)])
MIRROR = Material((1.0,) * 3, metallic=1.0, roughness=0.0)
CLEAR = Material((1.0,) * 3, transmission=1.0, roughness=0.0, ior=1.0, thickness=0.1)


def ways(tracer, emitted, path, rows, bounces, seed=0, limit=math.inf):
    scene = tracer.packed, tracer.world, tracer.surfaces
    follow = lambda few: all_steps(*scene, few, bounces, seed, 0, limit)  # noqa: E731
    return retrace(emitted, path.photons[rows], path.keys[rows], follow)


def events(way):
    return [EVENTS[each] for each in way["event"]]


def test_a_mirror_reflects_along_one_line_exactly():
    """A mirror stands upright at x = 0; light from (1, 1, 0) meets it at y = 1/2 and the floor at x = 1."""
    scene = lit(ispm.Scene(), (1.0, 1.0, 0.0))
    scene.add(FLOOR, material=lambert((0.5,) * 3))
    wall = np.array([(0, 0, -1), (0, 1, -1), (0, 1, 1), (0, 0, 1)], float)
    scene.add(polygons([wall[::-1]]), material=MIRROR)
    tracer = Tracer(scene)
    emitted = aim(tracer, [(1, 1, 0)], [(-math.sqrt(0.8), -math.sqrt(0.2), 0)])
    path = tracer.walk(emitted, 4)
    assert len(path.photons) == 1
    (way,) = ways(tracer, emitted, path, [0], 4)
    # float32 rounding, and rays that leave the mirror 16 roundings off it
    np.testing.assert_allclose(way["position"], [(1, 1, 0), (0, 0.5, 0), (1, 0, 0)], atol=4e-6)
    assert events(way)[:2] == ["light", "mirror"]
    assert way["number"].tolist() == [0, 1, 2] and way["light"].tolist() == [0, 0, 0]
    assert (way["flux"] == path.photons["flux"][0]).all()


def test_glass_that_bends_nothing_and_a_sheet_are_passed_straight_on_exactly():
    """From (0, 3, 0) straight down a ball of index 1 about (0, 1, 0), a sheet at y = 2, and a floor."""
    scene = lit(ispm.Scene(), (0.01, 3.0, 0.02))
    scene.add(FLOOR, material=lambert((0.5,) * 3))
    scene.add(FLOOR, material=Material((1.0,) * 3, transmission=1.0, roughness=0.0), translation=(0, 2, 0))
    scene.add(icosphere(0.5, 3), material=CLEAR, translation=(0, 1, 0))
    tracer = Tracer(scene)
    emitted = np.concatenate([aim(tracer, [(0.01, 3, 0.02)], [(0, -1, 0)])] * 64)
    emitted["key"] = np.arange(64)  # some are reflected by the sheet
    path = tracer.walk(emitted, 0)
    through = np.flatnonzero((path.photons["position"][:, 1] == 0.0) & (path.photons["bounce"] == 0))
    assert len(through) > 32
    for way in ways(tracer, emitted, path, through, 0):
        assert events(way) == ["light", "sheet", "glass", "glass", "end"]
        np.testing.assert_allclose(way["position"][:, [0, 2]], [(0.01, 0.02)] * 5, atol=4e-6)
        np.testing.assert_allclose(way["position"][[0, 1, 4], 1], (3, 2, 0), atol=4e-6)
        assert way["position"][2, 1] + way["position"][3, 1] == pytest.approx(2.0, abs=4e-6)


@pytest.mark.parametrize(("limit", "parts"), [(math.inf, 1), (0.0, SPLIT_COUNT)])
def test_each_way_ends_as_its_photon_is_stored(limit, parts):
    """All photons of a room with a mirror: place, flux and number of scatters; parts of split ones too."""
    scene = lit(box_room(albedo=0.7), (0.1, 0.2, -0.3))
    scene.add(icosphere(0.2, 2), material=MIRROR, translation=(0.1, -0.2, 0.1))
    scene.add(icosphere(0.1, 2), material=CLEAR, translation=(-0.2, 0.1, 0.2))
    tracer = Tracer(scene)
    emitted = tracer.emit(300)
    path = tracer.walk(emitted, 8, limit=limit)
    found = ways(tracer, emitted, path, np.arange(len(path.photons)), 8, limit=limit)
    assert len(found) == len(path.photons) > 300 * parts
    seen, shares = set(), set()
    for way, photon in zip(found, path.photons, strict=True):
        seen.update(events(way))
        np.testing.assert_array_equal(way["position"][0], np.float32((0.1, 0.2, -0.3)))
        np.testing.assert_allclose(way["position"][-1], photon["position"], atol=2e-7)
        np.testing.assert_allclose(way["flux"][-1], photon["flux"], rtol=1e-6)
        back = way["position"][-2] - way["position"][-1]
        np.testing.assert_allclose(back, photon["wi"] * np.linalg.norm(back), atol=4e-6)
        assert way["number"].tolist() == list(range(len(way)))
        scatters = sum(each == "diffuse" for each in events(way)[:-1])
        assert scatters == photon["bounce"]
        shares.add(round(float(emitted["flux"][0, 0] / way["flux"][0, 0]), 5))
    assert shares == {1.0, float(parts)}  # those that meet a mirror first stay whole
    assert {"light", "diffuse", "mirror", "glass", "end"} == seen


def test_a_photon_of_another_walk_has_no_way():
    tracer = Tracer(lit(box_room(albedo=0.7)))
    emitted = tracer.emit(100)
    path = tracer.walk(emitted, 4)
    path.photons["position"][3] += 0.001
    first, second = ways(tracer, emitted, path, [2, 3], 4)
    assert len(first) and not len(second)


def test_steps_without_room_are_walked_again(monkeypatch):
    from ispm.photons import walk

    tracer = Tracer(lit(box_room(albedo=1.0)))
    emitted = tracer.emit(600)
    scene = tracer.packed, tracer.world, tracer.surfaces
    much = all_steps(*scene, emitted, 20, 0, 0)
    monkeypatch.setattr(walk, "_HITS", 7)
    assert all_steps(*scene, emitted, 20, 0, 0).tobytes() == much.tobytes()
    assert len(much) == 22 * len(emitted)  # the light, the first hit, 20 more
    first = much[1::22]
    np.testing.assert_array_equal(first["key"], emitted["key"])
    np.testing.assert_array_equal(much[2::22]["key"], emitted["key"] + np.uint32(EVENT_STEP))
    assert len(all_steps(*scene, emitted[:0], 20, 0, 0)) == 0
