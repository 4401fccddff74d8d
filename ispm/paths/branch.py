"""How eye paths start from what a pixel shows, and go on: records of paths, and their first branches.

A mirror or clear glass sends out two, rough glass and narrow lobes of opaque surfaces draw some by chance:
the latter as many as what they reflect is worth. Weak ones, which fill much of many pictures, have but one
for 2 x 2 pixels, of which passes take another each, and so have all where most of the picture shows lobes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.accel.emitter_tree import NO_LOBE, Lobe
from ispm.accel.medium import attenuation, no_medium, spawn_ray
from ispm.accel.records import Hit
from ispm.accel.surface import hit_position
from ispm.lights.area import lit_side
from ispm.lights.nee import drawn_lobe, greatest
from ispm.lights.openings import Openings
from ispm.optics.bsdf import is_lambert, is_smooth, transmits
from ispm.optics.dispersion import ALL_BANDS, of_band
from ispm.optics.facets import visible_pdf
from ispm.optics.jit import jit
from ispm.optics.vector import Vector, add, dot, normalize, scale, sub
from ispm.paths.facet import (
    ROUGH_SAMPLES,
    facet_numbers,
    facet_split,
    lobe_blur,
    lobe_numbers,
    mean_reflectance,
    sample_lobe,
)

f32, i64, u32 = np.float32, np.int64, np.uint32

REFLECTED, TRANSMITTED, SCATTERED = 0, 1, 2  # what the first surface did to a path

PARTINGS = 3  # of a path at smooth glass, at most
GLOSS_SAMPLES = 4  # paths from a pixel whose narrow lobe is strong, at most
STRONG = f32(0.3)  # reflectance of such lobes
_WEAK = f32(0.12)  # and of those that have one path for 2 x 2 pixels
_BROAD = f32(0.05)  # alpha from which stronger ones have as few, where most of the picture shows lobes
_SHARP = f32(0.01)  # and below which each pixel has its own all the same
_REFLECTED_EACH = 4  # of the paths of rough glass so many reflect once


class View(NamedTuple):
    """What holds for all rays: width, spread, near and past are `EyeRays.width` and `slack`;
    columns, most, draws, widening, shows_environment, of_coats, behind, by_image and within those of EyeRays;
    openings: that let in the environment's light."""

    width: np.float32
    spread: np.float32
    near: np.float32
    past: np.float32
    pass_index: np.uint32
    seed: np.uint32
    columns: np.uint32
    most: np.int64
    draws: np.int64
    widening: np.float32
    shows_environment: bool
    of_coats: bool
    behind: bool
    by_image: bool
    within: np.uint32
    openings: Openings


class Branch(NamedTuple):
    """How a path continues from a surface; fields as those of a `Path` there."""

    key: np.uint32
    dimension: np.uint32
    lane: np.int64
    d: Vector
    weight: Vector
    pdf: np.float32
    blur: np.float32
    lobe: Lobe
    sees_background: bool
    band: np.int64
    is_clear: bool


class Path(NamedTuple):
    """A path that is being followed.

    key, dimension  of its random numbers
    lane            of its first end
    start, d        of its next ray
    weight          of the radiance that comes back along it
    pdf             of d, 1/sr, where a rough surface drew it; 0: a mirror or clear glass sent it there, or
                    the pixel's own rough glass let it through
    blur            `lobe_blur` there, 0 without a pdf
    side            normal, unit, of the side of the surface that it left, see `lit_side`, and
    origin          m, where on it; of paths with a pdf those of the lobe, sheets that they passed since aside
    lobe            by which lamps are drawn there once more, see `drawn_lobe`
    inside, focus   the hit at which it entered the solid that it is in, see `medium`; and what radiance from
                    there is multiplied by, 1 / eta^2, outside 1
    length          m from the eye to `start`
    sees_background           whether it went through glass alone, so that it sees the background
    band            of its light, see `optics.dispersion`: weights of the others are 0
    is_clear       whether mirrors and clear glass alone led here, so that it sees the sun's disc
    """

    key: np.uint32
    dimension: np.uint32
    lane: np.int64
    start: Vector
    d: Vector
    weight: Vector
    pdf: np.float32
    blur: np.float32
    side: Vector
    origin: Vector
    lobe: Lobe
    inside: Hit
    focus: np.float32
    length: np.float32
    sees_background: bool
    band: np.int64
    is_clear: bool


