"""Scenes at the edge of what there is: every picture is finite, not negative, and as symmetry says."""

import warnings

import numpy as np
import pytest
from transport import box_room, lit, render

from ispm.errors import SceneError, SceneWarning
from ispm.library.builtin import builtin
from ispm.library.shapes import box, icosphere, moved, polygons
from ispm.scene.camera import Camera, look_at_pose
from ispm.scene.light import PointLight
from ispm.scene.material import Material, Texture, TextureUse
from ispm.scene.scene import Scene

LIGHT_LAYERS = ("full", "direct", "indirect", "emission", "irradiance")
EYE = Camera.look_at((0.3, 0.4, 1.8), (0.0, -0.2, 0.0), yfov=1.1)


def sound(frame):
    """Check that a picture has only numbers that can be light; return it."""
    for layer in LIGHT_LAYERS:
        assert np.isfinite(frame[layer]).all(), layer
        assert frame[layer].min() >= 0.0, layer
    assert (frame.radiance == (frame.direct + frame.indirect) + frame.emission).all()
    return frame


def furnished():
    """A lit room with a glossy ball and a block."""
    scene = box_room((-2, -1, -2), (2, 1, 2), albedo=0.6)
    ball = Material((0.8, 0.3, 0.2), roughness=0.4)
    scene.add(icosphere(0.4, 4), material=ball, translation=(0.6, -0.6, 0.2))
    scene.add(box((-0.3, -0.3, -0.3), (0.3, 0.3, 0.3)), translation=(-0.7, -0.7, 0.1), scale=(1, 1, 0.7))
    return lit(scene, (0.1, 0.6, 0.3))


def means(picture, rows=3, columns=4):
    """Mean brightness of parts of the picture, (rows, columns)."""
    parts = [np.array_split(row, columns, axis=1) for row in np.array_split(picture, rows)]
    return np.array([[part.mean(dtype=float) for part in row] for row in parts])


@pytest.mark.parametrize("size", [(1, 1), (1, 37), (161, 91), (17, 3)])
@pytest.mark.parametrize("subsampling", [1, 4, 16])
def test_any_size_renders(gpu, size, subsampling):
    frame, _ = render(gpu, furnished(), EYE, size=size, subsampling=subsampling, photons=2000)
    sound(frame)
    assert frame.image.shape == (size[1], size[0], 3) and frame.radiance.max() > 0.0


@pytest.mark.parametrize("settings", [{"bounces": 0}, {"photons": 0}])
@pytest.mark.parametrize("emission", ["map", "rays"])
def test_without_photons_there_is_direct_light_alone(gpu, settings, emission):
    frame, photons = render(gpu, furnished(), EYE, emission=emission, **settings)
    sound(frame)
    assert not len(photons) and not frame.indirect.any() and frame.direct.any()
    assert frame.stats.flux_emitted == 0.0


def test_light_that_meets_nothing_leaves_the_picture_black(gpu):
    """A lamp below a floor's far side, seen from above, and one whose range ends before anything."""
    scene = Scene()
    floor = [np.array([(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)], float)]
    scene.add(polygons(floor), material=Material((0.5,) * 3, double_sided=True))
    below = scene.add(PointLight((5.0,) * 3), translation=(0, -0.5, 0))
    frame, photons = render(gpu, scene, EYE)
    assert not sound(frame).radiance.any() and not len(photons)
    below.light.range, below.translation = 0.1, (0, 0.5, 0)
    frame, photons = render(gpu, scene, EYE)
    assert not sound(frame).radiance.any() and not len(photons)
    assert frame.stats.flux_escaped == pytest.approx(frame.stats.flux_emitted)


@pytest.mark.parametrize("place", [(0.0, -1.0, 0.0), (2.0, -1.0, -2.0), (0.6, -0.6, 0.2), (-0.4, -0.5, 0.1)])
@pytest.mark.parametrize("emission", ["map", "rays"])
def test_a_light_on_or_in_a_surface_is_no_trouble(gpu, place, emission):
    """On the floor, in a corner, within the ball, on the block's face."""
    scene = furnished()
    scene["light"].translation = place
    frame, photons = render(gpu, scene, EYE, emission=emission, photons=5000)
    sound(frame)
    assert np.isfinite(photons["flux"]).all() and np.isfinite(photons["position"]).all()


@pytest.mark.parametrize("eye", [(2.0, 0.1, 0.2), (0.6, -0.6, 0.2), (-2.3, 0.0, 0.0), (0.1, 0.6, 0.3)])
def test_a_camera_in_a_wall_a_ball_outside_or_in_the_lamp_is_no_trouble(gpu, eye):
    frame, _ = render(gpu, furnished(), Camera.look_at(eye, (0, -0.3, 0)), photons=5000)
    sound(frame)


