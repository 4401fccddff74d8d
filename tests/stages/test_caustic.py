"""Caustic photons drawn at full resolution: all their light, where it belongs, from any camera."""

import math

import numpy as np
import pytest
from exact import mixed_scene, quad, view_of

from ispm.gpu import FLAT, Target
from ispm.library.common import lambert
from ispm.optics.incident import FilteredLight
from ispm.optics.records import CAUSTIC, PHOTON, PIXEL_BACK
from ispm.photons.footprint import OVERLAP, overlap_of, shape_kernels
from ispm.photons.grid import PhotonGrid
from ispm.reference.gather import gather
from ispm.scene.camera import look_at_pose
from ispm.scene.material import Material
from ispm.scene.packed import pack
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView
from ispm.stages.caustic import CausticStage
from ispm.stages.downsample import Downsample
from ispm.stages.filter import MET
from ispm.stages.gbuffer import GBufferStage
from ispm.stages.upload import Upload
from ispm.stages.upsample import Upsample

NO_BEAMS = np.zeros((0, 9), np.float32)


class Picture:
    """A scene drawn once, to draw photons over. Its receivers are the pixels themselves."""

    def __init__(self, gpu, scene, view):
        self.gpu, self.view, self.packed = gpu, view, pack(scene)
        self.stage, downsample = CausticStage(gpu), Downsample(gpu, 1)
        self._kept = Upload(gpu), GBufferStage(gpu)
        with gpu.frame() as frame:
            self.scene = self._kept[0](self.packed)
            self.gbuffer = self._kept[1](frame, self.scene, view)
            downsample(frame, self.scene, self.gbuffer, view)
        self.receivers = downsample.read(gpu, view)

    def draw(self, photons, beams=NO_BEAMS, clear=0.0):
        """Radiance and irradiance, (H, W, 3)."""
        planes = np.full(len(beams), clear, np.float32)
        return self.draw_kernels(shape_kernels(photons, beams, planes, 100.0, 1.0, None))

    def draw_kernels(self, photons):
        with self.gpu.frame() as frame:
            targets = self.stage(frame, self.scene, self.gbuffer, self.view, photons)
        return [found[..., :3] for found in self.gpu.read_many([(t, np.float32, 4) for t in targets])]

    def surfaces(self):
        """Base color and metallic as the G-buffer rounds them, (n, 4), and the material, of each pixel."""
        wanted = [(self.gbuffer.base, np.float16, 4), (self.gbuffer.points, np.uint32, 4)]
        base, points = self.gpu.read_many(wanted)
        rows = np.maximum(points[..., 3].ravel() & (PIXEL_BACK - 1), 1) - 1
        return base.reshape(-1, 4).astype(float), self.packed.materials[rows]


def discs(photons):
    """Photons with the kernels that they have."""
    return shape_kernels(photons, NO_BEAMS, NO_BEAMS[:, 0], 1.0, 1.0, None)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def photons_on(receivers, count, radius, seed):
    """Photons near visible points of a scene, from any side, with kernels of any tilt within some degrees."""
    random = np.random.default_rng(seed)
    at = receivers[random.choice(np.flatnonzero(receivers["valid"]), count)]
    photons = np.zeros(count, PHOTON)
    photons["normal"] = unit(at["ng"] + 0.1 * random.normal(size=(count, 3)))
    photons["position"] = at["position"] + 0.02 * random.normal(size=(count, 3))
    photons["wi"] = unit(photons["normal"] + unit(random.normal(size=(count, 3))))
    photons["flux"] = random.random((count, 3))
    photons["radius"] = random.uniform(*radius, count)
    photons["height"] = photons["radius"] * random.uniform(0.2, 1.0, count)
    return photons


def expected(picture, photons):
    """Radiance and irradiance, (n, 3) float64, by brute force."""
    sums = gather(picture.receivers, photons)
    light, fresnel, gloss, grazing = (sums[:, k : k + 3] for k in (0, 4, 8, 12))
    color, materials = picture.surfaces()
    base, metallic, f90 = color[:, :3], color[:, 3:], materials["specular"][:, None].astype(float)
    dielectric = materials["f0"][:, None] * f90
    kept = (1 - dielectric) * light - (f90 - dielectric) * fresnel
    f0 = dielectric * (1 - metallic) + base * metallic
    reflected = f0 * gloss + (f90 * (1 - metallic) + metallic) * grazing
    return base * (1 - metallic) / np.pi * kept + reflected, light


def orthographic(size):
    pose = look_at_pose(np.array([0.4, 1.6, 5.0]), np.array([0.0, 0.8, 0.0]))
    return CameraView(size, pose, ymag=2.0, near=0.0, far=20.0)


