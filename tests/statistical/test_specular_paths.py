"""Photons along mirrors, through glass and through what fills it, where the answer is known."""

import math

import numpy as np
import pytest
from transport import Tracer, aim, box_room, lit, total, trace

from ispm.library.common import lambert
from ispm.library.shapes import box, polygons
from ispm.scene.light import DirectionalLight
from ispm.scene.material import Material
from ispm.scene.scene import Scene

BLACK = lambert((1e-6,) * 3)  # which keeps photons that arrive, and sends none on


def mirror(reflectance):
    """A mirror that reflects the same share at every angle: its f0 and f90 are equal."""
    return Material((0.0,) * 3, roughness=0.0, specular=reflectance, specular_color=(25.0,) * 3)


def glass(ior=1.5, thickness=1.0, **how):
    return Material(roughness=0.0, transmission=1.0, ior=ior, thickness=thickness, **how)


def rectangle(corner, u, v, name=""):
    """A parallelogram whose front is along u x v."""
    a, u, v = (np.asarray(x, float) for x in (corner, u, v))
    return polygons([np.array([a, a + u, a + u + v, a + v])], name)


def solid_angle(dx, dy, h):
    """Of a rectangle with one corner h below a point and the other (dx, dy) from that one."""
    return math.atan2(dx * dy, h * math.sqrt(dx * dx + dy * dy + h * h))


def patch_flux(light, centre, half):
    """Flux on a square of z = 0 from 1 cd at `light`."""
    x, y, h = light
    (x0, x1), (y0, y1) = ((c - half - p, c + half - p) for c, p in zip(centre, (x, y), strict=True))
    return (
        solid_angle(x1, y1, h) - solid_angle(x0, y1, h) - solid_angle(x1, y0, h) + solid_angle(x0, y0, h)
    )  # fmt: skip


def in_patch(photons, centre, half):
    return (np.abs(photons["position"][:, :2] - centre) < half).all(axis=1) & (
        np.abs(photons["position"][:, 2]) < 1e-4
    )


def mirror_corner(walls, light, intensity):
    """Floor z = 0 and mirrors at x = 0 and y = 0, 8 m wide and high."""
    scene = Scene()
    scene.add(rectangle((0, 0, 0), (8, 0, 0), (0, 8, 0), "floor"), material=BLACK)
    scene.add(rectangle((0, 0, 0), (0, 8, 0), (0, 0, 8), "x"), material=walls)
    scene.add(rectangle((0, 0, 0), (0, 0, 8), (8, 0, 0), "y"), material=walls)
    return lit(scene, light, 4 * math.pi * intensity)


def test_a_mirror_corner_shows_the_light_three_times():
    """Density of photons from the image lights (method, V11 and V12): two by one mirror, one by both."""
    a, b, h = 1.0, 0.7, 1.2
    intensity, reflectance, place, half = 5.0, 0.9, (0.6, 0.9), 0.15
    images = {(-a, b): 1, (a, -b): 1, (-a, -b): 2}
    at = [
        intensity * reflectance**k * h / (math.dist((*place, 0), (x, y, h))) ** 3
        for (x, y), k in images.items()
    ]
    assert (at[0] + at[1], at[2]) == pytest.approx((1.3014347, 0.2892548), rel=1e-6)
    path = trace(mirror_corner(mirror(reflectance), (a, b, h), intensity), 1_000_000, 1)
    photons = path.photons[in_patch(path.photons, place, half)]
    assert (photons["bounce"] == 0).all()
    for (x, y), k in images.items():
        way = np.array([x, y, h]) - photons["position"]
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        from_here = np.abs(way - photons["wi"]).max(axis=1) < 1e-3
        expected = intensity * reflectance**k * patch_flux((x, y, h), place, half)
        # photons have equal flux but for the mirrors' share: Poisson at most
        sigma = 1 / math.sqrt(from_here.sum())
        assert photons["flux"][from_here, 0].sum() == pytest.approx(expected, rel=4.5 * sigma)
    assert total(photons)[0] == pytest.approx(
        intensity * sum(reflectance**k * patch_flux((x, y, h), place, half) for (x, y), k in images.items()),
        rel=4.5 / math.sqrt(len(photons)),
    )


