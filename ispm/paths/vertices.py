"""Vertices of eye paths: records of their ends, and of the first surfaces."""

from __future__ import annotations

import numpy as np
from numba import literal_unroll

from ispm.accel.surface import inner_side
from ispm.optics.bsdf import MIN_ALPHA, Bsdf, transmits
from ispm.optics.facets import NO_ANISOTROPY, mean_alpha
from ispm.optics.jit import jit
from ispm.optics.records import NO_HIT, RECEIVER
from ispm.optics.vector import dot, luminance, vec3

f32, u32 = np.float32, np.uint32

_BLUR_SHARE = f32(0.2)  # of a rough surface's blur, that its pixels may be averaged over
_LOBE_SHARE = f32(0.35)  # likewise of a lobe's: a sum of squares, it gets 6 % wider
_LOBE_SPREAD = f32(1.4)  # radians over alpha, the standard deviation of a lobe without its tails

_LEAST_REFLECTANCE = f32(1e-4)  # by which light is divided to be averaged

_NONE = (f32(0), f32(0), f32(0))
_DARK = _NONE, _NONE, f32(0), f32(0), f32(0), f32(0), _NONE, f32(0), f32(0), f32(0)
BLACK = Bsdf(*_DARK, NO_ANISOTROPY)  # of what is unlit

DIRECT, INDIRECT, EMISSION, THROUGH, COLUMNS = 0, 3, 6, 9, 12  # columns of EyePaths' light

# A surface that photons may light, or that is unlit, seen in mirrors and glass. slot: the ray's row;
# lane: what the first surface did to its path; weight: of the radiance that leaves it, in the ray's. f0
# and f90 are 0 where the path continues instead. by_image: 1 where the Lambert lobe still lacks the direct
# light of lamps with a surface and of the environment, see `EyeRays.by_image`.
PATH_END = np.dtype([
    ("slot", "<u4"), ("lane", "<u4"), ("weight", "<f4", 3), ("diffuse", "<f4", 3), ("f0", "<f4", 3),
    ("f90", "<f4"), ("dielectric_f0", "<f4"), ("dielectric_f90", "<f4"), ("instance", "<u4"),
    ("by_image", "<u4"),
])  # fmt: skip

# The mirror, glass or narrow lobe that a pixel shows; blur: pixels over which its light may be averaged, 0:
# it is smooth, or unknown; below 0: unknown, but no more than as many; reflectance: of a lobe, 0: it is none;
# samples: paths that went out from the lobe; met: the instance that they met first, NO_HIT: none, SEVERAL:
# not all the same; beyond: as blur, of what mirrors and lobes that they met show. Of a clear coat and of
# anisotropic facets: own, light of points that they reflect themselves; hidden, a coat's share of what is
# under it. Of a blended surface hidden is the share of what lies behind.
FIRST_VERTEX = np.dtype([
    ("n", "<f4", 3), ("alpha", "<f4"), ("ng", "<f4", 3), ("tint", "<f4"), ("blur", "<f4"),
    ("instance", "<u4"), ("reflectance", "<f4", 3), ("samples", "<u4"), ("own", "<f4", 3),
    ("hidden", "<f4"), ("beyond", "<f4"), ("met", "<u4"),
])  # fmt: skip
SEVERAL = NO_HIT - 1

# Where a path ends, and the receiver there.
PATH_END_AND_POINT = np.dtype([("end", PATH_END), ("point", RECEIVER)])


@jit
def store_end(end, slot, lane, weight, b, instance, by_image=False):
    """Write a PATH_END at a surface of the Bsdf b; weight: of its radiance, RGB."""
    gloss = f32(1) if b.alpha > f32(0) and not transmits(b) else f32(0)
    end.slot = u32(slot)
    end.lane = u32(lane)
    end.instance = instance
    end.by_image = u32(1) if by_image else u32(0)
    for k in literal_unroll((0, 1, 2)):
        end.weight[k] = weight[k]
        end.diffuse[k] = b.diffuse[k]
        end.f0[k] = gloss * b.f0[k]
    end.f90 = gloss * b.f90
    end.dielectric_f0 = b.dielectric_f0
    end.dielectric_f90 = b.dielectric_f90


