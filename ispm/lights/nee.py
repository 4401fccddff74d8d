"""Next-event estimation: light that comes to a point from the lights, its shadows found by rays."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.accel.emitter_tree import NO_LOBE, Lobe
from ispm.accel.layers import without_diffuse
from ispm.accel.surface import SurfacePoint, leave_surface
from ispm.accel.transmittance import ray_between, shadow_transmittance
from ispm.lights.area import (
    PAIRS,
    PAIRS_OF_MANY,
    area_numbers,
    lamp_irradiance,
    lamp_pdf,
    resample_surround,
    sample_lamps,
)
from ispm.lights.bright import is_bright
from ispm.lights.guided import guided_surround
from ispm.lights.refracted import surround_share
from ispm.optics.bsdf import (
    Bsdf,
    eval_bsdf,
    is_lambert,
    is_narrow,
    is_smooth,
    reflection_over_lambert,
    transmits,
)
from ispm.optics.bsdf_sampling import pdf_bsdf
from ispm.optics.environment import environment_pdf, has_environment
from ispm.optics.facets import is_anisotropic, visible_pdf
from ispm.optics.jit import jit
from ispm.optics.light import FAR, light_arriving, reaches
from ispm.optics.records import LIGHT_DIRECTIONAL
from ispm.optics.sampling import LATTICE
from ispm.optics.vector import Vector, add, dot, normalize, scale, sub

f32, i64, u32 = np.float32, np.int64, np.uint32

_NONE = f32(0), f32(0), f32(0)
_GOLDEN = 0.6180339887498949  # steps of which lie evenly in a line
_WHOLE = f32(1), f32(1)
# how a path goes on from where lights are drawn for
BY_NOTHING, BY_FACETS, BY_COAT, BY_GLASS, BY_BSDF = range(5)


@jit
def direct_light(tables, x, wo, u, scratch, limit, goes_on=BY_NOTHING):
    """Return the radiance along wo, (3,) cd/m2, of the finite lobes at a SurfacePoint, and the rays traced.

    u        random in [0, 1), for points of lamps with a surface and directions of the environment
    limit    lights whose first bounce here is bright are left out, see `is_bright`; infinite: none
    goes_on  see `area_light`
    """
    total, traced = punctual_light(tables, x, wo, scratch, limit)
    light, rays = area_light(tables, x, wo, u, scratch, limit, goes_on)
    return add(total, light), traced + rays


@jit
def punctual_light(tables, x, wo, scratch, limit):
    """Return what of `direct_light` comes from points and along directions."""
    total, traced = (f32(0), f32(0), f32(0)), i64(0)
    for k in range(len(tables.lights)):
        arriving = unshadowed(tables.lights[k], x, wo, limit)
        light, rays = shadowed(tables, x, arriving, scratch)
        total, traced = add(total, light), traced + rays
    return total, traced


@jit
def area_light(tables, x, wo, u, scratch, limit, goes_on, count=1, surround=True):
    """Return what of `direct_light` comes from lamps with a surface and from the environment: by so many
    points, and directions, of each.

    surround  whether the environment's is wanted
    goes_on  BY_NOTHING; BY_FACETS, BY_COAT, BY_GLASS or BY_BSDF: a path goes on by the narrow lobe of an
             opaque surface's facets, by a coat's lobe of any width, by one of rough glass's two lobes, or by
             `sample_bsdf`, and may meet the lamps too: their light in these lobes is weighed by the balance
             heuristic (Veach 1997, section 9.2.2), see `lamp_weight`. Unless by the last two, that in the
             facets of what transmits is left to paths
    """
    total, traced, share = (f32(0), f32(0), f32(0)), i64(0), f32(1) / f32(count)
    if len(tables.emitters.triangles) == 0 and not has_environment(tables.environment):
        return total, traced
    first = area_numbers(x.hit, u)
    for k in range(count):
        told = tables, x, wo, next_numbers(first, k), scratch, limit, goes_on, surround
        light, rays = drawn_area_light(*told)
        total, traced = add(total, scale(share, light)), traced + rays
    return total, traced


@jit
def drawn_area_light(tables, x, wo, numbers, scratch, limit, goes_on, surround, of_many=False):
    """Return what `area_light` does, by four random numbers of [0, 1) of one draw; of_many: see
    `resample_surround`."""
    total, traced = (f32(0), f32(0), f32(0)), i64(0)
    if len(tables.emitters.triangles) > 0:
        arriving = _unshadowed_lamp(tables, x, wo, numbers, limit, goes_on)
        total, traced = shadowed(tables, x, arriving, scratch)
    if has_environment(tables.environment) and surround:
        light, rays = _surround_light(tables, x, wo, numbers, goes_on, of_many, scratch)
        total, traced = add(total, light), traced + rays
    return total, traced


@jit
def next_numbers(numbers, k):
    """Return four random numbers of [0, 1), k steps along a lattice (Roberts 2018) from others."""
    (a, b, c, d), (rate_b, rate_c) = numbers, LATTICE
    return along(a, k, _GOLDEN), along(b, k, rate_b), along(c, k, rate_c), d


@jit
def along(number, k, rate):
    """Return the number of [0, 1) that is k steps of a rate along from another one."""
    moved = number + f32(k) * f32(rate)
    return moved - f32(math.floor(moved))


@jit
def lamp_weight(tables, position, side, pdf, hit, d, lobe=NO_LOBE):
    """Return the weight, float32, of emission at a Hit that a path meets along d, where its start also draws
    from lamps (balance heuristic, Veach 1997, section 9.2.2).

    position, side  of the start, m, and its `lit_side`
    pdf             1/sr, with which it drew d; 0: it goes on from the eye, a mirror or clear glass, which
                    draw none
    lobe            by which its start draws lamps once more, see `drawn_lobe`
    """
    if pdf == f32(0):
        return f32(1)
    return pdf / (pdf + lamp_pdf(tables, position, side, hit, d, lobe))


@jit
def drawn_lobe(b, n, wo):
    """Return the Lobe of a Bsdf by which pixels draw lamps once more: of opaque facets that are narrow, for
    of many lamps few shine where these reflect them."""
    if not is_narrow(b) or is_anisotropic(b):
        return NO_LOBE
    return Lobe(n, wo, b.alpha * b.alpha)


@jit
def surround_weight(tables, pdf, d):
    """Return likewise the weight of the environment's light where a path leaves the scene along d."""
    if pdf == f32(0):
        return f32(1)
    return pdf / (pdf + environment_pdf(tables.environment, d))


