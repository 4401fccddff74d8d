"""The flux of photons: bounce by bounce, wall by wall, and what is left at the end."""

import math

import numpy as np
import pytest
from scipy import integrate
from transport import Tracer, aim, box_room, lit, on_instance, total, trace

from ispm.library.common import lambert
from ispm.library.shapes import polygons
from ispm.photons.scatter import ROULETTE_AFTER
from ispm.scene.material import Material
from ispm.scene.scene import Scene


@pytest.mark.parametrize("albedo", [0.25, 0.8])
def test_each_bounce_stores_the_albedos_power_of_the_flux(albedo):
    """Exact while there is no roulette (method, V2); float32 weights."""
    path = trace(lit(box_room(albedo=albedo), (0.1, 0.2, 0.3)), 10_000, bounces=ROULETTE_AFTER)
    for bounce in range(1, ROULETTE_AFTER + 1):
        share = total(path.photons[path.photons["bounce"] == bounce]) / path.emitted
        assert share == pytest.approx([albedo**bounce] * 3, rel=1e-6)
    assert path.escaped.max() == 0.0
    assert path.dropped / path.emitted == pytest.approx([albedo**ROULETTE_AFTER] * 3, rel=1e-6)


def test_roulette_keeps_the_flux_of_later_bounces_in_expectation():
    """12 seeds of 40 000 photons pooled; what survives is binomial. 4 sigma for each of 6 bounces."""
    albedo, pooled, count = 0.6, np.zeros(11), 0
    tracer = Tracer(lit(box_room(albedo=albedo)))
    for seed in range(12):
        path = tracer.walk(tracer.emit(40_000, seed), 10, seed)
        count += path.photon_count
        pooled += np.bincount(path.photons["bounce"], path.photons["flux"][:, 0], 11) / path.emitted[0] / 12
    for bounce in range(ROULETTE_AFTER + 1, 11):
        survival = albedo ** (bounce - ROULETTE_AFTER)
        sigma = math.sqrt((1 - survival) / (survival * count))
        assert pooled[bounce] == pytest.approx(albedo**bounce, rel=4 * sigma)


def test_roulette_keeps_the_color_of_colored_walls():
    """A path's channels are rescaled together: the red that roulette keeps pays for what it drops."""
    tracer = Tracer(lit(colored_room()))
    shares = []
    for seed in range(16):
        path = tracer.walk(tracer.emit(10_000, seed), 8, seed)
        late = path.photons[path.photons["bounce"] == 7]
        shares.append(total(late) / path.emitted)
    mean, error = np.mean(shares, axis=0), np.std(shares, axis=0, ddof=1) / 4
    # 3 channels, t-distribution with 15 degrees of freedom: 5 sigma is 0.05 % together
    assert (np.abs(mean - np.array([0.9, 0.5, 0.1]) ** 7) < 5 * error + 1e-9).all()


def colored_room():
    scene = box_room()
    for node in scene.nodes:
        node.parts[0].material = lambert((0.9, 0.5, 0.1))
    return scene


def mixed_room(**light):
    """An open room with a glossy, a metal and an unlit wall: photons end in every way there is."""
    scene = box_room(albedo=0.8)
    for node, material in zip(scene.nodes, (
        Material((0.8, 0.4, 0.2), roughness=0.3), Material((0.9, 0.7, 0.3), metallic=1.0, roughness=0.2),
        Material(unlit=True),
    ), strict=False):  # fmt: skip
        node.parts[0].material = material
    scene.roots.pop()
    return lit(scene, (0.1, 0.2, -0.1), **light)


@pytest.mark.parametrize("light_range", [math.inf, 0.8])
@pytest.mark.parametrize("bounces", [1, 8])
def test_flux_is_absorbed_escapes_or_is_dropped(bounces, light_range):
    """Sums of float32 numbers in float64: 1e-12 is a hundred times their rounding."""
    path = trace(mixed_room(range=light_range), 20_000, bounces)
    ended = path.absorbed + path.escaped + path.dropped
    assert (path.escaped > 0.0).all() and (path.absorbed > 0.0).all()
    assert ended == pytest.approx(path.emitted, rel=1e-12)


@pytest.mark.parametrize("threads", [2, 3])
def test_photons_are_the_same_bytes_for_any_number_of_threads(threads):
    one, many = (trace(mixed_room(), 30_000, 6, threads=n) for n in (1, threads))
    assert one.photons.tobytes() == many.photons.tobytes()
    assert (one.absorbed == many.absorbed).all() and one.rays == many.rays