@pytest.mark.parametrize("make_view", [view_of, orthographic])
@pytest.mark.parametrize("radius", [(0.05, 0.5), (3.0, 8.0)], ids=["small", "round the eye"])
def test_caustics_match_brute_force(gpu, make_view, radius):
    picture = Picture(gpu, mixed_scene(), make_view((80, 45)))
    photons = photons_on(picture.receivers, 300, radius, seed=1)
    found = picture.draw(photons)
    for values, exact in zip(found, expected(picture, photons), strict=True):
        assert exact.max() > 0
        # float32: the kernel's error is eps d^2 / height^2 <= 25 eps of its peak for each of 300
        assert np.abs(values.reshape(-1, 3) - exact).max() < 1e-4 * exact.max()


def test_photons_in_parts_are_photons_at_once(gpu):
    """As where they are more than an adapter binds at once: in the same order, and so the same to the bit."""
    picture = Picture(gpu, mixed_scene(), view_of((80, 45)))
    photons = shape_kernels(
        photons_on(picture.receivers, 1000, (0.05, 0.5), seed=1),
        NO_BEAMS,
        np.zeros(0, np.float32),
        100.0,
        1.0,
        None,
    )
    whole = picture.draw_kernels(photons)
    picture.stage._most = 300 * photons.itemsize
    assert all(map(np.array_equal, whole, picture.draw_kernels(photons)))


def plane_view(kind, size=(160, 90)):
    if kind == "orthographic":
        return CameraView(size, look_at_pose(np.array([0.5, 3.0, 1.0]), np.zeros(3)), ymag=1.0, near=0, far=9)
    eye = {"from above": (0.01, 3.0, 0.0), "aslant": (0.3, 1.0, 2.5)}[kind]
    return CameraView(size, look_at_pose(np.array(eye), np.zeros(3)), yfov=math.radians(40), near=0.01)


def pixel_areas(view):
    """(H, W) m^2 of the plane y = 0 that each pixel covers."""
    origin, direction = view.rays()
    distance = origin[..., 1] / -direction[..., 1]
    along = direction @ view.forward
    square = 1.0 if view.ymag else along**3 * distance**2
    return view.footprint**2 * square / -direction[..., 1]


@pytest.mark.parametrize("kind", ["from above", "aslant", "orthographic"])
def test_a_photon_brings_all_its_flux(gpu, kind):
    """V10: the midpoint rule over some 500 pixels, of a C1 function."""
    scene = Scene()
    scene.add(quad(4.0), material=lambert((0.5, 0.25, 1.0)))
    view = plane_view(kind)
    picture = Picture(gpu, scene, view)
    photon = np.zeros(1, PHOTON)
    photon["position"], photon["normal"], photon["wi"] = (0.1, 0, 0.05), (0, 1, 0), unit(np.ones(3))
    photon["flux"], photon["radius"], photon["height"] = (1, 2, 3), 0.3, 0.075
    radiance, irradiance = picture.draw(photon)
    flux = np.einsum("hwc,hw->c", irradiance, pixel_areas(view))
    assert flux == pytest.approx([1, 2, 3], rel=3e-3)
    assert radiance == pytest.approx(irradiance * np.array([0.5, 0.25, 1.0]) / np.pi, rel=1e-3, abs=1e-6)


@pytest.mark.parametrize("clear", [0.0, 0.04, 0.12, 1.0])
@pytest.mark.parametrize("long", [1.0, 3.0, 50.0], ids=["round", "long", "longest"])
def test_a_kernel_of_a_beam_is_its_ellipse_and_ends_at_the_mirror(gpu, long, clear):
    """All the flux is in front of the plane that the photon comes from."""
    scene = Scene()
    scene.add(quad(4.0), material=lambert((1.0,) * 3))
    view = plane_view("from above", (320, 180))
    picture = Picture(gpu, scene, view)
    photon = np.zeros(1, PHOTON)
    photon["position"], photon["normal"], photon["wi"] = (0.1, 0, 0.05), (0, 1, 0), unit(np.ones(3))
    photon["flux"], photon["radius"], photon["height"] = 1.0, 0.01, 0.005
    beam = np.zeros((1, 9), np.float32)
    beam[0, [0, 5, 6]] = 0.15, 0.15 / long, 1.0  # along x and z; the mirror faces x
    irradiance = picture.draw(photon, beam, clear)[1][..., 0]
    areas = pixel_areas(view)
    # A cut that is half a pixel off adds at most that times 16 / (5 pi a), the kernel's profile where it is
    # highest, over the half that is left; else the midpoint rule, as above.
    a = 0.15 * math.sqrt(OVERLAP / math.pi)
    off = 0.5 * math.sqrt(areas.max()) * 16 / (5 * math.pi * a) / 0.5
    assert (irradiance * areas).sum() == pytest.approx(1.0, rel=3e-3 + off)
    origin, direction = view.rays()
    place = origin - direction * (origin[..., 1:2] / direction[..., 1:2]) - photon["position"][0]
    assert not irradiance[place[..., 0] < -clear - 1e-5].any()
    b = a / min(long, 8.0)  # no narrower than an eighth
    inside = (place[..., 0] / a) ** 2 + (place[..., 2] / b) ** 2
    assert not irradiance[inside > 1.001].any()
    assert (irradiance > 0)[(inside < 0.98) & (place[..., 0] > 1e-5 - clear)].all()