@jit
def light_from_one(tables, x, wo, u, pick, scratch, limit, openings):
    """Return an estimate of the radiance of `direct_light` by a ray to one light of each kind: of those along
    directions and of those from points, `pick`, of [0, 1), draws in proportion to the radiance that each
    makes without shadows; of emissive surfaces a point, of the environment a direction is drawn.

    Kinds have rays of their own, for a sun that does not shine in would take nearly all draws of a room.
    """
    total, nothing = _NONE, Arriving(_NONE, f32(0), wo, _NONE)
    suns = points = _Drawn(nothing, f32(1), f32(0), pick)
    for k in range(len(tables.lights)):
        arriving = unshadowed(tables.lights[k], x, wo, limit)
        if tables.lights[k].kind == u32(LIGHT_DIRECTIONAL):
            suns = _drawn(suns, arriving)
        else:
            points = _drawn(points, arriving)
    for drawn in (suns, points):
        if drawn.total > f32(0):
            light, _ = shadowed(tables, x, drawn.arriving, scratch)
            total = add(total, scale(drawn.total / drawn.value, light))
    if len(tables.emitters.triangles) > 0:
        arriving = _unshadowed_lamp(tables, x, wo, area_numbers(x.hit, u), limit, BY_NOTHING)
        light, _ = shadowed(tables, x, arriving, scratch)
        total = add(total, light)
    if has_environment(tables.environment):
        arriving = _guided_surround(tables, x, wo, area_numbers(x.hit, u), openings)
        share, _ = seen_surround(tables, x, arriving, scratch)
        total = add(total, times(arriving.radiance, share))
    return total


class Arriving(NamedTuple):
    """Light from one point of a light, shadows aside: radiance that it makes along wo, cd/m2 RGB, over the
    density with which the point was drawn; distance to it, m; wi; and where a shadow ray to it ends, m, but
    for light from FAR."""

    radiance: Vector
    distance: np.float32
    wi: Vector
    end: Vector


class _Drawn(NamedTuple):
    """One of several Arriving, its sum of channels, the sum of all, and a random number, uniform again."""

    arriving: Arriving
    value: np.float32
    total: np.float32
    pick: np.float32


