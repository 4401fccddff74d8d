"""The picture holds the light that there is: known rooms, exact sums, and no light where none comes."""

import math

import numpy as np
import pytest
from transport import box_room, lit, render

from ispm.library.builtin import builtin
from ispm.library.shapes import box, icosphere, polygons
from ispm.renderer import draw as draw_module
from ispm.scene.camera import Camera, look_at_pose
from ispm.scene.light import PointLight
from ispm.scene.material import Material
from ispm.scene.scene import Scene

_SPREAD = 1.8  # of the biweight kernel: pi r^2 times its square's integral (method, 1.7)


def blocks(picture, side=8):
    """Means of (h, w, 3) over blocks of `side` pixels, what is left over at the borders cut."""
    h, w = (n // side for n in picture.shape[:2])
    return picture[: h * side, : w * side].reshape(h, side, w, side, 3).mean(axis=(1, 3, 4), dtype=float)


def noise_of(photons):
    """Relative standard deviation of the mean of 1600 photons in a biweight filter: that of the picture.

    Photons of unequal flux count as (sum f)^2 / sum f^2.
    """
    flux = photons["flux"][:, 0].astype(float)
    equal = flux.sum() ** 2 / (flux**2).sum() / len(flux)
    return math.sqrt(_SPREAD / (1600 * equal))


@pytest.mark.parametrize("albedo", [0.5, 0.8])
def test_integrating_sphere_is_evenly_bright(gpu, albedo):
    """Method, V1: 30 bounces leave out under 0.1 %."""
    frame, photons = render(gpu, builtin("integrating-sphere", albedo=albedo), bounces=30)
    direct = albedo * 100 / (4 * math.pi**2 * 2**2)
    indirect = direct * (albedo - albedo**31) / (1 - albedo)
    assert blocks(frame.direct) == pytest.approx(direct, rel=2e-3)
    assert frame.indirect.mean() == pytest.approx(indirect, rel=0.02)
    assert frame.radiance.mean() == pytest.approx(direct + indirect, rel=0.02)
    found, sigma = blocks(frame.indirect) / indirect, noise_of(photons)
    assert found.std() < 1.25 * sigma
    # 220 blocks: 4.5 sigma is 0.15 % for the worst of all
    assert np.abs(found - 1).max() < 4.5 * sigma


def test_first_bounces_of_the_sphere_add_up_like_a_geometric_series(gpu):
    """Truncated after b bounces: L_1 + ... + L_b (method, V1)."""
    scene, direct = builtin("integrating-sphere", albedo=0.6), 0.6 * 100 / (4 * math.pi**2 * 2**2)
    assert direct == pytest.approx(0.3799544, rel=1e-6)
    for bounces in (1, 2, 4):
        frame, _ = render(gpu, scene, bounces=bounces)
        exact = direct * sum(0.6**b for b in range(1, bounces + 1))
        assert frame.indirect.mean() == pytest.approx(exact, rel=0.02)


def test_full_is_the_sum_of_its_parts_to_the_bit(gpu):
    frame, _ = render(gpu, glowing_room())
    assert frame.emission.max() == 3.0
    assert (frame.radiance == (frame.direct + frame.indirect) + frame.emission).all()


def glowing_room():
    """A room with a glossy ball, a lamp that glows and an unlit panel."""
    scene = box_room((-2, -1, -2), (2, 1, 2), albedo=0.6)
    ball = Material((0.8, 0.3, 0.2), roughness=0.4)
    scene.add(icosphere(0.5, 4), material=ball, translation=(0.5, -0.4, 0))
    glow = Material((0.5,) * 3, emission=(3.0, 2.0, 1.0))
    scene.add(box((-0.2, 0, -0.2), (0.2, 0.1, 0.2)), material=glow, translation=(-0.8, -1, 0.3))
    scene.add(box((0, 0, 0), (0.4, 0.4, 0.1)), material=Material((0.2, 0.9, 0.4), unlit=True),
              translation=(-1, 0, -1.5))  # fmt: skip
    scene.add(Camera(yfov=1.2), translation=(0.2, 0.1, 1.9))
    return lit(scene, (0.2, 0.6, 0.1))


@pytest.mark.parametrize("threads", [1, 3])
def test_pictures_repeat_to_the_bit_for_any_number_of_threads(gpu, threads):
    frames = [render(gpu, glowing_room(), threads=n, photons=10_000) for n in (2, threads)]
    (one, photons), (two, same_photons) = frames
    assert photons.tobytes() == same_photons.tobytes()
    for layer in ("full", "direct", "indirect", "irradiance", "depth", "normal"):
        assert one[layer].tobytes() == two[layer].tobytes(), layer


def test_statistics_balance_the_flux(gpu):
    stats = render(gpu, glowing_room(), photons=10_000)[0].stats
    glow = 0.48 * math.pi * (3.0 + 2.0 + 1.0)  # of the lamp's 0.4 x 0.1 x 0.4 m
    assert stats.flux_emitted == pytest.approx(12 * math.pi + glow, rel=0.03)
    ended = stats.flux_absorbed + stats.flux_escaped + stats.flux_dropped
    assert ended == pytest.approx(stats.flux_emitted, rel=1e-12)


def from_above(ymag, height):
    """An orthographic camera looking straight down from (0, height, 0)."""
    return Camera(ymag=ymag, pose=look_at_pose(np.array([0.0, height, 0.0]), np.zeros(3)))


@pytest.mark.parametrize("subsampling", [1, 2, 4, 8, 16])
def test_picture_holds_the_flux_of_the_photons_it_sees(gpu, subsampling):
    """Irradiance times area summed over the floor that is seen is the photons' flux there (method, V10)."""
    scene = lit(box_room((-3, -1, -3), (3, 1, 3)), (0.4, 0.5, 0.3))
    frame, photons = render(gpu, scene, from_above(0.9, 0.9), subsampling=subsampling, gather=0)
    half = 0.9 * 160 / 90, 0.9
    place = photons["position"]
    seen = (photons["instance"] == 2) & (np.abs(place[:, 0]) < half[0]) & (np.abs(place[:, 2]) < half[1])
    flux = photons["flux"][seen, 0].sum(dtype=float)
    found = frame.irradiance[..., 0].mean(dtype=float) * 4 * half[0] * half[1]
    assert found == pytest.approx(flux, rel=0.015)


def test_one_plane_has_direct_light_alone(gpu):
    """Method, V4: nothing comes back to a plane, and its direct light is I h rho / (pi d^3)."""
    scene = Scene()
    corners = np.array([(-4, 0, -4), (-4, 0, 4), (4, 0, 4), (4, 0, -4)], float)
    scene.add(polygons([corners]), material=Material((0.7, 0.5, 0.2), specular=0.0))
    scene.add(PointLight((10.0, 20.0, 30.0)), translation=(0.2, 1.5, -0.1))
    frame, photons = render(gpu, scene, from_above(2.0, 1.0))
    assert not len(photons) and not frame.indirect.any() and not frame.irradiance.any()
    x = ((np.arange(160) + 0.5) / 160 * 2 - 1) * 2.0 * 160 / 90 - 0.2
    z = ((np.arange(90) + 0.5) / 90 * 2 - 1)[:, None] * 2.0 + 0.1
    shape = 1.5 / (x**2 + 1.5**2 + z**2) ** 1.5 / math.pi
    expected = shape[..., None] * np.array([7.0, 10.0, 6.0])
    # base color is kept in 8 bits, sRGB or half: 0.5 %
    assert frame.direct == pytest.approx(expected, rel=5e-3)


def two_rooms(gap):
    """A bright and a dark closed room, walls `gap` m apart; the dark one's floor is a step lower."""
    bright = lit(box_room((-2, -1, -1), (-gap / 2, 1, 1), albedo=0.7), (-1.0, 0.1, 0.2))
    for node in box_room((gap / 2, -1.5, -1.5), (2, 1.5, 1.5), albedo=0.7).nodes:
        bright.roots.append(node)
    return bright


@pytest.mark.parametrize("gap", [1e-4, 0.01])
def test_no_light_passes_a_thin_wall(gpu, gap):
    """The dark side of a wall much thinner than a kernel is high stays black to the bit (method, V24)."""
    scene = two_rooms(gap)
    eye = Camera.look_at((1.8, 0.3, 0.2), (0.0, -0.2, 0.0), yfov=1.6)
    frame, photons = render(gpu, scene, eye, bounces=4)
    assert photons["height"].mean() > 1e-3 and (np.abs(photons["position"][:, 0]) < 2 * gap).any()
    assert not frame.indirect.any() and not frame.direct.any()
    bright, _ = render(gpu, scene, Camera.look_at((-1.8, 0.3, 0.2), (0.0, -0.2, 0.0), yfov=1.6), bounces=4)
    assert bright.indirect.min() > 0.0


def test_near_plane_does_not_change_the_light(gpu, monkeypatch):
    """Method, V25: the eye stands among photons whose kernels reach around it."""
    scene = lit(box_room((-2, -1, -2), (2, 1, 2)), (0.5, 0.3, 0.2))
    eye = Camera.look_at((-1.97, -0.97, 0.1), (1.0, -0.8, 0.0), yfov=1.6)
    pictures = []
    for near in (1e-5, 1e-3):
        monkeypatch.setattr(draw_module, "_NEAR", near)
        pictures.append(render(gpu, scene, eye, emission="rays", subsampling=1)[0])
    for layer in ("indirect", "irradiance"):
        assert blocks(pictures[0][layer]) == pytest.approx(blocks(pictures[1][layer]), rel=1e-3)
