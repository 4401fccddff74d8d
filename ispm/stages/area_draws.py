"""What the eye's pixels, and ends of its paths, draw from lamps with a surface and from the environment: a
shadow ray to each.

It runs on the CPU, where the trees are. A pixel draws from one of the 4 x 4 equal parts of what is to be
drawn from, and its neighbors from the others, so that any 4 x 4 pixels together draw evenly (Keller and
Heidrich, Interleaved Sampling, EGWR 2001), and so do, in either dimension, any four side by side. In the
first pass pixels draw more often where a penumbra is narrow, and twice beside one, for there the filter of
`area_light.py` takes in few of them. Where lamps are close it takes in few as well, and what they bring
without shadows is known, see `lights/known.py`. Of that what the neighbors have found decides, never a
pixel's own draw: a mean is off if what is drawn says whether it counts. Of shadows all draws about a pixel
decide, its own as well: together they are of all parts, whichever it drew.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from ispm.accel.emitter_tree import NO_LOBE, emitter_chance
from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Scratch
from ispm.accel.surface import SurfacePoint, Tables
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca
from ispm.lights.area import PAIRS_OF_MANY, candidate_pdf, lit_side, resample_surround, sample_lamps
from ispm.lights.area_parts import DIMENSION, first_turn, numbers_of
from ispm.lights.known import are_known, even_angle, unshaded_lamps
from ispm.lights.nee import drawn_lobe, draws_by_lobes, greatest, next_numbers
from ispm.lights.openings import Openings, draw_opening, opening_cell, opening_pdf
from ispm.optics.bsdf import Bsdf, is_lambert, is_narrow
from ispm.optics.environment import (
    SKY_DENSITY,
    environment_irradiance,
    environment_light,
    has_environment,
)
from ispm.optics.jit import jit
from ispm.optics.light import FAR
from ispm.optics.rng import random4
from ispm.optics.vector import dot, luminance, scale
from ispm.stages.area_marks import (
    are_partly_shaded,
    closeness,
    draws_more,
    is_any,
    mark_of,
    marks_about_squares,
    marks_around,
    square_of,
)
from ispm.stages.area_samples import (
    Arriving,
    KindsOfSamples,
    Lobes,
    Samples,
    add_light,
    add_light_of_lobe,
    has_wide_gloss,
)
from ispm.stages.pixels import Pixels, PixelView, is_lit, shown_at

f32, i64, u32 = np.float32, np.int64, np.uint32

UNSHADED = f32(1e9)  # pixels, where nothing shades, but the filter is wanted
CHUNK = 64  # pixels a thread takes at a time
_PAIRS = 1  # of directions that one of the environment is drawn from
_DRAWS, _DRAWS_LATER = 4, 2  # of a pixel in a narrow penumbra, in the first pass; in others, and beside one
_FAINT = f32(0.005)  # of the environment's light, of which at least a fourth is open


def draw_light(
    tables: Tables, pixels: Pixels, view: PixelView, openings: Openings, threads: int
) -> tuple[Lobes, KindsOfSamples]:
    """Return the Lobes of n pixels, and the Samples; Openings guide draws from the environment."""
    told = tables, pixels, view, openings
    return draw_by(
        partial(_draw_once, *told), partial(_refine, *told), tables, view, len(pixels.points), threads
    )


def draw_by(
    draw_once: Callable[..., None],
    refine: Callable[..., None],
    tables: Tables,
    view: PixelView,
    count: int,
    threads: int,
) -> tuple[Lobes, KindsOfSamples]:
    """Return what `draw_light` does of what kernels take `count` pixels to show.

    draw_once  of marks, the threads' counter, and the Lobes and Samples to fill, see `draw_first`
    refine     of marks, `marks_about_squares`, the counter and the Samples, see `draw_again`
    """
    emitters, environment = tables.emitters, tables.environment
    lamps = count if len(emitters.triangles) else 0
    by_draws = 0 if are_known(emitters) else lamps
    sky, suns = (count if len(rows) else 0 for rows in (environment.rows, environment.sunlight))
    samples = KindsOfSamples(_empty_samples(lamps, by_draws), _empty_samples(sky, 0), _empty_samples(suns, 0))
    alpha, f90 = np.zeros((2, count), np.float32)
    lobes, marks = Lobes(alpha, np.zeros((3, count), np.float32), f90), np.zeros(count, np.uint16)
    run_shared(lambda counter: draw_once(marks, counter, lobes, samples), threads)
    about = marks_about_squares(marks.reshape(-1, int(view.columns)))
    run_shared(lambda counter: refine(marks, about, counter, samples), threads)
    return lobes, samples


def _empty_samples(count: int, by_draws: int) -> Samples:
    """Samples of `count` pixels before any draw; by_draws: as many, or 0 where what lamps bring is known."""
    lamps, near = np.zeros((3, by_draws), np.float32), np.full(by_draws, np.inf, np.float32)
    diffuse, drawn, known = np.zeros((3, 3, count), np.float32)
    gloss = np.zeros((6, count), np.float32)
    reach, shine = np.full((2, count), np.inf, np.float32)
    return Samples(diffuse, gloss, drawn, known, lamps, near, reach, np.ones(count, np.float32), shine)


@jit
def _draw_once(tables, pixels, view, openings, marks, counter, lobes, samples):
    """`draw_first` for as many of the Pixels as a thread gets."""
    scratch, first = Scratch(alloca(STACK_WORDS), alloca(2)), first_turn(view)
    for i in shared_rows(counter, CHUNK, len(pixels.points)):
        if is_lit(tables, pixels, i):
            shown, numbers = shown_at(tables, pixels, view, i), numbers_of(view, i, i64(0), first)
            draw_first(tables, shown, numbers, openings, i, scratch, marks, lobes, samples)


@jit
def draw_first(tables, shown, numbers, openings, i, scratch, marks, lobes, samples):
    """Trace a shadow ray to each kind of light for what row i has Shown, by three random numbers, mark what
    they met, and write its Lobes."""
    lamps, sky, suns = samples
    kinds = len(lamps.reach) > 0, len(sky.reach) > 0, len(suns.reach) > 0
    if not is_lambert(shown.x.bsdf):
        # what reflection leaves to the Lambert lobe depends on the draw, whose ratio alone is biased; and
        # what is reflected is known by draws alone, of which each pixel of a square has another part
        for drawn in samples:
            if len(drawn.reach) > 0:
                drawn.reach[i] = UNSHADED
        lobes.alpha[i], lobes.f90[i] = shown.x.bsdf.alpha, shown.x.bsdf.f90
        for c in range(3):
            lobes.f0[c, i] = shown.x.bsdf.f0[c]
    _draw(tables, shown, numbers, openings, i, scratch, samples, kinds)
    by_lamps, others, sunlight = kinds
    if by_lamps and len(lamps.near) == 0:
        _set_known(lamps, i, unshaded_lamps(tables, shown.x, f32(0), f32(0), f32(0), i64(0)))
    if others:
        bright, dark = environment_irradiance(tables.environment, shown.x.n)
        _set_known(sky, i, dark)
        if sunlight:
            _set_known(suns, i, bright)
    marks[i] = mark_of(samples, i)


@jit
def _set_known(samples, i, irradiance):
    """Write what irradiance, lx RGB, makes of row i of the Samples if nothing shades it."""
    for c in range(3):
        samples.known[c, i] = irradiance[c] * f32(1 / math.pi)


@jit
def _refine(tables, pixels, view, openings, marks, about, counter, samples):
    """`draw_again` for as many of the Pixels as a thread gets."""
    scratch, first = Scratch(alloca(STACK_WORDS), alloca(2)), first_turn(view)
    for i in shared_rows(counter, CHUNK, len(pixels.points)):
        square = square_of(about, view, i)
        if draws_more(square) and is_lit(tables, pixels, i):
            shown = shown_at(tables, pixels, view, i)
            draw_again(tables, shown, view, openings, i, first, scratch, marks, square, samples)


@jit
def draw_again(tables, shown, view, openings, i, first, scratch, marks, square, samples):
    """Have row i, if it is in or beside a narrow penumbra, draw again, so that the Samples are their means,
    and if it is close to lamps, know what these bring without shadows.

    first   `first_turn`;  square  what `square_of` tells of it
    """
    lamps, kinds = samples.lamps, are_partly_shaded(square)
    around, draws = marks_around(marks, i, view.columns), i64(1)
    if is_any(kinds):
        is_narrow_here = is_any(are_partly_shaded(around | i64(marks[i])))
        draws = i64(_DRAWS if view.pass_index == u32(0) and is_narrow_here else _DRAWS_LATER)
    for k in range(1, draws):
        numbers = numbers_of(view, i, i64(k), first)
        _draw(tables, shown, numbers, openings, i, scratch, samples, kinds)
    for kind in range(len(kinds)):
        if kinds[kind]:
            _take_mean(samples[kind], i, draws)
    close = closeness(around)
    if close:
        r0, r1, r2, _ = random4(u32(i), u32(DIMENSION + 3), view.pass_index, view.seed)
        light = unshaded_lamps(tables, shown.x, r0, r1, r2, close + i64(1))
        for c in range(3):
            lamps.lamps[c, i] = light[c] * f32(1 / math.pi)
    elif kinds[0] and len(lamps.near) > 0:
        for c in range(3):
            lamps.lamps[c, i] *= f32(1) / f32(draws)


@jit
def _take_mean(samples, i, draws):
    """Make sums of so many draws of row i of the Samples their means, but for what lamps bring."""
    for sums in (samples.diffuse, samples.gloss, samples.drawn):
        for c in range(len(sums)):
            sums[c, i] *= f32(1) / f32(draws)


@jit
def _draw(tables, shown, numbers, openings, i, scratch, samples, kinds):
    """Add to row i of the Samples of these kinds, three bool, a draw by three random numbers."""
    by_lamps, others, sunlight = kinds
    if by_lamps:
        _draw_lamp(tables, shown, numbers, openings, i, scratch, samples.lamps)
    if not (others or sunlight):
        return
    sky, suns = samples.sky, samples.suns
    if len(suns.reach) == 0:
        suns, sunlight = sky, others
    _draw_surround(tables, shown, numbers, openings, i, scratch, sky, others, suns, sunlight)


@jit
def _from_sky(radiance, wi, pdf, guided, is_guided):
    """What is Arriving from where no sun is: within a pixel of one the density is that of its light.

    guided  density of a draw of openings, 1/sr: where these guide, all light fills what they see, and what
            ends rays elsewhere casts no shadow
    """
    density = min(pdf, SKY_DENSITY)
    if is_guided:
        density = max(density, guided) if guided > f32(0) else f32(0)
    return Arriving(radiance, FAR, wi, wi, pdf, density, f32(0))


@jit
def _next_three(numbers):
    """Three random numbers of [0, 1), a step along a lattice from others."""
    a, b, c, _ = next_numbers((numbers[0], numbers[1], numbers[2], f32(0)), 1)
    return a, b, c


@jit
def _draw_lamp(tables, shown, numbers, openings, i, scratch, samples):
    """Add to row i of the Samples a draw from lamps, by three random numbers, and one by its lobe."""
    x, by_lobe = shown.x, f32(0)
    lobe = drawn_lobe(x.bsdf, x.n, shown.wo)
    radiance, distance, wi, pdf, row, chance, end = sample_lamps(tables, x, *numbers)
    if pdf > f32(0):
        if lobe.square > f32(0):
            by_lobe = pdf / chance * emitter_chance(tables.emitters, row, x.position, lit_side(x), lobe)
        light = scale(f32(1) / pdf, radiance)
        density = f32(0) if _is_faint(tables, x, openings, scale(abs(dot(x.n, wi)), light)) else pdf
        arriving = Arriving(light, distance, wi, end, pdf, density, by_lobe)
        brought = add_light(tables, shown, arriving, i, scratch, samples)
        if len(samples.near) > 0 and greatest(brought) > f32(0):
            for c in range(3):
                samples.lamps[c, i] += brought[c]
            slant = abs(dot(shown.x.ng, shown.wo))
            wide = even_angle(tables.surfaces, tables.emitters.triangles[row], x.position)
            samples.near[i] = min(samples.near[i], wide * slant * distance / shown.width)
    if lobe.square == f32(0):
        return
    numbers = _next_three(numbers)
    radiance, distance, wi, by_lobe, row, chance, end = sample_lamps(tables, x, *numbers, lobe)
    if by_lobe > f32(0):
        pdf = by_lobe / chance * emitter_chance(tables.emitters, row, x.position, lit_side(x), NO_LOBE)
        arriving = Arriving(scale(f32(1) / by_lobe, radiance), distance, wi, end, pdf, pdf, by_lobe)
        add_light_of_lobe(tables, shown, arriving, i, scratch, samples)


@jit
def _is_faint(tables, x, openings, irradiance):
    """Whether irradiance, RGB, is so little beside that of an environment that is open about a SurfacePoint
    that its shadows do not show: a small glow all over a model needs no draws for narrow penumbrae."""
    if not has_environment(tables.environment) or opening_cell(openings.cells, x)[1]:
        return False
    _, sky = environment_irradiance(tables.environment, x.n)
    return luminance(irradiance) < _FAINT * luminance(sky)


@jit
def _draw_surround(tables, shown, numbers, openings, i, scratch, sky, draws_sky, suns, draws_suns):
    """Add to row i of the Samples of the sky and of suns, where asked for, the two Surrounds that three
    random numbers draw and, where openings guide, one of where the environment is open, by the balance
    heuristic (Veach 1997, section 9.2.2), but for candidates' densities in place of the first draws'."""
    x, wo = _without_color(shown.x), shown.wo
    place = cell, is_guided = opening_cell(openings.cells, x)
    dark, bright = _surround(tables, x, wo, numbers)
    share = tables.environment.sun_share if len(tables.environment.sunlight) > 0 else f32(1)
    if draws_sky:
        weight, guided = _first_share(tables, x, wo, openings, place, dark, dark.pdf)
        arriving = _from_sky(scale(weight, dark.radiance), dark.wi, dark.pdf, guided, is_guided)
        add_light(tables, shown, arriving, i, scratch, sky)
    if draws_suns:
        weight, guided = _first_share(tables, x, wo, openings, place, bright, bright.pdf / share)
        light = scale(weight, bright.radiance)
        arriving = Arriving(light, FAR, bright.wi, bright.wi, bright.pdf, bright.pdf, f32(0))
        add_light(tables, shown, arriving, i, scratch, suns)
    if not is_guided:
        return
    wi = draw_opening(openings, cell, x.position, *_next_three(numbers))
    radiance, pdf = environment_light(tables.environment, wi)
    is_sun = luminance(radiance) > tables.environment.brightest
    density = pdf / share if is_sun else pdf
    own = candidate_pdf(tables, x, wo, wi, density, _draws_by_lobes(x), has_wide_gloss(x.bsdf))
    if own <= f32(0) or not (draws_suns if is_sun else draws_sky):
        return
    guided = opening_pdf(openings, cell, x.position, wi)
    light = scale(f32(1) / (own + guided), radiance)
    if is_sun:
        add_light(tables, shown, Arriving(light, FAR, wi, wi, pdf, pdf, f32(0)), i, scratch, suns)
    else:
        add_light(tables, shown, _from_sky(light, wi, pdf, guided, True), i, scratch, sky)


@jit
def _first_share(tables, x, wo, openings, place, drawn, density):
    """The share, float32, of a Surround beside a draw of openings, if these guide, and the density of that;
    place: its `opening_cell`;  density: of its kind's own draw."""
    cell, is_guided = place
    if not is_guided:
        return f32(1), f32(0)
    own = candidate_pdf(tables, x, wo, drawn.wi, density, _draws_by_lobes(x), has_wide_gloss(x.bsdf))
    guided = opening_pdf(openings, cell, x.position, drawn.wi)
    return (own / (own + guided) if own > f32(0) else f32(1)), guided