@pytest.mark.parametrize(("passes", "beams_under_a_lamps"), [(1, 2.5), (4, 1.25), (16, 1.0)])
def test_kernels_hold_so_many_beams(passes, beams_under_a_lamps):
    photons = np.zeros(2, PHOTON)
    photons["normal"], photons["radius"] = (0, 1, 0), 0.01
    beams = np.zeros((2, 9), np.float32)
    beams[:, [0, 5, 6]] = 0.3, 0.1, 1.0
    overlap = overlap_of(np.array([True, False]), passes - 1)
    kernels = shape_kernels(photons, beams, np.ones(2), 10.0, 1.0, None, overlap=overlap)
    areas = math.pi * np.linalg.norm(np.cross(kernels["u"], kernels["v"]), axis=1)
    assert areas == pytest.approx([beams_under_a_lamps * 0.03, OVERLAP * 0.03])


def test_mirrors_show_the_kernels_that_pixels_do(gpu):
    """The grid that lights what eye paths end on is the twin of the stage, cuts and all."""
    picture = Picture(gpu, mixed_scene(), view_of((80, 45)))
    photons = photons_on(picture.receivers, 200, (0.05, 0.5), seed=8)
    random = np.random.default_rng(9)
    beams = (0.1 * random.normal(size=(150, 9))).astype(np.float32)
    beams[:, 6:] = unit(beams[:, 6:])
    clear = random.uniform(0.0, 0.1, 150).astype(np.float32)
    kernels = shape_kernels(photons, beams, clear, 10.0, 1.0, None)
    assert 30 < (kernels["front"] != 0).any(axis=1).sum() < 150
    drawn = picture.draw_kernels(kernels)[1].reshape(-1, 3)
    found = PhotonGrid(photons, kernels).estimate(picture.receivers, 2)[:, :3]
    # float32, as above; and a pixel whose center lies on a cut may fall on either side
    close = np.abs(found - drawn).max(axis=1) < 1e-4 * drawn.max()
    assert drawn.max() > 0 and close.mean() > 0.999


def test_near_plane_does_not_matter(gpu):
    """V25, with the eye inside some kernels."""
    found = []
    for near in (1e-4, 0.5):
        picture = Picture(gpu, mixed_scene(), view_of((80, 45), near=near))
        found.append(picture.draw(photons_on(picture.receivers, 200, (0.5, 8.0), seed=2)))
    for a, b in zip(*found, strict=True):
        # photons stand at the receivers, whose depths are rounded differently
        assert np.abs(a - b).max() < 1e-4 * a.max()


@pytest.mark.parametrize("make_view", [view_of, orthographic])
def test_triangles_hold_their_kernels_and_smaller_ones_do_not(gpu, make_view):
    """V23: a triangle three times as large finds no pixel more; one of nine tenths loses some."""
    picture = Picture(gpu, mixed_scene(), make_view((160, 90)))
    photons = photons_on(picture.receivers, 500, (0.005, 1.0), seed=3)
    drawn = {}
    sum_up = Target("rgba32float", blend="add")
    for scale in (0.9, 1.0, 3.0):
        picture.stage._splat = gpu.raster("stages/caustic.wgsl", [sum_up, sum_up], FLAT, BOUND_SCALE=scale)
        drawn[scale] = picture.draw(photons)[1]
    assert np.abs(drawn[3.0] - drawn[1.0]).max() < 1e-6 * drawn[1.0].max()
    assert np.abs(drawn[3.0] - drawn[0.9]).max() > 1e-5 * drawn[1.0].max()


