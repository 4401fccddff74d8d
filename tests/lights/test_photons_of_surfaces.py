"""Photons of emissive surfaces and environments: their flux, and where it goes."""

import math

import numpy as np
import pytest
from exact_light import sky_irradiance
from transport import Tracer, box_room

from ispm import Environment, Material, RectLight, Scene
from ispm.library.common import lambert
from ispm.library.shapes import box, icosphere, polygons
from ispm.lights.environment_emission import emit_from_environment, environment_flux
from ispm.lights.surface_emission import emissive_flux, emit_from_surfaces
from ispm.optics.records import NO_HIT

GLASS = Material(transmission=1.0, roughness=0.0, ior=1.5, thickness=1.0)
SEEDS = 12
# t-distribution of 11 degrees of freedom: beyond 6.5 once in 22,000, so that 20 numbers are once in 1,100
FAR = 6.5


def of_surfaces(tracer, count, share=0.5, seed=0):
    return emit_from_surfaces(tracer.packed, tracer.world, tracer.surfaces, count, share, seed, 0, 1)


def of_environment(tracer, count, share=0.5, seed=0):
    return emit_from_environment(tracer.packed, tracer.world, tracer.surfaces, count, share, seed, 0, 1)


def landed(photons, instances):
    """(instances + 1, 3) float64 lm on each instance; the last row is what meets nothing."""
    where = np.where(photons["instance"] == NO_HIT, instances, photons["instance"])
    flux = photons["flux"].astype(float)
    return np.stack([np.bincount(where, flux[:, c], instances + 1) for c in range(3)], axis=1)


def runs(emit, tracer, count, share):
    """(SEEDS, instances + 1, 3) lm of as many independent draws."""
    size = len(tracer.packed.instances)
    return np.array([landed(emit(tracer, count, share, seed), size) for seed in range(SEEDS)])


def is_mean(found, exact, slack=1e-5):
    """Whether the mean over the first axis is `exact`, within FAR standard errors and float32's rounding."""
    error = found.std(axis=0, ddof=1) / math.sqrt(len(found))
    return np.abs(found.mean(axis=0) - exact) <= FAR * error + slack * np.abs(exact)


def are_alike(one, two):
    """Whether two sets of runs have the same mean."""
    error = np.sqrt((one.var(axis=0, ddof=1) + two.var(axis=0, ddof=1)) / SEEDS)
    return np.abs(one.mean(axis=0) - two.mean(axis=0)) <= FAR * error + 1e-5 * one.mean(axis=0)


GLOW = (3.0, 2.0, 1.0)


def lamp_scene(kind):
    """A room with a lamp, and the lamp's flux, (3,) lm: pi times its area times its radiance."""
    scene = box_room((-2, -1, -2), (2, 1, 2), albedo=0.6)
    glow = Material((0.2,) * 3, emission=GLOW, double_sided=kind == "two-sided")
    if kind == "ball":
        scene.add(icosphere(0.3, 4), material=glow, translation=(0.3, 0.2, 0.1), scale=(1.0, 2.0, -1.0))
    elif kind == "lamp":
        scene.add(RectLight(GLOW, 0.8, 0.3), translation=(0.0, 0.9, 0.0)).look_at((0.1, -1.0, 0.0))
    else:
        corners = np.array([(-0.5, 0.3, -0.2), (0.5, 0.3, -0.2), (0.5, 0.0, 0.4), (-0.5, 0.0, 0.4)])
        scene.add(polygons([corners]), material=glow, scale=(1.0, 1.5, 1.0))
    tracer = Tracer(scene)
    rows = tracer.tables.emitters.triangles
    corners = np.stack([rows["edge1"], rows["edge2"]], axis=1).astype(float)
    area = np.linalg.norm(np.cross(corners[:, 0], corners[:, 1]), axis=1).sum() / 2
    return tracer, math.pi * area * np.array(GLOW) * (2 if kind == "two-sided" else 1)


