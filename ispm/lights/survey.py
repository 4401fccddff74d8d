"""The survey that finds openings: where light of the environment comes in to what the eye sees.

From places in the picture, and from places that those see, some lines to the environment are tried, and
others beside each that is open: where those end, there is what surrounds the opening. A sphere there stands
for it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.layers import is_translucent
from ispm.accel.mesh import hit_plane
from ispm.accel.records import Scratch
from ispm.accel.surface import (
    LAYERS_MAX,
    SurfaceTable,
    Tables,
    closest_surface,
    leave_surface,
    scene_tables,
    surface,
)
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca
from ispm.lights.area import resample_surround
from ispm.lights.boxes import Boxes
from ispm.lights.fitted_boxes import cell_weights, even_shares, fit_boxes, lined_boxes
from ispm.lights.openings import CELLS, NEAREST, NO_OPENINGS, GuidedCells, Openings, Ways
from ispm.lights.refracted import surround_share
from ispm.optics.bsdf import is_gathered, transmits
from ispm.optics.environment import has_environment
from ispm.optics.jit import jit
from ispm.optics.records import MATERIAL_HAS_INNER
from ispm.optics.rng import random4
from ispm.optics.sampling import cosine_hemisphere, in_cone, to_world
from ispm.optics.vector import dot, facing, luminance, scale, sub, vec3
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32

_DIMENSION = 3 << 20  # of the random numbers
_TRIED = 4  # lines from a place in a round, to the darker parts of a sky, and as many to its sun
_ROUNDS = 12  # at most
_FEW = 8  # open lines, from which on a survey fits boxes
_ENOUGH = 1000  # lines, after which no round follows, and about as many as are used
_BESIDE = tuple(math.cos(math.radians(angle)) for angle in (3.0, 6.0, 12.0, 24.0))  # of cones about a line
_RARE = 4  # lines tried for each that is open, from where draws are guided
_LIKE = 24  # places, nearest to a cell, that tell how rarely lines are open there
_GLAZED = 1.1  # times the lines that are open where these are rare: more open through glass and curtains
_SENT = 64  # lines through a box at most, along which photons are sent
_CHUNK = 16  # rows a thread takes at a time


class _Survey(NamedTuple):
    """What n rays of the eye found in a round.

    places  (n, 2, 3) float32 m, just above what they met, and what that sees
    sides   (n, 2) uint32, which these face, see `facing`
    tried   (n, 2) int32 lines from there; -1: there is no such place
    lines   (n, 2, 8, 3) float32, unit, towards the environment; those to a sun in the odd rows
    opened  (n, 2, 8) bool, whether they are open
    """

    places: np.ndarray
    sides: np.ndarray
    tried: np.ndarray
    lines: np.ndarray
    opened: np.ndarray


class _Lines(NamedTuple):
    """Open lines.

    starts      (m, 3) float32 m;  directions  (m, 3) float32, unit, towards the environment
    to_sun      (m,) int64, 1: its brightest part, else 0
    along       (m,) float32 m along them, where what is beside them ends rays; infinite: there is nothing
    farthest    (m,) m, where the last of some rays, farther and farther aside, ends that does
    planes      (m, 4, 4) float32, of what ends these: normal, unit, and its product with points, m; NaN: none
    ends        (m, 4, 3) float32 m, where; NaN: nowhere
    """

    starts: np.ndarray
    directions: np.ndarray
    to_sun: np.ndarray
    along: np.ndarray
    farthest: np.ndarray
    planes: np.ndarray
    ends: np.ndarray

    @property
    def seen(self) -> tuple[np.ndarray, ...]:
        """What `fit_boxes` is told."""
        return self.starts, self.directions, self.along, self.farthest, self.planes


class _Course(NamedTuple):
    """Which random numbers a survey takes, and whether its lines go straight on through glass and translucent
    sheets."""

    through_sheets: bool
    turn: np.uint32
    pass_index: np.uint32
    seed: np.uint32


class _Cells(NamedTuple):
    """Boxes in rows about places: (3,) float32 m, their corner and the size of each."""

    low: np.ndarray
    step: np.ndarray

    @classmethod
    def about(cls, places: np.ndarray) -> _Cells:
        """Return cells of the box about (m, 3) places."""
        low, size = places.min(axis=0), np.ptp(places, axis=0)
        return cls(low, np.maximum(size, 1e-3 * size.max() + f32(1e-30)) / f32(CELLS))

    def of(self, places: np.ndarray) -> np.ndarray:
        """Return the cell of each of (m, 3) places."""
        along = np.clip(((places - self.low) / self.step).astype(np.int64), 0, CELLS - 1)
        return np.asarray(along @ (1, CELLS, CELLS**2))

    def nearest(self, places: np.ndarray, count: int, threads: int) -> np.ndarray:
        """Return rows of those of (m, 3) places that are nearest to the middle of each cell, (cells^3, count)
        int32; the first where there are not so many."""
        out = np.zeros((CELLS**3, count), np.int32)
        run_shared(lambda counter: _find_nearest(places, *self, counter, np.empty(count, f32), out), threads)
        return out


def find_openings(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    rays: tuple[np.ndarray, np.ndarray],
    seed: int,
    pass_index: int,
) -> tuple[np.ndarray, Openings]:
    """Return what rays of the eye meet, (k, 3) m, and the Openings that light it.

    rays  origins and directions, (n, 3), m and unit, even over the picture
    Frosted glass and curtains close an opening for draws but not for photons, whose ways a survey of their
    own finds.
    """
    tables, threads = scene_tables(packed, world, surfaces), world.threads
    eye = [np.ascontiguousarray(each, f32) for each in rays]
    course = _Course(False, u32(0), u32(pass_index), u32(seed))
    first = _look(tables, eye, course, threads)
    openings = _survey(tables, eye, course, first, threads)
    if (packed.materials["flags"] & u32(MATERIAL_HAS_INNER)).any():
        course = course._replace(through_sheets=True)
        glazed = _look(tables, eye, course, threads)
        rare = first.opened.sum(axis=2) <= 1
        if glazed.opened[rare].sum() > _GLAZED * first.opened[rare].sum():
            openings = openings._replace(ways=_survey(tables, eye, course, glazed, threads).ways)
    return first.places[:, 0][first.tried[:, 0] >= 0], openings


def _survey(tables: Tables, eye: list[np.ndarray], course: _Course, first: _Survey, threads: int) -> Openings:
    """The Openings that a survey finds, whose first round is known."""
    there = first.tried > 0
    if not there.any():
        return NO_OPENINGS
    places, sides = first.places[there], first.sides[there]
    cells = _Cells.about(places)
    like = np.stack([_alike(places, sides == side, cells, threads) for side in range(6)])
    tried, opened = first.tried[there], first.opened[there].sum(axis=1)
    surveys = [first]
    while True:
        guided = tried[like].sum(axis=2) > _RARE * np.maximum(opened[like].sum(axis=2), 1)
        hidden = guided[sides, cells.of(places)]
        if not hidden.any() or opened[hidden].sum() >= _ENOUGH or len(surveys) == _ROUNDS:
            break
        surveys.append(_look(tables, eye, course._replace(turn=u32(len(surveys))), threads))
        tried, opened = (
            tried + surveys[-1].tried[there],
            opened + surveys[-1].opened[there].sum(axis=1),
        )
    found = [_open_lines(places, hidden, each.lines[there], each.opened[there]) for each in surveys]
    lines = _Lines(*map(np.concatenate, zip(*found, strict=True)))
    lines = _narrow(tables, lines, course, threads)
    return _openings(lines, cells, guided, float(hidden.mean()), threads)


def _openings(lines: _Lines, cells: _Cells, guided: np.ndarray, share: float, threads: int) -> Openings:
    """The Openings of lines, (m,) of which have something beside them; guided, share: see there."""
    if len(lines.starts) < _FEW:
        return NO_OPENINGS
    boxes, shares = fit_boxes(*lines.seen)
    nearest = min(len(lines.starts), NEAREST)
    weights = cell_weights(shares, cells.nearest(lines.starts, nearest, threads))
    guided_cells = GuidedCells(guided, cells.low, f32(1) / cells.step)
    return Openings(boxes, weights, guided_cells, _ways(boxes, lines, shares, share, guided_cells))


def _ways(boxes: Boxes, lines: _Lines, shares: np.ndarray, share: float, cells: GuidedCells) -> Ways:
    """The Ways in through boxes that have (m, k) shares in lines; share, cells: see there."""
    dark, bright = lines.to_sun == 0, lines.to_sun == 1
    own = [np.flatnonzero(shares.argmax(axis=1) == k) for k in range(len(boxes.middles))]
    outward = [_sign(lines.directions[rows] @ axes[0]) for rows, axes in zip(own, boxes.axes, strict=True)]
    boxes = boxes._replace(axes=boxes.axes * np.array(outward, f32)[:, None, None])
    each = [rows[dark[rows]] for rows in own]
    to_sky = even_shares(boxes, np.array([len(rows) for rows in each]) / max(dark.sum(), 1))
    to_sun = shares[bright].sum(axis=0) / max(bright.sum(), 1)
    each = [rows[np.linspace(0, len(rows) - 1, min(len(rows), _SENT), dtype=int)] for rows in each]
    firsts = np.cumsum([0, *(len(rows) for rows in each)])
    directions = lines.directions[np.concatenate(each)]
    lined = lined_boxes(boxes, lines.ends.reshape(-1, 3))
    return Ways(boxes, lined, to_sky.astype(f32), to_sun.astype(f32), directions, firsts, share, cells)


def _sign(values: np.ndarray) -> float:
    """-1 where values are below 0 in the mean, else 1."""
    return -1.0 if values.sum() < 0.0 else 1.0


def _look(tables: Tables, eye: list[np.ndarray], course: _Course, threads: int) -> _Survey:
    """A round of the survey."""
    shape = len(eye[0]), 2
    lines, opened = np.zeros((*shape, 2 * _TRIED, 3), f32), np.zeros((*shape, 2 * _TRIED), np.bool_)
    places, tried = np.zeros((*shape, 3), f32), np.full(shape, -1, np.int32)
    survey = _Survey(places, np.zeros(shape, np.uint32), tried, lines, opened)
    run_shared(lambda counter: _look_around(tables, *eye, course, counter, survey), threads)
    return survey


def _alike(places: np.ndarray, facing_alike: np.ndarray, cells: _Cells, threads: int) -> np.ndarray:
    """Rows of those of (m, 3) places that tell how rarely lines are open in each cell, (cells^3, 24): of the
    places that face alike, if there are enough."""
    rows = np.flatnonzero(facing_alike)
    if len(rows) < _LIKE:
        rows = np.arange(len(places))
    return np.asarray(rows[cells.nearest(places[rows], _LIKE, threads)])


def _open_lines(places: np.ndarray, hidden: np.ndarray, lines: np.ndarray, opened: np.ndarray) -> _Lines:
    """The open lines from (m, 3) places where these are rare, (m,) `hidden`; lines, opened: of a _Survey."""
    place, line = np.nonzero(opened & hidden[:, None])
    along, farthest = np.full((2, len(place)), np.inf, f32)
    planes = np.full((len(place), len(_BESIDE), 4), np.nan, f32)
    ends = np.full((len(place), len(_BESIDE), 3), np.nan, f32)
    return _Lines(places[place], lines[place, line], line % 2, along, farthest, planes, ends)


def _narrow(tables: Tables, lines: _Lines, course: _Course, threads: int) -> _Lines:
    """Some of the lines, evenly, those that have something beside them."""
    step = max(len(lines.starts) // _ENOUGH, 1)
    lines = _Lines(*(each[::step].copy() for each in lines))
    run_shared(lambda counter: _look_beside(tables, *lines, course, counter), threads)
    rows = np.flatnonzero(np.isfinite(lines.along))
    return _Lines(*(each[rows] for each in lines))


@jit
def _look_around(tables, origins, directions, course, counter, out):
    """Fill the rows of a _Survey of as many rays as a thread gets."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for i in shared_rows(counter, _CHUNK, len(origins)):
        start, d = vec3(origins[i]), vec3(directions[i])
        for step in range(2):
            key = u32(2 * i + step)
            holes, u1, u2, _ = random4(key, u32(_DIMENSION), course.pass_index, course.seed)
            found, hit = closest_surface(tables, start, d, holes, scratch)
            if not found:
                break
            x = surface(tables, hit, d)
            wo, start = scale(f32(-1), d), leave_surface(tables, hit, x.ng)
            for c in range(3):
                out.places[i, step, c] = start[c]
            out.sides[i, step], out.tried[i, step] = facing(x.ng), 0
            if not (has_environment(tables.environment) and is_gathered(x.bsdf)):
                break
            _try_lines(tables, x, wo, start, key, course, scratch, out, i, step)
            d = to_world(cosine_hemisphere(u1, u2), x.ng)


