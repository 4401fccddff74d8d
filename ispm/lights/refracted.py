"""The environment's light through clear solids: draws follow it, as paths do, and photons leave it to them.

A direction in which a place sees a pane or a glass leads on, by faces that light passes or that reflect all
of it, to where the environment is seen. That light is as even as the environment itself, so that a draw finds
it with far less noise and blur than photons have. But where glass shows something much brighter than what
lies straight behind it, as a ball in the sun does to its caustic, draws are too rare: that light comes by
photons. Both sides ask the same: of light that clear faces alone have let through, what it was where it came
from and in the direction in which it arrives.
"""

from __future__ import annotations

import math

import numpy as np

from ispm.accel.bands import is_dispersive
from ispm.accel.intersect import any_hit
from ispm.accel.medium import attenuated, medium, no_medium, spawn_ray
from ispm.accel.records import Ray
from ispm.accel.surface import LAYERS_MAX, closest_surface, leave_surface, surface
from ispm.accel.transmittance import let_through, passed_straight
from ispm.optics.bsdf import is_smooth, smooth_split, transmits
from ispm.optics.environment import environment_radiance
from ispm.optics.jit import jit
from ispm.optics.light import FAR
from ispm.optics.records import MATERIAL_BLEND, MATERIAL_MASK, MATERIAL_THIN, NO_HIT
from ispm.optics.vector import dot, scale, sub

f32, u32 = np.float32, np.uint32

FACES = 32  # of clear solids and sheets, up to which light that they let through is drawn
_BRIGHTER = f32(4)  # times what lies straight behind, up to which light through glass is drawn
_STRAIGHT = f32(1 - 1e-5)  # cosine of the angle between ways before and behind panes
_NONE = f32(0), f32(0), f32(0)


@jit
def surround_share(tables, start, d, scratch):
    """Return (share, until, is_refracted, is_bent) of the environment's light that comes to `start` along -d.

    share  RGB, of what lies in the direction d itself: what passes holes, blended surfaces and thin sheets,
           see `let_through`, or what clear solids refract here from elsewhere
    until  m to what stops it, or to the first solid; infinite: neither is known
    """
    ray = Ray(start, d, FAR)
    if not any_hit(tables.trees, ray, scratch.stack):
        return (f32(1), f32(1), f32(1)), f32(np.inf), False, False
    return stopped_share(tables, ray, scratch)


@jit
def stopped_share(tables, ray, scratch):
    """Return likewise what comes along a Ray that something stops."""
    share, d = let_through(tables, ray, True, scratch), ray.direction
    if not tables.clear or share[0] + share[1] + share[2] > f32(0):
        return share, f32(np.inf), False, False
    share, until, refracted, away = _followed(tables, ray.origin, d, scratch)
    if not refracted or share[0] + share[1] + share[2] <= f32(0):
        return _NONE, until, False, False
    more = brightening(tables.environment, d, away)
    share = more[0] * share[0], more[1] * share[1], more[2] * share[2]
    return share, until, True, dot(d, away) < _STRAIGHT


@jit
def brightening(environment, d, away):
    """Return, RGB, times what light an environment has in the direction `away` of what it has in d; black
    where that is too much to be drawn."""
    ahead, there = environment_radiance(environment, d), environment_radiance(environment, away)
    for c in range(3):
        if there[c] > _BRIGHTER * ahead[c]:
            return _NONE
    return (
        there[0] / max(ahead[0], f32(1e-30)),
        there[1] / max(ahead[1], f32(1e-30)),
        there[2] / max(ahead[2], f32(1e-30)),
    )


@jit
def is_drawn(environment, sent, d):
    """Return whether draws find the environment's light that was sent along `sent` and arrives along d, both
    unit, by clear faces alone."""
    more = brightening(environment, scale(f32(-1), d), scale(f32(-1), sent))
    return more[0] + more[1] + more[2] > f32(0)


@jit
def goes_through(x, d, wi):
    """Return whether light along d that a smooth event at a SurfacePoint's face sends along wi passes it, or
    is reflected there in total, and the face is clear."""
    if not is_clear(x) or dot(wi, x.ng) < f32(0):
        return is_clear(x)
    _, _, _, _, through = smooth_split(x.bsdf, x.n, x.ng, scale(f32(-1), d))
    return not through


@jit
def is_clear(x):
    """Return whether light of any color passes a SurfacePoint's face in one direction, and all of it does."""
    has_holes = x.flags & u32(MATERIAL_MASK | MATERIAL_BLEND) != u32(0)
    return transmits(x.bsdf) and is_smooth(x.bsdf) and not (has_holes or is_dispersive(x))


@jit
def _followed(tables, start, d, scratch):
    """Follow light back from `start` along d through clear solids: return its share, RGB, the distance to
    what stops it or to the first solid, m, whether it leaves the scene, and in which direction.

    Radiance grows by the square of the index where light enters a solid (Veach 1997, section 5.2)."""
    share, way, until, inside, is_first = (f32(1), f32(1), f32(1)), d, f32(0), no_medium(), True
    faces = 0
    entered = start  # what is between faces of solids: sheets and holes within do not end it
    for _ in range(FACES + LAYERS_MAX):
        found, hit = closest_surface(tables, start, way, f32(0), scratch)
        if not found:
            return share, until, True, way
        x = surface(tables, hit, way)
        if is_first:
            segment = sub(x.position, start)
            until += f32(math.sqrt(dot(segment, segment)))
        if not is_clear(x):
            passed = passed_straight(tables, hit, way)
            if passed[0] + passed[1] + passed[2] <= f32(0):
                return _NONE, until, False, way
            share = share[0] * passed[0], share[1] * passed[1], share[2] * passed[2]
            start = leave_surface(tables, hit, scale(f32(-1), x.ng))
            continue
        faces += 1
        if faces > FACES:
            break
        mirrored, passed, above, beyond, through = smooth_split(x.bsdf, x.n, x.ng, scale(f32(-1), way))
        if not through:
            passed, beyond = mirrored, above
        if x.flags & u32(MATERIAL_THIN) == u32(0):
            is_first, inside = False, medium(inside, x)
            if inside.instance != u32(NO_HIT):
                share = attenuated(tables, inside, entered, x.position, share)
            if through:
                passed = scale(f32(1) / (x.bsdf.eta * x.bsdf.eta), passed)
            entered = x.position
        share = share[0] * passed[0], share[1] * passed[1], share[2] * passed[2]
        start, inside = spawn_ray(tables, x, inside, beyond)
        way = beyond
    return _NONE, until, False, way