@pytest.mark.parametrize("kind", ["one-sided", "two-sided", "ball", "lamp"])
def test_photons_of_a_lamp_carry_its_flux(kind):
    """pi A L: with no caustics about each photon has the same share of it, to float32."""
    tracer, flux = lamp_scene(kind)
    photons = of_surfaces(tracer, 20_000)
    assert emissive_flux(tracer.packed, tracer.surfaces) == pytest.approx(
        flux @ (0.2126, 0.7152, 0.0722), rel=1e-4
    )
    assert photons["flux"].sum(axis=0, dtype=float) == pytest.approx(flux, rel=1e-3)
    np.testing.assert_allclose(photons["flux"][:, 0], flux[0] / 20_000, rtol=2e-3)
    assert (photons["instance"] != NO_HIT).all()  # the room is closed


@pytest.mark.parametrize("kind", ["one-sided", "two-sided", "ball", "lamp"])
def test_flux_of_lamps_is_absorbed_or_dropped(kind):
    """Exact sums of float32 in float64."""
    tracer, flux = lamp_scene(kind)
    path = tracer.walk(of_surfaces(tracer, 20_000), 6)
    ended = path.absorbed + path.escaped + path.dropped
    assert path.emitted == pytest.approx(flux, rel=1e-3)
    assert ended == pytest.approx(path.emitted, rel=1e-12)
    assert not path.escaped.any()


def test_two_sides_shine_alike_and_one_side_to_its_front_alone():
    """Of a square between floor and ceiling, without walls to the sides: half to each, to the binomial error
    of independent draws at most, 4.5 sigma."""
    for both in (False, True):
        scene = box_room((-3, -1, -3), (3, 1, 3))
        corners = np.array([(-0.5, 0, 0.5), (0.5, 0, 0.5), (0.5, 0, -0.5), (-0.5, 0, -0.5)])
        glow = Material((0.0,) * 3, specular=0.0, emission=GLOW, double_sided=both)
        scene.add(polygons([corners]), material=glow)
        tracer = Tracer(scene)
        photons = of_surfaces(tracer, 40_000)
        flux = landed(photons, 7)[:, 0] / photons["flux"][:, 0].sum(dtype=float)
        low, high = flux[2], flux[3]
        if both:
            assert low == pytest.approx(high, abs=4.5 / math.sqrt(40_000))
            assert low + high > 0.7
        else:
            assert low == 0.0 and high > 0.7


def with_caustics(environment=None):
    """A room, or open ground, with two glass balls, one of them small and near to the lamp."""
    if environment is None:
        scene = box_room((-2, -1, -2), (2, 1, 2), albedo=0.6)
        glow = Material((0.2,) * 3, emission=GLOW)
        scene.add(icosphere(0.3, 3), material=glow, translation=(0.3, 0.6, 0.1))
        scene.add(RectLight(GLOW, 0.8, 0.3), translation=(-1.0, 0.9, 0.0)).look_at((-0.9, -1.0, 0.0))
    else:
        scene = Scene(environment=environment)
        ground = np.array([(-2, -1, -2), (-2, -1, 2), (2, -1, 2), (2, -1, -2)], float)
        scene.add(polygons([ground]), material=lambert((0.5,) * 3))
        scene.add(box((-0.3, -1, 1.0), (0.5, 0.2, 1.5)), material=lambert((0.5,) * 3))
    scene.add(icosphere(0.4, 8), material=GLASS, translation=(0.2, -0.5, 0.2))
    scene.add(icosphere(0.15, 8), material=GLASS, translation=(-1.0, 0.5, 0.1))
    return Tracer(scene)


