"""What a photon lights by its beam: what its neighbours' paths light, through mirrors and glass."""

import math

import numpy as np
import pytest
from test_specular_paths import BLACK, glass, mirror, rectangle
from transport import Tracer, aim, box_room, lit

from ispm.library.shapes import icosphere
from ispm.optics.sampling import orthonormal_basis
from ispm.scene.light import DirectionalLight, SpotLight
from ispm.scene.material import Material
from ispm.scene.scene import Scene

STEP = 2e-4  # between directions, radian
SIDE = 1e-2  # of the square of directions that is a photon's own
LAMP = np.array([0.1, 2.5, 0.2])


def one_way(tracer, origin, d, key):
    """(position, beam) of the first photon along d that has not scattered; None where there is none. key: of
    its random numbers."""
    emitted = aim(tracer, origin[None], d[None])
    emitted["key"] = key
    emitted["flux"] = SIDE**2  # of a light of one candela
    path = tracer.walk(emitted, 1)
    first = path.photons["bounce"] == 0
    if not len(path.beams):
        return None
    return path.photons["position"][first][0].astype(float), path.beams[0].astype(float)


def differences(tracer, directions, key, origins=None):
    """Relative errors of beams against neighbouring paths, and (n,) shares of its beam that each photon's own
    is: less than 1 where it went a way by chance."""
    errors, shares = [], []
    for i, d in enumerate(directions):
        origin = LAMP if origins is None else origins[i]
        here = one_way(tracer, origin, d, key)
        if here is None:
            continue
        basis = np.array(orthonormal_basis(tuple(np.float32(d))), float)
        found = {}
        for k, way in enumerate(basis):
            if origins is None:
                turned = d + STEP * way
                there = one_way(tracer, origin, turned / np.linalg.norm(turned), key)
            else:
                there = one_way(tracer, origin + STEP * way, d, key)
            if there is None:
                continue
            found[k] = (there[0] - here[0]) / STEP * SIDE
        if not found:
            continue
        own, beam = np.array(list(found.values())), here[1][:6].reshape(2, 3)[list(found)]
        share = (own * beam).sum() / (beam**2).sum()
        span = share * (np.linalg.norm(here[1][:3]) + np.linalg.norm(here[1][3:6]))
        errors.extend(np.linalg.norm(own - share * beam, axis=1) / span)
        shares.append(share**2)
    return np.array(errors), np.array(shares)


def stage(material, shape):
    """A lamp in a black room, and a thing of glass or silver under it."""
    scene = box_room((-5, 0, -5), (5, 5, 5), albedo=1e-6)
    scene.add(shape, material=material, translation=(0, 1.0, 0))
    return lit(scene, tuple(LAMP))


@pytest.mark.parametrize("kind", ["glass", "sheet", "mirror"])
def test_beams_are_the_differences_of_neighboring_paths(kind):
    """100 rays at a ball of 20,480 triangles, each against two neighbours: where all three meet the same
    triangles, in at least seven of ten, they agree to the roundings of positions, 1e-6 m over STEP. Glass of
    index 1.5 lets .96 pass at each of two surfaces, along the normal."""
    material = {"glass": glass(), "sheet": glass(thickness=0.0), "mirror": mirror(1.0)}[kind]
    tracer = Tracer(stage(material, icosphere(0.4, 32)))
    random = np.random.default_rng(1)
    targets = np.array([0.0, 1.0, 0.0]) + random.uniform(-0.2, 0.2, (100, 3))
    directions = targets - LAMP
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    ways = [differences(tracer, directions, key) for key in range(4)]
    for errors, _ in ways:
        if kind == "sheet" and not len(errors):
            continue  # photons that passed count as direct light, and are not stored
        assert len(errors) > 150
        assert np.quantile(errors, 0.7) < 0.01
    shares = np.concatenate([each for _, each in ways])
    expected = {"mirror": [1.0], "glass": [0.04, 0.96**2], "sheet": [0.04]}[kind]
    near = [np.abs(shares - share) < 0.02 for share in expected]
    assert np.any(near, axis=0).mean() > 0.9
    assert all(each.any() for each in near)


@pytest.mark.parametrize("height", [0.5, 2.0])
def test_beams_tile_what_a_plane_mirror_lights(height):
    """20,000 photons of a point light over a mirror of 1 m2, seen again in it: their areas together are that
    of the mirror as seen from the light's image. A lattice's count in a square is off by a few over N."""
    scene = Scene()
    scene.add(rectangle((-0.5, 0, -0.5), (0, 0, 1), (1, 0, 0)), material=mirror(0.9))
    scene.add(rectangle((-40, height, -40), (80, 0, 0), (0, 0, 80)), material=BLACK)  # faces down
    light = (0.1, 0.4, 0.0)
    tracer = Tracer(lit(scene, light))
    path = tracer.walk(tracer.emit(20_000), 1)
    beams = path.beams.astype(float)
    areas = np.linalg.norm(np.cross(beams[:, :3], beams[:, 3:6]), axis=1)
    lit_area = (1.0 * (light[1] + height) / light[1]) ** 2
    assert len(beams) > 2000
    # 20 photons of some 4,000 more or fewer
    assert areas.sum() == pytest.approx(lit_area, rel=0.01)
    assert (np.abs(beams[:, 6:] - (0, 1, 0)) < 1e-6).all()