@jit
def _try_lines(tables, x, wo, start, key, course, scratch, out, i, step):
    """Try lines from a SurfacePoint, that rays leave at `start`."""
    for k in range(_TRIED):
        dimension = u32(_DIMENSION + 1) + course.turn * u32(_TRIED) + u32(k)
        u1, u2, pick, _ = random4(key, dimension, course.pass_index, course.seed)
        u1 = (f32(k) + u1) * f32(1 / _TRIED)
        drawn = resample_surround(tables, x, wo, u1, u2, pick, 1, tables.environment.brightest, False)
        for kind in range(2):
            wi = drawn[kind].wi
            if luminance(drawn[kind].radiance) <= f32(0) or dot(wi, x.ng) <= f32(0):
                continue
            out.tried[i, step] += 1
            out.opened[i, step, 2 * k + kind] = _is_open(tables, start, wi, course.through_sheets, scratch)
            for c in range(3):
                out.lines[i, step, 2 * k + kind, c] = wi[c]


@jit
def _is_open(tables, start, wi, through_sheets, scratch):
    """Whether a line along wi meets nothing that stops light, or leads to it elsewhere, or but sheets."""
    if not through_sheets:
        share, _, _, is_bent = surround_share(tables, start, wi, scratch)
        if not is_bent or luminance(share) <= f32(0):
            return luminance(share) > f32(0)
    found, _ = _closest(tables, start, wi, f32(0), True, scratch)
    return not found


