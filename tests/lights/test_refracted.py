"""The environment's light through clear solids: draws bring what photons leave to them, once."""

import numpy as np
import pytest
from transport import Tracer

from ispm import AlphaMode, Camera, Environment, Material, Renderer, Settings, shapes
from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Scratch
from ispm.kernels.simd import alloca
from ispm.library.common import lambert
from ispm.library.shapes import ball, box
from ispm.lights.environment_emission import emit_from_environment
from ispm.lights.refracted import is_drawn, surround_share
from ispm.optics.jit import jit
from ispm.optics.vector import vec3
from ispm.reference.paths import path_light
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView

f32 = np.float32
INDEX = 1.5


def glass(**more):
    return Material((1.0,) * 3, transmission=1.0, ior=INDEX, thickness=0.1, **{"roughness": 0.0, **more})


def even():
    return Environment(np.ones((8, 16, 3), f32))


def reflectance(cosine):
    """Of a face of glass, by Fresnel's equations, averaged over polarization."""
    inside = np.sqrt(1.0 - (1.0 - cosine**2) / INDEX**2)
    across = (cosine - INDEX * inside) / (cosine + INDEX * inside)
    along = (INDEX * cosine - inside) / (INDEX * cosine + inside)
    return (across**2 + along**2) / 2.0


