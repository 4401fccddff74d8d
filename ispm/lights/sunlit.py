"""Where suns shine on what the eye sees and on what lights that, found by a survey.

Through a window a sun lights a patch of a room, and most of its photons end outside, on walls and roof. Those
that come in are then few, and each carries much. So places that see the sun are looked for, and photons are
aimed at these, see `lights/plan.py`.
"""

from __future__ import annotations

import numpy as np

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Scratch
from ispm.accel.surface import SurfaceTable, closest_surface, leave_surface, scene_tables, surface
from ispm.accel.transmittance import shadow_transmittance
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca
from ispm.optics.bsdf import is_gathered
from ispm.optics.jit import jit
from ispm.optics.light import light_arriving
from ispm.optics.records import LIGHT_DIRECTIONAL
from ispm.optics.rng import random4
from ispm.optics.sampling import cosine_hemisphere, to_world
from ispm.optics.vector import dot, luminance, vec3
from ispm.scene.packed import Packed

f32, u32 = np.float32, np.uint32

_DIMENSION = 11 << 20  # of the random numbers
_STEPS = 3  # places that a ray of the eye finds: what it meets, and two that light this
_CHUNK = 16  # rays a thread takes at a time


def find_sunlit(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    rays: tuple[np.ndarray, np.ndarray],
    seed: int,
    pass_index: int,
) -> list[np.ndarray]:
    """Return for each light places where it shines, (n, 3) m world space: of lights along directions, from
    places that rays of the eye meet and that these see; of others none.

    rays  origins and directions, (n, 3), m and unit, even over the picture
    """
    suns = np.flatnonzero(packed.lights["kind"] == LIGHT_DIRECTIONAL)
    found = [np.zeros((0, 3), f32) for _ in packed.lights]
    if not len(suns):
        return found
    origins, directions = [np.ascontiguousarray(each, f32) for each in rays]
    places = np.zeros((len(origins), _STEPS, 3), f32)
    lit = np.zeros((len(suns), len(origins), _STEPS), np.bool_)
    tables, numbers = scene_tables(packed, world, surfaces), (u32(pass_index), u32(seed))
    told = tables, origins, directions, suns, numbers
    run_shared(lambda counter: _look(*told, counter, places, lit), world.threads)
    for row, own in zip(suns, lit, strict=True):
        found[row] = places[own]
    return found


@jit
def _look(tables, origins, directions, suns, numbers, counter, places, lit):
    """Write places that as many rays as a thread gets find, and which of the suns light them."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for i in shared_rows(counter, _CHUNK, len(origins)):
        start, d = vec3(origins[i]), vec3(directions[i])
        for step in range(_STEPS):
            holes, u1, u2, _ = random4(u32(i), u32(_DIMENSION + step), *numbers)
            found, hit = closest_surface(tables, start, d, holes, scratch)
            if not found:
                break
            x = surface(tables, hit, d)
            start = leave_surface(tables, hit, x.ng)
            for c in range(3):
                places[i, step, c] = start[c]
            for k in range(len(suns)):
                _, distance, wi = light_arriving(tables.lights[suns[k]], x.position)
                if dot(wi, x.ng) > f32(0):
                    passed = shadow_transmittance(tables, start, wi, distance, scratch)
                    lit[k, i, step] = luminance(passed) > f32(0)
            if not is_gathered(x.bsdf):
                break
            d = to_world(cosine_hemisphere(u1, u2), x.ng)
