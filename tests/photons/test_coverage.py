"""Light that kernels lose past edges comes back: against kernels integrated over surfaces."""

import math

import numpy as np
import pytest
from transport import Tracer, lit

from ispm.library.common import lambert
from ispm.library.shapes import box, polygons
from ispm.optics.records import CAUSTIC, PHOTON
from ispm.photons.coverage import Draws, keep_light
from ispm.photons.footprint import end_kernel
from ispm.scene.material import AlphaMode, Material, Texture
from ispm.scene.scene import Scene

_COUNT = 40_000
_RADIUS, _HEIGHT = 0.2, 0.05


def scene_of(*corners) -> Tracer:
    scene = Scene(name="sheets")
    for each in corners:
        scene.add(polygons([np.array(each, float)]), material=lambert((0.5,) * 3, double_sided=True))
    return Tracer(lit(scene, (0.3, 2.0, 0.2)))


def photons_at(position, normal=(0.0, 1.0, 0.0), wi=(0.0, 1.0, 0.0), count=_COUNT) -> np.ndarray:
    rows = np.zeros(count, PHOTON)
    rows["position"], rows["normal"], rows["wi"] = position, normal, wi
    rows["flux"], rows["radius"], rows["height"] = 1.0, _RADIUS, _HEIGHT
    return rows


def kept(tracer, photons, seed=0, pass_index=0, threads=2, **options) -> np.ndarray:
    photons, tracer.world.threads = photons.copy(), threads
    keys = np.arange(len(photons), dtype=np.uint32) * np.uint32(0x9E3779B1)
    draws = Draws(keys, seed, pass_index, options.pop("series", 1))
    keep_light(photons, draws, tracer.world, tracer.surfaces, **options)
    return photons["flux"]


def five_sigma(flux) -> float:
    return 5.0 * float(flux[:, 0].std()) / math.sqrt(len(flux)) + 1e-6


def floor(low_x=-1.0, high_x=1.0):
    return [(low_x, 0, -1), (low_x, 0, 1), (high_x, 0, 1), (high_x, 0, -1)]


def part_before(x: float) -> float:
    """Of a kernel of radius 1, in x and below: the integral of its marginal 16 / (5 pi) (1 - x^2)^(5/2)."""
    at = (np.arange(20_000) + 0.5) / 20_000 * (1.0 + x) - 1.0
    return float(16.0 / (5.0 * math.pi) * ((1.0 - at * at) ** 2.5).mean() * (1.0 + x))


def test_kernels_on_one_surface_stay_as_they_are():
    assert (kept(scene_of(floor()), photons_at((0.3, 0.0, 0.2))) == 1.0).all()


@pytest.mark.parametrize("clear", [0.15, 0.06, 0.0])
def test_past_an_open_edge_flux_grows_as_the_kernel_shrinks(clear):
    flux = kept(scene_of(floor(high_x=0.3)), photons_at((0.3 - clear, 0.0, 0.0)))
    assert abs(flux[:, 0].mean() - 1.0 / part_before(clear / _RADIUS)) < five_sigma(flux)


def test_holes_of_a_mask_are_past_an_edge():
    """Half of a masked floor is cut off by its texture: what falls there had been lost."""
    texture = np.ones((8, 8, 4), np.float32)
    texture[:, 4:, 3] = 0.0
    masked = Material((0.5,) * 3, alpha_mode=AlphaMode.MASK, base_color_texture=Texture(texture))
    square = polygons([np.array(floor(), float)])
    square.uv0 = np.array([(0, 0), (0, 1), (1, 1), (1, 0)], float)
    scene = Scene(name="mask")
    scene.add(square, material=masked)
    flux = kept(Tracer(lit(scene, (-0.3, 2.0, 0.2))), photons_at((-0.06, 0.0, 0.0)))
    assert abs(flux[:, 0].mean() - 1.0 / part_before(0.06 / _RADIUS)) < five_sigma(flux)


