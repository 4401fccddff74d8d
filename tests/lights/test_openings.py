"""Openings through which an environment lights what the eye sees: found, and what they guide."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from exact_light import polygon_irradiance
from test_photons_of_surfaces import are_alike, of_environment, runs
from transport import Tracer

from ispm import Camera, Environment, Material, Renderer, Settings, shapes
from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Scratch
from ispm.accel.surface import closest_surface, surface
from ispm.kernels.simd import alloca
from ispm.lights.environment_emission import emit_from_environment
from ispm.lights.nee import BY_NOTHING, light_from_one
from ispm.lights.openings import (
    NO_OPENINGS,
    Openings,
    draw_opening,
    opening_cell,
    opening_pdf,
)
from ispm.lights.ratio import area_light_by_ratio
from ispm.lights.survey import find_openings
from ispm.optics.jit import jit
from ispm.optics.vector import Vector, scale, vec3
from ispm.scene.scene import Scene

f32, i64, u32 = np.float32, np.int64, np.uint32
MATTE = Material((0.6, 0.6, 0.6), specular=0.0, roughness=1.0)
HOLE = np.array([[-0.2, 3.0, -0.3], [0.2, 3.0, -0.3], [0.2, 3.0, 0.3], [-0.2, 3.0, 0.3]])
RADIANCE = 10.0
THICK = 0.0005  # m, of the ceiling: a thick one shades the hole, which Lambert's formula does not know


def lit_by_a_hole(reach: float = 3e3, beside_a_sun: bool = False) -> Scene:
    """A floor below a ceiling with a hole, under an even sky, or one that is as bright straight above alone,
    and as a sun near the horizon; reach: how far the ceiling goes, m."""
    image = np.full((64, 128, 3), RADIANCE)
    if beside_a_sun:
        image[12:] = 0.0
        image[28, 40] = 0.22 * 64.0 * 128.0
    scene = Scene(environment=Environment(image))
    scene.add(shapes.plane(4.0, 4.0), material=MATTE)
    for size, x, z in (
        ((reach, THICK, reach), reach / 2 + 0.2, 0.0),
        ((0.4, THICK, reach / 2), 0.0, reach / 4 + 0.3),
    ):
        for side in (-1.0, 1.0):
            scene.add(shapes.box(size), material=MATTE, translation=(side * x, 3.0 + 0.5 * THICK, side * z))
    return scene


def eye_rays(columns=48, rows=27):
    """Rays from beneath the hole to the floor around it, and where they meet it, (n, 3) m."""
    x, z = np.meshgrid(np.linspace(-1.2, 1.2, columns), np.linspace(-0.8, 0.8, rows))
    floor = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(-1, 3)
    origins = np.tile([0.0, 2.5, 0.0], (len(floor), 1))
    d = floor - origins
    return (origins, d / np.linalg.norm(d, axis=1, keepdims=True)), floor


def found_in(tracer, rays) -> Openings:
    return find_openings(tracer.packed, tracer.world, tracer.surfaces, rays, 0, 0)[1]


def test_boxes_lie_about_the_hole_and_guide_below_it():
    """What is beside a line that passes the hole lies in the ceiling, whose plane the line meets in the hole:
    a box holds all these places, and little more. Most draws pass."""
    tracer, (rays, floor) = Tracer(lit_by_a_hole()), eye_rays()
    seen, openings = find_openings(tracer.packed, tracer.world, tracer.surfaces, rays, 0, 0)
    assert seen == pytest.approx(floor, abs=1e-4)
    assert_about_the_hole(openings.boxes, openings.weights.mean(axis=0))
    assert _cell(openings, np.float32([0.1, 0.0, 0.1]))[1]  # one cosine draw in 230 passes
    assert (openings.ways.directions[:, 1] > 0.0).all()
    assert openings.ways.to_sky.sum() == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("seed", range(6))
def test_few_open_lines_are_enough_for_a_box_about_the_hole(seed):
    """Of 40 rays a survey finds 10 to 20 lines. It wanted 32: where light comes in through one opening behind
    another, most passes had none to guide their draws."""
    tracer, (rays, _) = Tracer(lit_by_a_hole()), eye_rays(8, 5)
    found = find_openings(tracer.packed, tracer.world, tracer.surfaces, rays, seed, 0)[1]
    assert found.cells.guided.any()
    (middle,), (axes,), (lengths,) = found.boxes
    x, z = np.meshgrid(np.linspace(-0.2, 0.2, 21), np.linspace(-0.3, 0.3, 21))
    within = np.stack([x, np.full_like(x, 3.0), z], axis=-1).reshape(-1, 3)
    assert (np.abs((within - middle) @ axes.T) <= lengths).all(axis=1).mean() > 0.9
    assert lengths.max() < 0.9


def assert_about_the_hole(boxes, weights, within=0.05):
    """All but a twentieth of boxes, by their weights, end within so many m of the hole."""
    reach = np.einsum("ka,kac->kc", boxes.lengths, np.abs(boxes.axes))
    off = np.abs(boxes.middles - (0.0, 3.0, 0.0)) + reach - (0.2, 0.0, 0.3)
    assert weights[(off < within).all(axis=1)].sum() > 0.95 * weights.sum()


class _Place(NamedTuple):
    """What of a SurfacePoint tells its cell."""

    position: Vector
    ng: Vector


@jit
def _cell(openings, position):
    return opening_cell(openings.cells, _Place(vec3(position), (f32(0), f32(1), f32(0))))


def test_nothing_guides_where_lines_are_mostly_open_or_none_is():
    open_field = Scene(environment=Environment(np.full((4, 8, 3), RADIANCE)))
    open_field.add(shapes.plane(4.0, 4.0), material=MATTE)
    closed = lit_by_a_hole()
    closed.add(shapes.box((1.0, 0.1, 1.0)), material=MATTE, translation=(0.0, 3.06, 0.0))
    dark = lit_by_a_hole()
    dark.environment = None
    rays, _ = eye_rays()
    for scene in (open_field, closed, dark):
        assert found_in(Tracer(scene), rays).cells.guided.size == 0
    nowhere = rays[0], -rays[1]
    seen, openings = find_openings(*scene_of(Tracer(open_field)), nowhere, 0, 0)
    assert len(seen) == 0 and openings.cells.guided.size == 0


@pytest.mark.parametrize(
    "pane",
    [
        Material(transmission=1.0, thickness=0.01, roughness=0.5),
        Material(transmission=1.0, roughness=0.5),
        Material((0.8,) * 3, diffuse_transmission=0.5, double_sided=True),
    ],
    ids=["solid", "thin", "curtain"],
)
def test_photons_have_ways_through_what_stops_draws(pane):
    """A pane of frosted glass in the hole, or a curtain, stops shadow rays: of the ways in, those of the open
    hole are left. Of the sky's photons a few in a thousand met the pane before."""
    glazed = lit_by_a_hole()
    glazed.add(shapes.box((0.4, 0.005, 0.6)), material=pane, translation=(0.0, 3.005, 0.0))
    rays, _ = eye_rays()
    found, expected = found_in(Tracer(glazed), rays), found_in(Tracer(lit_by_a_hole()), rays)
    assert found.cells.guided.size == 0 and found.ways.share == pytest.approx(expected.ways.share, rel=0.05)
    assert len(found.ways.directions) == pytest.approx(len(expected.ways.directions), rel=0.05)
    assert_about_the_hole(found.ways.boxes, found.ways.to_sky, 0.15)


