"""What of light passes layers on a shadow ray: the product of what each lets through, exactly."""

from dataclasses import replace

import numpy as np
import pytest
from transport import Tracer

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Scratch
from ispm.accel.transmittance import shadow_transmittance
from ispm.kernels.simd import alloca
from ispm.optics.jit import jit
from ispm.optics.vector import vec3
from ispm.scene.material import AlphaMode, Material, Texture
from ispm.scene.mesh import Mesh
from ispm.scene.rotation import axis_angle
from ispm.scene.scene import Scene

f32 = np.float32

SQUARE = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], float)
HALVES = np.array([(0, 1, 2), (0, 2, 3)])
TINT = 0.9, 0.5, 0.2
SHEET = Material(TINT, transmission=1.0, roughness=0.0)  # thin, as it has no thickness
PLACES = np.array([(0.3, -0.6), (0.5, 0.25), (-0.7, 0.1)])
DIAGONAL = np.array([(0.5, 0.5), (-0.25, -0.25)])  # where two triangles of a square meet


@jit
def _shares(tables, starts, directions, distance, out):
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for i in range(len(starts)):
        start, d = vec3(starts[i]), vec3(directions[i])
        share = shadow_transmittance(tables, start, d, distance, scratch)
        for c in range(3):
            out[i, c] = share[c]


def shares(scene, distance=9.0, places=PLACES):
    """RGB of rays along +Z from z = -3, a row for each place."""
    tracer = Tracer(scene)  # whose arrays the tables are addresses of
    starts = np.column_stack([places, np.full(len(places), -3.0)]).astype(f32)
    out, ahead = np.zeros((len(places), 3), f32), np.tile(f32((0, 0, 1)), (len(places), 1))
    _shares(tracer.tables, starts, ahead, f32(distance), out)
    return out


def stacked(materials, gap=0.5):
    """A square for each material, `gap` apart, from z = 0."""
    scene = Scene()
    for k, material in enumerate(materials):
        scene.add(Mesh(SQUARE, HALVES), translation=(0, 0, k * gap), material=material)
    return scene


def blended(alpha, **kwargs):
    return Material((0.5, 0.5, 0.5, alpha), alpha_mode=AlphaMode.BLEND, **kwargs)


def masked(alpha):
    return Material((0.5, 0.5, 0.5, alpha), alpha_mode=AlphaMode.MASK, alpha_cutoff=0.5)


@pytest.mark.parametrize("alphas", [(0.5,), (0.5, 0.5), (0.3, 0.6, 0.2), (0.1,) * 40, (0.2, 1.0), (0.0, 0.0)])
@pytest.mark.parametrize("gap", [0.0, 1e-6, 0.1])
def test_blended_layers_let_through_the_product(alphas, gap):
    # 40 roundings of 2^-24, and alphas of 8 decimals
    np.testing.assert_allclose(
        shares(stacked(map(blended, alphas), gap)), np.prod(1.0 - np.array(alphas)), rtol=1e-5, atol=1e-7
    )


@pytest.mark.parametrize("alphas", [(0.5,), (0.3, 0.6, 0.2)])
def test_an_edge_within_a_layer_counts_once(alphas):
    found = shares(stacked(map(blended, alphas)), places=DIAGONAL)
    np.testing.assert_allclose(found, np.prod(1.0 - np.array(alphas)), rtol=1e-5)