def test_photons_that_cannot_be_seen_bring_nothing(gpu):
    picture = Picture(gpu, mixed_scene(), view_of((80, 45)))
    photons = photons_on(picture.receivers, 50, (0.05, 0.5), seed=4)
    behind, below = photons.copy(), photons.copy()
    behind["position"] += (0.0, 0.0, 20.0)
    below["normal"] *= -1
    for unseen in (behind, below):
        assert not np.any(picture.draw(unseen))
    assert picture.draw(photons)[0].any()


def test_no_photons_make_no_texture(gpu):
    picture = Picture(gpu, mixed_scene(), view_of((16, 9)))
    with gpu.frame() as frame:
        found = picture.stage(frame, picture.scene, picture.gbuffer, picture.view, np.zeros(0, CAUSTIC))
    assert found is None


def test_unlit_surfaces_and_mirrors_show_no_photons_and_nothing_is_undefined(gpu):
    """Even where the half vector is the normal: the lobe of no width is 0 / 0 there."""
    scene = Scene()
    for x, material in ((-1, Material(unlit=True)), (1, Material(metallic=1.0, roughness=0.0))):
        scene.add(quad(1.0), translation=(x, 0, 0), material=material)
    view = CameraView((80, 45), look_at_pose(np.array([0.0, 3.0, 0.01]), np.zeros(3)), near=0.01)
    picture = Picture(gpu, scene, view)
    photons = photons_on(picture.receivers, 50, (0.5, 1.0), seed=5)
    photons["wi"][0], photons["position"][0] = (0, 1, 0), (-0.5, 0, 0)
    radiance, irradiance = picture.draw(photons)
    assert np.isfinite(radiance).all() and np.isfinite(irradiance).all()
    assert not radiance.any() and irradiance.max() > 0


def test_noise_is_that_of_the_kernel(gpu):
    """V20: sd / mean = sqrt(1.8 / (D pi r^2)). N = 40,000 photons, some 1,000 independent places: the
    ratio of the two is 1 within 3 / sqrt(2 * 1000) = 7 %, seed 6."""
    count, half, radius = 40_000, 2.0, 0.05
    scene = Scene()
    scene.add(quad(half), material=lambert((0.5,) * 3))
    view = CameraView(
        (160, 160), look_at_pose(np.array([0.0, 3.0, 1e-3]), np.zeros(3)), ymag=1.6, near=0, far=9
    )
    photons = np.zeros(count, PHOTON)
    photons["position"][:, [0, 2]] = np.random.default_rng(6).uniform(-half, half, (count, 2))
    photons["normal"] = photons["wi"] = (0, 1, 0)
    photons["flux"] = (2 * half) ** 2 / count
    photons["radius"], photons["height"] = radius, radius / 4
    irradiance = Picture(gpu, scene, view).draw(photons)[1][..., 0].astype(float)
    noise = math.sqrt(1.8 / (count / (2 * half) ** 2 * math.pi * radius**2))
    assert irradiance.mean() == pytest.approx(1.0, abs=0.02)
    assert irradiance.std() == pytest.approx(noise, rel=0.07)


@pytest.mark.parametrize("missing", [False, True])
def test_upsampling_adds_caustics_to_every_pixel(gpu, missing):
    """Also to those that found no neighbour and are lit alone."""
    picture = Picture(gpu, mixed_scene(), view_of((61, 43)))
    photons = photons_on(picture.receivers, 100, (0.1, 0.5), seed=7)
    view, scene, gbuffer = picture.view, picture.scene, picture.gbuffer
    downsample, upsample = Downsample(gpu, 4), Upsample(gpu, 4)
    with gpu.frame() as frame:
        receivers = downsample(frame, scene, gbuffer, view)
    points = downsample.read(gpu, view)
    light = np.zeros((len(points), 16), np.float32)
    light[:, MET] = 1.0
    if missing:  # no receiver serves
        points["valid"] = 0
        receivers.write(points)
    with gpu.frame() as frame:
        caustic = picture.stage(frame, scene, gbuffer, view, discs(photons))
        upsample(frame, scene, gbuffer, view, receivers, FilteredLight(light, None), caustic)
    count = len(upsample.missed()[0])
    assert (count > 500) == missing
    if count:
        with gpu.frame() as frame:
            upsample.patch(frame, scene, gbuffer, view, np.zeros((count, 16), np.float32), caustic)
    wanted = [(t, np.float32, 4) for t in (upsample.indirect, upsample.irradiance, *caustic)]
    indirect, irradiance, *drawn = (found[..., :3] for found in gpu.read_many(wanted))
    assert drawn[0].max() > 0
    assert (indirect == drawn[0]).all() and (irradiance == drawn[1]).all()