@pytest.mark.parametrize("scale", [2.0**-9, 2.0**8])
def test_radiance_falls_with_the_square_of_the_size(gpu, scale):
    """A room of 8 mm and one of a kilometre: at equal flux, to rounding, the same picture over s^2."""
    pictures = []
    for s in (1.0, scale):
        scene = furnished()
        for node in scene.roots:
            node.translation = np.array(node.translation) * s
            node.scale = np.array(node.scale) * s
        eye = Camera(yfov=EYE.yfov, pose=EYE.pose.copy())
        eye.pose[:3, 3] *= s
        pictures.append(sound(render(gpu, scene, eye)[0]))
    for layer in ("direct", "indirect"):
        one, other = means(pictures[0][layer]), means(pictures[1][layer]) * scale**2
        assert other == pytest.approx(one, rel=2e-3), layer


def test_a_room_a_kilometre_away_looks_the_same(gpu):
    """float32 resolves 0.06 mm there. Other random corners: parts differ by 1.5 %, means of four by half."""
    pictures = []
    for offset in ((0.0, 0.0, 0.0), (1000.0, -700.0, 300.0)):
        scene = furnished()
        for node in scene.roots:
            node.translation = np.array(node.translation) + offset
        eye = Camera(yfov=EYE.yfov, pose=EYE.pose.copy())
        eye.pose[:3, 3] += offset
        pictures.append([sound(render(gpu, scene, eye, seed=seed)[0]) for seed in range(4)])
    near, far = ([np.mean([means(getattr(each, part)) for each in frames], axis=0) for part in
                  ("direct", "indirect")] for frames in pictures)  # fmt: skip
    assert far[0] == pytest.approx(near[0], rel=5e-3)
    assert far[1] == pytest.approx(near[1], rel=0.03)


def test_a_mirrored_instance_makes_a_mirrored_picture(gpu):
    """A lopsided block and its mirror image, left and right of the light."""
    scene = box_room((-2, -1, -2), (2, 1, 2), albedo=0.6)
    corners = np.array([(0, 0, 0), (0.8, 0, 0.1), (0.2, 1.1, 0), (0.1, 0.1, 0.9)])
    faces = [corners[[0, 2, 1]], corners[[0, 1, 3]], corners[[0, 3, 2]], corners[[1, 2, 3]]]
    wedge = polygons(faces, "wedge")
    for side in (1.0, -1.0):
        scene.add(wedge, material=Material((0.3, 0.6, 0.9), specular=0.0, double_sided=True),
                  translation=(0.4 * side, -0.9, -0.5), scale=(side, 1, 1))  # fmt: skip
    lit(scene, (0.0, 0.5, 0.6))
    eye = Camera.look_at((0.0, 0.2, 1.9), (0.0, -0.3, 0.0), yfov=1.1)
    frame, photons = render(gpu, scene, eye, photons=100_000)
    sound(frame)
    flipped = {layer: frame[layer][:, ::-1] for layer in ("direct", "indirect", "depth")}
    assert np.mean(np.abs(flipped["depth"] - frame.depth) < 1e-4) > 0.99
    assert means(flipped["direct"]) == pytest.approx(means(frame.direct), rel=0.01)
    assert means(flipped["indirect"]) == pytest.approx(means(frame.indirect), rel=0.04)
    normals = frame.normal[:, ::-1] * (-1, 1, 1)
    assert np.mean(np.abs(normals - frame.normal).max(axis=-1) < 1e-2) > 0.99
    flux = [photons["flux"][photons["instance"] == k, 0].sum(dtype=float) for k in (6, 7)]
    count = np.count_nonzero(photons["instance"] == 6)
    assert count > 2000 and flux[0] == pytest.approx(flux[1], rel=5 * np.sqrt(2 / count))


def test_a_stretched_instance_looks_like_a_stretched_mesh(gpu):
    """Scale in the node against scale in the vertices."""
    pictures = []
    scale, ball = np.array([0.5, 1.2, 2.0]), icosphere(0.4, 8)
    for baked in (True, False):
        scene = lit(box_room((-2, -1, -2), (2, 1, 2), albedo=0.6), (0.1, 0.6, 0.3))
        mesh = moved(ball)
        if baked:
            mesh.positions = (mesh.positions * scale).astype(np.float32)
            mesh.normals = (mesh.normals / scale).astype(np.float32)
        scene.add(mesh, material=Material((0.3, 0.6, 0.9), roughness=0.5), translation=(0.0, -0.4, 0.2),
                  scale=(1.0, 1.0, 1.0) if baked else scale)  # fmt: skip
        pictures.append(sound(render(gpu, scene, EYE)[0]))
    for layer in ("direct", "indirect"):
        # photons are the same but for a few at edges
        assert means(pictures[1][layer]) == pytest.approx(means(pictures[0][layer]), rel=0.02)


def test_a_level_normal_map_leaves_the_picture_as_it_is(gpu):
    pixels = np.full((4, 4, 4), 128, np.uint8)
    pixels[..., 2:] = 255
    level = TextureUse(Texture(pixels, srgb=False))
    pictures = []
    for use in (None, level):
        scene = lit(box_room((-2, -1, -2), (2, 1, 2), albedo=0.6), (0.1, 0.6, 0.3))
        for node in scene.nodes[:6]:
            node.parts[0].mesh.uv0 = np.array([(0, 0), (0, 1), (1, 1), (1, 0)], np.float32)
            node.parts[0].material.normal_texture = use
        pictures.append(sound(render(gpu, scene, EYE)[0]))
    # 128 of 255 leans 0.3 degrees: cosines change by 0.6 % at 45 degrees
    assert means(pictures[1].direct) == pytest.approx(means(pictures[0].direct), rel=0.02)
    assert means(pictures[1].indirect) == pytest.approx(means(pictures[0].indirect), rel=0.03)