@jit
def shares(tables, starts, directions, out):
    """Write `surround_share` of each ray: RGB, whether it is refracted, and bent."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for i in range(len(starts)):
        share, _, is_refracted, is_bent = surround_share(
            tables, vec3(starts[i]), vec3(directions[i]), scratch
        )
        for c in range(3):
            out[i, c] = share[c]
        out[i, 3], out[i, 4] = f32(is_refracted), f32(is_bent)


@jit
def ask_drawn(tables, sent, arriving, out):
    """Write `is_drawn` of light that was sent and arrives along these."""
    for i in range(len(sent)):
        out[i] = is_drawn(tables.environment, vec3(sent[i]), vec3(arriving[i]))


def found(scene, starts, directions):
    """(n, 5) of `shares`."""
    directions = np.asarray(directions, float)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    tracer, out = Tracer(scene), np.zeros((len(directions), 5), f32)
    shares(tracer.tables, f32(starts), f32(directions), out)
    return out


def test_a_pane_lets_through_what_its_two_faces_do_and_does_not_bend_light():
    """float32: 1e-5."""
    scene = Scene(environment=even())
    scene.add(box((-50, 1, -50), (50, 1.1, 50)), material=glass())
    angles = np.radians([0.0, 20.0, 40.0, 60.0])
    ways = np.stack([np.sin(angles), np.cos(angles), 0 * angles], axis=1)
    out = found(scene, np.zeros((4, 3)), ways)
    exact = (1.0 - reflectance(np.cos(angles))) ** 2
    assert out[:, 0] == pytest.approx(exact, rel=1e-5)
    assert (out[:, 3] == 1).all() and (out[:, 4] == 0).all()


def test_a_ball_bends_light_and_color_takes_what_it_should():
    """Twice the radius of red glass that keeps half of it on 1 m."""
    scene = Scene(environment=even())
    tinted = glass(attenuation_color=(0.5, 1.0, 1.0), attenuation_distance=1.0)
    scene.add(ball(1.0, 256, 128), material=tinted, translation=(0.0, 3.0, 0.0))
    out = found(scene, np.zeros((2, 3)), [(0.0, 1.0, 0.0), (0.15, 1.0, 0.0)])
    assert out[0, :2] == pytest.approx([0.25 * 0.96**2, 0.96**2], rel=0.01)
    assert (out[:, 3] == 1).all() and out[1, 4] == 1


@pytest.mark.parametrize(
    "material",
    [glass(dispersion=1.0), glass(roughness=0.3), lambert((0.5,) * 3)],
    ids=["dispersive", "rough", "opaque"],
)
def test_only_clear_faces_are_passed(material):
    scene = Scene(environment=even())
    scene.add(box((-5, 1, -5), (5, 1.1, 5)), material=material)
    assert not found(scene, np.zeros((1, 3)), [(0.1, 1.0, 0.0)]).any()


def test_light_in_glass_is_denser_and_comes_within_the_critical_angle():
    """In a block, and under a single sheet of a solid, which light enters and never leaves. From .73 rad on
    faces reflect all: in the block no light comes that way, below the sheet what comes from there."""
    block, sheet = Scene(environment=even()), Scene(environment=even())
    block.add(box((-10, -1, -10), (10, 1, 10)), material=glass())
    sheet.add(shapes.plane(20.0, 20.0), material=glass(), translation=(0.0, 1.0, 0.0))
    ways = [(0.0, 1.0, 0.0), (np.sin(0.7), np.cos(0.7), 0.0), (np.sin(0.8), np.cos(0.8), 0.0)]
    outside = np.cos(np.arcsin(INDEX * np.sin([0.0, 0.7])))
    exact = INDEX**2 * (1.0 - reflectance(outside))
    for each, last in ((block, 0.0), (sheet, 1.0)):
        assert found(each, np.zeros((3, 3)), ways)[:, 0] == pytest.approx([*exact, last], rel=1e-4)


def test_both_sides_ask_the_same_of_light_that_is_much_brighter():
    """What a ball shows of an environment with a bright half: all that the draws bring are at most four times
    what lies straight behind, and `is_drawn` says so of the same light."""
    image = np.ones((16, 32, 3), f32)
    image[:, 16:] = 10.0
    scene = Scene(environment=Environment(image))
    scene.add(ball(1.0, 128, 64), material=glass(), translation=(0.0, 3.0, 0.0))
    random = np.random.default_rng(3)
    ways = np.stack([*random.uniform(-0.3, 0.3, (2, 400)), np.ones(400)], axis=1)[:, [0, 2, 1]]
    out = found(scene, np.zeros((400, 3)), ways)
    assert 20 < (out[:, 0] == 0).sum() < 380
    assert out[:, 0].max() < 4.0
    tracer, told = Tracer(scene), np.zeros(2, np.bool_)
    bright, dark = f32([[-0.7, -0.7, 0.0], [0.7, -0.7, 0.0]])
    radiance = tracer.packed.environment.radiance
    assert radiance.min() == 1.0 and radiance.max() == 10.0
    ask_drawn(tracer.tables, np.stack([bright, dark]), np.stack([dark, bright]), told)
    assert told.tolist() != [told[0]] * 2  # one way only


def floor_seen(gpu, above):
    """Radiance of the middle of a dark floor in even light, under what is added to the scene; 16 passes."""
    scene = Scene(environment=even())
    scene.add(shapes.plane(60.0, 60.0), material=lambert((0.02,) * 3))
    above(scene)
    camera = Camera.look_at((0.0, 0.4, 0.001), (0.0, 0.0, 0.0), yfov=0.3)
    with Renderer(scene, Settings(size=(96, 64), light="none"), camera, gpu=gpu) as renderer:
        *_, frame = renderer.converge(16)
    return float(frame.radiance.mean())


def test_light_below_a_wide_pane_is_what_both_faces_let_through_in_all(gpu):
    """Draws bring what passes straight, (1 - r)^2, photons what faces mirror to each other first, together
    (1 - r) / (1 + r), in the mean over the cosine. A hundredth of the light passes beside the pane."""
    cosine = (np.arange(2000) + 0.5) / 2000
    r = reflectance(cosine)
    exact = float((2.0 * cosine * (1.0 - r) / (1.0 + r)).mean())

    def pane(scene):
        scene.add(box((-10, 0.5, -10), (10, 0.55, 10)), material=glass())

    assert floor_seen(gpu, pane) / floor_seen(gpu, lambda scene: None) == pytest.approx(exact, rel=0.015)


def test_a_thing_between_panes_has_its_own_shape_and_light(gpu):
    """A board of 20 x 8 cm in a glass case, which the light of a sky reached by wide kernels of photons
    alone: blocks of 8 x 8 pixels about it were off by .086 of their light in one pass, its middle by .1 to
    .2, all to one side; now by .035, most of it the noise of a pass and of the paths."""
    scene = Scene(environment=even())
    scene.add(shapes.plane(3.0, 3.0), material=lambert((0.5,) * 3))
    for z in (-0.1, 0.1):
        scene.add(box((-0.5, 0.0, z - 0.002), (0.5, 0.5, z + 0.002)), material=glass())
    for side in (-0.5, 0.5):
        scene.add(box((side - 0.002, 0.0, -0.098), (side + 0.002, 0.5, 0.098)), material=glass())
    scene.add(box((-0.498, 0.5, -0.102), (0.498, 0.504, 0.102)), material=glass())
    scene.add(box((-0.1, 0.12, -0.04), (0.1, 0.13, 0.04)), material=lambert((0.5,) * 3))
    camera, size = Camera.look_at((0.0, 0.35, 0.9), (0.0, 0.12, 0.0), yfov=0.4), (240, 160)
    settings = Settings(size=size, light="none")
    with Renderer(scene, settings, camera, gpu=gpu) as renderer:
        frame = renderer.render()
    tracer, view = Tracer(scene), CameraView(size, camera.pose, camera.yfov)
    y, x = np.indices((size[1], size[0])).reshape(2, -1) + 0.5
    truth = path_light(tracer.tables, *view.rays_through(x, y), samples=range(64), bounces=8, threads=2)
    truth = truth.reshape(frame.radiance.shape)
    shown, true = (
        picture[56:104, 72:168].mean(axis=-1).reshape(6, 8, 12, 8).mean(axis=(1, 3))
        for picture in (frame.radiance, truth)
    )
    assert np.sqrt(((shown / true - 1.0) ** 2).mean()) < 0.06


def test_holes_and_sheets_do_not_stop_what_clear_solids_let_through():
    """A veil that covers .4, of glass or of paper, and a thin pane before a block of red glass and within it:
    of red .5 are kept on each of its two meters, wherever they are."""
    cover = {"alpha_mode": AlphaMode.BLEND, "double_sided": True}
    thin = Material((1.0,) * 3, transmission=1.0, roughness=0.0, ior=INDEX)
    veils = {
        "paper": (Material((0.5, 0.5, 0.5, 0.4), specular=0.0, **cover), 0.6),
        "blended pane": (Material((1.0, 1.0, 1.0, 0.4), transmission=1.0, roughness=0.0, **cover), None),
        "pane": (thin, None),
    }
    tinted = glass(attenuation_color=(0.5, 1.0, 1.0), attenuation_distance=1.0)
    faces = (1.0 - 0.04) ** 2
    for name, (material, share) in veils.items():
        for height in (0.5, 2.0):  # before and within the block
            scene = Scene(environment=even())
            scene.add(box((-9, 1, -9), (9, 3, 9)), material=tinted)
            scene.add(shapes.plane(9.0, 9.0), material=material, translation=(0.0, height, 0.0))
            out = found(scene, np.zeros((1, 3)), [(0.0, 1.0, 0.0)])[0]
            if share is None:
                alone = Scene(environment=even())
                alone.add(shapes.plane(9.0, 9.0), material=material, translation=(0.0, height, 0.0))
                share = found(alone, np.zeros((1, 3)), [(0.0, 1.0, 0.0)])[0, 0]
            assert out[:2] == pytest.approx([0.25 * faces * share, faces * share], rel=1e-3), name


def test_draws_pass_as_many_faces_as_photons_leave_to_them():
    """32 of 16 panes, of whose light photons then bring what faces mirror to each other first: .43 - .27 of
    it along the normal, of 17 panes all, .41."""
    stored = []
    for panes, share in ((16, 0.96**32), (17, 0.0)):
        scene = Scene(environment=even())
        for k in range(panes):
            y = 0.2 + 0.05 * k
            scene.add(box((-3, y, -3), (3, y + 0.02, 3)), material=glass())
        scene.add(shapes.plane(1.0, 1.0), material=lambert((0.5,) * 3))
        out = found(scene, np.full((1, 3), 0.01), [(0.0, 1.0, 0.0)])[0]
        assert out[0] == pytest.approx(share, rel=1e-4)
        tracer = Tracer(scene)
        place = tracer.packed, tracer.world, tracer.surfaces
        photons = tracer.walk(emit_from_environment(*place, 200_000, 0.0, 0, 0, 1), 8).photons
        steep = (photons["bounce"] == 0) & (photons["wi"][:, 1] > 0.8)
        stored.append(photons["flux"][steep].sum())
    assert stored[1] > 1.8 * stored[0] > 0.0
