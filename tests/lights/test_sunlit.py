"""Where a sun shines in: found, and photons aimed there."""

import numpy as np
from test_openings import MATTE, eye_rays, lit_by_a_hole, scene_of
from test_photons_of_surfaces import are_alike, runs
from transport import Tracer

from ispm import DirectionalLight, PointLight, euler, shapes
from ispm.lights.emission import emit_rays
from ispm.lights.plan import plan_maps
from ispm.lights.sunlit import find_sunlit

_LEAN = 20.0  # degrees of the sun, so that it shines through the hole onto a place beside it


def sun_through_a_hole() -> Tracer:
    """A floor below a ceiling with a hole, of .4 x .6 m at a height of 3 m, and a block on the floor."""
    scene = lit_by_a_hole(20.0)
    scene.environment = None
    scene.add(shapes.box((0.5, 0.5, 0.5)), material=MATTE, translation=(-1.2, 0.25, 0.0))
    scene.add(PointLight((5.0,) * 3), translation=(0.5, 1.0, 0.0))
    turn = euler(-90.0 + _LEAN, 90.0, 0.0, degrees=True)
    scene.add(DirectionalLight((1000.0,) * 3), rotation=turn)
    return Tracer(scene)


def test_places_where_the_sun_shines_lie_below_the_hole_along_its_light():
    """On the floor and on the block; the slab of 1 cm and the lift of rays are less than 1 cm off."""
    tracer = sun_through_a_hole()
    lamp, sun = find_sunlit(*scene_of(tracer), eye_rays()[0], 0, 0)
    assert len(lamp) == 0 and len(sun) > 20
    passed = sun[:, 0] + (3.0 - sun[:, 1]) * np.tan(np.radians(_LEAN))
    assert (np.abs(passed) < 0.2 + 0.01).all() and (np.abs(sun[:, 2]) < 0.3 + 0.01).all()


def sent_to(places):
    """What emits photons of the sun as rays, aimed at places; (): at none."""

    def emit(tracer, count, share, seed=0):
        plan = plan_maps(tracer.packed, np.array([0, count]), share, seed, 0, None, places)
        return emit_rays(*scene_of(tracer), plan, seed, 0)

    return emit


def test_none_are_aimed_where_most_is_lit():
    tracer, corners = sun_through_a_hole(), [[x, 3.01, z] for x in (-9.0, 9.0) for z in (-9.0, 9.0)]
    emitted = [sent_to(places)(tracer, 1000, 0.0) for places in ((), [np.zeros((0, 3)), np.array(corners)])]
    assert emitted[0].tobytes() == emitted[1].tobytes()


def test_photons_aimed_where_the_sun_shines_carry_the_same_flux_everywhere():
    """And five times as many come in."""
    tracer = sun_through_a_hole()
    plain, aimed = sent_to(()), sent_to(find_sunlit(*scene_of(tracer), eye_rays()[0], 0, 0))
    assert are_alike(*(runs(emit, tracer, 40_000, 0.0) for emit in (plain, aimed)))[:-1].all()
    inside = [np.isin(emit(tracer, 40_000, 0.0)["instance"], (0, 5)).sum() for emit in (plain, aimed)]
    assert inside[1] > 5 * inside[0] > 0