def test_draws_are_guided_through_a_clear_pane():
    """As through the open hole: a pane does not bend the lines that pass it."""
    glazed = lit_by_a_hole()
    pane = Material(transmission=1.0, thickness=0.01, roughness=0.0)
    glazed.add(shapes.box((0.4, 0.005, 0.6)), material=pane, translation=(0.0, 3.005, 0.0))
    rays, _ = eye_rays()
    found, expected = found_in(Tracer(glazed), rays), found_in(Tracer(lit_by_a_hole()), rays)
    assert found.cells.guided.mean() == pytest.approx(expected.cells.guided.mean(), abs=0.05)
    assert found.ways.share == pytest.approx(expected.ways.share, rel=0.05)
    assert_about_the_hole(found.ways.boxes, found.ways.to_sky, 0.15)


def scene_of(tracer):
    return tracer.packed, tracer.world, tracer.surfaces


@jit
def _draws(openings, position, numbers, directions, densities):
    at = vec3(position)
    cell, _ = _cell(openings, position)
    for k in range(len(numbers)):
        d = draw_opening(openings, cell, at, numbers[k, 0], numbers[k, 1], numbers[k, 2])
        for c in range(3):
            directions[k, c] = d[c]
        densities[k] = opening_pdf(openings, cell, at, d)


@jit
def _densities(openings, position, directions, densities):
    at = vec3(position)
    cell, _ = _cell(openings, position)
    for k in range(len(directions)):
        densities[k] = opening_pdf(openings, cell, at, vec3(directions[k]))