def test_parallel_and_central_projection_see_the_same_light(gpu):
    """The middle of a wall through a narrow lens from afar, and in parallel rays."""
    scene = builtin("integrating-sphere", albedo=0.6)
    pose = look_at_pose(np.array([1.9, 0.0, 0.0]), np.array([-2.0, 0.0, 0.0]))
    central = render(gpu, scene, Camera(yfov=0.25, pose=pose))[0]
    parallel = render(gpu, scene, Camera(ymag=0.5, pose=pose))[0]
    assert "intrinsics" in central.camera and "intrinsics" not in parallel.camera
    assert sound(parallel).direct.mean() == pytest.approx(central.direct.mean(), rel=1e-3)
    # some 15 filters of 3 to 4 % noise see the same photons partly
    assert parallel.indirect.mean() == pytest.approx(sound(central).indirect.mean(), rel=0.04)


def test_unlit_and_glowing_surfaces(gpu):
    """Unlit shows its color as it is; a glowing surface still reflects."""
    scene = box_room((-2, -1, -2), (2, 1, 2), albedo=0.6)
    scene.nodes[4].parts[0].material = Material((0.2, 0.9, 0.4), unlit=True)
    scene.nodes[2].parts[0].material = Material((0.5,) * 3, emission=(2.0, 1.0, 0.5), specular=0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)
        frame, _ = render(gpu, lit(scene, (0.1, 0.6, 0.3)), EYE)
    sound(frame)
    unlit, glowing = (frame.instance == k for k in (4, 2))
    assert unlit.any() and glowing.any()
    steps = [(n, axis) for n in (-2, 2) for axis in (0, 1)]
    inside = unlit & np.all([np.roll(unlit, *step) for step in steps], axis=0)
    assert frame.radiance[inside] == pytest.approx(np.tile((0.2, 0.9, 0.4), (inside.sum(), 1)), rel=2e-3)
    assert frame.emission[glowing].max(axis=0).tolist() == [2.0, 1.0, 0.5]
    assert frame.indirect[glowing].min() > 0.0 and frame.direct[glowing].max() > 0.0


@pytest.mark.parametrize(
    ("count", "width"),
    [
        (4000, 0.02),
        (20_000, 0.01),
    ],
)  # fmt: skip
def test_grass_repeats_to_the_bit(gpu, count, width):
    """Slivers, where upsampling finds few neighbours and nearly every pixel is an edge."""
    random = np.random.default_rng(7)
    roots = random.uniform(-1, 1, (count, 1, 3)) * (1.5, 0, 1.5)
    blades = roots + random.normal(0, 1, (count, 3, 3)) * (width, 0.15, width) + (0, 0.15, 0)
    scene = box_room((-2, -0.5, -2), (2, 1.5, 2), albedo=0.6)
    scene.add(polygons(list(blades), "grass"), material=Material((0.2, 0.6, 0.1), double_sided=True))
    lit(scene, (0.3, 1.2, 0.2))
    frames = [sound(render(gpu, scene, EYE, subsampling=8, photons=20_000)[0]) for _ in range(4)]
    for layer in ("irradiance", "full"):
        assert all(frame[layer].tobytes() == frames[0][layer].tobytes() for frame in frames), layer


@pytest.mark.parametrize("half", [10.0, 1e4])
def test_a_plain_however_wide_hides_nothing_in_the_foreground(gpu, half):
    """What is near stays where it was; corners that far away are rounded to 2^-24 of themselves, .6 mm."""
    frames = []
    for wide in (5.0, half):
        scene = Scene()
        corners = np.array([(-wide, 0, -wide), (-wide, 0, wide), (wide, 0, wide), (wide, 0, -wide)])
        scene.add(polygons([corners]), material=Material((0.5,) * 3))
        scene.add(icosphere(0.3, 8), material=Material((0.5,) * 3), translation=(0, 0.3, 0))
        scene.add(PointLight((9.0,) * 3), translation=(1, 3, 1))
        eye = Camera.look_at((0.2, 0.6, 1.5), (0.0, 0.1, 0.0), yfov=0.8)
        frames.append(sound(render(gpu, scene, eye, bounces=0, antialias=False)[0]))
    near = frames[0]["depth"] < 3.0
    assert near.mean() > 0.5
    assert frames[1]["depth"][near] == pytest.approx(frames[0]["depth"][near], rel=1e-3)


@pytest.mark.parametrize("size", [1e-8, 1e11])
def test_a_scene_too_small_or_large_for_its_numbers_is_refused(gpu, size):
    scene = lit(box_room((-size,) * 3, (size,) * 3))
    scene.add(icosphere(0.3 * size, 4), material=Material(transmission=1.0, roughness=0.0, thickness=1.0))
    with pytest.raises(SceneError, match="m across; scale it to between"):
        render(gpu, scene)