@jit
def _closest(tables, start, d, holes, through_sheets, scratch):
    """`closest_surface`, or what it finds behind glass and translucent sheets, through which the ray goes
    straight on."""
    for _ in range(LAYERS_MAX):
        found, hit = closest_surface(tables, start, d, holes, scratch)
        if not (found and through_sheets):
            return found, hit
        x = surface(tables, hit, d)
        if not (transmits(x.bsdf) or is_translucent(x)):
            return True, hit
        start = leave_surface(tables, hit, scale(f32(-1), x.ng))
    return found, hit


@jit
def _look_beside(tables, starts, directions, _to_sun, along, farthest, planes, ends, course, counter):
    """Write what is beside open lines, as _Lines has it, for as many as a thread gets."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for i in shared_rows(counter, _CHUNK, len(starts)):
        start, along[i] = vec3(starts[i]), f32(np.inf)
        for turn in range(len(_BESIDE)):
            dimension = u32(_DIMENSION + 1 + _ROUNDS * _TRIED + turn)
            u, v, holes, _ = random4(u32(i), dimension, course.pass_index, course.seed)
            d = in_cone(vec3(directions[i]), f32(_BESIDE[turn]), u, v)
            through_sheets = course.through_sheets or tables.clear
            found, hit = _closest(tables, start, d, holes, through_sheets, scratch)
            if not found:
                continue
            at, ng = hit_plane(tables.surfaces, hit)
            away = dot(sub(at, start), d)
            farthest[i] = away if along[i] == f32(np.inf) else max(farthest[i], away)
            along[i] = away if along[i] == f32(np.inf) else along[i]
            for c in range(3):
                planes[i, turn, c], ends[i, turn, c] = ng[c], at[c]
            planes[i, turn, 3] = dot(ng, at)


@jit
def _find_nearest(places, low, step, counter, away, nearest):
    """Write what `_Cells.nearest` returns for as many cells as a thread gets."""
    most = len(away)
    for cell in shared_rows(counter, _CHUNK, len(nearest)):
        x, y, z = cell % CELLS, cell // CELLS % CELLS, cell // (CELLS * CELLS)
        middle = (
            low[0] + (f32(x) + f32(0.5)) * step[0],
            low[1] + (f32(y) + f32(0.5)) * step[1],
            low[2] + (f32(z) + f32(0.5)) * step[2],
        )
        away[:] = f32(np.inf)
        for i in range(len(places)):
            off = sub(vec3(places[i]), middle)
            square, k = dot(off, off), most - 1
            if square >= away[k]:
                continue
            while k > 0 and away[k - 1] > square:
                away[k], nearest[cell, k] = away[k - 1], nearest[cell, k - 1]
                k -= 1
            away[k], nearest[cell, k] = square, i
