"""Samples of the direct light of lamps with a surface and of the environment: what a draw adds to a pixel."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.accel.intersect import any_distance
from ispm.accel.layers import without_diffuse
from ispm.accel.records import Ray
from ispm.accel.transmittance import BEFORE, ray_between, shadow_transmittance
from ispm.lights.nee import BY_FACETS, drawn_share, greatest, side_of
from ispm.lights.refracted import stopped_share
from ispm.optics.bsdf import NARROW_ALPHA, eval_bsdf, fresnel_weight, is_lambert, is_narrow, transmits
from ispm.optics.coat import with_diffuse
from ispm.optics.facets import facet_lobe
from ispm.optics.jit import jit
from ispm.optics.light import FAR
from ispm.optics.vector import Vector, add, dot, normalize, scale, sub
from ispm.stages.pixels import lift

f32 = np.float32

_BLUR = f32(0.25)  # of a penumbra's width, that the filter blurs it over to each side at most
# Of a lobe's alpha, that view and light together turn by over the filter's reach. Squares of 5 x 5 pixels at
# strides of 4 and 12, whole from a reach of 36 on, have a standard deviation of 10.4: 2 % off GGX's peak.
_LOBE_BLUR = f32(0.5)
_MUCH = f32(1 / 8)  # of the Lambert lobe's albedo
_WHITE = f32(1), f32(1), f32(1)


class Lobes(NamedTuple):
    """The lobes of n pixels beside Lambert's, float32, 0 where there is none.

    alpha    (n,) roughness^2
    f0, f90  (3, n) and (n,) reflectance of facets along their normal and at grazing incidence
    """

    alpha: np.ndarray
    f0: np.ndarray
    f90: np.ndarray


class Samples(NamedTuple):
    """What shadow rays found, float32, a row for each channel.

    diffuse         (3, n) light of the Lambert lobe over its albedo, cd/m2
    gloss           (6, n) of the others, which is the first three times f0 and the last times f90: alike in
                    pixels whose textures differ
    drawn           (3, n) what `diffuse` would be without shadows and reflection above it
    known           (3, n) likewise, exact: the environment's, and that of lamps where `are_known`
    lamps           (3, n) likewise, of other lamps, in the mean; (3, 0) where there are none
    near            (n,) or (0,) pixels over which that may be averaged, infinite where they bring nothing
    reach           (n,) pixels to each side that the filter may take in: of the penumbra's width, infinite
                    where none shades a Lambert surface
    angle           (n,) radians, 1 at most, that the light fills of which that penumbra is
    shine           (n,) likewise for `gloss` alone: of the lobe's width, infinite where there is none
    """

    diffuse: np.ndarray
    gloss: np.ndarray
    drawn: np.ndarray
    known: np.ndarray
    lamps: np.ndarray
    near: np.ndarray
    reach: np.ndarray
    angle: np.ndarray
    shine: np.ndarray


class KindsOfSamples(NamedTuple):
    """Samples of each kind of light, without rows where a scene has none: apart, for the sharp shadows of one
    are not to narrow what another is filtered over.

    lamps  with a surface
    sky    the environment, but for `suns`
    suns   sunlight of the environment, see `EnvironmentTable`
    """

    lamps: Samples
    sky: Samples
    suns: Samples


class Arriving(NamedTuple):
    """Light of one point of a lamp, or from one direction: irradiance over the density of the draw, distance,
    m, wi, where a shadow ray to it ends, m, but for light from FAR, the density of its direction among all
    lamps' points or the environment, 1/sr, what density tells how wide its penumbra is: 1 over the solid
    angle that all of its kind fills; 0: it casts none; and the density with which a lobe draws it once more,
    see `drawn_lobe`."""

    irradiance: Vector
    distance: np.float32
    wi: Vector
    end: Vector
    pdf: np.float32
    density: np.float32
    by_lobe: np.float32


@jit
def has_wide_gloss(b):
    """Return whether a Bsdf has a wide lobe of facets that reflects much beside its Lambert lobe: rough
    metal, in part too, or what is dark."""
    is_wide = b.alpha >= NARROW_ALPHA and b.f90 > f32(0) and not transmits(b)
    return is_wide and greatest(b.f0) >= _MUCH * greatest(b.diffuse)


@jit
def add_light(tables, shown, arriving, i, scratch, samples):
    """Add what row i makes of an Arriving to the Samples, and return what of that is `drawn`."""
    x, wo, wi = shown.x, shown.wo, arriving.wi
    b, along = x.bsdf, abs(dot(x.n, wi))
    none = f32(0), f32(0), f32(0)
    if greatest(arriving.irradiance) <= f32(0):
        return none
    # over its albedo, of which channels may be 0: neighbors ask how much of the light passes in each
    f = eval_bsdf(with_diffuse(b, _WHITE), x.n, x.ng, wo, wi)
    gloss, share = none, f32(0)
    if not is_lambert(b):
        gloss = eval_bsdf(without_diffuse(b), x.n, x.ng, wo, wi)
        f = sub(f, gloss)
        share = _gloss_share(shown, arriving, arriving.pdf)
        gloss = scale(share, gloss)
    if not (is_lambert(b) or greatest(b.diffuse) > f32(0) or greatest(gloss) > f32(0)):
        return none
    lights = greatest(f) > f32(0) or greatest(gloss) > f32(0)
    shades_itself = not lights and dot(x.ng, wi) <= f32(0)
    brought = none
    if dot(x.n, wi) > f32(0) and (lights or shades_itself):
        brought = scale(f32(1 / math.pi), scale(along, arriving.irradiance))
        for c in range(3):
            samples.drawn[c, i] += brought[c]
    if not lights:
        return brought
    passed, is_refracted = _passed(tables, shown, arriving, i, scratch, samples)
    for c in range(3):
        samples.diffuse[c, i] += along * arriving.irradiance[c] * passed[c] * f[c]
    # behind clear solids paths by a lobe count in full
    if greatest(gloss) > f32(0) and not (is_refracted and (is_narrow(b) or transmits(b))):
        _add_gloss(shown, arriving, scale(share, passed), i, samples)
    return brought


@jit
def add_light_of_lobe(tables, shown, arriving, i, scratch, samples):
    """Add what the lobe of row i makes of an Arriving that it drew itself, see `drawn_lobe`."""
    x, wi = shown.x, arriving.wi
    gloss = eval_bsdf(without_diffuse(x.bsdf), x.n, x.ng, shown.wo, wi)
    if greatest(arriving.irradiance) <= f32(0) or greatest(gloss) <= f32(0):
        return
    share = _gloss_share(shown, arriving, arriving.by_lobe)
    passed, _ = _passed(tables, shown, arriving, i, scratch, samples)
    _add_gloss(shown, arriving, scale(share, passed), i, samples)


@jit
def _gloss_share(shown, arriving, own):
    """The weight for the lobe, float32, of an Arriving that was drawn with the density `own`, 1/sr: beside
    both draws and the path that goes on by the lobe (balance heuristic, Veach 1997, section 9.2.2)."""
    x, wi, pdf = shown.x, arriving.wi, arriving.pdf
    if transmits(x.bsdf) and dot(x.n, wi) <= f32(0):
        return f32(0)  # eye paths find what glass lets through
    _, share = drawn_share(x, shown.wo, wi, pdf, BY_FACETS)
    if arriving.by_lobe == f32(0) or share == f32(0):
        return share
    return own * share / (pdf + arriving.by_lobe * share)


@jit
def _add_gloss(shown, arriving, share, i, samples):
    """Add to row i what its lobe makes of a share, RGB, of an Arriving."""
    x, wi = shown.x, arriving.wi
    samples.shine[i] = min(samples.shine[i], _lobe_reach(shown, arriving.distance))
    first, second = _gloss_terms(x.bsdf, x.n, shown.wo, wi)
    for c in range(3):
        light = abs(dot(x.n, wi)) * arriving.irradiance[c] * share[c]
        samples.gloss[c, i] += light * first
        samples.gloss[3 + c, i] += light * second


@jit
def _gloss_terms(b, n, wo, wi):
    """D V (1 - Fc) and D V Fc, of which a Bsdf's facets reflect f0 of the first and f90 of the second."""
    h = normalize(add(wo, wi))
    dv, fc = facet_lobe(b, n, wo, wi, h), fresnel_weight(b, dot(wo, h))
    return dv * (f32(1) - fc), dv * fc