def test_lamps_photons_aimed_at_glass_carry_the_same_flux_everywhere():
    """On each of the 10 surfaces, 3 channels, alike within standard errors of 12 seeds of 20,000 photons; all
    together the lamps' flux."""
    tracer = with_caustics()
    plain, aimed = (runs(of_surfaces, tracer, 20_000, share) for share in (0.0, 0.9))
    assert are_alike(plain, aimed).all()
    flux = emissive_flux(tracer.packed, tracer.surfaces)
    luminance = (0.2126, 0.7152, 0.0722)
    for found in (plain, aimed):
        assert is_mean(found.sum(axis=1) @ luminance, flux, 1e-3)
    glass = plain.mean(axis=0)[-3:-1, 0]
    assert (glass > 0.0).all()
    # that they are aimed at all: more photons on glass
    counts = [np.bincount(of_surfaces(tracer, 20_000, share)["instance"]) for share in (0.0, 0.9)]
    assert counts[1][-2:].sum() > 3 * counts[0][-2:].sum()


IMAGE = np.random.default_rng(4).random((8, 16, 3)) ** 3 * 20.0


@pytest.mark.parametrize("rotation", [0.0, 1.9])
def test_environments_photons_aimed_at_glass_carry_the_same_flux_everywhere(rotation):
    tracer = with_caustics(Environment(IMAGE, rotation))
    plain, aimed = (runs(of_environment, tracer, 20_000, share) for share in (0.0, 0.9))
    found = are_alike(plain, aimed)[:-1]  # what is aimed past the box about the scene meets nothing
    assert found.all()
    counts = [(of_environment(tracer, 20_000, share)["instance"] // 2 == 1).sum() for share in (0.0, 0.9)]
    assert counts[1] > 2 * counts[0]  # on the two balls


def test_environments_photons_aimed_at_what_is_seen_carry_the_same_flux_everywhere():
    """A block on ground fifty times as wide, and beside it a glass ball: the same on each as not aimed, by
    ten times as many photons on the block."""
    scene = Scene(environment=Environment(IMAGE))
    ground = np.array([(-50, 0, -50), (-50, 0, 50), (50, 0, 50), (50, 0, -50)], float)
    scene.add(polygons([ground]), material=lambert((0.5,) * 3))
    scene.add(box((-1.0, 0.0, -1.0), (1.0, 2.0, 1.0)), material=lambert((0.5,) * 3))
    scene.add(icosphere(0.5, 8), material=GLASS, translation=(2.5, 0.6, 0.0))
    tracer = Tracer(scene)
    seen = np.random.default_rng(2).uniform((-2, 0, -2), (2, 2, 2), (500, 3))

    def aimed(tracer, count, share, seed=0):
        scene = tracer.packed, tracer.world, tracer.surfaces
        return emit_from_environment(*scene, count, share, seed, 0, 1, seen)

    for share in (0.0, 0.5):
        assert are_alike(*(runs(emit, tracer, 20_000, share) for emit in (of_environment, aimed)))[:-1].all()
    counts = [(emit(tracer, 20_000, 0.0)["instance"] == 1).sum() for emit in (of_environment, aimed)]
    assert counts[1] > 10 * counts[0]


NORMALS = np.array([(-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1)], float)


def block(environment, extra=None):
    """A box of 1 x 2 x 0.5 m whose faces are nodes, and their areas."""
    scene = Scene(environment=environment)
    low, high = np.array([-0.5, -1.0, -0.25]), np.array([0.5, 1.0, 0.25])
    for n in NORMALS:
        axis = np.abs(n).argmax()
        a, b = (axis + 1) % 3, (axis + 2) % 3
        corners = np.zeros((4, 3))
        corners[:, axis] = (high if n[axis] > 0 else low)[axis]
        for k, (s, t) in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)]):
            corners[k, a], corners[k, b] = (low, high)[s][a], (low, high)[t][b]
        scene.add(polygons([corners if n[axis] > 0 else corners[::-1]]), material=lambert((0.5,) * 3))
    if extra is not None:
        scene.add(icosphere(0.2, 6), material=GLASS, translation=extra)
    size = high - low
    return Tracer(scene), np.array([np.prod(np.delete(size, np.abs(n).argmax())) for n in NORMALS])


