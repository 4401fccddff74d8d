"""How photons scatter at surfaces: the BSDF sampled, or a direction to an opening, with roulette."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ispm.accel.layers import drawn_layer, has_sheen, is_coated
from ispm.optics.bsdf import eval_bsdf, has_finite, smooth_split, transmits
from ispm.optics.bsdf_sampling import pdf_bsdf, sample_bsdf
from ispm.optics.jit import jit
from ispm.optics.records import MATERIAL_UNLIT
from ispm.optics.rng import random4
from ispm.optics.vector import dot, luminance, scale
from ispm.photons.guided import draw_to_opening, guided_share, to_opening_pdf

f32, u32 = np.float32, np.uint32


ROULETTE_AFTER = 4  # scatters; living photons lower the error more than they cost before that
BY_COAT, BY_SHEEN, BY_BASE = range(3)  # layers
SPECULAR_MAX = 8  # events at smooth surfaces without roulette
_NEXT_TO_NOTHING = 1e-3  # share of the flux that an event keeps, below which roulette does not wait
_LARGEST = f32(1 - 2.0**-24)  # below 1
_SPECULAR_SURVIVAL = 0.9  # chance at each later one: ends paths between lossless surfaces without fireflies


class Event(NamedTuple):
    """Which random numbers a photon's next event takes: by its key and the events that it has met before."""

    key: np.uint32
    scatters: np.int64
    speculars: np.int64
    pass_index: np.uint32
    seed: np.uint32


@jit
def next_flight(event, x, d, flux, ways):
    """Sample where a photon of `flux`, lm, that meets the SurfacePoint x along d goes next, with roulette.

    ways  in for light, to which photons are sent from outside, see `photons.guided`
    -> whether it lives on, wi, its flux in lm afterwards, whether the surface was smooth, and, if so, the
    chance of all that
    """
    u0, u1, u2, u3 = random4(
        event.key, u32(2 * (event.scatters + event.speculars)), event.pass_index, event.seed
    )
    alive, wi, scattered, specular, chance = scatter(x, d, flux, u0, u1, u2)
    survival, is_sent = f32(1), False
    share = guided_share(ways, x)
    if share > f32(0) and _spreads(x, d, u2):
        v0, v1, v2, _ = random4(*_numbers_of_flight(event))
        is_sent = v0 < share
        if is_sent:
            wi, specular = draw_to_opening(ways, x, min(v0 / share, _LARGEST), v1, v2), False
        if specular:
            scattered = scale(f32(1) / (f32(1) - share), scattered)
        elif is_sent or alive:
            scattered = _scattered_toward(ways, x, d, flux, wi, u2, share)
            alive = _sum(scattered) > f32(0)
    if alive and not is_sent:
        kept = min(f32(1), _sum(scattered) / _sum(flux))
        # Black surfaces keep 1e-9 and less: after some of them a flux would underflow.
        if kept < f32(_NEXT_TO_NOTHING) or (not specular and event.scatters >= ROULETTE_AFTER):
            survival = kept
        elif specular and event.speculars >= SPECULAR_MAX:
            survival = f32(_SPECULAR_SURVIVAL)
    if survival < f32(1):
        alive = u3 < survival
        scattered = scale(f32(1) / survival, scattered)
    return alive, wi, scattered, specular, survival * chance


@jit
def layer_left(event, x):
    """Return by which layer of the SurfacePoint a photon goes where `next_flight` says: BY_COAT, BY_SHEEN or
    BY_BASE, see `drawn_layer`."""
    if not (is_coated(x) or has_sheen(x)):
        return BY_BASE
    _, _, u2, _ = random4(
        event.key, u32(2 * (event.scatters + event.speculars)), event.pass_index, event.seed
    )
    hidden = f32(1) - x.coat.shown
    if u2 < hidden:
        return BY_COAT
    return BY_SHEEN if has_sheen(x) and (u2 - hidden) / x.coat.shown < f32(1) - x.sheen.shown else BY_BASE


@jit
def flight_number(event):
    """Return the float32 random number in [0, 1) for holes that the flight after an Event meets."""
    _, _, _, u3 = random4(*_numbers_of_flight(event))
    return u3


@jit
def _numbers_of_flight(event):
    """Which four random numbers the flight after an Event takes: of where it is sent three, of holes one."""
    return event.key, u32(2 * (event.scatters + event.speculars) + 1), event.pass_index, event.seed


@jit
def scatter(x, d, flux, u0, u1, u2):
    """Sample where a photon of `flux`, lm, goes next, by three random numbers in [0, 1); the rest as of
    `next_flight`, but without roulette."""
    wo = scale(f32(-1), d)
    if x.flags & u32(MATERIAL_UNLIT):
        return False, wo, flux, False, f32(1)
    layer, wo, u2, chance = drawn_layer(x, wo, u2)
    n, ng = layer.n, layer.ng
    alive, wi, weight, specular = sample_bsdf(layer.bsdf, n, ng, wo, u0, u1, u2, False)
    if not alive:
        return False, wo, flux, False, f32(1)
    drawn = chance
    if specular:  # its weight is what the surface reflects or transmits, over the chance
        reflectance, transmittance, _, _, _ = smooth_split(layer.bsdf, n, ng, wo)
        whole = reflectance if dot(wi, ng) > f32(0) else transmittance
        drawn *= luminance(whole) / luminance(weight)
    weight = scale(adjoint_factor(dot(wo, n), dot(wo, ng), dot(wi, n), dot(wi, ng)) / chance, weight)
    scattered = (weight[0] * flux[0], weight[1] * flux[1], weight[2] * flux[2])
    return _sum(scattered) > f32(0), wi, scattered, specular, drawn


@jit
def _spreads(x, d, u2):
    """Whether the layer of a SurfacePoint that u2 draws for a photon that came along d scatters light to all
    sides of it."""
    layer, _, _, _ = drawn_layer(x, scale(f32(-1), d), u2)
    return not x.flags & u32(MATERIAL_UNLIT) and has_finite(layer.bsdf) and not transmits(layer.bsdf)


@jit
def _scattered_toward(ways, x, d, flux, wi, u2, share):
    """What a photon of `flux`, lm, that came along d carries along wi, if a `share` of its like are sent to
    openings, and the others go by the layer that u2 draws; black where nothing goes."""
    layer, wo, _, chance = drawn_layer(x, scale(f32(-1), d), u2)
    b, n, ng = layer.bsdf, layer.n, layer.ng
    pdf = (f32(1) - share) * pdf_bsdf(b, n, wo, wi) + share * to_opening_pdf(ways, x, wi)
    f = eval_bsdf(b, n, ng, wo, wi)
    weight = adjoint_factor(dot(wo, n), dot(wo, ng), dot(wi, n), dot(wi, ng))
    weight *= abs(dot(n, wi)) / max(chance * pdf, f32(1e-30))
    return weight * f[0] * flux[0], weight * f[1] * flux[1], weight * f[2] * flux[2]


@jit
def _sum(flux):
    """Sum of the channels, lm."""
    return flux[0] + flux[1] + flux[2]


@jit
def adjoint_factor(in_ns, in_ng, out_ns, out_ng):
    """Return by what shading normals multiply the flux of a photon that scatters, float32, [0.1, 10].

    in_*   cosines of the direction towards where it came from with the shading and geometric normal
    out_*  and of the direction it goes
    Source: Veach 1997, section 5.3.
    """
    factor = abs(in_ns * out_ng) / max(abs(in_ng * out_ns), f32(1e-20))
    return min(max(factor, f32(0.1)), f32(10))
