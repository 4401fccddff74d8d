"""Direct light of lamps with a surface and of the environment at the ends of eye paths, as at pixels.

Ends that mirrors and clear glass show side by side are pictures of their own, one for what is mirrored, one
for what is behind glass, one for the far sides of translucent sheets, and as many for a narrow lobe as paths
leave it. Each has the draws and the filter
of `area_light.py`. What is seen in a curved mirror lies farther apart than a pixel is wide: how far tells how
many pixels a penumbra has there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Hit, Scratch
from ispm.accel.surface import NO_LIGHT, SurfacePoint, SurfaceTable, Tables, scene_tables
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca
from ispm.lights.area_parts import first_turn, numbers_of
from ispm.lights.openings import Openings
from ispm.optics.bsdf import Bsdf
from ispm.optics.coat import NO_COAT
from ispm.optics.facets import NO_ANISOTROPY
from ispm.optics.jit import jit
from ispm.optics.records import NO_HIT
from ispm.optics.sheen import NO_SHEEN
from ispm.optics.vector import dot, sub, vec3
from ispm.paths.ends import SAME_SURFACE, without_gaps
from ispm.paths.vertices import DIRECT
from ispm.scene.packed import Packed
from ispm.stages.area_draws import CHUNK, draw_again, draw_by, draw_first
from ispm.stages.area_light import filtered, matte_light
from ispm.stages.area_marks import draws_more, square_of
from ispm.stages.area_shapes import Shapes, least_cosine
from ispm.stages.pixels import OFF_PLANE, PixelView, Shown

f32, i64, u32 = np.float32, np.int64, np.uint32

_SEEDS = 0x9E3779B1  # apart from image to image
_WHITE, _BLACK = (f32(1), f32(1), f32(1)), (f32(0), f32(0), f32(0))


class EndImage(NamedTuple):
    """An image of ends, of which a cell has at most one.

    rows    (h w,) int32 of the PATH_END and RECEIVER, -1: there is none
    ends, points  (m,) these
    widths  (h w,) float32 m, how far apart those of cells side by side lie
    """

    rows: np.ndarray
    ends: np.ndarray
    points: np.ndarray
    widths: np.ndarray


def add_area_light(
    light: np.ndarray,
    ends: np.ndarray,
    points: np.ndarray,
    pixels: np.ndarray,
    view: PixelView,
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    openings: Openings,
    smoothing: float,
) -> None:
    """Add to the `DIRECT` part of n rays' light what lamps with a surface and the environment bring to the
    Lambert lobes of those of their ends that are `by_image`.

    light      (n, DIRECT + 3 or more) float32 cd/m2
    ends       (m,) PATH_END;  points  (m,) RECEIVER, the same
    pixels     (n,) numbers of the rays' pixels;  view  which tells the picture's `columns`
    openings   through which the environment lights the ends
    smoothing  factor on the filter's width
    """
    tables = scene_tables(packed, world, surfaces)
    for number, rows in enumerate(_images(ends)):
        shown = pixels[ends["slot"][rows]].astype(np.int64)
        x, y = without_gaps(shown % view.columns), without_gaps(shown // view.columns)
        columns = int(x.max()) + 1
        cells = np.full((int(y.max()) + 1) * columns, -1, np.int32)
        cells[y * columns + x] = rows
        image = EndImage(cells, ends, points, np.zeros(len(cells), np.float32))
        seed = u32(int(view.seed) ^ _SEEDS * (number + 1) & 0xFFFFFFFF)
        own = view._replace(columns=i64(columns), seed=seed)
        _add_light_of_image(light, image, own, tables, openings, smoothing, world.threads)


def _images(ends: np.ndarray) -> Iterator[np.ndarray]:
    """Yield rows of PATH_END that are `by_image`: of each lane the first of each ray, and so on."""
    every = np.flatnonzero(ends["by_image"])
    lanes = ends["lane"][every]
    for lane in np.flatnonzero(np.bincount(lanes)):
        rows = every[lanes == lane]
        slots = ends["slot"][rows]
        starts = np.flatnonzero(np.diff(slots, prepend=-1))
        turn = np.arange(len(rows)) - np.repeat(starts, np.diff(starts, append=len(rows)))
        for k in range(int(turn.max()) + 1):
            yield rows[turn == k]


def _add_light_of_image(
    light: np.ndarray,
    image: EndImage,
    view: PixelView,
    tables: Tables,
    openings: Openings,
    smoothing: float,
    threads: int,
) -> None:
    """`add_area_light` of one image."""
    count = len(image.rows)
    point, normal, flat = np.zeros((3, 3, count), np.float32)
    word, off = np.zeros(count, np.uint32), np.zeros(count, np.float32)
    shapes = Shapes(word, point, normal, flat, off, least_cosine(smoothing))
    run_shared(lambda counter: _lay_out(image, view, counter, shapes), threads)
    told = tables, image, view, openings
    once, again = partial(_draw_once, *told), partial(_refine, *told)
    lobes, drawn = draw_by(once, again, tables, view, count, threads)
    for means, unshaded in filtered(shapes, lobes, tables, view, smoothing, drawn, threads):
        run_shared(partial(_add_shown, image, means, unshaded, light), threads)


@jit
def _lay_out(image, view, counter, shapes):
    """Write the Shapes of as many cells as a thread gets, and how far apart ends lie about them."""
    for i in shared_rows(counter, CHUNK, len(image.rows)):
        row = image.rows[i]
        if row < 0:
            continue
        point = image.points[row]
        image.widths[i] = _spacing(image, view, i)
        shapes.word[i], shapes.off[i] = image.ends[row].instance + u32(1), OFF_PLANE * image.widths[i]
        for c in range(3):
            shapes.point[c, i], shapes.normal[c, i] = point.position[c], point.n[c]
            shapes.flat[c, i] = point.ng[c]


@jit
def _spacing(image, view, i):
    """How far apart, m, the end of cell i and those beside it on its surface lie, in the direction in which
    that is more; no less than a pixel's width."""
    width = image.points[image.rows[i]].footprint
    column, count = i % view.columns, i64(len(image.rows))
    for step in (i64(1), view.columns):
        nearest = f32(np.inf)
        for k in (i - step, i + step):
            beside = step > i64(1) or abs(k % view.columns - column) == i64(1)
            if beside and i64(0) <= k < count and image.rows[k] >= 0:
                nearest = min(nearest, _distance(image, image.rows[i], image.rows[k]))
        width = max(width, nearest) if nearest < f32(np.inf) else width
    return width


