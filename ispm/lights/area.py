"""Light that comes to a point from lamps with a surface and from the environment: from points drawn there."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.accel.emitter_tree import NO_LOBE, draw_emitter, emitter_chance
from ispm.accel.emitters import (
    emitter_hit,
    emitter_point,
    emitter_row,
    in_front_of,
    sample_triangle,
    triangle_pdf,
)
from ispm.accel.glow import emitted_radiance
from ispm.optics.bsdf import eval_bsdf, transmits
from ispm.optics.bsdf_sampling import pdf_bsdf, sample_bsdf
from ispm.optics.environment import environment_light, sample_environment, sample_suns
from ispm.optics.jit import jit
from ispm.optics.rng import random4
from ispm.optics.sampling import LATTICE, cosine_hemisphere, to_world
from ispm.optics.vector import Vector, dot, luminance, scale, sub, vec3

f32, i64, u32 = np.float32, np.int64, np.uint32

_CODES = f32(2.0**24)  # of a random number
_LEAST_LIGHT = f32(1e-30)  # cd/m2, whose inverse a float32 still holds
PAIRS = 2  # of directions that one of the environment is drawn from
PAIRS_OF_MANY = 4  # likewise, of what rough metal or sheen reflects
_FINE = 4096  # parts of a random number's range, each of which has enough numbers of its own


@jit
def area_numbers(hit, u):
    """Return four float32 random numbers of [0, 1), made of another one, of 24 bits, and of the triangle of a
    Hit that they are for: not of where that is in it, which machines round otherwise."""
    return random4(u32(u * _CODES), hit.primitive, hit.instance, u32(0))


@jit
def sample_lamps(tables, x, u0, u1, u2, lobe=NO_LOBE):
    """Draw a point of a lamp with a surface for a SurfacePoint.

    u0, u1, u2  random in [0, 1)
    lobe        by which the lamp is drawn, too
    ->  (radiance, cd/m2 RGB, distance, m, wi, pdf, 1/sr; its row, chance, where a shadow ray to it ends, m);
        pdf 0 if none
    """
    none, position = (f32(0), f32(0), f32(0)), x.position
    row, chance, _ = draw_emitter(tables.emitters, position, lit_side(x), lobe, u0)
    if row < i64(0):
        return none, f32(0), none, f32(0), row, chance, none
    emitter = tables.emitters.triangles[row]
    u, v, pdf = sample_triangle(emitter, position, u1, u2)
    segment = sub(emitter_point(emitter, u, v), position)
    distance = f32(math.sqrt(dot(segment, segment)))
    if distance == f32(0) or not faces(emitter, segment):
        return none, f32(0), none, f32(0), row, chance, none
    wi = scale(f32(1) / distance, segment)
    radiance = emitted_radiance(tables, emitter_hit(emitter, u, v), wi)
    end = in_front_of(tables.trees, emitter, u, v, wi)
    return radiance, distance, wi, chance * pdf, row, chance, end


class Surround(NamedTuple):
    """A direction of the environment, drawn for a SurfacePoint by what it makes of its light.

    radiance  cd/m2 RGB from there over the density of the draw; black: nothing comes
    wi        unit
    pdf       1/sr, of the environment's own draw
    total     of what all candidates make of their light, over their densities, cd/m2
    pick      random in [0, 1), for the next candidate
    """

    radiance: Vector
    wi: Vector
    pdf: np.float32
    total: np.float32
    pick: np.float32


@jit
def resample_surround(tables, x, wo, u1, u2, pick, pairs, brightest, by_lobes, of_many=False):
    """Draw directions of the environment for a SurfacePoint by what it makes of their light along wo, out of
    some that are drawn by the environment and as many by the surface; where no part of it is as bright as a
    sun, the first of the latter, which does not tell of light that comes through the surface.

    u1, u2, pick  random in [0, 1);  pairs  of candidates
    by_lobes      whether the surface draws by all its lobes; else by the cosine alone
    of_many       whether it is drawn out of candidates even where no part is as bright as a sun
    brightest     luminance, cd/m2, above which directions have a draw of their own, so that the shadow of a
                  sun holds the light of the sky
    ->  two Surrounds, of the darker directions and of the brighter, which the environment draws by themselves
        where they bring much; both together are the light of all
    Source: Talbot, Cline and Egbert, Importance Resampling for Global Illumination, EGSR 2005; candidates'
    densities are those of both draws together (Veach 1997, section 9.2.2).
    """
    rate_1, rate_2 = LATTICE
    none = f32(0), f32(0), f32(0)
    if not of_many and _one_draw_does(tables, x):
        wi = _drawn_by_surface(x, wo, u1, u2, by_lobes)
        radiance, own = environment_light(tables.environment, wi)
        pdf = _surface_pdf(x, wo, wi, by_lobes)
        if pdf <= f32(0):
            radiance, pdf = none, f32(1)
        light = scale(f32(1) / pdf, radiance)
        return Surround(light, wi, own, f32(1), pick), Surround(none, wi, own, f32(0), pick)
    dark = bright = Surround(none, wo, f32(1), f32(0), pick)
    sunny = len(tables.environment.sunlight) > 0 and brightest != f32(np.inf)
    for k in range((3 if sunny else 2) * pairs):
        a, b = u1 + f32(k) * f32(rate_1), u2 + f32(k) * f32(rate_2)
        a, b = a - f32(math.floor(a)), b - f32(math.floor(b))
        of_suns = k >= 2 * pairs
        if of_suns:
            wi, radiance, own = sample_suns(tables.environment, a, b)
        elif k & 1:
            wi = _drawn_by_surface(x, wo, a, b, by_lobes)
            radiance, own = environment_light(tables.environment, wi)
        else:
            wi, radiance, own = sample_environment(tables.environment, a, b)
        is_sun, density = luminance(radiance) > brightest, own
        if sunny and is_sun != of_suns and (of_suns or not k & 1):
            continue  # what the other draw finds
        if sunny and is_sun:
            density /= tables.environment.sun_share
        pdf = candidate_pdf(tables, x, wo, wi, density, by_lobes, of_many)
        f = eval_bsdf(x.bsdf, x.n, x.ng, wo, wi)
        light = abs(dot(x.n, wi)) * (f[0] * radiance[0] + f[1] * radiance[1] + f[2] * radiance[2])
        if pdf <= f32(0) or light <= _LEAST_LIGHT:
            continue
        if is_sun:
            bright = _offered(bright, radiance, wi, own, light, pdf)
        else:
            dark = _offered(dark, radiance, wi, own, light, pdf)
    return _mean(dark, pairs), _mean(bright, pairs)


@jit
def candidate_pdf(tables, x, wo, wi, own, by_lobes, of_many=False):
    """Return the density, 1/sr, of a direction among the candidates of `resample_surround` of its kind.

    own  density of the environment's own draw of that kind, 1/sr
    """
    by_surface = _surface_pdf(x, wo, wi, by_lobes)
    return by_surface if not of_many and _one_draw_does(tables, x) else f32(0.5) * (own + by_surface)


@jit
def _one_draw_does(tables, x):
    """Whether a SurfacePoint draws the environment's light well enough by itself."""
    return tables.environment.brightest == f32(np.inf) and not transmits(x.bsdf)


