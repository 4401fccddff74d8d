"""Surfaces at hits: places, normals and materials, for instances placed in any way."""

import numpy as np
import pytest
from transport import Tracer

from ispm.accel.records import Hit
from ispm.accel.surface import hit_position, scene_tables, surface
from ispm.library.shapes import icosphere
from ispm.optics.jit import jit
from ispm.optics.records import MATERIAL_UNLIT
from ispm.scene.material import Material, Texture, TextureUse
from ispm.scene.mesh import Mesh
from ispm.scene.packed import pack
from ispm.scene.rotation import rotation_matrix
from ispm.scene.scene import Scene

TURN = (0.2, 0.3, 0.1, 0.9)
SCALES = [(1.0, 1.0, 1.0), (2.0, 0.3, 1.2), (-1.0, 1.0, 1.0), (-1.0, -0.5, 2.0), (-1.0, -2.0, -0.7)]


@jit
def _surfaces(tables, instances, primitives, uv, d, points, ng, n, bsdf, flags, front):
    for i in range(len(uv)):
        hit = Hit(instances[i], primitives[i], uv[i, 0], uv[i, 1])
        x = surface(tables, hit, (d[i, 0], d[i, 1], d[i, 2]))
        q, b = hit_position(tables.surfaces, hit), x.bsdf
        for k in range(3):
            points[i, k], ng[i, k], n[i, k] = x.position[k], x.ng[k], x.n[k]
            if x.position[k] != q[k]:
                points[i, k] = np.float32(np.nan)
            bsdf[i, k], bsdf[i, 3 + k], bsdf[i, 10 + k] = b.diffuse[k], b.f0[k], b.tint[k]
        bsdf[i, 6], bsdf[i, 7], bsdf[i, 8], bsdf[i, 9] = b.f90, b.alpha, b.dielectric_f0, b.dielectric_f90
        bsdf[i, 13], bsdf[i, 14] = b.eta, b.thin
        flags[i], front[i] = x.flags, x.entering


def surfaces(scene, primitives, uv, d, **footprint):
    """Points, ng, n, BSDFs, flags and whether the front was met, at hits of instance 0."""
    tracer = Tracer(scene, **footprint)
    count = len(uv)
    out = [np.zeros((count, k), np.float32) for k in (3, 3, 3, 15)]
    out += [np.zeros(count, np.uint32), np.zeros(count, np.bool_)]
    _surfaces(
        scene_tables(tracer.packed, None, tracer.surfaces), np.zeros(count, np.uint32),
        np.asarray(primitives, np.uint32), np.asarray(uv, np.float32), np.asarray(d, np.float32), *out,
    )  # fmt: skip
    return out


def some_hits(mesh, count=200):
    """Triangles of a mesh and barycentrics within them."""
    random = np.random.default_rng(3)
    uv = random.dirichlet((1, 1, 1), count)[:, 1:]
    return random.integers(0, len(mesh.triangles), count), uv, random.normal(size=(count, 3))


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


@pytest.mark.parametrize("scale", SCALES)
def test_places_and_normals_are_those_of_the_placed_mesh(scale):
    """Exact transforms in float64; both normals face where the ray came from."""
    ball = icosphere(0.7, 3)
    scene = Scene()
    scene.add(ball, translation=(3.0, -1.0, 2.0), rotation=TURN, scale=scale)
    primitives, uv, d = some_hits(ball)
    points, ng, n, *_ = surfaces(scene, primitives, uv, unit(d))
    matrix = rotation_matrix(np.array(TURN)) * np.array(scale)
    corners = ball.positions[ball.triangles[primitives]].astype(float)
    weights = np.concatenate([1 - uv.sum(axis=1, keepdims=True), uv], axis=1)[..., None]
    placed = corners @ matrix.T + (3.0, -1.0, 2.0)
    assert points == pytest.approx((weights * placed).sum(axis=1), abs=1e-6)
    flat = unit(np.cross(placed[:, 1] - placed[:, 0], placed[:, 2] - placed[:, 0]))
    flat *= -np.sign((flat * d).sum(axis=1, keepdims=True))
    assert ng == pytest.approx(flat, abs=1e-5)
    smooth = (weights * ball.normals[ball.triangles[primitives]]).sum(axis=1)
    smooth = unit(smooth @ np.linalg.inv(matrix))
    smooth *= np.sign((smooth * flat).sum(axis=1, keepdims=True))
    # a normal that coarse triangles turn away from where the ray came from is put back to graze it
    wo = -unit(d)
    away = np.minimum((smooth * wo).sum(axis=1, keepdims=True), 0.0)
    bent = unit(np.where(away < 0.0, smooth - (away - 1e-3) * wo, smooth))
    assert n == pytest.approx(bent, abs=1e-5)
    assert ((n * wo).sum(axis=1) > 0.0).all()


def textured_square(material):
    """A square in y = 0, facing +Y, u along +X and v along +Z."""
    corners = [(0, 0, 0), (0, 0, 1), (1, 0, 1), (1, 0, 0)]
    uv = np.array([(0, 0), (0, 1), (1, 1), (1, 0)])
    scene = Scene()
    scene.add(Mesh(np.array(corners), np.array([(0, 1, 2), (0, 2, 3)]), uv0=uv), material=material)
    return scene


def constant(*rgba):
    return TextureUse(Texture(np.full((4, 4, 4), rgba, np.uint8), srgb=False))


DOWN = np.array([[0.1, -1.0, 0.2]])


