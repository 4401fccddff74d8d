"""All estimators compute the same sum, and the sum is the light that arrives."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from scipy import integrate
from transport import trace

from ispm.errors import AdapterError
from ispm.estimators.grid import Grid
from ispm.estimators.tiled import Tiled
from ispm.estimators.tiled_cpu import TiledCpu
from ispm.estimators.volumes import Volumes, icosahedron_corners, icosahedron_faces
from ispm.gpu import RasterState, Target
from ispm.library.builtin import builtin
from ispm.optics.records import INNER, PHOTON, RECEIVER
from ispm.reference.gather import gather

LOW, HIGH = np.array([-2.0, -1.5, -6.0]), np.array([2.0, 1.5, 1.0])  # of a room around the eye
SIZE = (45, 27)  # not a multiple of a tile


@dataclass
class Scene:
    receivers: np.ndarray
    photons: np.ndarray
    clip: np.ndarray
    size: tuple[int, int] = SIZE


@pytest.fixture(scope="module")
def estimators(gpu):
    return {"volumes": Volumes(gpu), "tiled": Tiled(gpu), "tiled_cpu": TiledCpu(2), "grid": Grid(2)}


NAMES = ("volumes", "tiled", "tiled_cpu", "grid")


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def perspective(near=0.01, size=SIZE):
    f = 1 / math.tan(math.radians(35))
    clip = np.zeros((4, 4))
    clip[0, 0], clip[1, 1], clip[2, 3], clip[3, 2] = f * size[1] / size[0], f, near, -1
    return clip


def orthographic(half_height=1.4, size=SIZE, far=7.0):
    """Looking along -Z from z = 0.9; depth 1 near to 0 far."""
    clip = np.diag([size[1] / size[0] / half_height, 1 / half_height, 1 / far, 1.0])
    clip[2, 3] = 1 - 0.9 / far
    return clip


def seen_in_room(clip, jitter, random, size=SIZE):
    """Receivers where the screen's rays, `jitter` pixels around the centers at most, leave the room."""
    columns, rows = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    shift = random.uniform(-jitter, jitter, (2, *columns.shape))
    x = (columns + 0.5 + shift[0]) / size[0] * 2 - 1
    y = 1 - (rows + 0.5 + shift[1]) / size[1] * 2
    inverse = np.linalg.inv(clip)
    ends = []
    for z in (0.5, 0.25):
        p = np.stack([x, y, np.full_like(x, z), np.ones_like(x)], -1) @ inverse.T
        ends.append((p[..., :3] / p[..., 3:]).reshape(-1, 3))
    direction = unit(ends[1] - ends[0]) + 1e-12
    start = ends[0] if clip[3, 3] else np.zeros(3)
    distance = np.where(direction > 0, HIGH - start, LOW - start) / direction
    wall = distance.argmin(axis=1)
    everyone = np.arange(len(wall))
    ng = np.zeros_like(direction)
    ng[everyone, wall] = -np.sign(direction[everyone, wall])
    receivers = np.zeros(len(wall), RECEIVER)
    receivers["position"] = start + direction * distance.min(axis=1)[:, None]
    receivers["ng"], receivers["wo"] = ng, -direction
    receivers["n"] = unit(ng + 0.2 * random.normal(size=ng.shape))
    receivers["valid"] = random.random(len(wall)) < 0.95
    return receivers


def photons_in_room(count, radius, random):
    """On the walls, off them by a little, with kernels of any tilt within 20 degrees."""
    photons = np.zeros(count, PHOTON)
    wall, side = random.integers(0, 3, count), random.random(count) < 0.5
    position = random.uniform(LOW, HIGH, (count, 3))
    everyone = np.arange(count)
    position[everyone, wall] = np.where(side, HIGH[wall], LOW[wall])
    normal = np.zeros((count, 3))
    normal[everyone, wall] = np.where(side, -1, 1)
    normal = unit(normal + 0.15 * random.normal(size=normal.shape))
    photons["position"] = position + normal * random.uniform(-0.05, 0.05, (count, 1))
    photons["normal"] = normal
    photons["wi"] = unit(normal + unit(random.normal(size=normal.shape)))
    photons["flux"] = random.random((count, 3))
    photons["radius"] = random.uniform(*radius, count)
    photons["height"] = photons["radius"] * random.uniform(0.2, 1, count)
    return photons


