"""Upsampling gives every pixel the light of its own surface."""

from dataclasses import replace

import numpy as np
import pytest
from exact import mixed_scene, quad, view_of

from ispm.library.common import lambert
from ispm.library.shapes import polygons
from ispm.optics.incident import FilteredLight, channels
from ispm.paths.ends import spread_light
from ispm.scene.camera import look_at_pose
from ispm.scene.material import Texture
from ispm.scene.packed import pack
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView
from ispm.stages.downsample import Downsample
from ispm.stages.filter import MET
from ispm.stages.gbuffer import GBufferStage
from ispm.stages.lattice import DENSITY
from ispm.stages.upload import Upload
from ispm.stages.upsample import UNUSED, Upsample


def upsampled(gpu, scene, view, block, make_light, patch=None, gradient=None):
    """Irradiance (H, W, 3), what is seen (H, W), receivers and how many pixels were missed.

    make_light, patch  (n,) RECEIVER -> (n, 16) light, of the receivers and of the missed pixels
    gradient           likewise how that of the receivers changes with the normal, (n, WORDS)
    """
    upload, gbuffer = Upload(gpu), GBufferStage(gpu)
    downsample, upsample = Downsample(gpu, block), Upsample(gpu, block)
    with gpu.frame() as frame:
        packed = upload(pack(scene))
        drawn = gbuffer(frame, packed, view)
        buffer = downsample(frame, packed, drawn, view)
    receivers = downsample.read(gpu, view)
    with gpu.frame() as frame:
        upsample(
            frame,
            packed,
            drawn,
            view,
            buffer,
            FilteredLight(make_light(receivers), gradient and gradient(receivers)),
        )
    missed, points = upsample.missed()
    if patch and len(missed):
        with gpu.frame() as frame:
            upsample.patch(frame, packed, drawn, view, patch(points))
    irradiance, ids = gpu.read_many([(upsample.irradiance, np.float32, 4), (drawn.ids, np.uint32, 2)])
    return irradiance[..., :3], ids[..., 0], receivers, len(missed)


def even(value):
    """Light of the same irradiance everywhere."""

    def light(receivers):
        out = np.zeros((len(receivers), 16), np.float32)
        out[:, :3] = value
        out[:, MET] = 1.0
        return out

    return light


@pytest.mark.parametrize("block", [1, 2, 4, 16])
def test_even_light_stays_even(gpu, block):
    irradiance, seen, *_ = upsampled(gpu, mixed_scene(), view_of((61, 43)), block, even(2.5), even(2.5))
    assert irradiance[seen > 0] == pytest.approx(2.5, rel=1e-5)
    assert not irradiance[seen == 0].any()


def test_without_subsampling_each_pixel_keeps_its_own_light(gpu):
    """K = 1 is the identity: white noise comes back as it was, but for rounding."""
    size = (61, 43)
    noise = np.random.default_rng(4).uniform(0.1, 10.0, (size[0] * size[1], 3)).astype(np.float32)

    def light(receivers):
        out = even(0.0)(receivers)
        out[:, :3] = noise
        return out

    irradiance, seen, _, missed = upsampled(gpu, mixed_scene(), view_of(size), 1, light)
    on = seen.ravel() > 0
    assert missed == 0 and on.mean() > 0.5
    # 2.5 ulp for WGSL's quotient, and 1 for each of two products
    assert irradiance.reshape(-1, 3)[on] == pytest.approx(noise[on], rel=5 * 2.0**-23)


def test_bumps_take_the_light_of_receivers_turned_alike(gpu):
    """Columns of 2 pixels, turned left and right by 40 degrees: receivers know their own side's light alone.
    A pixel has a receiver of its side in the same or the next block; 1 % of the other's weight is left,
    of which up to 16 may stand against one: what is farthest off keeps half of the difference."""
    bumps = np.zeros((1, 2, 4), np.uint8)
    bumps[0, :, :3] = [(128 - 82, 128, 225), (128 + 82, 128, 225)]
    corners = np.array([(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)], float)
    floor = polygons([corners])
    floor.uv0 = np.array([(0, 0), (8, 0), (8, 1), (0, 1)], np.float32)
    normals = Texture(bumps, srgb=False, linear=False, mipmaps=False)
    scene = Scene()
    scene.add(floor, material=replace(lambert((0.5,) * 3), normal_texture=normals))
    view = CameraView((64, 48), look_at_pose(np.array([0.0, 0.0, 4.0]), np.zeros(3)), near=0.01)

    def by_side(receivers):
        out = even(1.0)(receivers)
        out[receivers["n"][:, 0] > 0.0, :3] = 9.0
        return out

    irradiance, *_ = upsampled(gpu, scene, view, 3, by_side, by_side)
    x = view.rays()[1][..., 0] / -view.rays()[1][..., 2] * 4.0
    right = np.floor((x + 2.0) * 4.0) % 2 == 1
    inside = abs(x) < 1.9
    assert irradiance[inside & right].mean() == pytest.approx(9.0, abs=0.4)
    assert irradiance[inside & ~right].mean() == pytest.approx(1.0, abs=0.4)