@pytest.mark.parametrize("place", [(0.3, 0.0, -0.2), (0.1, 2.9, 0.0), (9.0, 1.0, 3.0)])
def test_directions_are_drawn_by_their_density(place):
    """The mean of x^2 / pdf over draws is the integral of x^2 where the pdf is above 0, as of even
    directions; and the density is 1 in all. Both by 400,000 random numbers: four standard errors. From the
    floor, from among the spheres, and from outside all cells."""
    openings = found_in(Tracer(lit_by_a_hole()), eye_rays()[0])
    rng, place = np.random.default_rng(5), np.float32(place)
    numbers = rng.random((400_000, 3), np.float32)
    directions, densities = np.empty((400_000, 3), f32), np.empty(400_000, f32)
    _draws(openings, place, numbers, directions, densities)
    # at the rim of a cone rounding decides; of one draw in 1,000 no other sphere is about it
    assert np.mean(densities > 0.0) > 0.999
    drawn = directions[:, 0] ** 2 / np.maximum(densities, 1e-3)
    even = rng.normal(size=(400_000, 3))
    even = (even / np.linalg.norm(even, axis=1, keepdims=True)).astype(f32)
    of_even = np.empty(400_000, f32)
    _densities(openings, place, even, of_even)
    known = 4.0 * math.pi * np.where(of_even > 0.0, even[:, 0] ** 2, 0.0)
    for values, expected in ((drawn - known, 0.0), (4.0 * math.pi * of_even.astype(float) - 1.0, 0.0)):
        assert values.mean() == pytest.approx(expected, abs=4.0 * float(values.std()) / math.sqrt(400_000))


@jit
def _from_one(tables, openings, position, numbers, out):
    """Write what `light_from_one` brings to a place below, (n,), by numbers of its own."""
    scratch, d = Scratch(alloca(STACK_WORDS), alloca(2)), (f32(0), f32(-1), f32(0))
    _, hit = closest_surface(tables, vec3(position), d, f32(0), scratch)
    x = surface(tables, hit, d)
    for i in range(len(numbers)):
        u, pick, limit = numbers[i, 0], numbers[i, 1], f32(np.inf)
        out[i] = light_from_one(tables, x, scale(f32(-1), d), u, pick, scratch, limit, openings)[1]


@jit
def _at_end(tables, openings, position, numbers, out):
    """Likewise what four draws of `area_light_by_ratio` bring, of a pass that takes no ratio."""
    scratch, d = Scratch(alloca(STACK_WORDS), alloca(2)), (f32(0), f32(-1), f32(0))
    _, hit = closest_surface(tables, vec3(position), d, f32(0), scratch)
    x = surface(tables, hit, d)
    told = BY_NOTHING, i64(4), u32(10**8), openings
    for i in range(len(numbers)):
        light, _ = area_light_by_ratio(tables, x, scale(f32(-1), d), numbers[i, 0], scratch, *told)
        out[i] = light[1]


@pytest.mark.parametrize(
    ("kernel", "count", "less", "beside_a_sun"),
    [(_from_one, 200_000, 3.0, False), (_at_end, 100_000, 5.0, False), (_at_end, 100_000, 4.0, True)],
)
def test_draws_are_exact_and_have_a_fraction_of_the_noise(kernel, count, less, beside_a_sun):
    """By Lambert's formula for polygons, within four standard errors; and the noise of a guided draw is less
    than a third of a plain one's, of which one in 230 passes; of four, as at ends of eye paths, a fifth. Of
    draws of a sky as bright as a sun one in 60 passes: a quarter."""
    tracer, place = Tracer(lit_by_a_hole(beside_a_sun=beside_a_sun)), np.float32([0.3, 1.0, 0.2])
    openings = found_in(tracer, eye_rays()[0])
    numbers = np.random.default_rng(8).random((count, 2), np.float32)
    up, at = np.array([0.0, 1.0, 0.0]), np.array([0.3, 0.0, 0.2])
    exact = RADIANCE * 0.6 / math.pi * polygon_irradiance(HOLE, at, up)
    errors = []
    for guide in (NO_OPENINGS, openings):
        out = np.empty(len(numbers), np.float64)
        kernel(tracer.tables, guide, place, numbers, out)
        errors.append(float(out.std()) / math.sqrt(len(out)))
        assert out.mean() == pytest.approx(exact, abs=4.0 * errors[-1])
    assert errors[1] < errors[0] / less