POLISHED = Material((0.5, 0.5, 0.5), roughness=0.0)
COATED = Material((0.5, 0.5, 0.5), roughness=1.0, specular=0.0, clearcoat=1.0, clearcoat_roughness=0.0)


@pytest.mark.parametrize("material", [glass(), POLISHED, COATED], ids=["glass", "plastic", "coat"])
def test_beams_tile_what_a_weak_reflection_lights(material):
    """Likewise of a reflection that one of some twenty photons takes, by chance: N of them are off by the
    root of N, of which 4 sigma count, and more where they stand for more."""
    scene = Scene()
    scene.add(rectangle((-0.5, 0, -0.5), (0, 0, 1), (1, 0, 0)), material=material)
    scene.add(rectangle((-40, 1, -40), (80, 0, 0), (0, 0, 80)), material=BLACK)  # faces down
    light = (0.1, 0.4, 0.0)
    tracer = Tracer(lit(scene, light))
    path = tracer.walk(tracer.emit(200_000), 1)
    beams = path.beams[path.photons["position"][path.photons["bounce"] == 0][:, 1] > 0.99].astype(float)
    areas = np.linalg.norm(np.cross(beams[:, :3], beams[:, 3:6]), axis=1)
    assert len(areas) > 1000
    lit_area, sigma = (1.4 / 0.4) ** 2, math.sqrt((areas**2).sum())
    assert abs(areas.sum() - lit_area) < 4.0 * sigma
    assert sigma < 0.05 * lit_area


def test_beams_tile_what_each_band_lights_after_a_mirror():
    """A spot shines at a mirror, and back from it through the face of a glass: there a photon draws one of
    three bands, and stands for as many of that band. Indices differ by .0025, and areas by less of
    themselves; 4 sigma, as above."""
    areas = {}
    for dispersion in (0.0, 0.1):
        scene = Scene()
        scene.add(rectangle((0, -2, -2), (0, 4, 0), (0, 0, 4)), material=mirror(1.0))
        face = Material(
            (1.0,) * 3, transmission=1.0, roughness=0.0, ior=1.5, thickness=1.0, dispersion=dispersion
        )
        scene.add(rectangle((2, -9, -9), (0, 0, 18), (0, 18, 0)), material=face)
        scene.add(rectangle((3, -9, -9), (0, 0, 18), (0, 18, 0)), material=BLACK)
        turned = (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5))  # its light along -x
        scene.add(
            SpotLight((1.0,) * 3, inner_angle=0.29, outer_angle=0.3), translation=(1, 0, 0), rotation=turned
        )
        tracer = Tracer(scene)
        path = tracer.walk(tracer.emit(40_000), 1)
        first = path.photons["bounce"] == 0
        far = path.photons["position"][first][:, 0] > 2.99
        beams, flux = path.beams[far].astype(float), path.photons["flux"][first][far]
        area = np.linalg.norm(np.cross(beams[:, :3], beams[:, 3:6]), axis=1)
        areas[dispersion] = [area[flux[:, c] > 0.0] for c in range(3)]
    plain, *_ = areas[0.0]
    assert len(plain) > 5000
    for band in areas[0.1]:
        assert 0.25 < len(band) / len(plain) < 0.42
        sigma = math.sqrt((band**2).sum())
        assert abs(band.sum() - plain.sum()) < 4.0 * sigma + 0.003 * plain.sum()


def test_beams_of_parallel_light_keep_their_width():
    """From a plane mirror at 45 degrees onto a wall; and each photon's area is its share of the light."""
    scene = Scene()
    scene.add(rectangle((-1, 0, -1), (0, 0, 2), (2, 2, 0)), material=mirror(1.0))
    scene.add(rectangle((-3, -3, -3), (0, 0, 6), (0, 6, 0)), material=BLACK)
    scene.add(DirectionalLight((2.0,) * 3), rotation=(-math.sqrt(0.5), 0, 0, math.sqrt(0.5)))
    tracer = Tracer(scene)
    path = tracer.walk(tracer.emit(5000), 1)
    beams, flux = path.beams.astype(float), path.photons["flux"][:, 0].astype(float)
    areas = np.linalg.norm(np.cross(beams[:, :3], beams[:, 3:6]), axis=1)
    assert len(beams) > 500
    assert areas == pytest.approx(flux / 2.0, rel=1e-4)


def test_beams_of_a_soft_spot_are_wider_where_it_fades():
    """A photon's solid angle is its flux over the intensity that its light sends there."""
    scene = Scene()
    scene.add(rectangle((-5, 0, -5), (0, 0, 10), (10, 0, 0)), material=mirror(1.0))
    scene.add(rectangle((-40, 3, -40), (80, 0, 0), (0, 0, 80)), material=BLACK)
    scene.add(
        SpotLight((1.0,) * 3, inner_angle=0.05, outer_angle=0.6), translation=(0, 1, 0),
        rotation=(-math.sqrt(0.5), 0, 0, math.sqrt(0.5)),
    )  # fmt: skip
    tracer = Tracer(scene)
    path = tracer.walk(tracer.emit(4000), 1)
    beams = path.beams.astype(float)
    areas = np.linalg.norm(np.cross(beams[:, :3], beams[:, 3:6]), axis=1)
    # together they tile the disc that the cone lights, 4 m from the light's image; where the spot is nearly
    # dark few photons stand for much, and their number is off by its root: 3 sigma of the last tenth
    assert areas.sum() == pytest.approx(math.pi * (4 * math.tan(0.6)) ** 2, rel=0.1)