def wavy(size=(61, 43)):
    """A floor seen from above, whose normal map turns it by up to 37 degrees in waves of 8 pixels."""
    x, y = np.meshgrid(*[2.0 * np.pi * (np.arange(32) + 0.5) / 32] * 2)
    slope = np.stack([0.5 * np.cos(x), 0.5 * np.cos(y), np.ones_like(x)], axis=-1)
    slope /= np.linalg.norm(slope, axis=-1, keepdims=True)
    corners = np.array([(-3, -2, 0), (3, -2, 0), (3, 2, 0), (-3, 2, 0)], float)
    floor = polygons([corners])
    floor.uv0 = np.array([(0, 0), (7.6, 0), (7.6, 5), (0, 5)], np.float32)
    normals = Texture((0.5 + 0.5 * slope).astype(np.float32), srgb=False)
    scene = Scene()
    scene.add(floor, material=replace(lambert((0.5,) * 3), normal_texture=normals))
    pose = look_at_pose(np.array([0.0, 0.0, 4.0]), np.zeros(3))
    return scene, CameraView(size, pose, ymag=2.0, near=0.01, far=10.0)


_SLOPES = np.array([[3.0, 0.0, 1.0, 0.0], [0.0, -2.0, 1.0, 0.0], [0.0, 0.0, 0.0, 0.0]], np.float32)


def leaning(receivers):
    """Light linear in the normal, channels of _SLOPES; and darker where it has none."""
    out = np.zeros((len(receivers), 16), np.float32)
    out[:, :3] = (4.0 + receivers["n"] @ _SLOPES[:, :3]) * (receivers["valid"] > 0)[:, None]
    out[:, MET] = 1.0
    return out


def slopes_of(receivers):
    """Its gradient, (n, WORDS)."""
    return np.repeat(_SLOPES.reshape(1, 12), len(receivers), axis=0)


def test_pixels_follow_light_to_their_own_normals(gpu):
    """The four receivers about a pixel face elsewhere: their light is off by a third of its deviations, where
    that linear in the normal is to be met but for the second order of the tangent plane, and 16 bits."""
    scene, view = wavy()
    pixels = upsampled(gpu, scene, view, 1, even(1.0))[2].reshape(43, 61)
    expected = leaning(pixels.reshape(-1))[:, :3].reshape(43, 61, 3)
    with_slopes = upsampled(gpu, scene, view, 3, leaning, leaning, slopes_of)[0]
    without = upsampled(gpu, scene, view, 3, leaning, leaning)[0]
    inner = np.s_[4:-4, 4:-4]
    spread = np.std(expected[inner], axis=(0, 1)).max()
    followed, mixed = (
        np.sqrt(((each - expected)[inner] ** 2).mean()) / spread for each in (with_slopes, without)
    )
    assert followed < 0.05 and mixed > 0.15


def test_unused_light_is_not_spread(gpu):
    """Pixels about receivers that are alone count as missed, and none is black or has their light."""

    def light(receivers):
        out = even(2.0)(receivers)
        lone = np.arange(len(receivers)) % 7 < 3
        out[lone, :3], out[lone, DENSITY] = 100.0, UNUSED
        return out

    every = upsampled(gpu, mixed_scene(), view_of((61, 43)), 4, even(2.0))[3]
    irradiance, seen, _, missed = upsampled(gpu, mixed_scene(), view_of((61, 43)), 4, light, even(2.0))
    assert missed > every
    assert irradiance[seen > 0] == pytest.approx(2.0, rel=1e-5)


def test_missed_pixels_all_find_room(gpu):
    """Where no receiver's light is to be spread each pixel that is seen gets light of its own."""

    def none(receivers):
        out = even(9.0)(receivers)
        out[:, DENSITY] = UNUSED
        return out

    irradiance, seen, _, missed = upsampled(gpu, mixed_scene(), view_of((61, 43)), 4, none, even(2.0))
    assert missed == np.count_nonzero(seen)
    assert irradiance[seen > 0] == pytest.approx(2.0, rel=1e-5)


