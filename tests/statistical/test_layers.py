"""Layers with holes that lie on each other: rays meet every one of them."""

import numpy as np
import pytest
from transport import Tracer

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Scratch
from ispm.accel.surface import closest_surface, scene_tables
from ispm.kernels.simd import alloca
from ispm.optics.jit import jit
from ispm.optics.rng import random4
from ispm.scene.material import AlphaMode, Material
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Scene

f32, u32 = np.float32, np.uint32

RAYS = 100_000
SQUARE = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], float)
HALVES = np.array([(0, 1, 2), (0, 2, 3)])


@jit
def count_passed(tables, rays, on_diagonal, place, passed):
    """Count in passed[0] rays along +Z, at random places over the square or on its diagonal."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for i in range(rays):
        x, y, u, _ = random4(u32(i), u32(0), u32(3), u32(0))
        x, y = f32(2) * x - f32(1), f32(2) * y - f32(1)
        origin = (place[0] + x, place[1] + (x if on_diagonal else y), place[2] - f32(3))
        found, _ = closest_surface(tables, origin, (f32(0), f32(0), f32(1)), u, scratch)
        passed[0] += not found


def share_passed(scene, on_diagonal=False, place=(0.0, 0.0, 0.0)):
    tracer = Tracer(scene)
    passed = np.zeros(1, np.int64)
    tables = scene_tables(tracer.packed, tracer.world, tracer.surfaces)
    count_passed(tables, RAYS, on_diagonal, tuple(f32(x) for x in place), passed)
    return passed[0] / RAYS


def glassy(alpha):
    return Material((0.5, 0.5, 0.5, alpha), alpha_mode=AlphaMode.BLEND)


def square_nodes(alphas, gap=0.0, place=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0, 1.0)):
    """One node for each layer, `gap` apart."""
    scene = Scene()
    for k, alpha in enumerate(alphas):
        node = np.add(place, (0.0, 0.0, k * gap))
        scene.add(Mesh(SQUARE, HALVES), translation=node, rotation=turn, material=glassy(alpha))
    return scene


def one_mesh(layers):
    """All layers in one mesh, the other diagonal in each second one."""
    parts = [np.roll(HALVES, 0, 1) + 4 * k if k % 2 == 0 else (HALVES + 1) % 4 + 4 * k for k in range(layers)]
    scene = Scene()
    scene.add(Mesh(np.tile(SQUARE, (layers, 1)), np.concatenate(parts)), material=glassy(0.5))
    return scene


def within_statistics(share, expected):
    # 4.5 standard deviations of a binomial of 1e5
    return abs(share - expected) < 4.5 * np.sqrt(expected * (1 - expected) / RAYS)


@pytest.mark.parametrize("alphas", [(0.5,), (0.5, 0.5), (0.3, 0.6, 0.2), (0.1,) * 12])
@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (300.0, -200.0, 500.0)])
def test_light_passes_coincident_layers_one_by_one(alphas, place):
    share = share_passed(square_nodes(alphas, place=place), place=place)
    assert within_statistics(share, np.prod(1 - np.array(alphas)))


@pytest.mark.parametrize("gap", [1e-7, 1e-6, 1e-5, 1e-4])
def test_layers_close_to_each_other_are_all_met(gap):
    assert within_statistics(share_passed(square_nodes((0.5, 0.5, 0.5), gap)), 0.125)


@pytest.mark.parametrize("layers", [2, 3])
def test_layers_of_one_mesh_are_all_met(layers):
    assert within_statistics(share_passed(one_mesh(layers)), 0.5**layers)


def test_an_edge_within_a_layer_counts_once():
    assert within_statistics(share_passed(square_nodes((0.5,)), on_diagonal=True), 0.5)
