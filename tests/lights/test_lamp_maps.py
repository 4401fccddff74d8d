"""Photons that leave lamps with a surface through bounce maps: as those that leave as rays."""

import math

import numpy as np
import pytest
from scipy import stats
from transport import Tracer, box_room

from ispm import DiskLight, Material, RectLight, Renderer, Settings, SphereLight
from ispm.accel.records import NO_TREES
from ispm.errors import SettingsError
from ispm.library.common import lambert
from ispm.library.shapes import box, icosphere
from ispm.lights import lamp_maps
from ispm.lights.lamp_maps import emit_from_lamp_maps, plan_lamp_maps
from ispm.lights.surface_emission import emissive_flux, emit_from_surfaces
from ispm.optics.records import EMITTED_BY_SURFACE, NO_HIT
from ispm.scene.packed import to_world
from ispm.stages.bounce import BounceStage
from ispm.stages.upload import Upload

COUNT, SEEDS, CELLS = 4000, 24, 4
GLOW = (3.0, 2.0, 1.0)
FLOOR = 2  # the instance, in the order of SIDES

LAMPS = {
    "rectangle": RectLight(GLOW, 0.8, 0.3),
    "two-sided rectangle": RectLight(GLOW, 0.8, 0.3, two_sided=True),
    "disk": DiskLight(GLOW, 0.4),
    "two-sided disk": DiskLight(GLOW, 0.4, two_sided=True),
    "sphere": SphereLight(GLOW, 0.3),
}


def room(lamp, blocked):
    """A room of 4 x 2 x 4 m with a lamp that is turned; blocked: a box and a ball stand before it."""
    scene = box_room((-2, -1, -2), (2, 1, 2), albedo=0.6)
    scene.add(lamp, translation=(0.2, 0.55, 0.1)).look_at((0.4, -1.0, -0.1))
    if blocked:
        scene.add(box((-0.3, -0.2, -0.2), (0.1, 0.05, 0.6)), material=lambert((0.5,) * 3))
        scene.add(icosphere(0.15, 4), material=lambert((0.5,) * 3), translation=(0.7, 0.1, -0.4))
    return scene


class Emitter:
    """Emits the photons of a scene's lamps in both ways."""

    def __init__(self, gpu, scene):
        self.gpu, self.tracer = gpu, Tracer(scene)
        self._upload, self._stage = Upload(gpu), BounceStage(gpu)

    def rays(self, seed, share=0.0):
        tracer = self.tracer
        return emit_from_surfaces(tracer.packed, tracer.world, tracer.surfaces, COUNT, share, seed, 0, 1)

    def maps(self, seed, share=0.0, pass_index=0):
        packed, surfaces = self.tracer.packed, self.tracer.surfaces
        lamps = plan_lamp_maps(packed, surfaces, COUNT, share, seed, pass_index)
        with self.gpu.frame() as frame:
            maps = self._stage(frame, self._upload(packed), lamps.maps, 1e-4 * packed.diagonal)
        return emit_from_lamp_maps(lamps, surfaces, maps.read(self.gpu), 1)


def on_cells(photons):
    """Luminous flux on each cell of the floor, then on each other instance, and what meets nothing."""
    flux = photons["flux"].astype(float).sum(axis=1)
    floor = photons["instance"] == FLOOR
    corners = np.array([(-2, -2), (-2, 2), (2, 2), (2, -2)], float)  # x, z
    triangles = corners[np.array([(0, 1, 2), (0, 2, 3)])[photons["primitive"][floor]]]
    u, v = photons["u"][floor, None], photons["v"][floor, None]
    points = triangles[:, 0] * (1 - u - v) + triangles[:, 1] * u + triangles[:, 2] * v
    column, row = np.clip(((points + 2) / 4 * CELLS).astype(int), 0, CELLS - 1).T
    others = np.where(photons["instance"] == NO_HIT, 15, np.minimum(photons["instance"], 14))
    where = np.where(floor, 0, CELLS**2 + others)
    where[floor] = CELLS * row + column
    return np.bincount(where, flux, CELLS**2 + 16)