class Waiting(NamedTuple):
    """Paths that parted from one at smooth glass and wait to be followed, the last to part in front.

    may_part  whether more may part from it: not where several paths stand for one;  room  how many
    size      of those that wait, of `paths`
    """

    may_part: bool
    room: np.int64
    size: np.int64
    paths: tuple[Path, Path, Path]


@jit
def nothing_waits(path, may_part):
    """Return the Waiting of a path that sets out."""
    return Waiting(may_part, i64(PARTINGS), i64(0), (path, path, path))


@jit
def part(waiting, path):
    """Return a Waiting with one path more."""
    paths = path, waiting.paths[0], waiting.paths[1]
    return Waiting(waiting.may_part, waiting.room - i64(1), waiting.size + i64(1), paths)


@jit
def with_left_over(waiting, weight):
    """Return a Waiting whose path in front takes over what a later face reflects, RGB of the light: it sees
    nearly the same, from a few faces before."""
    first = waiting.paths[0]
    paths = _weighted(first, add(first.weight, weight), first.band), waiting.paths[1], waiting.paths[2]
    return Waiting(waiting.may_part, waiting.room, waiting.size, paths)


@jit
def without_next(waiting):
    """Return a Waiting without the path in front."""
    paths = waiting.paths[1], waiting.paths[2], waiting.paths[2]
    return Waiting(waiting.may_part, waiting.room, waiting.size - i64(1), paths)