@pytest.mark.parametrize("angle", [20.0, 40.0, -30.0])
def test_folds_bring_what_the_kernel_integrates_to(angle):
    """A floor that turns by an angle at x = 0, down or up; photons 0.02 m before the fold."""
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    slope = [(0, 0, -1), (0, 0, 1), (c, -s, 1), (c, -s, -1)]
    x, z = np.meshgrid((np.arange(2000) + 0.5) / 1000.0 - 1.0, (np.arange(500) + 0.5) / 1000.0 - 0.25)
    # places on the unfolded floor, and their offsets from the photon
    along = np.where(x > 0.0, x * c, x) + 0.02
    across = np.where(x > 0.0, -x * s, 0.0)
    t2 = (along**2 + z**2) / _RADIUS**2 + across**2 / _HEIGHT**2
    share = 3.0 / (math.pi * _RADIUS**2) * (np.maximum(1.0 - t2, 0.0) ** 2).sum() * 1e-6
    flux = kept(scene_of(floor(high_x=0.0), slope), photons_at((-0.02, 0.0, 0.0)))
    assert abs(flux[:, 0].mean() - 1.0 / share) < five_sigma(flux) + 1e-3


def test_surfaces_that_a_photon_does_not_light_are_none():
    """A floor that goes on 3 cm lower is lit; a wall in its place is not."""
    edge, step = floor(high_x=0.0), [(0, -0.03, -1), (0, -0.03, 1), (1, -0.03, 1), (1, -0.03, -1)]
    wall = [(0, 0, -1), (0, 0, 1), (0, -1, 1), (0, -1, -1)]
    rows = photons_at((0.0, 0.0, 0.0))
    alone, walled, lower = (kept(scene_of(edge, *more), rows)[:, 0] for more in ((), (wall,), (step,)))
    sigma5 = 5.0 * alone.std() / math.sqrt(_COUNT)
    assert abs(alone.mean() - 2.0) < sigma5
    assert abs(walled.mean() - 2.0) < sigma5
    assert lower.mean() < 2.0 - sigma5


@pytest.mark.parametrize("double_sided", [False, True])
@pytest.mark.parametrize("clear", [0.1, 0.03])
def test_a_floor_below_what_stands_on_it_does_not_count_at_rays_ends(clear, double_sided):
    """A box on a floor, its side `clear` from the photon; of a double-sided one, nobody knows its inside."""
    scene = Scene(name="box")
    scene.add(polygons([np.array(floor(), float)]), material=lambert((0.5,) * 3))
    scene.add(box((clear, 0, -1), (1, 1, 1)), material=lambert((0.5,) * 3, double_sided=double_sided))
    tracer, rows = Tracer(lit(scene, (-0.3, 2.0, 0.2))), photons_at((0.0, 0.0, 0.0))
    assert (kept(tracer, rows) == 1.0).all()
    flux = kept(tracer, rows, solids=True)
    share = 1.0 if double_sided else part_before(clear / _RADIUS)
    assert abs(flux[:, 0].mean() - 1.0 / share) < five_sigma(flux)


@pytest.mark.parametrize("thick", [0.0, 0.02])
def test_the_floor_behind_a_wall_counts(thick):
    """Light leaks to it, and rays meet it there: only the floor within the wall is lost."""
    scene = Scene(name="wall")
    scene.add(polygons([np.array(floor(), float)]), material=lambert((0.5,) * 3))
    sheet = polygons([np.array([(0.05, 0, -1), (0.05, 0, 1), (0.05, 1, 1), (0.05, 1, -1)], float)])
    solid = box((0.05, 0, -1), (0.05 + thick, 1, 1))
    scene.add(solid if thick else sheet, material=lambert((0.5,) * 3, double_sided=not thick))
    flux = kept(Tracer(lit(scene, (-0.3, 2.0, 0.2))), photons_at((0.0, 0.0, 0.0)), solids=True)
    lost = part_before((0.05 + thick) / _RADIUS) - part_before(0.05 / _RADIUS)
    assert abs(flux[:, 0].mean() - 1.0 / (1.0 - lost)) < five_sigma(flux)


