"""Photons as they leave the lights: their number, their flux, and that maps and rays send the same."""

import math

import numpy as np
import pytest
from scipy import stats
from transport import Tracer, box_room, lit, on_instance, render

from ispm.optics.records import LIGHT
from ispm.renderer.renderer import Renderer
from ispm.scene.builtins_common import lambert
from ispm.scene.light import PointLight
from ispm.scene.lightmap import CUBE_AXES, LightMap, square_map, texel_measures
from ispm.scene.material import AlphaMode, Material, Texture, TextureUse
from ispm.scene.packed import pack
from ispm.scene.scene import Scene
from ispm.scene.shapes import box, icosphere, polygons
from ispm.settings import Settings
from ispm.tracer.emission import map_width, share_photons, thin


def point_light(spread=1.0):
    """A LIGHT of 2, 1 and 0.5 cd; aimed where `spread` is below 1."""
    row = np.zeros(1, LIGHT)[0]
    row["intensity"], row["spread"] = (2.0, 1.0, 0.5), spread
    face = 4 * math.atan2(spread**2, math.sqrt(1 + 2 * spread**2))
    row["faces"], row["solid_angle"] = (6, 4 * math.pi) if spread == 1.0 else (1, face)
    return row


def cube_texel_solid_angles(width, shift, spread):
    light = point_light(spread)
    cube = LightMap(0, np.zeros(3), CUBE_AXES, False, 4 * math.pi)
    return texel_measures(
        cube if spread == 1.0 else square_map(0, light, np.eye(3), spread), light, width, shift
    )


def thinned(light, wanted, offset=0.3, shift=(0.2, -0.4)):
    width = map_width(light, wanted)
    texels = np.zeros((int(light["faces"]), width, width, 4), np.uint32)
    angles = cube_texel_solid_angles(width, shift, float(light["spread"]))
    return thin(texels, angles, light, wanted, 0, 0, offset)


@pytest.mark.parametrize("spread", [1.0, 0.3, 0.01])
@pytest.mark.parametrize("wanted", [1, 7, 1000, 40_000])
def test_thinned_photons_have_equal_flux_and_the_wanted_number(spread, wanted):
    light = point_light(spread)
    photons = thinned(light, wanted)
    expected = light["intensity"] * float(light["solid_angle"]) / wanted
    assert (photons["flux"] == photons["flux"][:1]).all()
    assert photons["flux"][0] == pytest.approx(expected, rel=1e-6)
    # each texel survives with a chance of its own: at most as uncertain as so many coins
    assert abs(len(photons) - wanted) <= 4 * math.sqrt(wanted)


@pytest.mark.parametrize("spread", [1.0, 0.3])
def test_thinning_keeps_the_flux_of_every_texel_in_expectation(spread):
    """Over 4096 offsets of its lattice each texel survives in proportion to its solid angle, to a step."""
    light, wanted, shift = point_light(spread), 10, (0.2, -0.4)
    width, faces = map_width(light, wanted), int(light["faces"])
    keys = [thinned(light, wanted, (k + 0.5) / 4096, shift)["key"] for k in range(4096)]
    survived = np.bincount(np.concatenate(keys), minlength=faces * width**2) / 4096
    angles = cube_texel_solid_angles(width, shift, spread).ravel()
    assert survived == pytest.approx(angles * wanted / float(light["solid_angle"]), abs=2 / 4096)
    assert survived.max() < 1.0


def test_maps_are_wide_enough_for_every_texel():
    """A texel that carried more than a photon's flux would lose the rest."""
    for spread in (1.0, 0.79, 0.1, 1e-3):
        light = point_light(spread)
        for wanted in (1, 100, 12_345):  # of a handful a shifted map's largest texel may be 2 % above
            for shift in ((0.0, 0.0), (0.5, -0.5)):
                angles = cube_texel_solid_angles(map_width(light, wanted), shift, spread)
                assert angles.max() * wanted <= float(light["solid_angle"]) * (1 + 1e-6)


def test_photons_are_shared_by_luminous_flux():
    lights = np.zeros(3, LIGHT)
    lights["intensity"] = [(1, 1, 1), (3, 3, 3), (0, 0, 0)]
    lights["solid_angle"] = 4 * math.pi
    assert share_photons(lights, 1000).tolist() == [250, 750, 0]
    assert share_photons(lights, 0).tolist() == [0, 0, 0]
    assert share_photons(lights[2:], 1000).tolist() == [0]
    assert share_photons(lights, 1).min() == 0 and share_photons(lights, 1)[:2].min() == 1


def furnished_room():
    """A room with a ball, a mirrored box, a flat box that turns, and two lights."""
    scene = box_room((-2, -1, -2), (2, 1, 2), albedo=0.6)
    scene.add(icosphere(0.4, 4, "ball"), material=Material((0.8, 0.3, 0.2), roughness=0.5),
              translation=(1.0, -0.6, 0.3))  # fmt: skip
    low = box((-0.3, -0.3, -0.3), (0.3, 0.3, 0.3), "block")
    scene.add(low, material=lambert((0.7,) * 3), translation=(-1, -0.6, 0.8), scale=(-1.0, 1.4, 0.7))
    scene.add(low, material=lambert((0.2, 0.7, 0.3)), translation=(-0.8, 0.3, -1.2),
              rotation=(0.2, 0.3, 0.1, 0.9), scale=(2.0, 0.1, 1.0))  # fmt: skip
    scene.add(PointLight((2.0, 2.0, 2.0)), translation=(0.2, 0.7, 0.1))
    scene.add(PointLight((1.0, 0.5, 0.2)), translation=(-1.6, -0.8, -1.5))
    return scene