def make_scene(name):
    random = np.random.default_rng(sum(map(ord, name)))
    clip = orthographic() if name == "orthographic" else perspective()
    receivers = seen_in_room(clip, 0.5 if name == "off-center" else 0.0, random)
    if name != "diffuse":
        receivers["alpha"] = np.where(
            random.random(len(receivers)) < 0.7, random.uniform(0.02, 1, len(receivers)), 0
        )
    sizes = {"eye inside kernels": (3.0, 8.0), "off-center": (0.05, 0.4)}
    photons = photons_in_room(400, sizes.get(name, (0.1, 1.0)), random)
    if name == "inner sides":
        photons["instance"][::2] |= INNER
        receivers["valid"][::3] |= INNER * receivers["valid"][::3]
    return Scene(receivers, photons, clip)


SCENES = ("diffuse", "glossy", "eye inside kernels", "orthographic", "off-center", "inner sides")


def disagreement(found, expected):
    """Largest error of each group of four channels, relative to the group's peak."""
    groups = np.abs(found - expected).reshape(-1, 4, 4).max(axis=(0, 2))
    peaks = np.abs(expected).reshape(-1, 4, 4).max(axis=(0, 2))
    return groups / np.where(peaks > 0, peaks, 1)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("scene", SCENES)
def test_estimator_matches_brute_force(estimators, name, scene):
    s = make_scene(scene)
    expected = gather(s.receivers, s.photons)
    assert (expected[:, 3] > 0).mean() > 0.3
    assert (expected[:, 12:15].max() > 0) == (scene != "diffuse")
    found = estimators[name](s.receivers, s.photons, s.clip, s.size)
    # float32: kappa's error is eps d^2 / h^2 <= 25 eps of its peak, D's 4 eps / alpha; both below 1e-4
    assert disagreement(found, expected).max() < 1e-4


@pytest.mark.parametrize("name", NAMES)
def test_no_photons_bring_no_light(estimators, name):
    s = make_scene("glossy")
    found = estimators[name](s.receivers, s.photons[:0], s.clip, s.size)
    assert found.shape == (len(s.receivers), 16)
    assert not found.any()


@pytest.mark.parametrize("name", NAMES)
def test_near_plane_does_not_matter(estimators, name):
    s = make_scene("eye inside kernels")
    found = [estimators[name](s.receivers, s.photons, perspective(near), s.size) for near in (1e-4, 0.7)]
    # lists made by atomics differ in order
    assert disagreement(found[0], found[1]).max() < 1e-6


def test_photons_that_cannot_be_seen_stay_out(estimators):
    s = make_scene("diffuse")
    behind = s.photons.copy()
    behind["position"][:, 2] = 20.0
    for name in NAMES:
        assert not estimators[name](s.receivers, behind, s.clip, s.size).any()


@pytest.mark.parametrize("scene", ["diffuse", "orthographic"])
def test_broken_photons_light_nothing(scene):
    s = make_scene(scene)
    broken = s.photons[:4].copy()
    broken["position"][0], broken["radius"][1], broken["height"][2], broken["radius"][3] = (
        np.nan,
        np.nan,
        np.nan,
        0,
    )
    assert not TiledCpu(1)(s.receivers, broken, s.clip, s.size).any()


def test_estimates_repeat_to_the_bit_for_any_threads(gpu):
    s = make_scene("glossy")
    found = [TiledCpu(threads)(s.receivers, s.photons, s.clip, s.size) for threads in (1, 2, 5)]
    assert (found[0] == found[1]).all()
    assert (found[0] == found[2]).all()