@jit
def _surround(tables, x, wo, numbers):
    """The two Surrounds that three random numbers draw for a SurfacePoint, see `_without_color`."""
    pick, u1, u2 = numbers
    brightest, of_many = tables.environment.brightest, has_wide_gloss(x.bsdf)
    pairs = PAIRS_OF_MANY if of_many else _PAIRS
    return resample_surround(tables, x, wo, u1, u2, pick, pairs, brightest, _draws_by_lobes(x), of_many)


@jit
def _without_color(x):
    """The SurfacePoint that directions are drawn for: if it `has_wide_gloss`, the same without its color,
    so that a texture does not change which directions the pixels of one filter draw."""
    b = x.bsdf
    if not has_wide_gloss(b):
        return x
    gloss, matte = greatest(b.f0), greatest(b.diffuse)
    matte = matte / (gloss + matte) if matte > f32(0) else f32(0)
    gloss, none = f32(1) - matte, (f32(0), f32(0), f32(0))
    kept = f32(1), b.alpha, f32(0), f32(0), none, b.eta, b.thin, f32(0), b.anisotropy
    b = Bsdf((matte, matte, matte), (gloss, gloss, gloss), *kept)
    return SurfacePoint(x.hit, x.position, x.ng, x.n, b, x.flags, x.entering, x.coat, x.sheen, x.translucence)


@jit
def _draws_by_lobes(x):
    """Whether a SurfacePoint draws directions of the environment by its lobes: eye paths take narrow ones."""
    return draws_by_lobes(x.bsdf) and not is_narrow(x.bsdf)
