"""Follow photons from their first hits until they are absorbed, leave, or have scattered enough."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import literal_unroll

from ispm.accel.bands import in_band, is_dispersed_first, is_dispersive
from ispm.accel.intersect import STACK_WORDS
from ispm.accel.layers import has_sheen, is_translucent, weight_met
from ispm.accel.medium import attenuated, medium, no_medium, passed_sheet, spawn_ray
from ispm.accel.records import Hit, Scratch
from ispm.accel.surface import SurfaceTable, Tables, closest_surface, scene_tables, surface
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca
from ispm.lights.bright import is_bright_first_bounce, split_count
from ispm.lights.emitted import emitted_beam, first_segment
from ispm.lights.openings import NO_WAYS, Ways
from ispm.lights.refracted import FACES, goes_through, is_drawn
from ispm.optics.bsdf import is_gathered, is_smooth, shows_photons
from ispm.optics.dispersion import ALL_BANDS, BANDS, band_number, draw_band, of_band
from ispm.optics.jit import jit
from ispm.optics.records import EMITTED_BY_ENVIRONMENT, MATERIAL_THIN, NO_HIT, PHOTON
from ispm.optics.rng import random4
from ispm.optics.vector import dot, scale, sub, vec3
from ispm.photons.beam import beam_at, redirected_beam
from ispm.photons.hits import store_beam, store_photon
from ispm.photons.scatter import BY_COAT, BY_SHEEN, Event, flight_number, layer_left, next_flight
from ispm.photons.steps import STEP, Steps, write_event, write_step
from ispm.scene.packed import Packed

f32, i64, u32 = np.float32, np.int64, np.uint32

_CONTINUED_DIMENSION = 1 << 23  # of the random number that draws which of the split photons is continued
PART_BIT = 28  # first bit of a key that numbers split photons; numbers of texels stay below it
EVENT_STEP = 0x9E3779B1  # between the keys of two hits of a photon, from 2^32 over the golden ratio
BEAM = 9  # floats of a beam: two vectors that span what it lights, and the normal of the surface it left
_LEAST_CHANCE = f32(1e-6)  # of a reflection or refraction, by whose inverse its beam grows
_CHUNK = 256  # photons a thread takes at a time; results do not depend on it or on the threads
_HITS = 12 * _CHUNK  # that a chunk has room for at first; the few chunks that need more are walked again

_FATES = "emitted", "absorbed", "escaped", "dropped", "stored"  # rows of a chunk's sums
_EMITTED, _ABSORBED, _ESCAPED, _DROPPED, _STORED = range(5)


@dataclass(frozen=True)
class Walk:
    """What became of the photons.

    photons    (M,) PHOTON in the order of the emitted ones; radius and height not yet set
    focused    (M,) bool, whether it met a mirror or glass since it last scattered, if ever; thin sheets that
               it passed do not count
    beams      (C, 9) float32 of the photons that have not scattered: the two vectors in m that span what the
               photon lights there, and the normal of the surface that it comes from
    not_gathered  (M,) bool, whether gather rays do not find the light that it brings: it is focused, or
               comes from where it last scattered as caustic light, at a bright first bounce, by a coat that
               it met first, or on what lets light through
    keys       (M,) uint32, of random numbers: each hit has its own
    emitted, absorbed, escaped, dropped   (3,) float64 lumen; the first is the sum of the others
    stored     (3,) float64 lumen, each photon counted at each hit
    rays       traced
    """

    photons: np.ndarray
    focused: np.ndarray
    not_gathered: np.ndarray
    of_area: np.ndarray
    keys: np.ndarray
    beams: np.ndarray
    emitted: np.ndarray
    absorbed: np.ndarray
    escaped: np.ndarray
    dropped: np.ndarray
    stored: np.ndarray
    photon_count: int
    rays: int


def walk(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    emitted: np.ndarray,
    bounces: int,
    seed: int,
    pass_index: int,
    limit: float = math.inf,
    ways: Ways = NO_WAYS,
) -> Walk:
    """Trace photons from their first hits, storing one at each later hit.

    emitted  (N,) EMITTED
    bounces  scatters at most, the one at the first hit included; events at smooth surfaces do not count
    limit    of bright first bounces, see `bright.is_bright`; there photons are split into `SPLIT_COUNT`
    ways     in, to which photons that scatter outside are sent, see `photons.guided`
    The first hit is direct light, which shadow maps show, also behind thin sheets, so it is not stored; of
    the environment's light nor is what draws find behind clear solids, see `lights.refracted`. Flux
    changes by f cos / pdf, and between hits by absorption; after `ROULETTE_AFTER` scatters (at once where one
    keeps next to nothing) and `SPECULAR_MAX` specular events roulette keeps the expectation (docs/method.md,
    Emission and walk).
    Returns the same bytes for any number of threads.
    """
    chunks = np.arange(-(-len(emitted) // _CHUNK))
    tables = scene_tables(packed, world, surfaces)
    course = _Course(i64(bounces), f32(limit), ways, u32(pass_index), u32(seed))
    # Mostly pages that are never touched.
    room = world.scratch(len(chunks) * _HITS, PHOTON)
    found = _walk_some(tables, emitted, course, chunks, room, world.threads)
    hit_counts, ray_counts = found.counts.T
    hits = [found.hits.part(c * _HITS, n) for c, n in enumerate(hit_counts)]
    for chunk in np.flatnonzero(hit_counts > _HITS):
        room = np.empty(hit_counts[chunk], PHOTON)
        again = _walk_some(tables, emitted, course, chunks[chunk:][:1], room, 1)
        hits[chunk] = again.hits.part(0, len(room))
        (found.sums[chunk],) = again.sums
    hits = hits or [found.hits.part(0, 0)]
    joined = _Hits(*(np.concatenate(arrays) for arrays in zip(*hits, strict=True)))
    flux = dict(zip(_FATES, found.sums.sum(axis=0), strict=True))
    rays = int(ray_counts.sum())
    return Walk(**joined._asdict(), **flux, photon_count=len(emitted), rays=rays)


def all_steps(
    packed: Packed,
    world: World,
    surfaces: SurfaceTable,
    emitted: np.ndarray,
    bounces: int,
    seed: int,
    pass_index: int,
    limit: float = math.inf,
    ways: Ways = NO_WAYS,
) -> np.ndarray:
    """Return what a few photons meet on the ways that `walk` has them go, (n,) STEP, one photon after the
    other; arguments as of `walk`."""
    tables = scene_tables(packed, world, surfaces)
    course = _Course(i64(bounces), f32(limit), ways, u32(pass_index), u32(seed))
    batches, no_hits = [np.zeros(0, STEP)], np.empty(0, PHOTON)
    for first in range(0, len(emitted), _CHUNK):
        few, chunk = emitted[first : first + _CHUNK], np.arange(1)
        steps = Steps(np.empty(_HITS, STEP), np.zeros(1, np.int64))
        _walk_some(tables, few, course, chunk, no_hits, 1, steps)
        count = int(steps.written[0])
        if count > len(steps.rows):
            steps = Steps(np.empty(count, STEP), np.zeros(1, np.int64))
            _walk_some(tables, few, course, chunk, no_hits, 1, steps)
        batches.append(steps.rows[:count])
    return np.concatenate(batches)


def _walk_some(
    tables: Tables,
    emitted: np.ndarray,
    course: _Course,
    chunks: np.ndarray,
    room: np.ndarray,
    threads: int,
    steps: Steps | None = None,
) -> _Found:
    """Walk the photons of some chunks, each with its part of `room`, PHOTON records, for its hits.

    steps  None: they are not wanted; else there is one chunk, whose steps are added
    """
    focused, not_gathered, of_area = np.zeros((3, len(room)), np.bool_)
    keys, beams = np.empty(len(room), np.uint32), np.empty((len(room), BEAM), np.float32)
    counts, sums = np.zeros((len(chunks), 2), np.int64), np.zeros((len(chunks), 5, 3))
    found = _Found(_Hits(room, focused, not_gathered, of_area, keys, beams), counts, sums)
    run_shared(lambda counter: _walk_chunks(tables, emitted, course, chunks, counter, found, steps), threads)
    return found


class _Course(NamedTuple):
    """How far and where photons go, see `walk`, and which random numbers they take."""

    bounces: np.int64
    limit: np.float32
    ways: Ways
    pass_index: np.uint32
    seed: np.uint32


class _Hits(NamedTuple):
    """Hits of photons: (n,) PHOTON, and beams (n, BEAM) float32; the rest as of a Walk."""

    photons: np.ndarray
    focused: np.ndarray
    not_gathered: np.ndarray
    of_area: np.ndarray
    keys: np.ndarray
    beams: np.ndarray

    def part(self, first: int, count: int) -> _Hits:
        """Return `count` rows; of the beams those of photons that have not scattered."""
        photons, focused, not_gathered, of_area, keys, beams = (each[first : first + count] for each in self)
        return _Hits(photons, focused, not_gathered, of_area, keys, beams[photons["bounce"] == 0])


class _Found(NamedTuple):
    """What a walk of some chunks of photons writes.

    hits    n rows, of which each chunk has an equal part
    counts  (chunks, 2) int64, hits, whether there is room for them or not, and rays
    sums    (chunks, 5, 3) float64 lm, emitted, absorbed, escaped, dropped and stored
    """

    hits: _Hits
    counts: np.ndarray
    sums: np.ndarray


class _Split(NamedTuple):
    """One part of a photon: which of how many, which of them is continued where they scatter next, and the
    band of its light from the start on, see `optics.dispersion`."""

    part: np.int64
    parts: int
    continued: np.int64
    band: np.int64


class _Room(NamedTuple):
    """Where a photon writes: its next row of hits, the end of those that its chunk has, and the chunk."""

    row: np.int64
    end: np.int64
    chunk: np.int64


@jit
def _walk_chunks(tables, emitted, course, chunks, counter, found, steps):
    """Walk the (N,) EMITTED photons of as many of the (chunks,) int64 as a thread gets, writing a _Found,
    and Steps where these are not None."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    room = i64(len(found.hits.photons) // max(len(chunks), 1))
    for chunk in shared_rows(counter, 1, len(chunks)):
        row, end = chunk * room, (chunk + i64(1)) * room
        rays, first = i64(0), chunks[chunk] * i64(_CHUNK)
        for i in range(first, min(first + i64(_CHUNK), len(emitted))):
            photon = emitted[i]
            parts = split_count(tables, photon, course.limit)
            continued = i64(0)
            if parts > 1:
                u, _, _, _ = random4(photon.key, u32(_CONTINUED_DIMENSION), course.pass_index, course.seed)
                continued = i64(u * f32(parts))
            bands = i64(BANDS) if is_dispersed_first(tables, photon) else i64(1)
            for number in range(parts * bands):
                band = number % bands if bands > i64(1) else ALL_BANDS
                split = _Split(number // bands, parts, continued, band)
                place = _Room(row, end, chunk)
                row, traced = _walk_one(tables, photon, split, course, scratch, found, place, steps)
                rays += traced
        found.counts[chunk, 0] = row - chunk * room
        found.counts[chunk, 1] = rays


@jit
def _walk_one(tables, photon, split, course, scratch, found, room, steps):
    """Follow a _Split of an EMITTED photon on its _Course; return the next row for hits and the number of
    rays traced. Rows from `room.end` on are counted, not written to the _Found; steps: Steps or None, for
    which the compiler leaves out what is about them."""
    row, chunk, hits, sums = room.row, room.chunk, found.hits, found.sums
    key = photon.key ^ u32(split.part << i64(PART_BIT))
    whole = vec3(photon.flux)
    flux = of_band(split.band, scale(f32(1) / f32(split.parts), whole))
    _add(sums, chunk, _EMITTED, flux)
    if photon.instance == u32(NO_HIT):
        _add(sums, chunk, _ESCAPED, flux)
        return row, i64(0)
    hit = Hit(photon.instance, photon.primitive, photon.u, photon.v)
    origin, d, within = first_segment(tables, photon)
    beam = emitted_beam(tables, photon, d)
    if steps is not None:
        write_step(steps, origin, flux, photon, key, i64(0))
    kept = scale(within, flux)
    _add_difference(sums, chunk, _ESCAPED, flux, kept)
    flux = kept
    # Thin sheets aside: has met nothing since the light, or, of the environment's, clear faces alone, and any
    # of these; comes off a mirror or glass.
    direct, refracted, focused, sent = True, False, False, d
    hidden = False  # whether gather rays do not find where it last scattered
    inside, plane = no_medium(), d  # normal of the surface that the photon left; of a light: its direction
    scatters, speculars, rays = i64(0), i64(0), i64(0)
    shines_through = tables.clear and photon.light == u32(EMITTED_BY_ENVIRONMENT)
    band, wider = split.band, f32(1)  # where chance decides, a photon stands for more of its light
    while True:
        x = surface(tables, hit, d)
        inside = medium(inside, x)
        if inside.instance != u32(NO_HIT):
            kept = attenuated(tables, inside, origin, x.position, flux)
            _add_difference(sums, chunk, _ABSORBED, flux, kept)
            flux = kept
        if steps is not None:
            met = scatters + speculars
            write_step(steps, x.position, flux, photon, key + u32(met) * u32(EVENT_STEP), met + i64(1))
        segment = sub(x.position, origin)
        length = f32(math.sqrt(dot(segment, segment)))
        if scatters == i64(0):
            beam = beam_at(beam, length, d, x.ng)
        drawn = direct and (not refracted or (speculars <= FACES and is_drawn(tables.environment, sent, d)))
        if not drawn and (shows_photons(x.bsdf) or has_sheen(x) or is_translucent(x)):
            if row < room.end:
                more = weight_met(tables, hit)
                clear = abs(dot(segment, plane))
                store_photon(hits.photons[row], x, scale(more, flux), d, clear, length, scatters)
                hits.focused[row], hits.not_gathered[row] = focused, focused or hidden
                hits.of_area[row] = photon.light >= u32(EMITTED_BY_ENVIRONMENT)
                hits.keys[row] = key + u32(scatters + speculars) * u32(EVENT_STEP)
                if scatters == i64(0):
                    store_beam(hits.beams, row, beam, wider * f32(math.sqrt(more)), plane)
            _add(sums, chunk, _STORED, flux)
            row += 1
        last = scatters == course.bounces
        if last and not is_smooth(x.bsdf):
            _add(sums, chunk, _DROPPED, flux)
            break
        if is_dispersive(x):
            if band == ALL_BANDS:
                band, chance = draw_band(flux, x.bsdf, band_number(key, course.pass_index, course.seed))
                kept = scale(f32(1) / chance, of_band(band, flux))
                _add_difference(sums, chunk, _ABSORBED, flux, kept)
                flux, wider = kept, wider / f32(math.sqrt(chance))
            x = in_band(tables, x, band)
        event = Event(key, scatters, speculars, course.pass_index, course.seed)
        alive, wi, scattered, specular, chance = next_flight(event, x, d, flux, course.ways)
        if alive and last and not specular:
            _add(sums, chunk, _DROPPED, flux)
            break
        if alive and not specular and scatters == i64(1):
            alive = split.part == split.continued
            scattered = scale(f32(split.parts), scattered)
        if not alive:
            _add(sums, chunk, _ABSORBED, flux)
            break
        _add_difference(sums, chunk, _ABSORBED, flux, scattered)
        if steps is not None:
            write_event(steps, x, wi, specular)
        if not specular:
            hidden = not (is_gathered(x.bsdf) or has_sheen(x) or is_translucent(x))
            if scatters == i64(0):
                layer = layer_left(event, x)
                hidden = hidden or not drawn or layer == BY_COAT
                hidden = hidden or is_bright_first_bounce(
                    tables, photon, x, wi, course.limit, layer == BY_SHEEN
                )
        elif scatters == i64(0):
            eta = f32(1) if x.flags & u32(MATERIAL_THIN) else x.bsdf.eta
            beam = redirected_beam(tables.surfaces, hit, beam, d, wi, x.ng, x.n, eta)
            wider /= f32(math.sqrt(max(chance, _LEAST_CHANCE)))
        arriving, flux, d, origin, plane = d, scattered, wi, x.position, x.ng
        u = flight_number(event)
        speculars += i64(specular)
        scatters += i64(not specular)
        passed_through_thin = specular and passed_sheet(x, d)
        if shines_through and specular and not passed_through_thin:
            direct, refracted = direct and goes_through(x, arriving, d), True
        else:
            direct = direct and passed_through_thin
        focused = focused if passed_through_thin else specular
        start, inside = spawn_ray(tables, x, inside, d)
        rays += i64(1)
        met, hit = closest_surface(tables, start, d, u, scratch)
        if not met:
            _add(sums, chunk, _ESCAPED, flux)
            break
    return row, rays


@jit
def _add(sums, chunk, fate, flux):
    """Add a flux, lm, to the (chunks, 5, 3) float64 sums; fate: `_EMITTED` to `_STORED`."""
    for c in literal_unroll((0, 1, 2)):
        sums[chunk, fate, c] += flux[c]


@jit
def _add_difference(sums, chunk, fate, before, after):
    """Add what was lost of a flux likewise, in float64."""
    for c in literal_unroll((0, 1, 2)):
        sums[chunk, fate, c] += np.float64(before[c]) - np.float64(after[c])
