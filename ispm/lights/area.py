"""Light that comes to a point from lamps with a surface and from the environment: from points drawn there."""

from __future__ import annotations

import math

import numpy as np

from ispm.accel.emitters import (
    draw_emitter,
    emitter_chance,
    emitter_point,
    emitter_row,
    sample_triangle,
    triangle_pdf,
)
from ispm.accel.records import Hit
from ispm.accel.surface import emitted_radiance
from ispm.optics.bsdf import transmits
from ispm.optics.environment import sample_environment
from ispm.optics.jit import jit
from ispm.optics.rng import random4
from ispm.optics.vector import dot, scale, sub, vec3

f32, i64, u32 = np.float32, np.int64, np.uint32

_CODES = f32(2.0**24)  # of a random number, and of a barycentric


@jit
def area_numbers(hit, u):
    """Return four float32 random numbers of [0, 1), made of another one and of the Hit that they are for."""
    place = hit.primitive ^ u32(hit.instance * u32(0x9E3779B1))
    return random4(u32(u * _CODES), place, u32(hit.u * _CODES), u32(hit.v * _CODES))


@jit
def sample_lamps(tables, x, u0, u1, u2):
    """Draw a point of a lamp with a surface for a SurfacePoint.

    u0, u1, u2  random in [0, 1)
    ->  (radiance, cd/m2 RGB, distance, m, wi, pdf, 1/sr, row and point, m, of the emitter); pdf 0: none
    """
    none, position = (f32(0), f32(0), f32(0)), x.position
    row, chance, _ = draw_emitter(tables.emitters, position, lit_side(x), u0)
    if row < i64(0):
        return none, f32(0), none, f32(0), row, none
    emitter = tables.emitters.triangles[row]
    u, v, pdf = sample_triangle(emitter, position, u1, u2)
    point = emitter_point(emitter, u, v)
    segment = sub(point, position)
    distance = f32(math.sqrt(dot(segment, segment)))
    if distance == f32(0) or not _faces(emitter, segment):
        return none, f32(0), none, f32(0), row, none
    wi = scale(f32(1) / distance, segment)
    radiance = emitted_radiance(tables, Hit(emitter.instance, emitter.primitive, u, v))
    return radiance, distance, wi, chance * pdf, row, point


@jit
def sample_surround(tables, x, u1, u2):
    """Draw a direction of the environment for a SurfacePoint; u1, u2: random in [0, 1).

    ->  (radiance, cd/m2 RGB, wi, pdf, 1/sr); pdf 0: nothing comes from there
    """
    wi, radiance, pdf = sample_environment(tables.environment, u1, u2)
    if dot(lit_side(x), wi) < f32(0):
        pdf = f32(0)
    return radiance, wi, pdf


@jit
def lamp_pdf(tables, position, side, hit, d):
    """Return the density, 1/sr, with which `sample_lamps` draws a Hit's point, which is met along d, for a
    SurfacePoint at `position`, m, whose `lit_side` is `side`; 0: it does not."""
    row = emitter_row(tables.emitters, hit.instance, hit.primitive)
    if row < i64(0):
        return f32(0)
    emitter = tables.emitters.triangles[row]
    if not _faces(emitter, d):
        return f32(0)
    chance = emitter_chance(tables.emitters, row, position, side)
    return chance * triangle_pdf(emitter, position, hit.u, hit.v)


@jit
def lamp_irradiance(emitter, point, position):
    """Return what an EMITTER's lamp would bring to a position if it shone as this point of it does, lx RGB on
    a surface that faces it: what `is_bright` asks of a path, which knows one point of the lamp.

    A lamp of the area A and radiance L, L A cos / (d2 + A / pi): at most pi L, as from all around.
    """
    segment = sub(position, point)
    square = max(dot(segment, segment), f32(1e-30))
    cosine = abs(dot(segment, vec3(emitter.normal))) / f32(math.sqrt(square))
    power = emitter.lamp * cosine / (square + emitter.lamp * f32(1 / math.pi))
    return scale(power, vec3(emitter.radiance))


@jit
def lit_side(x):
    """Return the normal of the side of a SurfacePoint that light comes to; zeros: it comes to both."""
    return (f32(0), f32(0), f32(0)) if transmits(x.bsdf) else x.ng


@jit
def _faces(emitter, d):
    """Whether an EMITTER shines back along d."""
    return emitter.two_sided != u32(0) or dot(d, vec3(emitter.normal)) < f32(0)