def test_photons_know_how_far_the_mirror_is_that_they_come_from():
    path = trace(mirror_corner(mirror(0.9), (1.0, 0.7, 1.2), 1.0), 2000, 1)
    place = path.photons["position"]
    came_from = np.abs(path.photons["radius"][:, None] - np.abs(place[:, :2])).min(axis=1)
    # a rounding of the place, some units of 2^-24 of 8 m, on either end of the flight
    assert len(place) > 300 and came_from.max() < 1e-5


def test_a_tube_of_mirrors_brings_light_down_beyond_the_limit():
    """Flux on the floor is that of all image lights, also of those after more events than go without
    roulette. Width 1, light 6 m above the floor; 4.5 sigma of the photons' own spread, over the seeds."""
    reflectance, height = 0.95, 6.0
    scene = Scene()
    scene.add(rectangle((-0.5, -0.5, 0), (1, 0, 0), (0, 1, 0), "floor"), material=BLACK)
    for k in range(4):
        c, s = math.cos(k * math.pi / 2), math.sin(k * math.pi / 2)
        corner, along = np.array([0.5 * c - 0.5 * s, 0.5 * s + 0.5 * c, 0]), np.array([s, -c, 0])
        scene.add(rectangle(corner, along, (0, 0, 2 * height)), material=mirror(reflectance))
    tracer = Tracer(lit(scene, (0, 0, height), 4 * math.pi))
    tiles = np.arange(-120, 121)
    images = np.abs(tiles)[:, None] + np.abs(tiles)
    flux = np.array([[patch_flux((x, y, height), (0, 0), 0.5) for x in tiles] for y in tiles])
    expected = (flux * reflectance**images).sum()
    beyond = (flux * reflectance**images)[images > 12].sum() / expected
    assert beyond > 0.2  # of the light comes by more than 12 mirrors
    found = [total(tracer.walk(tracer.emit(20_000, seed), 1, seed).photons)[0] for seed in range(8)]
    error = np.std(found, ddof=1) / math.sqrt(len(found))
    assert error < 0.01 * expected
    assert np.mean(found) == pytest.approx(expected, abs=5.4 * error)  # t with 7 degrees of freedom: 0.1 %


def slab(material, slope=0.0):
    """A slab 1 m thick above a black screen at z = -1; light down, leaning by `slope` towards +x."""
    scene = Scene()
    scene.add(box((-2, -2, 0), (2, 2, 1)), material=material)
    scene.add(rectangle((-9, -9, -1), (18, 0, 0), (0, 18, 0)), material=BLACK)
    turn = -math.atan(slope) / 2
    scene.add(DirectionalLight(), rotation=(0, math.sin(turn), 0, math.cos(turn)))
    return Tracer(scene)


def parallel(tracer, count, slope=0.0, seed=1):
    """Photons of the slab's light onto a square of side 1 about the origin."""
    origins = np.random.default_rng(seed).random((count, 3)) - (0.5, 0.5, 0.0)
    origins[:, 2] = 5.0
    d = np.array([slope, 0.0, -1.0]) / math.hypot(slope, 1)
    return aim(tracer, origins - 5 * slope * np.eye(3)[0], np.broadcast_to(d, origins.shape))


@pytest.mark.parametrize("ior", [1.5, 2.0])
def test_a_slab_attenuates_as_beer_and_lambert_say(ior):
    """Through, with every reflection inside: T^2 a / (1 - R^2 a^2), a = exp(-thickness rate) per channel."""
    color, reach, count = np.array([0.9, 0.5, 0.2]), 0.7, 20_000
    tracer = slab(glass(ior, attenuation_color=tuple(color), attenuation_distance=reach))
    path = tracer.walk(parallel(tracer, count), 1)
    a, r = color ** (1.0 / reach), ((ior - 1) / (ior + 1)) ** 2
    expected = (1 - r) ** 2 * a / (1 - r**2 * a**2)
    below = path.photons[path.photons["position"][:, 2] < -0.5]
    share = np.zeros((count, 3))
    share[: len(below)] = below["flux"] * count / path.emitted
    sigma = share.std(axis=0) / math.sqrt(count)
    assert (np.abs(share.mean(axis=0) - expected) < 4.5 * sigma).all()
    assert path.absorbed + path.escaped + path.dropped == pytest.approx(path.emitted, rel=1e-12)