@jit
def _drawn_by_surface(x, wo, u1, u2, by_lobes):
    """A direction, unit, that a SurfacePoint draws for light along wo; u1, u2: random in [0, 1)."""
    if not by_lobes:
        return to_world(cosine_hemisphere(u1, u2), x.n)
    fine = u1 * f32(_FINE)  # digits of it that do not tell where on a lobe
    _, wi, _, _ = sample_bsdf(x.bsdf, x.n, x.ng, wo, u1, u2, fine - f32(math.floor(fine)), True)
    return wi


@jit
def _surface_pdf(x, wo, wi, by_lobes):
    """The density of `_drawn_by_surface`, 1/sr."""
    if by_lobes:
        return pdf_bsdf(x.bsdf, x.n, wo, wi)
    return max(dot(x.n, wi), f32(0)) * f32(1 / math.pi)


@jit
def _offered(drawn, radiance, wi, own, light, pdf):
    """A Surround after another candidate: its radiance, RGB, wi and the environment's density of it, the
    light that the point makes of it, and the density that it was drawn with."""
    value = light / pdf
    total = drawn.total + value
    if drawn.pick * total < value:
        return Surround(scale(f32(1) / light, radiance), wi, own, total, drawn.pick * total / value)
    pick = (drawn.pick * total - value) / drawn.total
    return Surround(drawn.radiance, drawn.wi, drawn.pdf, total, pick)


@jit
def _mean(drawn, pairs):
    """A Surround after so many pairs of candidates."""
    radiance = scale(drawn.total / f32(2 * pairs), drawn.radiance)
    return Surround(radiance, drawn.wi, drawn.pdf, drawn.total, drawn.pick)


@jit
def lamp_pdf(tables, position, side, hit, d, lobe):
    """Return the density, 1/sr, with which `sample_lamps` draws a Hit's point, which is met along d, for a
    SurfacePoint at `position`, m, whose `lit_side` is `side`; 0: it does not. lobe: by which it is drawn once
    more, if any: the sum of both."""
    row, u, v = emitter_row(tables.emitters, hit)
    if row < i64(0):
        return f32(0)
    emitter = tables.emitters.triangles[row]
    if not faces(emitter, d):
        return f32(0)
    chance = emitter_chance(tables.emitters, row, position, side, NO_LOBE)
    if lobe.square > f32(0):
        chance += emitter_chance(tables.emitters, row, position, side, lobe)
    return chance * triangle_pdf(emitter, position, u, v)


@jit
def lamp_irradiance(emitter, point, position):
    """Return what an EMITTER's lamp would bring to a position if it shone from this point of it, lx RGB on a
    surface that faces it: what `is_bright` asks of a path, which knows one point of the lamp.

    A lamp of the area A and radiance L, L A cos / (d2 + A / pi): at most pi L, as from all around.
    """
    segment = sub(position, point)
    square = max(dot(segment, segment), f32(1e-30))
    cosine = abs(dot(segment, vec3(emitter.normal))) / f32(math.sqrt(square))
    power = emitter.lamp * cosine / (square + emitter.lamp * f32(1 / math.pi))
    return scale(power, vec3(emitter.mean))


@jit
def lit_side(x):
    """Return the normal of the side of a SurfacePoint that light comes to; zeros: it comes to both."""
    return (f32(0), f32(0), f32(0)) if transmits(x.bsdf) else x.ng


@jit
def faces(emitter, d):
    """Return whether an EMITTER shines back along d."""
    return emitter.two_sided != u32(0) or dot(d, vec3(emitter.normal)) < f32(0)
