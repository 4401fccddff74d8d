"""What a photon lights by its beam: what its neighbours' paths light, through mirrors and glass."""

import math

import numpy as np
import pytest
from test_specular_paths import BLACK, glass, mirror, rectangle
from transport import Tracer, aim, box_room, lit

from ispm.library.shapes import icosphere
from ispm.optics.sampling import orthonormal_basis
from ispm.scene.light import DirectionalLight, SpotLight
from ispm.scene.scene import Scene

STEP = 2e-4  # between directions, radian
SIDE = 1e-2  # of the square of directions that is a photon's own
LAMP = np.array([0.1, 2.5, 0.2])


def one_way(tracer, origin, d):
    """(position, beam) of the first photon along d that has not scattered; None where there is none."""
    emitted = aim(tracer, origin[None], d[None])
    emitted["flux"] = SIDE**2  # of a light of one candela
    path = tracer.walk(emitted, 1)
    first = path.photons["bounce"] == 0
    if not len(path.beams):
        return None
    return path.photons["position"][first][0].astype(float), path.beams[0].astype(float)


def differences(tracer, directions, origins=None):
    """Relative errors of beams against neighbouring paths."""
    errors = []
    for i, d in enumerate(directions):
        origin = LAMP if origins is None else origins[i]
        here = one_way(tracer, origin, d)
        if here is None:
            continue
        basis = np.array(orthonormal_basis(tuple(np.float32(d))), float)
        for k, way in enumerate(basis):
            if origins is None:
                turned = d + STEP * way
                there = one_way(tracer, origin, turned / np.linalg.norm(turned))
            else:
                there = one_way(tracer, origin + STEP * way, d)
            if there is None:
                continue
            found = (there[0] - here[0]) / STEP * SIDE
            span = np.linalg.norm(here[1][:3]) + np.linalg.norm(here[1][3:6])
            errors.append(np.linalg.norm(found - here[1][3 * k : 3 * k + 3]) / span)
    return np.array(errors)


def stage(material, shape):
    """A lamp in a black room, and a thing of glass or silver under it."""
    scene = box_room((-5, 0, -5), (5, 5, 5), albedo=0.0)
    scene.add(shape, material=material, translation=(0, 1.0, 0))
    return lit(scene, tuple(LAMP))


@pytest.mark.parametrize(
    "material", [glass(), glass(thickness=0.0), mirror(1.0)], ids=["glass", "sheet", "mirror"]
)
def test_beams_are_the_differences_of_neighboring_paths(material):
    """100 rays at a ball of 20,480 triangles, each against two neighbours: where all three meet the same
    triangles, in at least seven of ten, they agree to the roundings of positions, 1e-6 m over STEP."""
    tracer = Tracer(stage(material, icosphere(0.4, 32)))
    random = np.random.default_rng(1)
    targets = np.array([0.0, 1.0, 0.0]) + random.uniform(-0.2, 0.2, (100, 3))
    directions = targets - LAMP
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    errors = differences(tracer, directions)
    assert len(errors) > 150
    assert np.quantile(errors, 0.7) < 0.01


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