def far_lit_blocks():
    """Blocks on a floor under a lamp forty metres away, whose one map is narrow."""
    scene = Scene()
    corners = np.array([(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)], float)
    scene.add(polygons([corners], "floor"), material=lambert((0.7,) * 3))
    for x in (-0.5, 0.4):
        scene.add(box((0, 0, 0), (0.3, 0.5, 0.3)), material=lambert((0.5,) * 3), translation=(x, 0, x / 2))
    scene.add(PointLight((9e3,) * 3), translation=(18.0, 30.0, 20.0))
    assert pack(scene).lights["faces"][0] == 1
    return scene


@pytest.mark.parametrize("make", [furnished_room, far_lit_blocks])
def test_maps_and_rays_light_every_object_alike(gpu, make):
    """Flux stored on each object: Welch's t-test over 16 seeds, at 1 % for all objects together (Sidak)."""
    stored = {emission: [] for emission in ("map", "rays")}
    with Renderer(make(), Settings(size=(16, 9), photons=8000, bounces=3), gpu=gpu) as renderer:
        for emission, rows in stored.items():
            for seed in range(16):
                renderer.settings = renderer.settings.replace(emission=emission, seed=seed)
                renderer.render()
                photons = renderer.photons()
                rows.append(np.bincount(photons["instance"], photons["flux"].sum(axis=1), 16))
    used = np.sum(stored["map"], axis=0) > 0.0
    p = stats.ttest_ind(*(np.array(rows)[:, used] for rows in stored.values()), equal_var=False).pvalue
    assert used.sum() >= 3
    assert p.min() > 1 - 0.99 ** (1 / used.sum())


def test_rays_and_maps_emit_the_lights_flux(gpu):
    for emission in ("map", "rays"):
        frame, _ = render(gpu, furnished_room(), size=(16, 9), photons=20_000, bounces=1, emission=emission)
        flux = 4 * math.pi * (3 * 2.0 + 1.7)
        # map: 20 000 photons, at most as uncertain as coins of 1 in 2: 4 sigma; rays: exact
        close = 4 * math.sqrt(0.5 / 20_000) if emission == "map" else 1e-6
        assert frame.stats.flux_emitted == pytest.approx(flux, rel=close)


def pane(opacity, height):
    """A square of side 2 at a height, BLEND with this opacity."""
    corners = np.array([(-1, height, -1), (-1, height, 1), (1, height, 1), (1, height, -1)])
    return polygons([corners], "pane"), Material((1, 1, 1, opacity), alpha_mode=AlphaMode.BLEND)


@pytest.mark.parametrize("opacities", [(0.5,), (0.5, 0.5), (0.2, 0.6), (0.9, 0.3, 0.5)])
def test_rays_pass_blended_panes_one_after_the_other(opacities):
    """Straight down through panes: what is left is the product of their transmittances."""
    scene = Scene()
    for k, opacity in enumerate(opacities):
        mesh, material = pane(opacity, -0.001 * k)
        scene.add(mesh, material=material)
    tracer = Tracer(lit(scene, (0, 0.5, 0)))
    met = tracer.emit(100_000)["instance"]
    # the first pane covers a share of the sphere; rays that pass it meet all the others (thin gaps)
    reached = [np.count_nonzero(met == k) for k in range(len(opacities))]
    share = 4 * math.atan2(1.0, 0.5 * math.sqrt(2.25)) / (4 * math.pi)
    left = 1.0
    for count, opacity in zip(reached, opacities, strict=True):
        expected = 100_489 * share * left * opacity  # the next square number
        assert count == pytest.approx(expected, abs=4 * math.sqrt(expected) + 100_489 * share * 0.005)
        left *= 1 - opacity


def test_rays_pass_the_open_share_of_a_masked_plane():
    """One quarter of a square under the light is a hole, and a quarter of the square's photons pass."""
    pixels = np.full((2, 2, 4), 255, np.uint8)
    pixels[0, 0, 3] = 0
    texture = TextureUse(Texture(pixels, linear=False, mipmaps=False))
    corners = np.array([(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)], float)
    square = polygons([corners], "square")
    square.uv0 = np.array([(0, 0), (0, 1), (1, 1), (1, 0)], np.float32)
    scene = Scene()
    scene.add(square, material=Material(alpha_mode=AlphaMode.MASK, base_color_texture=texture))
    tracer = Tracer(lit(scene, (0, 1, 0)))
    hits = np.count_nonzero(tracer.emit(160_000)["instance"] == 0)
    # one photon in each cell: only those along the outline are by chance, some 1 % of them
    assert hits == pytest.approx(160_000 / 6 * 0.75, rel=0.01)


def test_unlit_and_black_surfaces_keep_what_they_get():
    for material in (Material(unlit=True), lambert((0.0, 0.0, 0.0)), Material((0, 0, 0), metallic=1.0)):
        scene = box_room()
        scene.nodes[0].parts[0].material = material
        tracer = Tracer(lit(scene))
        path = tracer.walk(on_instance(tracer.packed, 0, 1000, seed=0), 3)
        black = material.metallic == 1.0  # F90 = 1 at grazing angles
        assert (path.absorbed[0] / path.emitted[0] > 0.9) if black else (path.absorbed == path.emitted).all()