def test_photons_sent_through_openings_carry_the_same_flux_everywhere():
    """Onto floor, ceiling and the block below a hole, by a sky with a small bright part; and ten times as
    many come in."""
    scene = lit_by_a_hole(20.0)
    image = np.full((32, 64, 3), RADIANCE)
    image[1, 20] = 3e5
    scene.environment = Environment(image)
    scene.add(shapes.box((0.5, 0.5, 0.5)), material=MATTE, translation=(0.0, 0.25, 0.0))
    tracer = Tracer(scene)
    openings = found_in(tracer, eye_rays()[0])
    assert openings.ways.to_sky.any() and openings.ways.to_sun.any()

    def sent(tracer, count, share, seed=0):
        return emit_from_environment(*scene_of(tracer), count, share, seed, 0, 1, None, openings.ways)

    assert are_alike(*(runs(emit, tracer, 40_000, 0.0) for emit in (of_environment, sent)))[:-1].all()
    inside = [np.isin(emit(tracer, 40_000, 0.0)["instance"], (0, 5)).sum() for emit in (of_environment, sent)]
    assert inside[1] > 10 * inside[0]


def test_photons_sent_through_an_opening_to_glass_carry_the_same_flux():
    """To two small balls below a hole. Of lines to a ball from above one in 177 passes the hole, which fills
    .036 sr: twenty times as many come in."""
    scene = lit_by_a_hole()
    for x, radius in ((0.4, 0.2), (-0.5, 0.05)):
        ball = Material(transmission=1.0, thickness=0.1, roughness=0.0)
        scene.add(shapes.sphere(radius), material=ball, translation=(x, 0.4, 0.1))
    tracer = Tracer(scene)
    openings = found_in(tracer, eye_rays()[0])

    def sent(tracer, count, share, seed=0):
        return emit_from_environment(*scene_of(tracer), count, share, seed, 0, 1, None, openings.ways)

    one, two = (runs(emit, tracer, 100_000, 0.5)[:, 5:7] for emit in (of_environment, sent))
    assert are_alike(one, two).all()
    photons = [emit(tracer, 40_000, 0.5) for emit in (of_environment, sent)]
    met = [(np.isin(each["instance"], (5, 6)) & (each["origin"][:, 1] < 0.0)).sum() for each in photons]
    assert met[1] > 20 * met[0] > 0


@pytest.mark.parametrize("beside_a_sun", [False, True])
def test_pictures_of_light_through_a_hole_are_exact_and_have_little_noise(gpu, beside_a_sun):
    """One cosine draw in 230 passes. By these alone, a mean over squares of 45 x 45 pixels is off by a third
    (.41 was measured). Of guided draws one in six passes at least: four to a pixel, and 25 pixels to the
    smallest square, err by sqrt(5 / 100) = .22 at most. The mean of 48 pictures is exact to four of its
    standard errors, by Lambert's formula for polygons, of a floor so narrow that filters, which know nothing
    beyond the picture's edge, average what is nearly even. What is as bright as a sun has draws of its own,
    which differ by as much as their mean, as some are of the sun near the horizon: a ratio of means of 25
    such errs by 1 / 25 (Cochran, Sampling Techniques, 6.8)."""
    camera = Camera.look_at((0.0, 2.5, 0.0), (0.0, 0.0, -1e-3), yfov=0.15)
    settings = Settings(size=(96, 64), bounces=0, antialias=False)
    scene, means = lit_by_a_hole(beside_a_sun=beside_a_sun), []
    with Renderer(scene, settings, camera, gpu=gpu) as renderer:
        frame = renderer.render()
        depth = frame.depth.astype(float)
        first = frame.direct[..., 1].astype(float)
        for seed in range(48):
            renderer.settings = settings.replace(seed=seed)
            means.append(renderer.render().direct[..., 1].astype(float).mean())
    assert depth.std() < 0.2  # the floor alone
    tangent = math.tan(0.075)
    x, z = np.meshgrid(
        2.5 * tangent * 1.5 * (2 * (np.arange(96) + 0.5) / 96 - 1),
        2.5 * tangent * (2 * (np.arange(64) + 0.5) / 64 - 1),
    )
    up = np.array([0.0, 1.0, 0.0])
    at = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(-1, 3)
    irradiance = np.reshape([polygon_irradiance(HOLE, place, up) for place in at], x.shape)
    truth = RADIANCE * 0.6 / math.pi * irradiance
    assert np.sqrt(((first / truth - 1.0) ** 2).mean()) < 0.22
    error = 4.0 * float(np.std(means)) / math.sqrt(48) + (0.04 * truth.mean() if beside_a_sun else 0.0)
    assert np.mean(means) == pytest.approx(truth.mean(), abs=error)