@jit
def _distance(image, one, other):
    """The distance, m, of two ends of one surface; infinite: they are not."""
    a, b = image.points[one], image.points[other]
    if image.ends[one].instance != image.ends[other].instance or dot(vec3(a.ng), vec3(b.ng)) < f32(
        SAME_SURFACE
    ):
        return f32(np.inf)
    way = sub(vec3(b.position), vec3(a.position))
    return f32(math.sqrt(dot(way, way)))


@jit
def _shown_at(image, view, i):
    """The Shown of cell i: a white Lambert lobe under what it gives way to."""
    row = image.rows[i]
    end, point = image.ends[row], image.points[row]
    gives_way = end.dielectric_f0, end.dielectric_f90, _BLACK, f32(1), f32(1), f32(0), NO_ANISOTROPY
    b = Bsdf(_WHITE, _BLACK, f32(0), f32(0), *gives_way)
    position, hit = vec3(point.position), Hit(u32(NO_HIT), u32(0), f32(0), f32(0))
    to_eye = sub(vec3(view.eye), position)
    place = position, vec3(point.ng), vec3(point.n)
    x = SurfacePoint(hit, *place, b, u32(0), True, NO_COAT, NO_SHEEN, NO_LIGHT)
    return Shown(x, vec3(point.wo), f32(math.sqrt(dot(to_eye, to_eye))), image.widths[i])


@jit
def _draw_once(tables, image, view, openings, marks, counter, lobes, samples):
    """`draw_first` for as many cells as a thread gets."""
    scratch, first = Scratch(alloca(STACK_WORDS), alloca(2)), first_turn(view)
    for i in shared_rows(counter, CHUNK, len(image.rows)):
        if image.rows[i] >= 0:
            shown, numbers = _shown_at(image, view, i), numbers_of(view, i, i64(0), first)
            draw_first(tables, shown, numbers, openings, i, scratch, marks, lobes, samples)


@jit
def _refine(tables, image, view, openings, marks, about, counter, samples):
    """`draw_again` for as many cells as a thread gets."""
    scratch, first = Scratch(alloca(STACK_WORDS), alloca(2)), first_turn(view)
    for i in shared_rows(counter, CHUNK, len(image.rows)):
        square = square_of(about, view, i)
        if draws_more(square) and image.rows[i] >= 0:
            shown = _shown_at(image, view, i)
            draw_again(tables, shown, view, openings, i, first, scratch, marks, square, samples)


@jit
def _add_shown(image, means, unshaded, light, counter):
    """Add what as many cells as a thread gets show of Means and what is Unshaded to the direct part of (n,
    COLUMNS) light."""
    for i in shared_rows(counter, CHUNK, len(image.rows)):
        if image.rows[i] >= 0:
            end = image.ends[image.rows[i]]
            for c in range(3):
                light[end.slot, DIRECT + c] += (
                    end.weight[c] * end.diffuse[c] * matte_light(means, unshaded, c, i)
                )