@jit
def _lobe_reach(shown, distance):
    """Pixels to each side over which wo and the direction of light from so far, m, turn by little of the
    lobe's alpha together."""
    slant = max(abs(dot(shown.x.ng, shown.wo)), f32(1e-3))
    turn = shown.width * (f32(1) / shown.distance + f32(1) / (slant * distance))  # radians a pixel
    return _LOBE_BLUR * shown.x.bsdf.alpha / max(turn, f32(1e-30))


@jit
def _passed(tables, shown, arriving, i, scratch, samples):
    """What share of an Arriving, RGB, passes what is between, and whether clear solids refract it; the
    penumbra's width tells how far row i of the Samples reaches."""
    x, wi, none = shown.x, arriving.wi, (f32(0), f32(0), f32(0))
    up = lift(tables, shown)
    start = add(x.position, scale(up, side_of(x.ng, wi)))
    toward, distance = wi, arriving.distance
    if distance < FAR:
        toward, distance = ray_between(start, arriving.end)
    limit = distance * (f32(1) - BEFORE)
    met = any_distance(tables.trees, Ray(start, toward, limit), scratch.stack)
    if met >= limit:
        return (f32(1), f32(1), f32(1)), False
    passed, is_refracted = none, False
    if arriving.distance == FAR and tables.clear:
        passed, until, is_refracted, is_bent = stopped_share(tables, Ray(start, wi, limit), scratch)
        met = until if until < f32(np.inf) else met
        if is_refracted and not is_bent:
            return passed, True
    elif tables.porous:
        passed = shadow_transmittance(tables, start, toward, distance, scratch)
    is_itself = abs(dot(x.ng, wi)) * met <= up  # rays along a surface meet that by rounding alone
    if arriving.density > f32(0) and not is_itself:
        # of the lamp's image through a pinhole at what is between
        angle = f32(1) / f32(math.sqrt(arriving.density))
        width = angle * met / max(f32(1) - met / distance, f32(1e-6))
        reach = _BLUR * width / shown.width
        if reach < samples.reach[i]:
            samples.reach[i], samples.angle[i] = reach, min(angle, f32(1))
    return passed, is_refracted