@pytest.mark.parametrize("layers", [1, 2])
@pytest.mark.parametrize("place", [0.0, 2.3])
def test_rays_to_points_of_an_edge_pass_each_layer_once(layers, place):
    """In any direction, by squares turned anyhow, whose two triangles round distances differently; layers of
    one mesh at one place are met one by one on their edges, too, and with the corner at which four meet."""
    random, count = np.random.default_rng(4), 4000
    fan = np.array([(4, 0, 1), (4, 1, 2), (4, 2, 3), (4, 3, 0)])
    for k, triangles in enumerate([HALVES, np.roll(HALVES, 1, axis=1), fan, fan[::-1]]):
        scene = Scene()
        corners = np.concatenate([SQUARE, np.zeros((1, 3))])
        mesh = Mesh(np.tile(corners, (layers, 1)), np.concatenate([triangles + 5 * k for k in range(layers)]))
        turn = axis_angle((1.0, k - 1.0, 0.5), 0.7 * k)
        scene.add(mesh, translation=(place, -place, 0.4 * place), rotation=turn, material=blended(0.5))
        tracer = Tracer(scene)
        rows = tracer.packed.instances[0]
        matrix = np.array([rows["world0"], rows["world1"], rows["world2"]], float)
        along = random.uniform(-0.9, 0.9, count)
        along[: count // 4] = 0.0
        places = np.stack([along, along, 0.0 * along, 1.0 + 0.0 * along], axis=1) @ matrix.T
        ways = random.normal(size=(count, 3))
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        out = np.zeros((count, 3), f32)
        _shares(tracer.tables, f32(places - 3.0 * ways), f32(ways), f32(9.0), out)
        np.testing.assert_allclose(out, 0.5**layers, rtol=1e-6)


def test_layers_of_one_mesh_count_one_by_one():
    scene = Scene()
    turned = np.concatenate([HALVES, (HALVES + 1) % 4 + 4, HALVES + 8])
    scene.add(Mesh(np.tile(SQUARE, (3, 1)), turned), material=blended(0.5))
    np.testing.assert_allclose(shares(scene), 0.125, rtol=1e-6)


def test_holes_pass_light_whole_and_the_rest_of_a_mask_blocks():
    assert (shares(stacked([masked(0.4)] * 3)) == 1.0).all()
    assert (shares(stacked([masked(0.4), masked(0.6)])) == 0.0).all()


def test_layers_beyond_the_light_do_not_count():
    np.testing.assert_allclose(shares(stacked([blended(0.5)] * 4), distance=3.75), 0.25, rtol=1e-6)


def test_a_thin_sheet_passes_its_tint_but_for_what_it_reflects():
    f0 = 0.04  # of an index of 1.5, met at right angles: both faces are one
    np.testing.assert_allclose(
        shares(stacked([SHEET])), np.tile((1 - f0) * np.array(TINT), (3, 1)), rtol=1e-5
    )


def checkered(low, high, **kind):
    """Two by two even cells, of which a ray along +Z at PLACES meets the second, and others the first."""
    cells = np.indices((2, 2)).sum(axis=0)[..., None] % 2
    return Texture(np.where(cells, np.array(high), np.array(low)).astype(np.float32), linear=False, **kind)


@pytest.mark.parametrize("away", [1.0, 1e4])
def test_cells_of_stained_glass_pass_light_alike_however_wide_the_scene_is(away):
    """Half of it is dark and shut: what passes the means of both textures would be a quarter."""
    sheet = replace(
        SHEET,
        base_color=(1.0, 1.0, 1.0),
        base_color_texture=checkered((0.02,) * 3, TINT),
        transmission_texture=checkered((0.0,) * 3, (1.0,) * 3, srgb=False),
    )
    scene, uv = Scene(), 0.5 * SQUARE[:, :2] + 0.5
    scene.add(Mesh(SQUARE, HALVES, uv0=uv), material=sheet)
    scene.add(Mesh(SQUARE, HALVES), translation=(0.0, 0.0, 10.0), scale=(away,) * 3)
    places = np.array([(0.5, -0.6), (-0.7, 0.25), (0.5, 0.6), (-0.7, -0.25)])
    expected = np.zeros((4, 3))
    expected[:2] = 0.96 * np.array(TINT)
    np.testing.assert_allclose(shares(scene, places=places), expected, atol=0.0045)  # half of 8 bits


def test_a_blended_sheet_covers_a_share_of_the_light():
    sheet = replace(SHEET, base_color=(*TINT, 0.25), alpha_mode=AlphaMode.BLEND)
    expected = 0.75 + 0.25 * 0.96 * np.array(TINT)
    np.testing.assert_allclose(
        shares(stacked([sheet, blended(0.5)])), np.tile(0.5 * expected, (3, 1)), rtol=1e-5
    )


def test_opaque_surfaces_block_behind_any_layers():
    assert (shares(stacked([blended(0.5), SHEET, Material((0.5, 0.5, 0.5))])) == 0.0).all()
