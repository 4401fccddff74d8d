"""Direct light of lights without a surface at the eye's pixels by shadow rays, where maps would take longer.

It runs on the CPU, where the trees are. The lights that bring a pixel most have a ray each, so that shadows
that show have sharp edges; of the others one is drawn, see `lights/few.py`. In the first pass what the
neighbors of a pixel see of those that they draw tells how much of the others' light it gets, a ratio of means
as in `stages/area_light.py`; what a surface reflects of them, but for its Lambert lobe, is their mean. Later
passes take what they draw as it is, so that their mean converges.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Scratch
from ispm.accel.shaft import MOST, list_met
from ispm.accel.surface import SurfaceTable, scene_tables
from ispm.accel.transmittance import listed_transmittance, shadow_transmittance
from ispm.accel.world import World
from ispm.kernels.share import run_shared, shared_rows
from ispm.kernels.simd import alloca, u2f
from ispm.lights.few import choose
from ispm.lights.nee import greatest, side_of, times
from ispm.optics.bsdf import eval_bsdf
from ispm.optics.jit import jit
from ispm.optics.light import FAR, light_arriving, reaches
from ispm.optics.records import LIGHT_DIRECTIONAL
from ispm.optics.rng import random4
from ispm.optics.vector import add, dot, scale, sub, vec3
from ispm.scene.packed import Packed
from ispm.settings import Settings
from ispm.stages.pixels import Pixels, PixelView, is_alike, is_lit, lift, plane_at, shown_at

f32, i64, u32 = np.float32, np.int64, np.uint32

_DIMENSION = 6 << 20  # of the random numbers
_SIDE = 4  # pixels of a square that draws from each part of the others once
_REACH = 2  # pixels to each side that tell what a pixel sees of the others
_CHUNK = 64  # pixels a thread takes at a time
_TILE = 8  # pixels to a side of a tile, whose rays to a light go together
_FEW = 4  # rays that are fewer go by themselves
_NONE = f32(0), f32(0), f32(0)
_DRAW_NS = 270.0  # of a processor, that a software adapter takes to draw a triangle for one light
_TRACE_NS = 900.0  # likewise, about, that the rays of a pixel take


# A shadow ray of a pixel: to which of a tile's lights, -1: none; where it starts, m, the unit direction, and
# metres to the light; radiance that this makes but for shadows, cd/m2. When traced, `toward` is the share of
# light, RGB, that passes, and `brought` what comes.
_RAY = np.dtype([
    ("light", "<i4"), ("start", "<f4", 3), ("toward", "<f4", 3), ("distance", "<f4"), ("brought", "<f4", 3),
])  # fmt: skip


class _Tile(NamedTuple):
    """What a thread writes of a tile of pixels and of the lights that reach it, of which there are up to m.

    lights   (m,) int64 rows of these
    values   (m,) float32, sums of channels of the radiance along wo that each makes in a pixel but for
             shadows, `brought`, (m, 3) cd/m2, where there is any
    rays     (3 n,) _RAY, of each pixel to the two lights that bring most and to the one drawn
    """

    lights: np.ndarray
    values: np.ndarray
    brought: np.ndarray
    rays: np.ndarray


class _Samples(NamedTuple):
    """What shadow rays found at n pixels, float32.

    sure    (n, 3) light of those lights that have rays of their own, cd/m2
    others  (n, 3) likewise of the others, but for their shadows
    weight  (n,) what the one drawn stands for, sum of channels; 0: `others` has its shadows
    passed  (n, 3) and as much of it as passes what is between
    """

    sure: np.ndarray
    others: np.ndarray
    weight: np.ndarray
    passed: np.ndarray


def takes_rays(packed: Packed, settings: Settings, software: bool) -> bool:
    """Return whether lights without a surface have rays in place of shadow maps.

    software  the adapter is a program on the CPU: where the settings leave the choice, rays are taken if it
              takes longer to draw all triangles for each light
    """
    if settings.shadows != "auto":
        return settings.shadows == "rays" and len(packed.lights) > 0
    pixels = math.prod(settings.size)
    return software and packed.triangle_count * len(packed.lights) * _DRAW_NS > pixels * _TRACE_NS


def point_light(
    pixels: Pixels, view: PixelView, packed: Packed, world: World, surfaces: SurfaceTable
) -> np.ndarray:
    """Return the direct light of lights without a surface, (n, 4) float32 cd/m2 of the n pixels; of an
    opacity of 1."""
    count = len(pixels.points)
    tables = scene_tables(packed, world, surfaces)
    sure, others, passed = np.zeros((3, count, 3), np.float32)
    samples = _Samples(sure, others, np.zeros(count, np.float32), passed)
    out = np.ones((count, 4), np.float32)

    def sample(counter: np.uint64) -> None:
        lights = len(packed.lights)
        values, brought = np.empty(lights, np.float32), np.empty((lights, 3), np.float32)
        own = _Tile(np.empty(lights, np.int64), values, brought, np.empty(3 * _TILE**2, _RAY))
        _sample_pixels(tables, pixels, view, own, counter, samples)

    run_shared(sample, world.threads)
    run_shared(lambda counter: _filter(pixels, view, samples, counter, out), world.threads)
    return out


@jit
def _sample_pixels(tables, pixels, view, own, counter, samples):
    """Trace the rays of as many tiles of the Pixels as a thread gets, whose _Tile is its own."""
    scratch, refs = Scratch(alloca(STACK_WORDS), alloca(2)), alloca(MOST)
    across = (view.columns + i64(_TILE - 1)) // _TILE
    down = (i64(len(pixels.points)) // view.columns + i64(_TILE - 1)) // _TILE
    for tile in shared_rows(counter, 1, across * down):
        reaching = _lights_of_tile(tables, pixels, view, tile, own)
        if reaching == i64(0):
            continue
        own.rays["light"][:] = -1
        for n in range(_TILE * _TILE):
            i = _pixel_of(pixels, view, tile, n)
            if i >= i64(0) and is_lit(tables, pixels, i):
                shown, pick = shown_at(tables, pixels, view, i), _pick(view, i)
                _choose(tables, shown, pick, view.pass_index == u32(0), reaching, own, n, samples, i)
        for light in range(reaching):
            count = _list_for(tables, own, light, scratch, refs)
            for row in range(len(own.rays)):
                ray = own.rays[row]
                if ray.light == light:
                    told = vec3(ray.start), vec3(ray.toward), ray.distance
                    if count >= i64(0):
                        passed = listed_transmittance(tables, *told, refs, count, scratch)
                    else:
                        passed = shadow_transmittance(tables, *told, scratch)
                    for c in range(3):
                        ray.brought[c] *= passed[c]
                        ray.toward[c] = passed[c]
        for n in range(_TILE * _TILE):
            i = _pixel_of(pixels, view, tile, n)
            if i >= i64(0):
                _add_up(own, n, samples, i)


@jit
def _pixel_of(pixels, view, tile, n):
    """The row, int64, of Pixels of pixel n of a tile; -1: it is beyond the picture."""
    across = (view.columns + i64(_TILE - 1)) // _TILE
    column, row = tile % across * _TILE + n % _TILE, tile // across * _TILE + n // _TILE
    i = row * view.columns + column
    return i if column < view.columns and i < i64(len(pixels.points)) else i64(-1)


@jit
def _lights_of_tile(tables, pixels, view, tile, own):
    """Write the rows of the lights that reach any pixel of a tile; return how many."""
    low, high = (FAR, FAR, FAR), (-FAR, -FAR, -FAR)
    for n in range(_TILE * _TILE):
        i = _pixel_of(pixels, view, tile, n)
        if i >= i64(0) and is_lit(tables, pixels, i):
            point = pixels.points[i]
            low, high = _grown(low, high, (u2f(point[0]), u2f(point[1]), u2f(point[2])))
    count = i64(0)
    if low[0] <= high[0]:
        for k in range(len(tables.lights)):
            x, y, z = vec3(tables.lights[k].position)
            across, up = min(max(x, low[0]), high[0]), min(max(y, low[1]), high[1])
            nearest = across, up, min(max(z, low[2]), high[2])
            if reaches(tables.lights[k], nearest):
                own.lights[count] = k
                count += i64(1)
    return count


@jit
def _grown(low, high, p):
    """A box with a point in it."""
    low = min(low[0], p[0]), min(low[1], p[1]), min(low[2], p[2])
    return low, (max(high[0], p[0]), max(high[1], p[1]), max(high[2], p[2]))


@jit
def _pick(view, i):
    """The number of [0, 1) by which pixel `i` draws a light: those of a square lie in as many parts."""
    r0, _, _, _ = random4(u32(i), u32(_DIMENSION), view.pass_index, view.seed)
    shift, _, _, _ = random4(u32(0), u32(_DIMENSION + 1), view.pass_index, view.seed)
    column, row = i % view.columns % _SIDE, i // view.columns % _SIDE
    pick = (f32((row * _SIDE + column) * 7 % (_SIDE * _SIDE)) + r0) * f32(1 / (_SIDE * _SIDE)) + shift
    return pick - f32(math.floor(pick))


@jit
def _choose(tables, shown, pick, first, reaching, own, n, samples, i):
    """Write the rays of pixel `n` of a tile, and in row i of the _Samples what shadows do not change.

    pick      random in [0, 1): draws a light
    first     whether the others' shadows are left to the filter
    reaching  how many lights reach the tile
    """
    unshadowed = _NONE
    for k in range(reaching):
        brought = _brought(tables.lights[own.lights[k]], shown.x, shown.wo)
        own.values[k] = _sum(brought)
        if own.values[k] > f32(0):
            unshadowed = add(unshadowed, brought)
            for c in range(3):
                own.brought[k, c] = brought[c]
    few = choose(own.values[:reaching], pick)
    for slot, k in enumerate((few.best, few.second)):
        if k >= i64(0):
            unshadowed = sub(unshadowed, vec3(own.brought[k]))
            _aim(tables, shown, k, f32(1), own, 3 * n + slot)
    if few.drawn < i64(0):
        return
    _aim(tables, shown, few.drawn, few.weight, own, 3 * n + 2)
    if first and few.weight > f32(1):  # of one there is no doubt which to draw
        samples.weight[i] = few.weight * own.values[few.drawn]
        for c in range(3):
            samples.others[i, c] = max(unshadowed[c], f32(0))


@jit
def _aim(tables, shown, k, weight, own, row):
    """Write a row of the rays: to light `k` of the tile, whose light counts so often."""
    ray, x, light = own.rays[row], shown.x, tables.lights[own.lights[k]]
    _, distance, wi = light_arriving(light, x.position)
    start, toward = add(x.position, scale(lift(tables, shown), side_of(x.ng, wi))), wi
    if distance < FAR:
        segment = sub(add(x.position, scale(distance, wi)), start)
        distance = f32(math.sqrt(dot(segment, segment)))
        toward = scale(f32(1) / max(distance, f32(1e-30)), segment)
    ray.light, ray.distance = k, distance
    for c in range(3):
        ray.start[c], ray.toward[c], ray.brought[c] = start[c], toward[c], weight * own.brought[k, c]


@jit
def _list_for(tables, own, light, scratch, refs):
    """List what the rays to a light of the tile may meet, see `list_met`; -1: each is to find it itself."""
    low, high, count = (FAR, FAR, FAR), (-FAR, -FAR, -FAR), 0
    for row in range(len(own.rays)):
        if own.rays[row].light == light:
            low, high = _grown(low, high, vec3(own.rays[row].start))
            count += 1
    if count < _FEW or tables.lights[own.lights[light]].kind == u32(LIGHT_DIRECTIONAL):
        return i64(-1)
    return list_met(
        tables.trees, vec3(tables.lights[own.lights[light]].position), low, high, scratch.stack, refs
    )


@jit
def _add_up(own, n, samples, i):
    """Write row i of the _Samples what the rays of pixel `n` of a tile have found."""
    for slot in range(2):
        if own.rays[3 * n + slot].light >= 0:
            for c in range(3):
                samples.sure[i, c] += own.rays[3 * n + slot].brought[c]
    ray = own.rays[3 * n + 2]
    if ray.light < 0:
        return
    for c in range(3):
        if samples.weight[i] == f32(0):
            samples.others[i, c] = ray.brought[c]
        samples.passed[i, c] = samples.weight[i] * ray.toward[c]


@jit
def _brought(light, x, wo):
    """The radiance along wo that a LIGHT makes at a SurfacePoint but for shadows, cd/m2; black where the
    surface hides it itself."""
    if not reaches(light, x.position):
        return _NONE
    irradiance, _, wi = light_arriving(light, x.position)
    along, above = dot(x.n, wi), dot(x.ng, wi) > f32(0)
    lit = (above and along > f32(0)) or (x.bsdf.thin > f32(0) and not above)
    if not lit or greatest(irradiance) <= f32(0):
        return _NONE
    return scale(abs(along), times(irradiance, eval_bsdf(x.bsdf, x.n, x.ng, wo, wi)))


@jit
def _filter(pixels, view, samples, counter, out):
    """Write the light of as many of the Pixels as a thread gets to (n, 4) float32."""
    columns, rows = view.columns, i64(len(pixels.points)) // view.columns
    for i in shared_rows(counter, _CHUNK, len(pixels.points)):
        share = f32(1), f32(1), f32(1)
        if samples.weight[i] > f32(0):
            row, column, plane = i // columns, i % columns, plane_at(pixels, view, i)
            weight, passed = f32(0), _NONE
            for y in range(max(row - _REACH, 0), min(row + _REACH, rows - 1) + 1):
                for x in range(max(column - _REACH, 0), min(column + _REACH, columns - 1) + 1):
                    k = y * columns + x
                    if samples.weight[k] > f32(0) and (k == i or is_alike(pixels, plane, i, k)):
                        # Those at the ends count half: each part that is drawn from has the same weight.
                        half = f32(0.5) if abs(y - row) == _REACH else f32(1)
                        half *= f32(0.5) if abs(x - column) == _REACH else f32(1)
                        weight += half * samples.weight[k]
                        passed = add(passed, scale(half, vec3(samples.passed[k])))
            share = scale(f32(1) / weight, passed)
        light = add(vec3(samples.sure[i]), times(share, vec3(samples.others[i])))
        for c in range(3):
            out[i, c] = light[c]


@jit
def _sum(a):
    """The sum of linear RGB's channels."""
    return a[0] + a[1] + a[2]