def test_an_even_sky_lights_each_face_of_a_block_alike():
    """E = pi on each of the 6 faces; all together pi times the surface, which is `environment_flux`: photons
    come through the box about the scene, and here that is all there is."""
    tracer, areas = block(Environment(np.ones((4, 8, 3))))
    found = runs(of_environment, tracer, 20_000, 0.5)
    assert is_mean(found[:, :6], math.pi * areas[:, None]).all()
    whole = found.sum(axis=(1))
    assert is_mean(whole, math.pi * areas.sum()).all()
    assert found[:, :6].sum() > 0.999 * found.sum()
    assert environment_flux(tracer.packed) == pytest.approx(math.pi * areas.sum(), rel=1e-6)


@pytest.mark.parametrize("rotation", [0.0, 0.7])
def test_any_sky_lights_each_face_of_a_block_by_its_irradiance(rotation):
    """As the sum over the image has it, which is right to 1e-3."""
    tracer, areas = block(Environment(IMAGE, rotation, 0.5))
    found = runs(of_environment, tracer, 20_000, 0.5)[:, :6]
    exact = np.array([0.5 * sky_irradiance(IMAGE, rotation, n) for n in NORMALS]) * areas[:, None]
    assert is_mean(found, exact, 1e-3).all()


def test_photons_aimed_at_glass_beside_a_block_light_its_faces_as_well():
    """A glass ball 1 m off the block's top: as not aimed, and on the lower face, which never sees the ball,
    E = pi."""
    tracer, areas = block(Environment(np.ones((4, 8, 3))), (0.0, 2.0, 0.0))
    plain, aimed = (runs(of_environment, tracer, 20_000, share) for share in (0.0, 0.9))
    assert are_alike(plain, aimed)[:7].all()
    for found in (plain, aimed):
        assert is_mean(found[:, 2], math.pi * areas[2]).all()
        # a ball of radius r: pi pi 4 r^2, less what the block hides, which sees it within a few degrees
        assert found[:, 6].mean() < math.pi * 4 * math.pi * 0.2**2


def test_flux_of_an_environment_is_absorbed_escapes_or_is_dropped():
    tracer = with_caustics(Environment(IMAGE))
    path = tracer.walk(of_environment(tracer, 20_000), 6)
    ended = path.absorbed + path.escaped + path.dropped
    assert ended == pytest.approx(path.emitted, rel=1e-12)
    assert path.escaped.any() and path.absorbed.any()


def test_a_furnace_of_glowing_walls_stores_the_series_of_its_albedo():
    """V3: each wall emits pi L A; what is stored at bounce b is rho^b of that on each wall: where all
    have one radiance each gets what it gives. 40,000 photons: 4.5 sigma of a Poisson count for 12 numbers."""
    scene, albedo = box_room((0, 0, 0), (2, 1, 3), albedo=0.7), 0.7
    for node in scene.nodes:
        node.parts[0].material.emission = GLOW
    tracer, areas = Tracer(scene), np.array([3, 3, 6, 6, 2, 2])
    emitted = of_surfaces(tracer, 40_000)
    photons = tracer.walk(emitted, 2).photons
    first = landed(emitted, 6)[:6, 0]
    assert emitted["flux"].sum(axis=0, dtype=float) == pytest.approx(22 * math.pi * np.array(GLOW), rel=1e-3)
    for bounce, found in (
        (0, first),
        *((b, landed(photons[photons["bounce"] == b], 6)[:6, 0]) for b in (1, 2)),
    ):
        exact = albedo**bounce * 3.0 * math.pi * areas
        sigma = np.sqrt(exact * exact.sum() / 40_000)
        assert (np.abs(found - exact) < 4.5 * sigma).all(), bounce
