"""The rays of a walk, for a race on the very same."""

from __future__ import annotations

import numpy as np

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.medium import attenuated, medium, no_medium, spawn_ray
from ispm.accel.records import Hit, Scratch
from ispm.accel.surface import SurfaceTable, closest_surface, scene_tables, surface
from ispm.accel.world import World
from ispm.kernels.simd import alloca
from ispm.lights.emitted import first_segment
from ispm.lights.openings import NO_WAYS
from ispm.optics.bsdf import is_smooth
from ispm.optics.jit import jit
from ispm.optics.records import NO_HIT
from ispm.optics.vector import scale
from ispm.photons.scatter import SPECULAR_MAX, Event, flight_number, next_flight
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32


def rays_of_walk(
    packed: Packed, world: World, surfaces: SurfaceTable, emitted: np.ndarray, bounces: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return origins and directions, (N, 3) float32, of the rays that `walk` of pass 0 traces, in its order.

    emitted  (N,) EMITTED
    """
    rays = np.empty((len(emitted) * (max(bounces, 1) + SPECULAR_MAX), 2, 3), np.float32)
    count = _record(scene_tables(packed, world, surfaces), emitted, i64(bounces), u32(seed), rays)
    return np.ascontiguousarray(rays[:count, 0]), np.ascontiguousarray(rays[:count, 1])


@jit
def _record(tables, emitted, bounces, seed, rays):
    """Walk each EMITTED photon as `walk` does, and write the (N, 2, 3) float32 origins and directions of its
    rays instead of what they hit; return how many rays."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    count = i64(0)
    for i in range(len(emitted)):
        photon = emitted[i]
        if photon.instance == u32(NO_HIT):
            continue
        hit = Hit(photon.instance, photon.primitive, photon.u, photon.v)
        origin, d, within = first_segment(tables, photon)
        flux = scale(within, (photon.flux[0], photon.flux[1], photon.flux[2]))
        inside = no_medium()
        scatters, speculars = i64(0), i64(0)
        while count < len(rays):
            x = surface(tables, hit, d)
            inside = medium(inside, x)
            if inside.instance != u32(NO_HIT):
                flux = attenuated(tables, inside, origin, x.position, flux)
            if scatters == bounces and not is_smooth(x.bsdf):
                break
            event = Event(photon.key, scatters, speculars, u32(0), seed)
            alive, wi, scattered, specular, _ = next_flight(event, x, d, flux, NO_WAYS)
            if not alive or (scatters == bounces and not specular):
                break
            flux, d, origin = scattered, wi, x.position
            u = flight_number(event)
            speculars += i64(specular)
            scatters += i64(not specular)
            start, inside = spawn_ray(tables, x, inside, d)
            for axis in range(3):
                rays[count, 0, axis] = start[axis]
                rays[count, 1, axis] = d[axis]
            count += 1
            found, hit = closest_surface(tables, start, d, u, scratch)
            if not found:
                break
    return count