def test_each_wall_of_a_cube_receives_a_sixth():
    """Light in the middle (method, V8). 160 000 photons: sigma 0.22 %; 4.5 for six walls."""
    tracer = Tracer(lit(box_room()))
    emitted = tracer.emit(160_000)
    share = np.bincount(emitted["instance"], emitted["flux"][:, 0], 6) / (4 * math.pi)
    assert share == pytest.approx([1 / 6] * 6, rel=4.5 * math.sqrt(5 / 160_000))


def test_photons_from_one_wall_reach_the_others_by_their_view_factors():
    """Unit cube: opposite 0.1998249, adjacent 0.2000438 (method, V8); 4.5 sigma for five walls."""
    count = 400_000
    tracer = Tracer(lit(box_room(albedo=1.0)))
    path = tracer.walk(on_instance(tracer.packed, 0, count, seed=1), 1)
    share = np.bincount(path.photons["instance"], minlength=6) / count
    expected = np.array([0.0, 0.1998249, *[0.2000438] * 4])
    assert np.abs(share - expected).max() < 4.5 * math.sqrt(0.16 / count)


def test_half_the_light_of_a_floor_reaches_the_wall_it_meets():
    """Method, V7: the wall takes half the hemisphere of any point of the floor, but for its edges, 0.1 %."""
    scene, reach = Scene(), 1000.0
    floor = np.array([(-reach, 0, 0), (-reach, 0, reach), (reach, 0, reach), (reach, 0, 0)])
    wall = np.array([(-reach, 0, 0), (reach, 0, 0), (reach, reach, 0), (-reach, reach, 0)])
    for name, corners in (("floor", floor), ("wall", wall)):
        scene.add(polygons([corners], name), material=lambert((1.0,) * 3))
    tracer, count = Tracer(lit(scene, (0.0, 1.0, 1.0))), 100_000
    for away in (0.1, 1.0):
        down = np.array([0.0, -1.0, away - 1.0])
        rays = np.tile(down / np.linalg.norm(down), (count, 1))
        path = tracer.walk(aim(tracer, np.tile((0.0, 1.0, 1.0), (count, 1)), rays), 1)
        share = total(path.photons[path.photons["instance"] == 1])[0]
        assert share == pytest.approx(0.5, abs=4 * 0.5 / math.sqrt(count) + 1e-3)


