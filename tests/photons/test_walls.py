"""Kernels end at walls that stand on their surface, and at nothing else."""

import numpy as np
import pytest
from transport import Tracer, lit

from ispm.library.common import lambert
from ispm.library.shapes import icosphere, polygons
from ispm.optics.records import CAUSTIC
from ispm.photons.walls import end_at_walls
from ispm.scene.scene import Scene

WALL = 0.06  # m from the kernels' middle


def ended(tracer, position, u, v):
    """One kernel of a lumen after it was ended where walls stand."""
    kernel = np.zeros(1, CAUSTIC)
    kernel["position"], kernel["u"], kernel["v"] = position, u, v
    kernel["height"], kernel["flux"] = 0.25 * np.linalg.norm(v), 1.0
    end_at_walls(kernel, tracer.world, tracer.surfaces)
    return kernel[0]


def quad(*corners):
    return polygons([np.array(corners, float)])


@pytest.fixture(scope="module")
def corner():
    """A floor, and a thin wall across x."""
    scene = Scene()
    scene.add(quad((-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)), material=lambert((1.0,) * 3))
    scene.add(quad((WALL, 0, -1), (WALL, 0, 1), (WALL, 1, 1), (WALL, 1, -1)), material=lambert((1.0,) * 3))
    return Tracer(lit(scene, (0, 2, 0)))


@pytest.mark.parametrize(("u", "v"), [((0.1, 0, 0), (0, 0, -0.02)), ((0.08, 0, 0.08), (0.02, 0, -0.02))])
def test_a_kernel_ends_at_the_wall_it_would_reach_through(corner, u, v):
    kernel = ended(corner, (0, 0, 0), u, v)
    assert kernel["front"] == pytest.approx((-1, 0, 0), abs=1e-6)
    assert kernel["reach"] == pytest.approx(WALL, rel=1e-5)
    # what would lie behind is given to the rest: of a chord at x of the disc's radius
    x = WALL / np.hypot(u[0], v[0])
    s = np.linspace(-1, x, 100_001)
    part = np.trapezoid(16 / (5 * np.pi) * (1 - s**2) ** 2.5, s)
    assert kernel["flux"] == pytest.approx(1 / part, rel=1e-4)


def test_kernels_that_reach_no_wall_stay_whole(corner):
    for position, u in (((0, 0, 0), (0.05, 0, 0)), ((-0.5, 0, 0), (0.3, 0, 0.1)), ((0.5, 0, 0), (0.4, 0, 0))):
        kernel = ended(corner, position, u, (0, 0, -0.02))
        assert not kernel["front"].any() and (kernel["flux"] == 1.0).all()


def test_only_the_rows_asked_for_end(corner):
    kernels = np.zeros(3, CAUSTIC)
    kernels["u"], kernels["v"], kernels["flux"] = (0.1, 0, 0), (0, 0, -0.1), 1.0
    end_at_walls(kernels, corner.world, corner.surfaces, np.array([2, 0], np.uint32))
    assert kernels["front"].any(axis=1).tolist() == [True, False, True]


@pytest.mark.parametrize("degrees", [0, 30, 55])
def test_walls_that_lean_end_kernels(degrees):
    """Away from the kernel, by up to 58 degrees from its surface's normal."""
    slant = np.radians(degrees)
    up = np.array([np.sin(slant), np.cos(slant), 0.0])
    foot = np.array([[WALL, 0, -1], [WALL, 0, 1]])
    scene = Scene()
    scene.add(quad((-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)), material=lambert((1.0,) * 3))
    scene.add(quad(*foot, *(foot[::-1] + up)), material=lambert((1.0,) * 3))
    kernel = ended(Tracer(lit(scene, (-1, 2, 0))), (0, 0, 0), (0.1, 0, 0), (0, 0, -0.1))
    front = -np.cos(slant), np.sin(slant), 0
    assert kernel["front"] == pytest.approx(front, abs=1e-6)
    assert kernel["reach"] == pytest.approx(WALL * np.cos(slant), rel=1e-5)


@pytest.mark.parametrize("inside", [False, True])
def test_a_round_surface_is_no_wall_to_its_own_kernels(inside):
    scene = Scene()
    scene.add(icosphere(1.0, 16), material=lambert((1.0,) * 3))
    side = -1.0 if inside else 1.0
    kernel = ended(Tracer(lit(scene, (0, 3, 0))), (0, 1, 0), (0.3, 0, 0), (0, 0, -0.1 * side))
    assert not kernel["front"].any()