@jit
def _drawn(drawn, arriving):
    """A _Drawn after another Arriving came, drawn in proportion to its radiance."""
    value = arriving.radiance[0] + arriving.radiance[1] + arriving.radiance[2]
    if value <= f32(0):
        return drawn
    total = drawn.total + value
    if drawn.pick * total < value:
        return _Drawn(arriving, value, total, drawn.pick * (total / value))
    return _Drawn(drawn.arriving, drawn.value, total, (drawn.pick * total - value) / (total - value))


@jit
def shadowed(tables, x, arriving, scratch):
    """Return what of an Arriving comes to a SurfacePoint, cd/m2 RGB, and the rays traced."""
    if greatest(arriving.radiance) <= f32(0):
        return (f32(0), f32(0), f32(0)), i64(0)
    start = leave_surface(tables, x.hit, side_of(x.ng, arriving.wi))
    wi, distance = arriving.wi, arriving.distance
    if distance < FAR:
        wi, distance = ray_between(start, arriving.end)
    passed = shadow_transmittance(tables, start, wi, distance, scratch)
    return times(arriving.radiance, passed), i64(1)


@jit
def seen_surround(tables, x, arriving, scratch):
    """Return the share of an Arriving from the environment, RGB, that comes to a SurfacePoint, and whether
    through clear solids, where no path by a lobe weighs what it finds; of none that is black."""
    if greatest(arriving.radiance) <= f32(0):
        return (f32(0), f32(0), f32(0)), False
    start = leave_surface(tables, x.hit, side_of(x.ng, arriving.wi))
    share, _, is_refracted, _ = surround_share(tables, start, arriving.wi, scratch)
    return share, is_refracted


@jit
def unshadowed(light, x, wo, limit):
    """Return the Arriving of a LIGHT at a SurfacePoint, seen along wo; black where its first bounce is
    bright, see `is_bright`."""
    if not reaches(light, x.position):
        return Arriving(_NONE, FAR, x.n, _NONE)
    irradiance, distance, wi = light_arriving(light, x.position)
    end = add(x.position, scale(distance, wi))
    return Arriving(_reflected(x, wo, irradiance, irradiance, wi, limit), distance, wi, end)


@jit
def _unshadowed_lamp(tables, x, wo, numbers, limit, goes_on):
    """The Arriving of a point of a lamp with a surface, drawn by four random numbers of [0, 1); goes_on: see
    `area_light`."""
    radiance, distance, wi, pdf, row, _, end = sample_lamps(tables, x, *numbers[:3])
    if pdf <= f32(0):
        return Arriving(_NONE, distance, wi, end)
    bright = radiance
    if limit != f32(np.inf):
        bright = lamp_irradiance(tables.emitters.triangles[row], end, x.position)
    share = drawn_share(x, wo, wi, pdf, goes_on)
    light = _reflected(left_to_draws(x, goes_on), wo, scale(f32(1) / pdf, radiance), bright, wi, limit, share)
    return Arriving(light, distance, wi, end)


@jit
def _surround_light(tables, x, wo, numbers, goes_on, of_many, scratch):
    """The environment's part of `drawn_area_light`; paths that go on by the whole BSDF find by themselves
    what clear solids refract."""
    arriving = _unshadowed_surround(tables, x, wo, numbers, goes_on, of_many)
    if goes_on == BY_BSDF:
        return shadowed(tables, x, arriving, scratch)
    share, is_refracted = seen_surround(tables, x, arriving, scratch)
    if is_refracted and (goes_on != BY_NOTHING or transmits(x.bsdf)):
        arriving = _unshadowed_surround(tables, x, wo, numbers, goes_on, of_many, True)
    return times(arriving.radiance, share), i64(1)


@jit
def _unshadowed_surround(tables, x, wo, numbers, goes_on, of_many, only_matte=False):
    """The Arriving of a direction of the environment, likewise; only_matte: without what paths by the lobes
    bring."""
    _, u1, u2, pick = numbers
    seen = left_to_draws(x, goes_on)
    by_lobes = goes_on == BY_NOTHING and draws_by_lobes(seen.bsdf)
    pairs = PAIRS_OF_MANY if of_many else PAIRS
    drawn, _ = resample_surround(tables, seen, wo, u1, u2, pick, pairs, f32(np.inf), by_lobes, of_many)
    share = (f32(1), f32(0)) if only_matte else drawn_share(x, wo, drawn.wi, drawn.pdf, goes_on)
    light = _reflected(seen, wo, drawn.radiance, _NONE, drawn.wi, f32(np.inf), share)
    return Arriving(light, FAR, drawn.wi, _NONE)