@jit
def branches(view, x, wo, key):
    """Number of paths that start from a pixel's SurfacePoint, seen along wo; key: of its ray."""
    b = x.bsdf
    if is_smooth(b):
        return i64(2)
    if transmits(b):
        return i64(ROUGH_SAMPLES + ROUGH_SAMPLES // _REFLECTED_EACH)
    return _gloss_samples(view, x, wo, key)


@jit
def _gloss_samples(view, x, wo, key):
    """Number of paths that start from a pixel whose surface is opaque and rough."""
    reflectance = greatest(mean_reflectance(x, wo))
    if is_lambert(x.bsdf):
        return i64(0)
    if not _is_shared(view, x.bsdf, reflectance):
        return max(view.most, i64(1)) if reflectance >= STRONG else i64(1)
    column, row = key % view.columns, key // view.columns
    own = (column & u32(1)) | (row & u32(1)) << u32(1)
    return i64(own == (u32(3) * view.pass_index & u32(3)))


@jit
def _is_shared(view, b, reflectance):
    """Whether 2 x 2 pixels whose narrow lobes are alike have one path among them: those that reflect little,
    and less than what is matte there."""
    if view.columns == u32(0) or b.alpha < _SHARP:
        return False
    is_weak = reflectance < min(_WEAK, greatest(b.diffuse))
    return is_weak or (view.most == i64(0) and b.alpha >= _BROAD)


@jit
def first_path(tables, view, x, wo, key, k, length, band):
    """Return Path `k` of `branches`, transmitted or, of the rest, reflected, from a SurfacePoint that is
    seen along wo from `length` m away; band: of its light, as the SurfacePoint is to it."""
    if not is_smooth(x.bsdf) and not transmits(x.bsdf):
        return _first_of_lobe(tables, view, x, wo, key, k, length)
    smooth = is_smooth(x.bsdf)
    passes = k == 1 if smooth else k < ROUGH_SAMPLES
    sample = 0 if smooth else (k if passes else (k - ROUGH_SAMPLES) * _REFLECTED_EACH)
    u1, u2, _ = facet_numbers(key, u32(sample << 8), view.pass_index, view.seed)
    reflectance, transmittance, above, beyond, _ = facet_split(x, wo, u1, u2)
    wi, weight, dimension = above, reflectance, u32(sample << 8 | 1)
    share = f32(1) if smooth else f32(_REFLECTED_EACH / ROUGH_SAMPLES)
    lane, pdf, blur = REFLECTED if smooth else SCATTERED, f32(0), f32(0)
    if not (smooth or passes):
        pdf = visible_pdf(x.bsdf, x.n, wo, normalize(add(wo, wi)))  # as pixels draw from lamps for this, too
        blur = lobe_blur(x.bsdf, pdf)
    if passes:
        wi, weight, dimension = beyond, transmittance, u32(sample << 8 | 128)
        share = f32(1) if smooth else f32(1.0 / ROUGH_SAMPLES)
        lane = TRANSMITTED if smooth else SCATTERED
    weight, inside, focus = of_band(band, scale(share, weight)), no_medium(), f32(1)
    if x.hit.instance == view.within and not x.entering:
        inside, focus = x.hit, x.bsdf.eta * x.bsdf.eta
        left = scale(f32(1) / focus, attenuation(tables.surfaces, inside, length))
        weight = left[0] * weight[0], left[1] * weight[1], left[2] * weight[2]
    branch = Branch(key, dimension, i64(lane), wi, weight, pdf, blur, NO_LOBE, True, band, smooth)
    return leave(tables, x, inside, focus, length, branch)


@jit
def _first_of_lobe(tables, view, x, wo, key, k, length):
    """`first_path` from an opaque surface: one of as many as `branches` says."""
    reflectance = greatest(mean_reflectance(x, wo))
    strong, shared = reflectance >= STRONG, _is_shared(view, x.bsdf, reflectance)
    count = max(view.most, i64(1)) if strong else i64(1)
    u1, u2 = lobe_numbers(view, key, k, count, shared)
    _, wi, factor, pdf = sample_lobe(x, wo, u1, u2)
    lane = REFLECTED if strong else SCATTERED
    weight = scale(f32(1) / f32(count), factor)
    lobe, rest = drawn_lobe(x.bsdf, x.n, wo), (False, ALL_BANDS, False)
    blur = lobe_blur(x.bsdf, pdf)
    branch = Branch(key, u32(k << 8 | 1), i64(lane), wi, weight, pdf, blur, lobe, *rest)
    return leave(tables, x, no_medium(), f32(1), length, branch)


@jit
def leave(tables, x, inside, focus, length, branch):
    """Return the Path that continues from a SurfacePoint by a Branch.

    inside, focus  as of a Path;  length  m, from the eye
    """
    key, dimension, lane, d, weight, pdf, blur, lobe, sees_background, band, is_clear = branch
    start, inside = spawn_ray(tables, x, inside, d)
    passes, solid = dot(d, x.ng) < f32(0), x.bsdf.thin == f32(0)
    if passes and solid:
        focus = f32(1) / (x.bsdf.eta * x.bsdf.eta) if x.entering else f32(1)
    sees_background = sees_background and (passes or (solid and transmits(x.bsdf) and not x.entering))
    side = lit_side(x) if not passes or transmits(x.bsdf) else scale(f32(-1), x.ng)
    place = side, x.position, lobe, inside, focus, length
    return Path(key, dimension, lane, start, d, weight, pdf, blur, *place, sees_background, band, is_clear)


@jit
def path_in_band(path, band):
    """Return a Path with the light of a band alone."""
    return _weighted(path, of_band(band, path.weight), band)


@jit
def _weighted(path, weight, band):
    """A Path of another weight and band."""
    key, dimension, lane, start, d, _, pdf, blur = path[:8]
    side, origin, lobe, inside, focus, length, sees, _, clear = path[8:]
    place = side, origin, lobe, inside, focus, length
    return Path(key, dimension, lane, start, d, weight, pdf, blur, *place, sees, band, clear)


@jit
def distance_to(tables, start, hit):
    """Return the distance in m from `start` to a Hit."""
    segment = sub(hit_position(tables.surfaces, hit), start)
    return f32(math.sqrt(dot(segment, segment)))


@jit
def pixel_width(view, length):
    """Width in m that a pixel covers after `length` m of its path, were all mirrors flat."""
    return view.width + view.spread * length