def furnace():
    """A room with a block in it: (Tracer, per instance its area and the lamp that all of it sees)."""
    scene = box_room((0, 0, 0), (2, 1, 3), albedo=0.7)
    for node in box_room((0.4, 0.3, 0.8), (0.9, 0.6, 1.9), albedo=0.7).roots:
        scene.roots.append(node)
    lit(lit(scene, (0.1, 0.1, 0.1)), (1.95, 0.95, 2.95))
    faces = [
        np.prod([side for axis, side in enumerate(size) if axis != k // 2])
        for size in ((2, 1, 3), (0.5, 0.3, 1.1))
        for k in range(6)
    ]
    lamps = [0] * 6 + [0, 1] * 3  # the block's low faces see the low lamp
    return Tracer(scene), np.array(faces), lamps


def test_an_evenly_lit_furnace_stays_evenly_lit():
    """Method, V3: where every wall gives off the same radiance, each gets pi times that from all sides.

    N = 20,000 from each of 12 faces, none lost before the roulette; each bounce's irradiance on each face
    within 4.5 sigma, and so the mean cosine of its light, 2/3, of a standard deviation sqrt(1/18).
    """
    tracer, areas, lamps = furnace()
    emitted = np.concatenate([
        on_instance(tracer.packed, k, 20_000, seed=k, flux=area) for k, area in enumerate(areas)
    ])  # fmt: skip
    emitted["light"] = np.repeat(lamps, 20_000)
    emitted["key"] = np.arange(len(emitted))
    photons = tracer.walk(emitted, ROULETTE_AFTER).photons
    ng = np.einsum("ij,ij->i", photons["wi"], photons["normal"]).astype(float)
    for bounce in range(1, ROULETTE_AFTER + 1):
        for face, area in enumerate(areas):
            here = (photons["bounce"] == bounce) & (photons["instance"] == face)
            count, flux = here.sum(), photons["flux"][here, 0].astype(float)
            sigma = math.sqrt((flux**2).sum())  # Poisson at most
            assert flux.sum() == pytest.approx(0.7**bounce * area, abs=4.5 * sigma)
            # those from small faces weigh less: so few of equal flux are they worth
            worth = flux.sum() ** 2 / (flux**2).sum()
            mean = np.average(ng[here], weights=flux)
            assert count > 500 and mean == pytest.approx(2 / 3, abs=4.5 * math.sqrt(1 / 18 / worth))


def plate(x, y, name):
    """A square of side 2 x at height y, seen from both sides."""
    corners = np.array([(-x, y, -x), (-x, y, x), (x, y, x), (x, y, -x)])
    return polygons([corners], name)


def bounced_irradiance(r, height, gap, intensity, albedo, reach):
    """E_1 on the lower of two planes, r m from the axis, from the upper one within `reach` m of it."""
    upper = gap - height

    def ring(angle, s):
        emitted = albedo * intensity * upper / (upper**2 + s**2) ** 1.5 / math.pi
        apart = s**2 + r**2 - 2 * s * r * math.cos(angle)
        return emitted * s * gap**2 / (gap**2 + apart) ** 2

    return 2 * integrate.dblquad(ring, 0, reach, 0, math.pi, epsrel=1e-5)[0]


@pytest.mark.parametrize(
    ("height", "gap", "intensity", "albedo", "exact"),
    [(1, 2, 10, 0.7, 1.3570686), (0.5, 3, 10, 0.7, 0.3797237), (1.5, 2, 10, 0.7, 2.0737257)],
)
def test_first_bounce_between_two_planes(height, gap, intensity, albedo, exact):
    """Irradiance of the lower plane from the upper one's bounce, on and around the axis (method, V5)."""
    reach, disc = 30.0, 0.8
    assert bounced_irradiance(0, height, gap, intensity, albedo, reach) == pytest.approx(exact, rel=1e-4)
    scene = Scene()
    for name, y in (("lower", 0.0), ("upper", float(gap))):
        scene.add(plate(reach, y, name), material=lambert((albedo,) * 3))
    path = trace(lit(scene, (0, height, 0), 4 * math.pi * intensity), 1_000_000, 1)
    lower = path.photons[path.photons["instance"] == 0]
    near = np.hypot(lower["position"][:, 0], lower["position"][:, 2]) < disc
    got = lower["flux"][near, 0].sum(dtype=float) / (math.pi * disc**2)
    # mean over the disc: Gauss-Legendre in r^2
    nodes, weights = np.polynomial.legendre.leggauss(5)
    at = disc * np.sqrt((1 + nodes) / 2)
    rings = [bounced_irradiance(r, height, gap, intensity, albedo, reach) for r in at]
    sigma = 1 / math.sqrt(near.sum())
    assert sigma < 0.011
    assert got == pytest.approx(np.dot(weights, rings) / 2, rel=4 * sigma)


def test_flux_between_planes_halves_at_each_bounce():
    """Light in the middle: each plane gets Phi / 2 rho^b; edges lose under (gap / reach)^2 of it."""
    scene = Scene()
    for name, y in (("lower", 0.0), ("upper", 2.0)):
        scene.add(plate(200.0, y, name), material=lambert((0.7,) * 3))
    path = trace(lit(scene, (0, 1, 0)), 200_000, 3)
    for bounce in (1, 2, 3):
        here = path.photons[path.photons["bounce"] == bounce]
        share = np.bincount(here["instance"], here["flux"][:, 0], 2) / path.emitted[0] / 0.7**bounce
        # 200 000 photons: 4 sigma is 0.9 % of each half, edges 1 %
        assert share == pytest.approx([0.5, 0.5], rel=0.019)


def test_a_convex_scene_stores_no_photons():
    """Light over one plane (method, V4): half the photons hit it, and none comes back."""
    scene = Scene()
    scene.add(plate(50.0, 0.0, "floor"), material=lambert((0.9, 0.5, 0.2)))
    path = trace(lit(scene, (0, 1, 0)), 50_000, 8)
    assert not len(path.photons) and (path.stored == 0.0).all()
    # edges lose h / sqrt(h^2 + x^2) of the half, 2 % at 50 m; strata make the count almost exact
    assert path.absorbed[0] / path.emitted[0] == pytest.approx(0.5 * 0.1, rel=0.03)