def agree(one, other):
    """Whether rows of samples have the same means: Welch's t-test at 1 % for all columns together (Sidak)."""
    one, other = np.array(one), np.array(other)
    used = np.concatenate([one, other]).std(axis=0) > 0.0
    p = stats.ttest_ind(one[:, used], other[:, used], equal_var=False).pvalue
    return used.sum() >= CELLS**2 and p.min() > 1 - 0.99 ** (1 / used.sum())


@pytest.mark.parametrize("blocked", [False, True], ids=["free", "blocked"])
@pytest.mark.parametrize("kind", LAMPS)
def test_maps_and_rays_of_lamps_light_every_cell_alike(gpu, kind, blocked, monkeypatch):
    """First hits on each of 16 cells of the floor and on all else, 24 seeds of 8 points each."""
    monkeypatch.setattr(lamp_maps, "_PHOTONS", COUNT // 8)
    emit = Emitter(gpu, room(LAMPS[kind], blocked))
    assert agree(*([on_cells(by(seed)) for seed in range(SEEDS)] for by in (emit.maps, emit.rays)))


def with_glass():
    """A room with a two-sided lamp and two glass balls, one of them behind it."""
    scene = room(LAMPS["two-sided rectangle"], False)
    glass = Material(transmission=1.0, roughness=0.0, ior=1.5, thickness=1.0)
    scene.add(icosphere(0.25, 8), material=glass, translation=(0.7, -0.5, 0.3))
    scene.add(icosphere(0.1, 8), material=glass, translation=(-0.3, 0.8, 0.0))
    return scene


def test_maps_aimed_at_glass_carry_the_same_flux_everywhere(gpu, monkeypatch):
    """By maps without aim, by aimed ones and by rays; and more photons meet the glass."""
    monkeypatch.setattr(lamp_maps, "_PHOTONS", COUNT // 4)
    emit = Emitter(gpu, with_glass())
    plain, aimed = ([emit.maps(seed, share) for seed in range(SEEDS)] for share in (0.0, 0.6))
    rays = [on_cells(emit.rays(seed, 0.6)) for seed in range(SEEDS)]
    assert agree([on_cells(each) for each in plain], [on_cells(each) for each in aimed])
    assert agree([on_cells(each) for each in aimed], rays)
    glass = [np.isin(np.concatenate(each)["instance"], (7, 8)).sum() for each in (plain, aimed)]
    assert glass[1] > 2 * glass[0]


@pytest.mark.parametrize("kind", LAMPS)
def test_photons_of_lamp_maps_carry_the_flux_of_the_lamp(gpu, kind):
    """Each photon the same, pi A L / N; their number as uncertain as so many coins at most, 4 sigma; their
    shares of area and direction together, m2 sr, are those of the lamp, pi A."""
    emit = Emitter(gpu, room(LAMPS[kind], False))
    photons = emit.maps(3)
    flux = emissive_flux(emit.tracer.packed, emit.tracer.surfaces)
    np.testing.assert_allclose(photons["flux"] @ (0.2126, 0.7152, 0.0722), flux / COUNT, rtol=2e-3)
    assert abs(len(photons) - COUNT) <= 4 * math.sqrt(COUNT)
    extents = (photons["spread"].astype(float) * photons["turn"]) ** 2
    np.testing.assert_allclose(extents, math.pi * LAMPS[kind].area / COUNT, rtol=2e-3)
    assert len(np.unique(photons["key"])) == len(photons)


@pytest.mark.parametrize("kind", LAMPS)
def test_photons_of_lamp_maps_leave_the_side_that_shines(gpu, kind):
    """Points on the triangle told, and hits before its face; on both sides where both shine."""
    emit = Emitter(gpu, room(LAMPS[kind], False))
    tracer = emit.tracer
    photons = np.concatenate([emit.maps(seed) for seed in range(4)])
    triangles = tracer.tables.emitters.triangles[photons["emitter"]]
    off = photons["origin"] - triangles["corner"].astype(float)
    assert np.abs(np.einsum("ij,ij->i", off, triangles["normal"])).max() < 1e-5
    d = positions(tracer, photons) - photons["origin"]
    cosines = np.einsum("ij,ij->i", d, triangles["normal"]) / np.linalg.norm(d, axis=1)
    if getattr(LAMPS[kind], "two_sided", False):
        assert abs(cosines.mean()) < 0.1 and cosines.std() > 0.6
    else:
        # the mean over the cosine's hemisphere is 2/3, its deviation 0.236, of points that differ little
        assert cosines.min() > 0.0 and cosines.mean() == pytest.approx(2 / 3, abs=0.02)
    assert (photons["light"] == EMITTED_BY_SURFACE).all()


def positions(tracer, photons):
    """Where photons hit, (n, 3) float64 m; all of them do."""
    packed, points = tracer.packed, np.empty((len(photons), 3))
    for k in np.unique(photons["instance"]):
        mine = photons["instance"] == k
        placed = packed.instances[k]
        mesh = packed.geometry.ranges[placed["mesh"]].mesh
        corners = mesh.positions[mesh.triangles[photons["primitive"][mine]]].astype(float)
        u, v = photons["u"][mine, None], photons["v"][mine, None]
        at = corners[:, 0] * (1 - u - v) + corners[:, 1] * u + corners[:, 2] * v
        matrix = to_world(placed).astype(float)
        points[mine] = at @ matrix[:, :3].T + matrix[:, 3]
    return points


def test_passes_draw_other_points_evenly(gpu):
    """One point a pass: of 64 passes each quarter of a square lamp, along each axis, has a quarter, within
    the discrepancy of the lattice."""
    emit = Emitter(gpu, room(RectLight(GLOW, 1.0, 1.0), False))
    lamps = [plan_lamp_maps(emit.tracer.packed, emit.tracer.surfaces, 100, 0.0, 5, k) for k in range(64)]
    points = np.concatenate([each.lights["position"] for each in lamps])
    assert len(points) == 64
    triangles = emit.tracer.tables.emitters.triangles
    axes = triangles["edge1"][0], triangles["edge2"][0] - triangles["edge1"][0]
    corner = triangles["corner"][0]
    for axis in axes:
        place = (points - corner) @ axis / (axis @ axis)
        counts = np.histogram(place - place.min(), 4, (0.0, 1.0))[0]
        assert counts.min() >= 10 and counts.max() <= 22


def test_points_are_drawn_without_trees(gpu, monkeypatch):
    """They lie on the lamp, whatever stands in memory where there are no trees."""
    emit = Emitter(gpu, room(RectLight(GLOW, 1.0, 1.0), False))
    poison = NO_TREES._replace(rows=np.full(4096, np.nan, np.float32))
    monkeypatch.setattr("ispm.accel.surface.NO_TREES", poison)
    lamps = plan_lamp_maps(emit.tracer.packed, emit.tracer.surfaces, 64_000, 0.0, 5, 0)
    triangle = emit.tracer.tables.emitters.triangles[0]
    normal = np.cross(triangle["edge1"], triangle["edge2"])
    heights = (lamps.lights["position"] - triangle["corner"]) @ normal
    assert len(heights) == 64
    assert np.abs(heights).max() < 1e-6


def test_a_picture_with_maps_of_lamps_says_so(gpu):
    """Its statistics and its view of bounce maps; with rays there is no such view."""
    scene = room(LAMPS["rectangle"], True)
    told = {"size": (32, 18), "photons": 2000}
    with Renderer(scene, Settings(**told, emission="map"), gpu=gpu) as renderer:
        assert renderer.render().stats.emission == "map"
        assert renderer.view("bounce-map").any()
    with Renderer(scene, Settings(**told, emission="rays"), gpu=gpu) as renderer:
        assert renderer.render().stats.emission == "rays"
        with pytest.raises(SettingsError, match="bounce-map"):
            renderer.view("bounce-map")
