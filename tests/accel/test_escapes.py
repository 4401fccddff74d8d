"""Photons do not leave closed rooms, nor meet the surface they have just left."""

import math

import numpy as np
import pytest
from tracer_scenes import merged, shell

from ispm.accel.intersect import STACK_WORDS, closest, instance_scale, read_hit
from ispm.accel.leave import leave_triangle
from ispm.accel.records import Ray, Scratch
from ispm.accel.world import World
from ispm.kernels.simd import alloca
from ispm.kernels.threads import run_threads
from ispm.optics.jit import jit
from ispm.optics.rng import random4
from ispm.optics.vector import cross, dot, scale
from ispm.scene.packed import pack
from ispm.scene.rotation import rotation_matrix
from ispm.scene.scene import Scene

f32, i64, u32 = np.float32, np.int64, np.uint32

RAYS = 2_000_000
PHOTONS_EACH = 100  # rays of one photon
TURN = np.array([0.3, 0.5, 0.7, 1.0])
FAR = np.array([1000.0, -700.0, 400.0])


@jit
def bounce(trees, corners, photons, seed, x, y, z, out):
    """Count rays, escapes, and hits on the plane just left, in out."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for photon in range(photons):
        origin, n = (f32(x), f32(y), f32(z)), (f32(0), f32(0), f32(1))
        last = f32(0)
        for step in range(PHOTONS_EACH):
            u0, u1, _, _ = random4(u32(photon), u32(step), u32(seed), u32(0))
            d = cosine_direction(n, u0, u1)
            t = closest(trees, Ray(origin, d, f32(np.inf)), scratch)
            out[0] += 1
            if t == f32(np.inf):
                out[1] += 1
                break
            hit = read_hit(scratch.found)
            row, u, v = i64(hit.primitive), hit.u, hit.v
            a = (corners[row, 0], corners[row, 1], corners[row, 2])
            e1 = (corners[row, 3] - a[0], corners[row, 4] - a[1], corners[row, 5] - a[2])
            e2 = (corners[row, 6] - a[0], corners[row, 7] - a[1], corners[row, 8] - a[2])
            ng = cross(e1, e2)
            ng = scale(f32(1) / math.sqrt(dot(ng, ng)), ng)
            if dot(ng, d) > f32(0):
                ng = scale(f32(-1), ng)
            if last > f32(0) and dot(ng, n) > f32(0.9):
                out[2] += 1
            origin = leave_triangle(a, e1, e2, u, v, ng, instance_scale(trees, hit.instance))
            n, last = ng, f32(1)


@jit
def cosine_direction(n, u0, u1):
    """A direction about n, cosine-weighted."""
    phi, r, z = f32(2 * np.pi) * u0, math.sqrt(u1), math.sqrt(max(f32(0), f32(1) - u1))
    x, y = r * f32(math.cos(phi)), r * f32(math.sin(phi))
    helper = (f32(1), f32(0), f32(0)) if abs(n[0]) < f32(0.7) else (f32(0), f32(1), f32(0))
    t = cross(helper, n)
    t = scale(f32(1) / math.sqrt(dot(t, t)), t)
    b = cross(n, t)
    return (
        x * t[0] + y * b[0] + z * n[0],
        x * t[1] + y * b[1] + z * n[1],
        x * t[2] + y * b[2] + z * n[2],
    )


def room(kind):
    """(packed scene, center) of a closed cube of 5 m with 20 x 20 quads a face, turned unless 'straight'."""
    mesh = merged(shell(np.full(3, 5.0), 20, 20))
    corners = mesh.positions - 2.5
    turn = rotation_matrix(TURN)
    scene = Scene()
    center = np.zeros(3) if kind in ("straight", "turned") else FAR
    if kind == "turned":
        corners = corners @ turn.T
    if kind == "turned, far by its vertices":
        corners = corners @ turn.T + FAR
    mesh.positions = corners.astype(np.float32)
    node = scene.add(mesh)
    if kind == "turned, far by its node":
        node.rotation, node.translation = TURN / np.linalg.norm(TURN), FAR
    if kind == "far, uneven scale":
        node.matrix = np.eye(4)
        node.matrix[:3, :3] = turn @ np.diag([2.0, 0.5, 1.0]) @ turn
        node.matrix[:3, 3] = FAR
    return pack(scene), center


def run(kind, rays):
    packed, center = room(kind)
    world = World()
    world.update(packed)
    rows = packed.instances[0]
    matrix = np.stack([rows["world0"], rows["world1"], rows["world2"]])
    placed = (packed.geometry.vertices["position"] @ matrix[:, :3].T + matrix[:, 3]).astype(np.float32)
    corners = placed[packed.geometry.indices].reshape(-1, 9)
    photons = rays // PHOTONS_EACH // world.threads
    counts = np.zeros((world.threads, 3), np.int64)

    def work(k):
        bounce(world.trees, corners, photons, k, *center, counts[k])

    run_threads(work, world.threads)
    return counts.sum(axis=0)


ROOMS = [
    "straight", "turned", "turned, far by its vertices", "turned, far by its node", "far, uneven scale",
]  # fmt: skip


@pytest.mark.parametrize("kind", ROOMS)
def test_photons_stay_in_a_closed_room(kind):
    # N = 2e6 rays, seeds 0 .. threads. The claim is at most 1 in 1e7; measured: 0 in 5e7 in each room.
    rays, escapes, again = run(kind, RAYS)
    assert rays > 0.99 * RAYS
    assert escapes <= 1
    if kind != "turned, far by its vertices":  # whose faces are bumpy by an ulp of 1 km, 6e-5 m
        assert again == 0
