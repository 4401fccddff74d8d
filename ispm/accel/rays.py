"""Many rays at once, from arrays."""

from __future__ import annotations

import numpy as np

from ispm.accel.intersect import (
    HIT_INSTANCE,
    HIT_PRIMITIVE,
    HIT_U,
    HIT_V,
    STACK_WORDS,
    any_hit,
    closest,
)
from ispm.accel.records import Ray, Scratch
from ispm.kernels.share import shared_rows
from ispm.kernels.simd import alloca, ldf, ldu, stf, stu
from ispm.optics.jit import jit
from ispm.optics.records import NO_HIT

f32, i64, u32 = np.float32, np.int64, np.uint32

# t: distance in lengths of the ray's direction; u, v: barycentric coordinates of the second and third corner.
# Where nothing was hit t is the ray's limit, and instance is NO_HIT.
HIT = np.dtype([("t", "<f4"), ("instance", "<u4"), ("primitive", "<u4"), ("u", "<f4"), ("v", "<f4")])

_CHUNK = 256  # rays a thread takes at a time


@jit
def _ray(origins, directions, limits, i):
    """Ray i of arrays by address: float32, three a vector and one a limit."""
    origin = (ldf(origins, 3 * i), ldf(origins, 3 * i + 1), ldf(origins, 3 * i + 2))
    direction = (ldf(directions, 3 * i), ldf(directions, 3 * i + 1), ldf(directions, 3 * i + 2))
    return Ray(origin, direction, ldf(limits, i))


@jit
def trace_rays(trees, origins, directions, limits, count, counter, hits):
    """Write a HIT for each of `count` rays; threads share the int64 at the address `counter`.

    trees   a Trees;  origins, directions, hits  addresses of float32 and HIT arrays
    limits  address of float32: where each ray ends, in lengths of its direction
    """
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    hit = scratch.found
    for i in shared_rows(counter, _CHUNK, count):
        stu(hit, HIT_PRIMITIVE, u32(NO_HIT))
        stu(hit, HIT_INSTANCE, u32(NO_HIT))
        stf(hit, HIT_U, f32(0))
        stf(hit, HIT_V, f32(0))
        t = closest(trees, _ray(origins, directions, limits, i), scratch)
        stf(hits, 5 * i, t)  # a HIT's five words are in another order than those found
        stu(hits, 5 * i + 1, ldu(hit, HIT_INSTANCE))
        stu(hits, 5 * i + 2, ldu(hit, HIT_PRIMITIVE))
        stf(hits, 5 * i + 3, ldf(hit, HIT_U))
        stf(hits, 5 * i + 4, ldf(hit, HIT_V))


@jit
def occlude_rays(trees, origins, directions, limits, count, counter, blocked):
    """Write to (count,) bool `blocked` whether anything is on each ray before its limit; see `trace_rays`."""
    stack = alloca(STACK_WORDS)
    for i in shared_rows(counter, _CHUNK, count):
        blocked[i] = any_hit(trees, _ray(origins, directions, limits, i), stack)