def test_tiles_list_photons_in_their_order(gpu):
    """In whatever order threads come, so that sums of floats repeat to the bit."""
    s = make_scene("glossy")
    tiled = Tiled(gpu)
    found = [tiled(s.receivers, s.photons, s.clip, s.size) for _ in range(2)]
    assert (found[0] == found[1]).all()
    starts = gpu.read_buffer(tiled._buffers["starts"], np.uint32, -(-s.size[0] // 8) * -(-s.size[1] // 8) + 1)
    members = gpu.read_buffer(tiled._buffers["members"], np.uint32, int(starts[-1])).astype(int)
    inside = np.ones(len(members), bool)
    inside[starts[starts < len(members)]] = False
    inside[0] = False
    assert np.diff(starts.astype(int)).max() > 40 and (np.diff(members)[inside[1:]] > 0).all()


def floor(size, half, height=0.0):
    """Receivers on z = height under an orthographic eye; (w*h,) row by row, and the camera."""
    clip = orthographic(half, size)
    x = ((np.arange(size[0]) + 0.5) / size[0] * 2 - 1) * half * size[0] / size[1]
    y = (1 - (np.arange(size[1]) + 0.5) / size[1] * 2) * half
    receivers = np.zeros(size[0] * size[1], RECEIVER)
    receivers["position"][:, 0], receivers["position"][:, 1] = (a.ravel() for a in np.meshgrid(x, y))
    receivers["position"][:, 2] = height
    receivers["ng"] = receivers["n"] = receivers["wo"] = (0, 0, 1)
    receivers["valid"] = 1
    return receivers, clip


def lattice(step, half, radius, total):
    """Photons of `total` lm together, evenly over the square |x|, |y| < half at z = 0."""
    place = np.arange(-half + step / 2, half, step)
    photons = np.zeros(len(place) ** 2, PHOTON)
    photons["position"][:, 0], photons["position"][:, 1] = (a.ravel() for a in np.meshgrid(place, place))
    photons["normal"] = photons["wi"] = (0, 0, 1)
    photons["flux"] = total / len(photons)
    photons["radius"], photons["height"] = radius, radius / 4
    return photons


@pytest.mark.parametrize("name", NAMES)
def test_uniform_photons_give_flux_per_area_and_the_known_edge(estimators, name):
    """E = Phi / A inside; at u radii from the edge the kernel's mass within: biweight's closed form."""
    size, radius = (64, 32), 0.4
    receivers, clip = floor(size, 1.2)
    found = estimators[name](receivers, lattice(0.04, 1.0, radius, 100.0), clip, size)
    u = (1.0 - np.abs(receivers["position"][:, 0].astype(float))) / radius
    mass = [
        0.5 + 16 / (5 * math.pi) * integrate.quad(lambda t: (1 - t * t) ** 2.5, 0, np.clip(v, -1, 1))[0]
        for v in u
    ]
    middle = np.abs(receivers["position"][:, 1]) < 0.5  # away from the other two edges
    # ten photons per radius: the lattice sum of a C1 function is within 1e-3 of its integral
    np.testing.assert_allclose(found[middle, 0], np.array(mass)[middle] * 100 / 4, atol=25 * 2e-3)
    np.testing.assert_allclose(found[middle, 3], np.array(mass)[middle] / 0.04**2, atol=625 * 2e-3)


@pytest.mark.parametrize("name", NAMES)
def test_single_photon_keeps_its_flux(estimators, name):
    receivers, clip = floor((64, 64), 1.0)
    photon = lattice(0.1, 0.05, 0.7, 5.0)
    found = estimators[name](receivers, photon, clip, (64, 64))
    # midpoint rule over 45 pixels across the kernel: error (pixel / radius)^2 at most
    assert found[:, 0].sum() * (2 / 64) ** 2 == pytest.approx(5.0, rel=2e-3)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("tilt", [0.3, 0.9])
def test_a_tilted_plane_gets_the_share_of_the_ellipse_it_cuts(estimators, name, tilt):
    """An ellipse with the half axes r and b, 1 / b^2 = cos^2 / r^2 + sin^2 / h^2: b / r of the flux."""
    side, radius, height = 96, 0.7, 0.3
    receivers, clip = floor((side, side), 1.0)
    normal = np.array([math.sin(tilt), 0.0, math.cos(tilt)])
    receivers["position"][:, 2] = -math.tan(tilt) * receivers["position"][:, 0]
    receivers["ng"] = receivers["n"] = normal
    photon = lattice(0.1, 0.05, radius, 5.0)
    photon["height"] = height
    found = estimators[name](receivers, photon, clip, (side, side))
    area = (2 / side) ** 2 / math.cos(tilt)  # of a pixel on the plane
    share = 1 / math.hypot(math.cos(tilt), math.sin(tilt) * radius / height)
    # the ratio of the cosines of wi, which a normal that is the geometric one leaves at 1;
    # midpoint rule: 13 pixels or more across half the ellipse, error 1 / 13^2 at most
    assert found[:, 3].sum() * area == pytest.approx(share, rel=6e-3)
    assert found[:, 0].sum() * area == pytest.approx(5.0 * share, rel=6e-3)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("radius", [0.3, 0.9])
def test_a_sphere_gets_all_flux_of_a_round_kernel(estimators, name, radius):
    """The similar-distance fact (method, 1.7): a cap of chord c has the area pi c^2 on any sphere."""
    side = 96
    receivers, clip = floor((side, side), 1.0)
    x, y = receivers["position"][:, 0].astype(float), receivers["position"][:, 1].astype(float)
    within = x * x + y * y < 0.99
    z = np.sqrt(np.where(within, 1 - x * x - y * y, 1))
    receivers["position"][:, 2] = 1 - z  # a bowl of radius 1, its lowest point in the middle
    receivers["ng"] = receivers["n"] = np.stack([-x, -y, z], axis=1)
    receivers["valid"] = within
    photon = lattice(0.1, 0.05, radius, 5.0)
    photon["height"] = radius
    found = estimators[name](receivers, photon, clip, (side, side))
    area = (2 / side) ** 2 / z
    # midpoint rule: 14 pixels or more across half the kernel
    assert (found[:, 3] * area).sum() == pytest.approx(1.0, rel=5e-3)
    assert (found[:, 0] * area).sum() == pytest.approx(5.0, rel=5e-3)


@pytest.mark.parametrize("name", NAMES)
def test_thin_wall_keeps_the_dark_side_dark(estimators, name):
    receivers, clip = floor((16, 16), 1.0, height=-0.01)
    photons = lattice(0.1, 1.0, 0.5, 10.0)
    lit = estimators[name](receivers, photons, clip, (16, 16))
    receivers["ng"] = receivers["n"] = (0, 0, -1)
    dark = estimators[name](receivers, photons, clip, (16, 16))
    assert lit[:, 0].max() > 1
    assert not dark.any()


def test_scaled_icosahedron_holds_the_kernel_and_unscaled_does_not():
    triangles = icosahedron_corners()[icosahedron_faces().reshape(20, 3)]
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    inradius = np.einsum("ij,ij->i", unit(normal), triangles[:, 0])
    assert inradius.min() == pytest.approx(inradius.max())
    assert 1.25840857 * inradius.min() > 1 - 1e-8
    assert inradius.min() < 0.8


def test_unscaled_volumes_lose_light(gpu):
    """The margin of a pixel is small against these kernels, so corners on the kernel's surface clip it."""
    volumes = Volumes(gpu)
    target = Target("rgba32float", blend="add")
    state = RasterState(depth=None, cull="front", fragment="fs_diffuse")
    volumes._diffuse = gpu.raster("estimators/volumes.wgsl", [target], state, BOUND_SCALE=1.0)
    receivers, clip = floor((64, 64), 1.0)
    photon = lattice(0.1, 0.05, 0.9, 5.0)
    found = volumes(receivers, photon, clip, (64, 64))
    assert disagreement(found, gather(receivers, photon)).max() > 1e-3


def talk_kernel(receivers, photons, errors):
    """(n, m) kappa of the slide's distance, t = d / r (1 +- c (r - h) / h), in double precision."""
    offset = receivers["position"][:, None].astype(float) - photons["position"].astype(float)
    d = np.linalg.norm(offset, axis=2)
    z = np.abs(np.einsum("nmi,mi->nm", offset, photons["normal"].astype(float)))
    r, h = photons["radius"].astype(float), photons["height"].astype(float)
    t = d / r * (1 + (-1 if errors else 1) * z / d * (r - h) / h)
    ellipsoid = (d**2 - z**2) / r**2 + z**2 / h**2
    if not errors:
        assert (
            t**2 >= ellipsoid - 1e-12
        ).all()  # so the volume drawn for the ellipsoid holds this kernel too
    s = 1 / 3
    norm = 1 / (2 * math.pi * s**2 * (1 - math.exp(-1 / (2 * s**2)))) / r**2
    return np.where((t < 1) & (ellipsoid < 1), norm * np.exp(-(np.maximum(t, 0) ** 2) / (2 * s**2)), 0)


@pytest.mark.parametrize("errors", [False, True])
def test_talk_volumes_have_the_slides_kernel(gpu, errors):
    s = make_scene("diffuse")
    volumes = Volumes(gpu, talk=True, errors=errors)
    found = volumes(s.receivers, s.photons, s.clip, s.size)
    kappa = talk_kernel(s.receivers, s.photons, errors)
    wi_ng = s.receivers["ng"].astype(float) @ s.photons["wi"].T.astype(float)
    wi_n = s.receivers["n"].astype(float) @ s.photons["wi"].T.astype(float)
    counts = (s.receivers["valid"] > 0)[:, None] & (wi_ng > 0)
    counts &= s.receivers["ng"].astype(float) @ s.photons["normal"].T.astype(float) > 0.5
    kappa = np.where(counts, kappa, 0)
    assert kappa.sum(axis=1) == pytest.approx(found[:, 3], abs=2e-3 * kappa.sum(axis=1).max())
    cosine = np.maximum(wi_n, 0) if errors else np.clip(wi_n, 0, None) / np.where(counts, wi_ng, 1)
    light = (kappa * np.minimum(cosine, 10)) @ s.photons["flux"][:, 0]
    # kernels jump by 1.1 % of their peak at the edge, and rounding decides which side a receiver is on
    assert light == pytest.approx(found[:, 0], abs=2e-3 * light.max())


def test_cut_gaussian_keeps_the_flux_of_a_photon(gpu):
    receivers, clip = floor((64, 64), 1.0)
    volumes = Volumes(gpu, talk=True)
    found = volumes(receivers, lattice(0.1, 0.05, 0.7, 5.0), clip, (64, 64))
    # midpoint rule over 45 pixels across, and a rim of 1.1 % of the peak on pixels that are in or out
    assert found[:, 0].sum() * (2 / 64) ** 2 == pytest.approx(5.0, rel=5e-3)


def test_second_cosine_of_the_slide_loses_a_third_in_an_integrating_sphere(gpu):
    """Method, 1.7: photons land by the cosine, so a second one averages cos^2 over cos, 2/3."""
    radius, albedo, flux, bounces = 2.0, 0.6, 100.0, 3
    path = trace(
        builtin("integrating-sphere", radius=radius, albedo=albedo, flux=flux), 40_000, bounces, seed=3
    )
    photons = path.photons
    # as high as wide, the talk's distance is the chord's with either sign, whose caps on a sphere hold pi r^2
    photons["radius"] = photons["height"] = 0.3
    size = (32, 32)
    clip = perspective(size=size)
    columns, rows = (np.arange(32) + 0.5) / 16 - 1, 1 - (np.arange(32) + 0.5) / 16
    x, y = np.meshgrid(columns * math.tan(math.radians(35)), rows * math.tan(math.radians(35)))
    way = unit(np.stack([x, y, -np.ones_like(x)], axis=-1).reshape(-1, 3))
    receivers = np.zeros(len(way), RECEIVER)
    receivers["position"], receivers["ng"], receivers["n"], receivers["wo"] = radius * way, -way, -way, -way
    receivers["valid"] = 1
    exact = flux / (4 * math.pi * radius**2) * sum(albedo**b for b in range(1, bounces + 1))
    ratios = []
    for errors in (False, True):
        volumes = Volumes(gpu, talk=True, errors=errors)
        ratios.append(volumes(receivers, photons, clip, size)[:, 0].mean(dtype=float) / exact)
    in_view = (unit(photons["position"].astype(float)) @ way.T).max(axis=1) > 0.99
    # of photons of equal flux: 4 sigma of their number, and the triangles' 0.05 %
    slack = 4 / math.sqrt(in_view.sum()) + 1e-3
    assert slack < 0.04
    assert ratios[0] == pytest.approx(1.0, abs=slack)
    assert ratios[1] == pytest.approx(2 / 3, abs=slack)


def test_volumes_without_blending_say_what_to_choose(gpu, monkeypatch):
    monkeypatch.setattr(type(gpu), "has", lambda self, feature: False)
    with pytest.raises(AdapterError, match="'tiled' or 'grid'"):
        Volumes(gpu)