def test_normal_map_tilts_along_u_and_against_v():
    """glTF: red along +U; green along the bitangent, upwards in the picture, which is -V."""
    for pixel, expected in (((255, 128), (1, 0)), ((128, 255), (0, -1)), ((0, 128), (-1, 0))):
        scene = textured_square(Material(normal_texture=constant(*pixel, 191, 255)))
        n = surfaces(scene, [0], [(0.2, 0.2)], DOWN)[2][0]
        tilted = np.array((expected[0], 0.498, expected[1]))  # 191 of 255 is 0.498 along the normal
        assert n == pytest.approx(unit(tilted), abs=0.01)


def test_a_level_normal_map_changes_nothing():
    """128 of 255 is 0.004 off the middle."""
    scene = textured_square(Material(normal_texture=constant(128, 128, 255, 255)))
    assert surfaces(scene, [1], [(0.2, 0.2)], DOWN)[2][0] == pytest.approx((0, 1, 0), abs=0.006)


def test_textures_multiply_the_materials_factors():
    material = Material((0.5, 1.0, 0.25), metallic=0.8, roughness=0.5, specular=0.0,
                        base_color_texture=constant(255, 128, 64, 255),
                        metallic_roughness_texture=constant(9, 204, 51, 9))  # fmt: skip
    bsdf = surfaces(textured_square(material), [0], [(0.2, 0.2)], DOWN)[3][0]
    metallic, roughness = 0.8 * 51 / 255, 0.5 * 204 / 255
    base = np.array([0.5, 128 / 255, 0.25 * 64 / 255])
    assert bsdf[:3] == pytest.approx(base * (1 - metallic), rel=1e-5)
    assert bsdf[3:6] == pytest.approx(base * metallic, rel=1e-5)
    assert bsdf[7] == pytest.approx(roughness**2, rel=1e-5)


def test_textures_are_averaged_over_no_more_than_part_of_an_instance():
    """In a scene of 4 km photons see means of textures over 20 m, of a square of 1 m over .02 of 1.4 m."""
    halves = np.zeros((64, 64, 3), np.float32)
    halves[:, :32] = 1.0
    scene = textured_square(Material(base_color_texture=Texture(halves, linear=False), specular=0.0))
    far = Mesh(np.array([(0, 0, 0), (0, 0, 1), (1, 0, 1)]), np.array([(0, 1, 2)]))
    scene.add(far, scale=(4000.0,) * 3)
    places = [(0.2, 0.2), (0.7, 0.1)], np.tile(DOWN, (2, 1))  # of the first triangle, u .2 and .1
    found = [surfaces(scene, [0, 0], *places, **given)[3][:, 0] for given in ({}, {"part": 0.02})]
    assert found[0] == pytest.approx((0.5, 0.5), abs=0.01) and found[1] == pytest.approx((1.0, 1.0))


def test_textures_multiply_specular_reflection():
    """F0 = min(0.04 color, 1) factor, F90 = factor: by RGB of one texture and A of the other."""
    material = Material((0.5,) * 3, specular=0.5, specular_color=(2.0, 1.0, 30.0),
                        specular_texture=constant(9, 9, 9, 204),
                        specular_color_texture=constant(51, 102, 255, 9))  # fmt: skip
    bsdf = surfaces(textured_square(material), [0], [(0.2, 0.2)], DOWN)[3][0]
    assert bsdf[3:6] == pytest.approx(0.4 * np.array([0.04 * 0.4, 0.04 * 0.4, 1.0]), rel=1e-5)
    assert bsdf[6] == pytest.approx(0.4, rel=1e-5)


def test_flags_and_broken_normals_come_through():
    scene = textured_square(Material(unlit=True))
    scene.nodes[0].parts[0].mesh.normals = np.zeros((4, 3), np.float32)
    *_, flags, _ = surfaces(scene, [0], [(0.2, 0.2)], DOWN)
    assert flags[0] & MATERIAL_UNLIT
    assert np.isfinite(pack(scene).geometry.vertices["normal"]).all()


def test_transmission_is_factor_times_red_and_tints():
    material = Material((0.5, 1.0, 0.25), transmission=0.8, thickness=1.0, ior=2.0, metallic=0.0,
                        transmission_texture=constant(128, 9, 9, 9))  # fmt: skip
    above, below = (surfaces(textured_square(material), [0], [(0.2, 0.2)], s * DOWN) for s in (1, -1))
    share, base = 0.8 * 128 / 255, np.array([0.5, 1.0, 0.25])
    assert above[5][0] and not below[5][0]
    for found, eta in ((above, 2.0), (below, 0.5)):
        bsdf = found[3][0]
        assert bsdf[:3] == pytest.approx(base * (1 - share), rel=1e-5)
        assert bsdf[10:13] == pytest.approx(base * share, rel=1e-5)
        assert bsdf[13:] == pytest.approx((eta, 0.0))
    thin = surfaces(textured_square(Material(transmission=1.0, ior=2.0)), [0], [(0.2, 0.2)], -DOWN)
    assert thin[3][0, 13:] == pytest.approx((2.0, 1.0))


@pytest.mark.parametrize("scale", SCALES)
def test_the_front_of_a_closed_mesh_is_its_outside_however_it_is_scaled(scale):
    ball = icosphere(0.7, 3)
    scene = Scene()
    scene.add(ball, translation=(3.0, -1.0, 2.0), rotation=TURN, scale=scale)
    primitives, uv, d = some_hits(ball)
    points, *_, entering = surfaces(scene, primitives, uv, unit(d))
    outwards = points - (3.0, -1.0, 2.0)
    ng = surfaces(scene, primitives, uv, -unit(outwards))[1]  # towards where a ray from outside comes from
    assert (entering == ((ng * d).sum(axis=1) < 0)).all()