def two_floors():
    """Two floors one above the other; a camera that sees the edge of the upper one."""
    scene = Scene()
    for x, y in ((-2.0, 0.0), (0.0, 0.5)):
        corners = np.array([(x, y, -2), (x, y, 2), (x + 2, y, 2), (x + 2, y, -2)], float)
        scene.add(polygons([corners]), material=lambert((0.5,) * 3))
    pose = look_at_pose(np.array([0.3, 3.0, 0.5]), np.zeros(3))
    return scene, CameraView((80, 60), pose, near=0.01)


@pytest.mark.parametrize("block", [1, 2, 4])
def test_light_does_not_cross_an_edge(gpu, block):
    """Each floor keeps its own light where they are several standard deviations, half blocks, apart."""

    def by_height(receivers):
        out = even(0.0)(receivers)
        out[:, :3] = np.where(receivers["position"][:, 1:2] > 0.25, 9.0, 1.0)
        return out

    scene, view = two_floors()
    irradiance, seen, *_ = upsampled(gpu, scene, view, block, by_height, by_height)
    assert irradiance[seen == 1] == pytest.approx(1.0, rel=1e-3)
    assert irradiance[seen == 2] == pytest.approx(9.0, rel=1e-3)


@pytest.mark.parametrize("block", [2, 4, 8])
def test_a_ramp_is_interpolated(gpu, block):
    """Light that grows along x: bilinear taps at real surface points are off by half a block at most."""

    def ramp(receivers):
        out = even(0.0)(receivers)
        out[:, :3] = 10.0 + receivers["position"][:, :1]
        return out

    scene, view = two_floors()
    irradiance, seen, receivers, _ = upsampled(gpu, scene, view, block, ramp, ramp)
    origin, direction = view.rays()
    for number, height in ((1, 0.0), (2, 0.5)):
        t = (height - origin[..., 1]) / direction[..., 1]
        x = (origin + t[..., None] * direction)[..., 0]
        error = np.abs(irradiance[..., 0] - 10.0 - x)[seen == number]
        pixel = receivers["footprint"].max()
        assert error.max() < 1.5 * pixel and error.mean() < 0.5 * pixel


def passage():
    """A wall seen aslant, 1 m to the left, that ends 12 m away before another that faces the eye."""
    scene = Scene()
    for corners in (
        [(-1, -3, 0), (-1, -3, -12), (-1, 3, -12), (-1, 3, 0)],
        [(-1, -3, -12), (1, -3, -12), (1, 3, -12), (-1, 3, -12)],
    ):
        scene.add(polygons([np.array(corners, float)]), material=lambert((0.5,) * 3))
    pose = look_at_pose(np.zeros(3), np.array([0.0, 0.0, -1.0]))
    return scene, CameraView((160, 90), pose, yfov=0.9, near=0.01)


@pytest.mark.parametrize("reach", [1.0, 0.0, 100.0])
def test_light_is_not_carried_far_along_a_wall_seen_aslant(gpu, reach):
    """A block that shows the wall's end may have its receiver on the other wall. Pixels there lie farther
    than all receivers of the wall: the middle of any of these is as far off as the last one at least. Where
    that is more than half of the radius over which light was averaged they want light of their own, and not
    where it is less, or light was not averaged."""

    def growing(receivers):
        out = even(0.0)(receivers)
        out[:, :3] = 1.0 - receivers["position"][:, 2:]
        channels(out)["reach"] = reach
        return out

    scene, view = passage()
    irradiance, seen, receivers, missed = upsampled(gpu, scene, view, 4, growing, growing)
    _, direction = view.rays()
    z = direction[..., 2] / -np.minimum(direction[..., 0], -1e-9)  # where its ray meets the plane of x = -1
    of_wall = receivers["position"][(receivers["valid"] > 0) & (receivers["ng"][:, 0] > 0.5)]
    beyond = (seen == 1) & (z < of_wall[:, 2].min() - 0.5)
    assert beyond.sum() > 20
    carried = abs(irradiance[..., 0] / (1.0 - z) - 1.0)[beyond]
    if reach == 1.0:
        assert carried.max() < 1e-4
    else:
        assert missed == 0 and np.median(carried) > 0.05