def test_attenuation_follows_the_way_aslant():
    """Index 1 neither reflects nor bends: every photon is left the same share."""
    color, slope = (0.9, 0.5, 0.2), 0.75
    tracer = slab(glass(1.0, attenuation_color=color, attenuation_distance=1.0), slope)
    path = tracer.walk(parallel(tracer, 500, slope), 1)
    below = path.photons[path.photons["position"][:, 2] < -0.5]
    assert len(below) == 500
    expected = np.array(color) ** math.hypot(slope, 1.0)
    assert below["flux"] / path.emitted.astype(np.float32) * 500 == pytest.approx(
        np.tile(expected, (500, 1)), rel=1e-4
    )


def test_what_lies_in_glass_is_lit_through_it():
    """A flight that ends on something opaque inside a solid is attenuated by the solid; so is one from a
    light in it, and one after it has scattered inside."""
    color = np.array([0.9, 0.5, 0.2])
    material = glass(1.0, attenuation_color=tuple(color), attenuation_distance=1.0)
    scene = Scene()
    scene.add(box((-2, -2, 0), (2, 2, 1)), material=material)
    scene.add(rectangle((-1, -1, 0.25), (2, 0, 0), (0, 2, 0), "sunken"), material=lambert((0.5,) * 3))
    scene.add(DirectionalLight())
    tracer = Tracer(scene)
    sunken = 1
    path = tracer.walk(parallel(tracer, 1000), 2)
    here = path.photons[path.photons["instance"] == sunken]
    assert here["flux"] * 1000 == pytest.approx(np.tile(color**0.75, (1000, 1)), rel=1e-4)
    # half the light comes back up through 0.75 m / cos and leaves
    left = path.escaped
    rate = -np.log(color) * 0.75
    z = (np.arange(4000) + 0.5) / 4000
    up = (2 * z * np.exp(-rate[:, None] / z)).mean(axis=1)
    spread = ((2 * z * np.exp(-2 * rate[:, None] / z)).mean(axis=1) - up**2) ** 0.5
    # those that would leave by the sides have 1 m to go at least, at a slope of 0.75
    sigma = 0.5 * color**0.75 * spread / math.sqrt(1000)
    assert (np.abs(left - 0.5 * color**0.75 * up) < 4.5 * sigma + 0.02 * up).all()
    inside = Scene()
    inside.add(box((-2, -2, 0), (2, 2, 1)), material=material)
    inside.add(rectangle((-9, -9, -1), (18, 0, 0), (0, 18, 0)), material=BLACK)
    tracer = Tracer(lit(inside, (0, 0, 0.5), 1.0))
    d = np.array([[0.6, 0.0, -0.8]])
    path = tracer.walk(aim(tracer, np.array([[0, 0, 0.5]]), d), 1)
    assert path.photons["flux"][0] == pytest.approx(color ** (0.5 / 0.8), rel=1e-4)


def test_light_through_a_sheet_is_direct_and_not_stored_again():
    """A pane between lamp and floor: shadow maps show what goes through it, photons what it mirrors."""
    scene = box_room((-1, -1, -1), (1, 1, 1), albedo=1e-6)
    scene.add(rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)), material=glass(thickness=0.0))
    path = trace(lit(scene, (0, 0, 0.5)), 50_000, 4)
    assert len(path.photons) and (path.photons["bounce"] == 0).all()
    assert path.photons["position"][:, 2].min() >= 0.0
    # what it mirrors is Fresnel's share of what arrives, over the half space below the lamp
    z = (np.arange(2000) + 0.5) / 2000
    other = np.sqrt(1.5**2 - 1 + z * z)
    fresnel = 0.5 * (((z - other) / (z + other)) ** 2 + ((2.25 * z - other) / (2.25 * z + other)) ** 2)
    reach = z > 0.5 / math.hypot(0.5, math.sqrt(2))  # beyond, the walls come first; in the corners they do
    low, high = fresnel[z > 0.5 / math.hypot(0.5, 1)].sum() / 4000, fresnel[reach].sum() / 4000
    share = total(path.photons)[0] / path.emitted[0]
    assert 0.95 * low < share < 1.05 * high