@jit
def store_point(point, x, wo, b, width, least):
    """Write the RECEIVER of an end at the SurfacePoint x, with the Bsdf b; width: a pixel's there, m; least:
    alpha, as which narrower lobes count."""
    for k in literal_unroll((0, 1, 2)):
        point.position[k] = x.position[k]
        point.ng[k] = x.ng[k]
        point.n[k] = x.n[k]
        point.wo[k] = wo[k]
    glossy = max(b.f90, b.dielectric_f90) > f32(0) or b.f0[0] + b.f0[1] + b.f0[2] > f32(0)
    point.alpha = max(mean_alpha(b), max(least, MIN_ALPHA)) if glossy else f32(0)
    point.valid = u32(1) | inner_side(x)
    point.footprint = width
    point.slant = f32(1) / max(abs(dot(wo, x.ng)), f32(0.02))


@jit
def store_first(first, x, instance, angle):
    """Write a FIRST_VERTEX: what lies behind is blurred by as much as facets turned by alpha deflect light.

    angle  radians over a pixel's width: between neighbouring pixels' directions to what lies behind
    """
    b = x.bsdf
    bent = f32(1) if b.thin > f32(0) else abs(f32(1) - f32(1) / b.eta)
    for k in literal_unroll((0, 1, 2)):
        first.n[k] = x.n[k]
        first.ng[k] = x.ng[k]
    first.alpha = b.alpha
    first.tint = luminance(b.tint)
    first.blur = _BLUR_SHARE * f32(2) * bent * b.alpha * angle
    first.instance = instance


@jit
def add_light(light, i, column, value, weight):
    """Add value times weight, Vectors, to row `i` of EyePaths' light, from a column on."""
    for c in range(3):
        light[i, column + c] += value[c] * weight[c]


@jit
def light_at(light, i):
    """Return direct light, emission and share of the background, Vectors, of row `i` of EyePaths' light."""
    row = light[i]
    return vec3(row[DIRECT:]), vec3(row[EMISSION:]), vec3(row[THROUGH:])


@jit
def scale_since(light, i, before, share):
    """Leave a share of what came to row `i` of EyePaths' light since it was `before`, see `light_at`."""
    direct, emission, through = before
    for c in range(3):
        light[i, DIRECT + c] = direct[c] + share * (light[i, DIRECT + c] - direct[c])
        light[i, EMISSION + c] = emission[c] + share * (light[i, EMISSION + c] - emission[c])
        light[i, THROUGH + c] = through[c] + share * (light[i, THROUGH + c] - through[c])


@jit
def store_gloss(first, x, instance, angles, met, reflectance, samples):
    """Write a FIRST_VERTEX of an opaque surface with a narrow lobe; blur and beyond: standard deviations.

    angles  of both as of `store_first`, 0 or less: unknown, and of anisotropic facets the most that it can
            be, negated;  met  see FIRST_VERTEX
    reflectance  of the lobe, RGB;  samples  paths that it sent out
    """
    b = x.bsdf
    for k in literal_unroll((0, 1, 2)):
        first.n[k] = x.n[k]
        first.ng[k] = x.ng[k]
        first.reflectance[k] = max(reflectance[k], _LEAST_REFLECTANCE)
    first.alpha = mean_alpha(b)
    first.blur = _LOBE_SHARE * _LOBE_SPREAD * b.alpha * angles[0]
    first.beyond = _LOBE_SHARE * _LOBE_SPREAD * b.alpha * angles[1]
    first.instance, first.met = instance, met
    first.samples = u32(samples)


@jit
def store_own(first, own, hidden):
    """Write what a FIRST_VERTEX reflects itself of lights that are points, cd/m2 RGB, and what it hides."""
    first.hidden = hidden
    for k in literal_unroll((0, 1, 2)):
        first.own[k] = own[k]


@jit
def store_clear(first, x, clear):
    """Write a FIRST_VERTEX of a blended SurfacePoint; clear: the share of what lies behind that it shows."""
    for k in literal_unroll((0, 1, 2)):
        first.n[k] = x.n[k]
        first.ng[k] = x.ng[k]
    first.instance = x.hit.instance
    first.hidden = clear
