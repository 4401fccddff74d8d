"""Rays that go together are stopped exactly where each would be by itself."""

import math

import numpy as np
import pytest
from tracer_scenes import merged, shell

from ispm.accel.intersect import STACK_WORDS, any_hit
from ispm.accel.records import Ray
from ispm.accel.shaft import MOST, is_stopped, list_met
from ispm.accel.world import World
from ispm.kernels.simd import alloca
from ispm.optics.jit import jit
from ispm.optics.vector import dot, scale, sub, vec3
from ispm.scene.packed import pack
from ispm.scene.rotation import axis_angle
from ispm.scene.scene import Scene
from ispm.shapes import box, sphere

f32 = np.float32

GROUPS, EACH = 4000, 16
FAR = np.array([900.0, -700.0, 400.0])


@jit
def compare(trees, apexes, starts, out):
    """For each group of rays: how many subtrees they have, and of each ray whether it is stopped, by itself
    and by these, -1 where there are too many."""
    stack, refs = alloca(STACK_WORDS), alloca(MOST)
    for group in range(len(apexes)):
        apex, low, high = vec3(apexes[group]), vec3(starts[group, 0]), vec3(starts[group, 0])
        for k in range(starts.shape[1]):
            p = vec3(starts[group, k])
            low = min(low[0], p[0]), min(low[1], p[1]), min(low[2], p[2])
            high = max(high[0], p[0]), max(high[1], p[1]), max(high[2], p[2])
        count = list_met(trees, apex, low, high, stack, refs)
        for k in range(starts.shape[1]):
            segment = sub(apex, vec3(starts[group, k]))
            distance = f32(math.sqrt(dot(segment, segment)))
            ray = Ray(vec3(starts[group, k]), scale(f32(1) / distance, segment), distance)
            out[group, k, 0] = count
            out[group, k, 1] = any_hit(trees, ray, stack)
            out[group, k, 2] = is_stopped(trees, ray, refs, count, stack) if count >= 0 else -1


def compared(scene, center, size, spread):
    """What `compare` writes of groups of points, `spread` m wide, in a box of a size about a center."""
    world, rng = World(), np.random.default_rng(3)
    world.update(pack(scene))
    apexes = center + size * rng.uniform(-0.5, 0.5, (GROUPS, 3))
    # of some groups all starts have a coordinate in common, or lie beside the apex
    places = center + size * rng.uniform(-0.5, 0.5, (GROUPS, 1, 3))
    places[:40] = apexes[:40, None]
    flat = rng.uniform(size=(GROUPS, 1, 3)) < 0.7
    starts = places + spread * flat * rng.uniform(-0.5, 0.5, (GROUPS, EACH, 3))
    out = np.zeros((GROUPS, EACH, 3), np.int64)
    compare(world.trees, apexes.astype(f32), starts.astype(f32), out)
    return out


def hall(offset):
    """Boxes and balls, turned and stretched, in a closed box: 150 instances."""
    scene, rng = Scene(), np.random.default_rng(5)
    meshes = box(1.0), sphere(0.5), merged(shell((1.0, 1.0, 1.0), 3, 3))
    scene.add(box(20.0), translation=offset)
    for k in range(150):
        turn = axis_angle(rng.normal(size=3), rng.uniform(0.0, 3.0))
        place = offset + rng.uniform(-9.0, 9.0, 3)
        scene.add(meshes[k % 3], translation=place, rotation=turn, scale=rng.uniform(0.2, 2.0, 3))
    return scene


@pytest.mark.parametrize("offset", [np.zeros(3), FAR])
@pytest.mark.parametrize("spread", [1e-3, 0.3, 3.0])
def test_rays_that_go_together_are_stopped_as_by_themselves(offset, spread):
    """No one of 64,000 differs, near the origin and far from it, where boxes need room for rounding."""
    out = compared(hall(offset), offset, 18.0, spread)
    listed = out[..., 0] >= 0
    assert (out[listed][:, 1] == out[listed][:, 2]).all()
    assert 0.2 < out[..., 1].mean() < 0.9
    assert listed.mean() > 0.2


def test_close_rays_meet_little():
    """Most groups of rays that are a millimetre apart meet a few leaves of hundreds."""
    out = compared(hall(np.zeros(3)), np.zeros(3), 18.0, 1e-3)
    assert (out[..., 0] >= 0).mean() > 0.9
    assert np.median(out[..., 0]) < 12


def test_nothing_is_met_where_nothing_is():
    out = compared(Scene(), np.zeros(3), 18.0, 0.3)
    assert not out.any()