def test_bounces_count_what_spreads():
    """Lamp, floor, mirror, floor: one scatter; lamp, mirror, floor: none, a caustic."""
    scene = Scene()
    scene.add(rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0), "floor"), material=lambert((0.8,) * 3))
    scene.add(rectangle((-1, -1, 1), (0, 2, 0), (2, 0, 0), "mirror"), material=mirror(1.0))
    path = trace(lit(scene, (0, 0, 0.3)), 20_000, 2)
    floor, mirrors = (path.photons[path.photons["instance"] == k] for k in (0, 1))
    assert not len(mirrors)
    height = 2.0 - 0.3  # of the lamp's image
    way = np.array([0, 0, height]) - floor["position"]
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    straight = np.abs(way - floor["wi"]).max(axis=1) < 1e-4
    assert (floor["bounce"][straight] == 0).sum() > 1000
    assert set(floor["bounce"][~straight]) == {1, 2}
    assert ((floor["bounce"] == 0) <= straight).all()


def test_rough_glass_stores_nothing_and_plastic_does():
    for material, stores in (
        (Material(roughness=0.5, transmission=1.0, thickness=1.0), False),
        (Material(roughness=0.5, transmission=0.5, thickness=1.0), True),
        (Material((0.5,) * 3, roughness=0.0), True),
        (Material(metallic=1.0, roughness=0.0), False),
    ):
        scene = box_room(albedo=0.5)
        scene.nodes[0].parts[0].material = material
        path = trace(lit(scene, (0.1, 0, 0)), 3000, 3)
        assert bool((path.photons["instance"] == 0).any()) == stores


def still_life(**light):
    """A closed room with a ball of tinted glass, rough glass, a mirror, polished plastic and a pane."""
    scene = box_room((-1, -1, -1), (1, 1, 1), albedo=0.7)
    for k, material in enumerate((
        glass(attenuation_color=(0.9, 0.6, 0.3), attenuation_distance=0.2),
        Material((0.9, 0.8, 0.7), roughness=0.4, transmission=0.8, thickness=1.0),
        Material((0.9, 0.7, 0.3), metallic=1.0, roughness=0.0),
        Material((0.2, 0.3, 0.8), roughness=0.0),
        glass(thickness=0.0, base_color=(0.8, 0.9, 0.9)),
        Material((0.9, 0.8, 0.7), roughness=0.5, transmission=0.8),
    )):  # fmt: skip
        x = -0.7 + 0.25 * k
        scene.add(box((x, -0.5, -0.9), (x + 0.15, 0.5, 0.5)), material=material)
    return lit(scene, (0.0, 0.0, 0.8), **light)


@pytest.mark.parametrize("bounces", [1, 6])
def test_flux_is_absorbed_escapes_or_is_dropped_among_glass_and_mirrors(bounces):
    """Sums of float32 numbers in float64: 1e-12 is a hundred times their rounding."""
    path = trace(still_life(range=1.5), 20_000, bounces)
    ended = path.absorbed + path.escaped + path.dropped
    assert ended == pytest.approx(path.emitted, rel=1e-12)
    assert (path.photons["bounce"] == 0).any() and path.photons["bounce"].max() == bounces
    assert np.isfinite(path.photons["flux"]).all() and (path.photons["flux"] >= 0).all()


def test_a_room_of_polished_plastic_stores_all_its_photons():
    """Each hit is stored and half the light goes on as from a mirror: more hits than `bounces`."""
    scene = box_room()
    for node in scene.nodes:
        node.parts[0].material = Material((0.9,) * 3, metallic=0.5, roughness=0.0)
    path = trace(lit(scene), 20_000, 4)
    assert len(path.photons) / path.photon_count > 5
    # what is stored and not absorbed at once is scattered once more: no flux vanished between
    assert path.absorbed + path.dropped == pytest.approx(path.emitted, rel=1e-12)