@pytest.mark.parametrize("solids", [False, True])
@pytest.mark.parametrize("pane", ["glass", "rough glass", "tinted", "blend"])
def test_what_is_seen_through_takes_no_light_from_what_is_below(pane, solids):
    """A pane 1 cm above a floor, where the kernels of the floor's photons are .7 of what they are on it."""
    materials = {
        "glass": Material(transmission=1.0, roughness=0.0, thickness=0.01),
        "rough glass": Material(transmission=1.0, roughness=0.5, thickness=0.01),
        "tinted": Material(transmission=0.8, roughness=0.0, thickness=0.01),
        "blend": Material((0.5, 0.5, 0.5, 0.4), alpha_mode=AlphaMode.BLEND),
    }
    scene = Scene(name="pane")
    scene.add(polygons([np.array(floor(), float)]), material=lambert((0.5,) * 3))
    scene.add(box((-1, 0.01, -1), (1, 0.02, 1)), material=materials[pane])
    tracer = Tracer(lit(scene, (-0.3, 2.0, 0.2)))
    assert (kept(tracer, photons_at((0.1, 0.0, 0.0)), solids=solids) == 1.0).all()


def test_a_mirror_takes_no_light_from_its_frame():
    """Beside a mirror in a hole of a wall kernels shrink as at the hole's edge: nothing is seen on it."""
    hole, rows = floor(high_x=0.0), photons_at((-0.05, 0.0, 0.0))
    scene = Scene(name="mirror")
    scene.add(polygons([np.array(hole, float)]), material=lambert((0.5,) * 3))
    scene.add(polygons([np.array(floor(low_x=0.0), float)]), material=Material(metallic=1.0, roughness=0.0))
    flux = kept(Tracer(lit(scene, (-0.3, 2.0, 0.2))), rows)
    assert abs(flux[:, 0].mean() - 1.0 / part_before(0.05 / _RADIUS)) < five_sigma(flux)


def test_only_the_rows_that_are_asked_for_change():
    tracer, photons = scene_of(floor(high_x=0.0)), photons_at((0.0, 0.0, 0.0), count=2000)
    some = np.arange(3, 2000, 7, dtype=np.uint32)
    flux, whole = kept(tracer, photons, rows=some), kept(tracer, photons)
    assert (flux[some] == whole[some]).all()
    assert (np.delete(flux, some, axis=0) == 1.0).all()


def test_ellipses_count_only_what_walls_leave_of_them():
    """A kernel half on the floor whose other half a wall has cut off: its flux is doubled once, not twice."""
    rows = np.zeros(_COUNT, CAUSTIC)
    rows["u"], rows["v"], rows["flux"], rows["wi"] = (0.0, 0.0, 0.4), (0.1, 0.0, 0.0), 1.0, (0.0, 1.0, 0.0)
    rows["height"] = _HEIGHT
    assert np.cross(rows["u"][0], rows["v"][0])[1] > 0.0
    tracer = scene_of(floor(high_x=0.0))
    whole = kept(tracer, rows)
    assert abs(whole[:, 0].mean() - 2.0) < five_sigma(whole)
    for row in rows:
        end_kernel(row, (np.float32(-1), np.float32(0), np.float32(0)), 0.0)
    assert np.abs(kept(tracer, rows) - 2.0).max() < 1e-5


def test_numbers_are_of_keys_passes_and_seeds_alone():
    tracer, rows = scene_of(floor(high_x=0.0)), photons_at((-0.05, 0.0, 0.0), count=2000)
    one = kept(tracer, rows, threads=1)
    assert (kept(tracer, rows, threads=3) == one).all()
    assert (kept(tracer, rows[:500]) == one[:500]).all()
    assert (kept(tracer, rows, seed=1) != one).any() and (kept(tracer, rows, pass_index=1) != one).any()
    assert not kept(tracer, rows[:0]).size
