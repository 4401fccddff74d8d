"""Kernels on and below translucent and blended sheets, thinner than the gap to the next one.

Light goes through a stack of paper, and photons lie on all its sheets, which have the same normal, and on the
desk below. A kernel that reached the sheets around would bring each of them the light of all.
"""

from __future__ import annotations

import numpy as np

from ispm.accel.intersect import STACK_WORDS, closest, instance_scale
from ispm.accel.records import Ray, Scratch
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca
from ispm.optics.jit import jit
from ispm.optics.records import INNER, MATERIAL_BLEND, MATERIAL_TRANSLUCENT
from ispm.optics.vector import add, scale, vec3
from ispm.scene.packed import Packed

f32, u32 = np.float32, np.uint32

_SHARE = f32(0.5)  # of the gap to the next surface, that a kernel is high at most
_LIFT = f32(16 * 2.0**-24)  # of the scale of rounding errors, by which rays start off a sheet
_CHUNK = 256  # photons a thread takes at a time


def part_sheets(photons: np.ndarray, packed: Packed, world: World) -> None:
    """Lower kernels to half of the gap to what lies in front of surfaces and, where these are translucent or
    blended, behind them: in scenes with any such surface.

    photons  (N,) PHOTON with radius and height set, `height` changed in place
    """
    flags = packed.materials["flags"][packed.instances["material"]]
    sheets = flags & (MATERIAL_TRANSLUCENT | MATERIAL_BLEND) != 0
    if sheets.any():
        run_shared(lambda counter: _part(world.trees, photons, sheets, counter), world.threads)


@jit
def _part(trees, photons, sheets, counter):
    """Lower as many of the (N,) PHOTON as a thread gets; sheets: (I,) bool, whether instances are any."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for i in shared_rows(counter, _CHUNK, len(photons)):
        photon = photons[i]
        n, position, instance = vec3(photon.normal), vec3(photon.position), photon.instance & ~u32(INNER)
        lift = _LIFT * instance_scale(trees, instance)
        for side in range(2 if sheets[instance] else 1):
            d = n if side == 0 else scale(f32(-1), n)
            reach = photon.height / _SHARE
            gap = closest(trees, Ray(add(position, scale(lift, d)), d, f32(reach)), scratch)
            photon.height = _SHARE * min(gap + lift, reach)
