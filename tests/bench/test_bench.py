"""The benchmark: what it reports, and that it measures what it says. Times are never asserted."""

import json
import math

import numpy as np
import pytest

from ispm import shapes
from ispm.accel.surface import SurfaceTable
from ispm.accel.world import World
from ispm.bench.change import changes, parse_report
from ispm.bench.rays import rays_of_walk
from ispm.bench.report import tables
from ispm.bench.suite import STAGES, measure_trace, moments, run_bench, spread
from ispm.cli.console import to_json
from ispm.library.builtin import builtin
from ispm.lights.emission import emit_rays
from ispm.lights.plan import plan_maps
from ispm.optics.records import NO_HIT
from ispm.optics.texture import TextureTable
from ispm.photons.walk import walk
from ispm.renderer.motion import moved
from ispm.scene.packed import pack
from ispm.scene.scene import Scene
from ispm.settings import Settings

TINY = Settings(size=(64, 36), photons=400, shadow_resolution=64, bounces=3)


@pytest.fixture(scope="module")
def report():
    return run_bench(quick=True, settings=TINY, frames=2)


def test_report_has_every_column_with_its_spread(report):
    columns = report.frame.columns
    assert set(columns) == {*STAGES, "photons_per_s", "ns_per_stored_photon"}
    for values in (*columns.values(), report.frame.no_bounces):
        assert 0.0 <= values.low <= values.q1 <= values.median <= values.q3 <= values.high
    assert report.frame.frames == 2


def test_quick_renders_a_quarter_of_the_pixels(report):
    assert (report.frame.stats.width, report.frame.stats.height) == (32, 18)


def test_timed_frames_have_an_object_that_moves(report):
    # The lantern, and nothing else.
    assert report.frame.stats.dynamic_polygons == 480
    assert report.frame.stats.dynamic_objects == 1
    assert report.frame.stats.static_polygons == 67_414 - 480


def test_report_survives_json_and_makes_tables(report):
    values = json.loads(to_json(report))
    assert values["frame"]["stats"]["polygons"] == 67_414
    assert values["peak_memory"] > 1e6 or not math.isfinite(values["peak_memory"])
    for _, rows in tables(report):
        assert len({len(row) for row in rows}) == 1


def test_report_can_be_compared_with_later_ones(report):
    measured = parse_report(to_json(report), "it")
    found = changes(measured, measured)
    assert [each.stage for each in found][-1] == "total at 0 bounces" and len(found) == len(STAGES) - 1
    assert [each.ratio for each in found if each.before] == [1.0] * sum(each.before > 0.0 for each in found)
    assert not any(each.is_slower for each in found)


def test_without_embree_the_trace_is_skipped_in_a_line(report, monkeypatch):
    monkeypatch.setattr("ispm.bench.suite.find_spec", lambda name: None)
    rays, rates = measure_trace(builtin("cornell-box"), TINY)
    assert rays > 0 and rates == []


def test_moments_change_camera_light_and_object_every_time():
    scene = builtin("atrium")
    before = None
    for moment in moments(scene, 5):
        packed = pack(moment)
        eye = moment.cameras[0].local_matrix()
        light = packed.lights["position"][0].copy()
        if before is not None:
            assert np.abs(eye - before[0]).max() > 1e-3
            assert np.abs(light - before[1]).max() > 1e-3
            assert moved(packed.placed, before[2]).sum() == 1
        before = eye, light, packed.placed
    assert scene.cameras[0].matrix is None  # the scene itself stays as it was


def test_rays_of_a_walk_are_those_it_traces():
    # As many as the walk counts, and those that ended on a surface end where its photons were stored: to
    # rounding, for the walk computes the place from the triangle and the ray from its length.
    scene = builtin("cornell-box")
    packed = pack(scene)
    world = World(1)
    world.update(packed)
    surfaces = SurfaceTable(packed, TextureTable.pack(packed.textures, packed.colors), 0.0)
    plan = plan_maps(packed, np.array([400]), 0.0, 3, 0)
    emitted = emit_rays(packed, world, surfaces, plan, 3, 0)
    path = walk(packed, world, surfaces, emitted, 6, 3, 0)
    origins, directions = rays_of_walk(packed, world, surfaces, emitted, 6, 3)
    assert len(origins) == path.rays > 1000
    hits = world.trace(origins, directions)
    ended = hits["instance"] != NO_HIT
    ends = origins + directions * hits["t"][:, None]
    assert np.abs(ends[ended] - path.photons["position"]).max() < 1e-5 * packed.diagonal


def test_spread_is_median_and_percentiles():
    values = spread([float(k) for k in range(101)])
    assert (values.low, values.median, values.high) == (5.0, 50.0, 95.0)


def test_nothing_moved_without_a_frame_before_or_with_other_instances():
    scene = Scene()
    for k in range(3):
        scene.add(shapes.box(), translation=(float(k), 0.0, 0.0))
    before = pack(scene).placed
    assert not moved(before, None).any()
    scene.nodes[2].translation = (2.0, 1.0, 0.0)
    after = pack(scene).placed
    assert moved(after, before).tolist() == [False, False, True]
    scene.remove(scene.nodes[0])
    assert not moved(pack(scene).placed, before).any()