@jit
def _guided_surround(tables, x, wo, numbers, openings):
    """The Arriving of a direction of the environment, where openings are rare mostly one that sees these."""
    seen = left_to_draws(x, BY_NOTHING)
    by_lobes = draws_by_lobes(seen.bsdf)
    wi, radiance, _ = guided_surround(tables, seen, wo, numbers, openings, f32(np.inf), by_lobes)
    return Arriving(_reflected(seen, wo, radiance, _NONE, wi, f32(np.inf)), FAR, wi, _NONE)


@jit
def draws_by_lobes(b):
    """Return whether directions of the environment are drawn by a Bsdf's lobes: of narrow ones the cosine
    hardly ever finds any, and then with a great weight."""
    return not is_lambert(b) and not is_smooth(b) and not transmits(b)


@jit
def left_to_draws(x, goes_on):
    """Return a SurfacePoint with the lobes that light from drawn points is for, see `area_light`."""
    b = x.bsdf
    if goes_on in (BY_BSDF, BY_GLASS) or not transmits(b):
        return x
    f0, f90 = reflection_over_lambert(b)
    kept = f0, f90, _NONE, b.eta, b.thin, b.sheen, b.anisotropy
    b = Bsdf(b.diffuse, _NONE, f32(0), f32(0), *kept)
    return SurfacePoint(x.hit, x.position, x.ng, x.n, b, x.flags, x.entering, x.coat, x.sheen, x.translucence)


@jit
def drawn_share(x, wo, wi, pdf, goes_on):
    """Return the weights, float32, of light from a drawn point for the Lambert lobe and for the others, where
    paths may meet the point too, see `area_light`; pdf: of the draw, 1/sr."""
    b = x.bsdf
    if goes_on == BY_BSDF:
        share = pdf / (pdf + pdf_bsdf(b, x.n, wo, wi))
        return share, share
    if goes_on == BY_GLASS:
        return f32(1), pdf / (pdf + glass_pdf(b, x.n, wo, wi))
    by_facets = goes_on == BY_COAT or (goes_on == BY_FACETS and (is_narrow(b) or transmits(b)))
    if by_facets and dot(x.n, wi) > f32(0):
        return f32(1), pdf / (pdf + visible_pdf(b, x.n, wo, normalize(add(wo, wi))))
    return f32(1), f32(1)


@jit
def glass_pdf(b, n, wo, wi):
    """Return the density, 1/sr, with which a path goes on along wi by the facets of a Bsdf that transmits."""
    return pdf_bsdf(without_diffuse(b), n, wo, wi)


@jit
def _reflected(x, wo, irradiance, bright, wi, limit, share=_WHOLE):
    """Radiance along wo, cd/m2 RGB, that a SurfacePoint makes of light from wi; black where the first bounce
    of light of the irradiance `bright` is bright. irradiance, bright: lx on a surface that faces wi;
    share: of the Lambert lobe and of the others, that counts."""
    none = f32(0), f32(0), f32(0)
    if greatest(irradiance) <= f32(0):
        return none
    f = eval_bsdf(x.bsdf, x.n, x.ng, wo, wi)
    if share[1] != f32(1):
        others = eval_bsdf(without_diffuse(x.bsdf), x.n, x.ng, wo, wi)
        f = add(scale(share[0], sub(f, others)), scale(share[1], others))
    if greatest(f) <= f32(0) or is_bright(x.bsdf, x.ng, wo, bright, wi, limit * x.coat.shown):
        return none
    if dot(wi, x.ng) < f32(0) and x.bsdf.thin == f32(0):  # refracted radiance
        f = scale(f32(1) / (x.bsdf.eta * x.bsdf.eta), f)
    return scale(abs(dot(x.n, wi)), times(f, irradiance))


@jit
def side_of(ng, wi):
    """Return ng or -ng, unit: the normal of the surface's side that wi leaves from."""
    return ng if dot(wi, ng) > f32(0) else scale(f32(-1), ng)


@jit
def times(a, b):
    """Return a b, channel by channel, of linear RGB."""
    return a[0] * b[0], a[1] * b[1], a[2] * b[2]


@jit
def greatest(a):
    """Return the largest channel of linear RGB."""
    return max(a[0], max(a[1], a[2]))