@pytest.mark.parametrize("block", [2, 4, 5])
@pytest.mark.parametrize("index", [1, 2, 7])
def test_a_ramp_is_exact_wherever_a_pass_has_its_receivers(gpu, block, index):
    """Bilinear weights are of the receivers' places, not of the blocks' middles, which are half a block off.

    The 1e-3 that each weight has at least draws a value to its neighbours' mean, 0.004 blocks at most.
    """
    scene = Scene()
    scene.add(quad(4.0))
    pose = look_at_pose(np.array([0.0, 3.0, 0.0]), np.zeros(3))
    view = CameraView((40, 40), pose, ymag=2.0, near=0.1, far=10.0, pass_index=index)

    def ramp(receivers):
        out = even(0.0)(receivers)
        out[:, :3] = 100.0 + 10.0 * receivers["position"][:, :1]  # 1 a pixel
        return out

    irradiance, *_ = upsampled(gpu, scene, view, block, ramp)
    expected = 100.0 + np.arange(40) + 0.5 - 20.0
    inner = slice(block, -block)  # outermost pixels have receivers on one side alone
    error = (irradiance[..., 0] - expected)[inner, inner]
    assert np.abs(error).max() < 0.005 * block


def test_pixels_without_neighbours_are_listed_and_patched(gpu):
    """Slivers between the receivers' pixels take the light that is brought for them."""
    scene = Scene()
    for k in range(12):
        x, y = -1.5 + 0.25 * k, 0.3 + 0.1 * (k % 3)
        corners = np.array([(x, y, -2), (x, y, 2), (x + 0.03, y, 2), (x + 0.03, y, -2)], float)
        scene.add(polygons([corners]), material=lambert((0.5,) * 3))
    floor = np.array([(-2, 0, -2), (-2, 0, 2), (2, 0, 2), (2, 0, -2)], float)
    scene.add(polygons([floor]), material=lambert((0.5,) * 3))
    view = two_floors()[1]
    irradiance, seen, _, missed = upsampled(gpu, scene, view, 8, even(1.0), even(7.0))
    patched = (irradiance[..., 0] == 7.0).sum()
    assert missed > 20 and patched == missed
    assert irradiance[seen > 0].min() == pytest.approx(1.0)


@pytest.mark.parametrize("block", [1, 3, 4])
def test_ends_of_eye_paths_are_interpolated_as_pixels_are(gpu, block):
    """`spread_light` against the shader, of noise: the same pixels are missed, and the others alike.

    In an orthographic view receivers and pixels agree about the width of a pixel. Both sum up to 20 float32
    products of factors with some 10 roundings each; weights as small as 1e-3 add none. Pixels whose weights
    lie at a threshold to rounding may take another branch: of 2,623 at most 3.
    """
    view = view_of((61, 43), ymag=1.6)
    noise = np.random.default_rng(4).uniform(0.1, 10.0, (61 * 43, 3)).astype(np.float32)

    def light(receivers):
        out = even(0.0)(receivers)
        out[:, :3] = noise[: len(receivers)]
        return out

    pixels = upsampled(gpu, mixed_scene(), view, 1, even(1.0))[2]
    irradiance, seen, image, missed = upsampled(gpu, mixed_scene(), view, block, light)
    y, x = np.divmod(np.arange(61 * 43), 61)
    places = ((np.stack([x, y], axis=1) + 0.5) / block - 0.5).astype(np.float32)
    size = -(-61 // block), -(-43 // block)
    spread, found = spread_light(pixels, places, image, FilteredLight(light(image), None), size, block, 1)
    on = (seen.ravel() > 0) & found
    assert abs(np.count_nonzero(seen.ravel() > 0) - on.sum() - missed) <= 3
    error = abs(spread[on, :3] / irradiance.reshape(-1, 3)[on] - 1.0).max(axis=1)
    assert np.sort(error)[-4] < 200 * 2.0**-24


@pytest.mark.parametrize("block", [1, 3, 4])
def test_ends_of_eye_paths_follow_normals_as_pixels_do(gpu, block):
    """`spread_light` against the shader where light has slopes, of at most 3.2: in two axes off by 2^-11 of
    themselves, at offsets of at most a half, 1.6 2^-11 in all; and twice that for the rounding of normals."""
    scene, view = wavy()
    pixels = upsampled(gpu, scene, view, 1, even(1.0))[2]
    irradiance, seen, image, missed = upsampled(gpu, scene, view, block, leaning, leaning, slopes_of)
    y, x = np.divmod(np.arange(61 * 43), 61)
    places = ((np.stack([x, y], axis=1) + 0.5) / block - 0.5).astype(np.float32)
    light = FilteredLight(leaning(image), slopes_of(image))
    spread, found = spread_light(pixels, places, image, light, (-(-61 // block), -(-43 // block)), block, 1)
    assert found.all() and not missed and (seen > 0).all()
    error = abs(spread[:, :3] - irradiance.reshape(-1, 3)).max()
    assert error < 3.0 * 1.6 * 2.0**-11
