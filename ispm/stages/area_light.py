"""Direct light of lamps with a surface and of the environment at the eye's pixels: draws, and a filter.

It runs on the CPU, where the trees are. The draws of any 4 x 4 pixels together are even, see `area_draws.py`;
the filter, of `area_filter.py`, is the mean over such a square (the discontinuity buffer of Wald et al.,
Interactive Global Illumination using Fast Ray Tracing, EGWR 2002). It takes in pixels of the same surface
alone, and no farther than a fraction of the penumbra's width, by the distance to what casts the shadow: at
contacts its edge stays sharp. Where penumbrae are much wider than the square, what it lets through is
filtered again, from squares that lie farther and farther apart (Dammertz et al., Edge-Avoiding A-Trous
Wavelet Transform for fast Global Illumination Filtering, HPG 2010). So is what lamps bring without shadows,
where that is drawn, which varies over a fraction of their distance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from ispm.accel.surface import SurfaceTable, Tables, scene_tables
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.lights.known import is_one_lamp
from ispm.lights.openings import Openings
from ispm.optics.environment_table import is_one_sun
from ispm.optics.jit import jit
from ispm.paths.shown import BENT
from ispm.scene.packed import Packed
from ispm.stages.area_draws import CHUNK, draw_light
from ispm.stages.area_filter import WORK, Means, Unshaded, filter_samples, widen
from ispm.stages.area_samples import KindsOfSamples, Lobes, Samples
from ispm.stages.area_shapes import Shapes, lay_out, least_cosine
from ispm.stages.pixels import Pixels, PixelView, is_lit, transmitted_shares

f32, i64 = np.float32, np.int64

_LEAST_REACH = 2.0  # pixels to each side that the filter takes in at least in the first pass
_STRIDES = 4, 12  # pixels between squares that lie side by side: each of 3 x 3 of those before


def area_light(
    pixels: Pixels,
    view: PixelView,
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    openings: Openings,
    smoothing: float,
) -> np.ndarray:
    """Return the direct light of lamps with a surface and of the environment, (n, 4) float32 cd/m2 of
    the n pixels; of an opacity of 1.

    openings   through which the environment lights the pixels
    smoothing  factor on the filter's width
    """
    count, threads = len(pixels.points), world.threads
    tables = scene_tables(packed, world, surfaces)
    point, normal, flat = np.empty((3, 3, count), np.float32)
    word, off = np.empty(count, np.uint32), np.empty(count, np.float32)
    shapes = Shapes(word, point, normal, flat, off, least_cosine(smoothing))
    run_shared(lambda counter: lay_out(pixels, view, counter, shapes), threads)
    light = np.zeros((count, 4), np.float32)
    light[:, 3] = 1.0
    lobes, drawn = draw_light(tables, pixels, view, openings, threads)
    for means, unshaded in filtered(shapes, lobes, tables, view, smoothing, drawn, threads):
        run_shared(partial(_add_shown, tables, pixels, lobes, means, unshaded, light), threads)
    return light


def filtered(
    shapes: Shapes,
    lobes: Lobes,
    tables: Tables,
    view: PixelView,
    smoothing: float,
    drawn: KindsOfSamples,
    threads: int,
) -> Iterator[tuple[Means, Unshaded]]:
    """Yield of each kind of Samples that a scene has the Means, and what is Unshaded; the samples' own values
    are used up."""
    for samples, is_line in zip(drawn, _are_lines(tables), strict=True):
        if len(samples.reach):
            # Single rays are specks where they go to many lights. Of one light's shadow the edge is a line.
            # Highlights of one light keep their shape on balls; those of many would be grain there.
            least, passes = np.float32(_LEAST_REACH / math.sqrt(1.0 + view.pass_index)), int(view.pass_index)
            np.maximum(samples.reach, least * samples.angle if is_line else least, out=samples.reach)
            bent = BENT * f32(1.0 if is_line else passes / (1.0 + passes))
            yield _filtered(shapes, lobes, view, smoothing, samples, bent, threads)


def _are_lines(tables: Tables) -> tuple[bool, bool, bool]:
    """Whether all draws of each kind of Samples go to one small light."""
    return is_one_lamp(tables.emitters), False, is_one_sun(tables.environment)


def _filtered(
    shapes: Shapes,
    lobes: Lobes,
    view: PixelView,
    smoothing: float,
    samples: Samples,
    bent: np.float32,
    threads: int,
) -> tuple[Means, Unshaded]:
    """The Means of Samples and what is Unshaded; the samples' own values are used up."""
    count = len(samples.reach)

    def run(kernel: Callable[..., Any], *given: Any) -> None:
        run_shared(
            lambda counter: kernel(*given[:-1], counter, np.empty(WORK, np.float32), *given[-1]), threads
        )

    told = shapes, view, f32(smoothing)
    (matte, diffuse, drawn), gloss = np.zeros((3, 3, count), np.float32), np.zeros((6, count), np.float32)
    missed = np.zeros((3, count if view.pass_index else 0), np.float32)
    unshaded = Unshaded(matte, missed, np.zeros(count, np.float32))
    reaches = [np.full_like(a, np.inf) for a in (samples.near, samples.reach, samples.shine)]
    means = Means(diffuse, drawn, gloss, np.zeros_like(samples.lamps), *reaches)
    run(filter_samples, *told, samples, lobes, bent, (means, unshaded))
    wider = Means(**{name: getattr(samples, name) for name in Means._fields})
    for stride in _STRIDES:
        run(widen, *told, i64(stride), means, lobes, (wider, unshaded))
        means, wider = wider, means
    return means, unshaded


@jit
def _add_shown(tables, pixels, lobes, means, unshaded, light, counter):
    """Add what as many of the Pixels as a thread gets show of Means and what is Unshaded to (n, 4) light."""
    for i in shared_rows(counter, CHUNK, len(pixels.points)):
        if not is_lit(tables, pixels, i):
            continue
        base = pixels.base[i]
        passed, through = transmitted_shares(tables, pixels.points[i, 3])
        opaque = (f32(1) - base[3]) * (f32(1) - passed) * (f32(1) - through)
        for c in range(3):
            matte = matte_light(means, unshaded, c, i)
            gloss = lobes.f0[c, i] * means.gloss[c, i] + lobes.f90[i] * means.gloss[3 + c, i]
            light[i, c] += matte * (opaque * base[c]) + gloss


@jit
def matte_light(means, unshaded, c, i):
    """Return channel c of the light of row i's Lambert lobe over its albedo, cd/m2."""
    share = means.diffuse[c, i] / max(means.drawn[c, i], f32(1e-30))
    matte = share * unshaded.diffuse[c, i]
    if unshaded.missed.shape[1] > 0:
        matte = max(matte + unshaded.missed[c, i], f32(0))
    return matte
