"""Light of photons at receivers, eight of these at a time.

Up to 64 receivers that lie close together make a tile: rows of floats, eight a block, so that what one photon
brings to a block is computed in vectors. A block that a photon's ellipsoid does not reach is passed over.
Records, tiles and boxes are given by their addresses.
"""

from __future__ import annotations

import numpy as np

from ispm.kernels.simd import ldf, ldu, stf
from ispm.optics.bsdf import NARROW_ALPHA, gloss
from ispm.optics.density import cosine_ratio, density_kernel, photon_counts
from ispm.optics.jit import jit
from ispm.optics.records import INNER, PHOTON, RECEIVER
from ispm.optics.vector import add, dot, sub

f32, u32, uint64 = np.float32, np.uint32, np.uint64

CHANNELS = 16
TILE = 64  # receivers
LANES = 8  # of a block: what one vector instruction works on
FAR = f32(1e15)  # m; its square is a float too
BOX = 6  # floats of a box: low and high corner
BLOCKS = TILE // LANES


def _word(record: np.dtype, name: str) -> int:
    """Offset of a field in its record, in units of 4 bytes."""
    assert record.fields is not None
    return int(record.fields[name][1]) // 4


_ALPHA, _NG, _VALID, _N, _WO = (_word(RECEIVER, name) for name in ("alpha", "ng", "valid", "n", "wo"))
RADIUS, _FLUX, _WI, NORMAL, HEIGHT, _BOUNCE, _INSTANCE = (
    _word(PHOTON, name) for name in ("radius", "flux", "wi", "normal", "height", "bounce", "instance")
)
WORDS = PHOTON.itemsize // 4
assert RECEIVER.itemsize == PHOTON.itemsize and _word(RECEIVER, "position") == _word(PHOTON, "position") == 0

# A tile's receivers as it works on them: rows of 64 floats, sums behind, then the blocks' boxes.
_ROW_NG, _ROW_N, _ROW_WO, _ROW_ALPHA, _ROW_INNER, _ROW_SUMS = 3, 6, 9, 12, 13, 14
_ROWS = _ROW_SUMS + CHANNELS
_BOXES = _ROWS * TILE
WORK = (_BOXES + BOX * BLOCKS) // 2  # in 8 bytes


@jit
def is_valid(receivers, i):
    """Return whether the RECEIVER of row `i` is to be lit."""
    return ldu(receivers, i * WORDS + _VALID) != u32(0)


@jit
def is_inner(word):
    """Return whether INNER is set in a word of a PHOTON (instance), CAUSTIC (side) or RECEIVER (valid)."""
    return word & u32(INNER) != u32(0)


@jit
def vector(base, first):
    """Return three float32 in a row, from number `first` on."""
    return ldf(base, first), ldf(base, first + 1), ldf(base, first + 2)


@jit
def empty_box(boxes, box):
    """Make a box, of BOX float32, hold nothing."""
    for axis in range(3):
        stf(boxes, box * BOX + axis, FAR)
        stf(boxes, box * BOX + 3 + axis, -FAR)


@jit
def extend_box(boxes, box, point):
    """Make a box hold a point, (3,) m, too."""
    for axis in range(3):
        low, high = box * BOX + axis, box * BOX + 3 + axis
        stf(boxes, low, min(ldf(boxes, low), point[axis]))
        stf(boxes, high, max(ldf(boxes, high), point[axis]))


@jit
def meets(photon, box):
    """Return whether a PHOTON's ellipsoid may reach into a box: its sphere does, and its slab does."""
    x, n = vector(photon, 0), vector(photon, NORMAL)
    low, high = vector(box, 0), vector(box, 3)
    d2 = (
        _outside2(x[0], low[0], high[0]) + _outside2(x[1], low[1], high[1]) + _outside2(x[2], low[2], high[2])
    )
    half = (high[0] - low[0]) * abs(n[0]) + (high[1] - low[1]) * abs(n[1]) + (high[2] - low[2]) * abs(n[2])
    along = dot(add(low, high), n) - f32(2) * dot(x, n)
    # a little more than reach, for the rounding of the sums
    radius, height = ldf(photon, RADIUS) * f32(1.0001), ldf(photon, HEIGHT) * f32(1.0001)
    reach = max(radius, height)
    return (d2 < reach * reach) & (abs(along) - half * f32(1.0001) < f32(2) * height)


@jit
def _outside2(x, low, high):
    """Squared distance, m2, of x from the interval from low to high, m."""
    d = max(max(low - x, x - high), f32(0))
    return d * d


@jit
def clear(work):
    """Empty a tile, of WORK uint64."""
    for word in range(_ROWS * TILE):
        stf(work, word, f32(0))
    for block in range(BLOCKS):
        empty_box(_boxes(work), block)
    for k in range(TILE):
        stf(work, k, FAR)  # beyond the reach of any photon


@jit
def put(work, k, receivers, i):
    """Make the RECEIVER of row `i`, if it is to be lit, number k of the tile; return whether it has a glossy
    lobe."""
    if not is_valid(receivers, i):
        return False
    extend_box(_boxes(work), k // LANES, vector(receivers, i * WORDS))
    for axis in range(3):
        stf(work, axis * TILE + k, ldf(receivers, i * WORDS + axis))
        stf(work, (_ROW_NG + axis) * TILE + k, ldf(receivers, i * WORDS + _NG + axis))
        stf(work, (_ROW_N + axis) * TILE + k, ldf(receivers, i * WORDS + _N + axis))
        stf(work, (_ROW_WO + axis) * TILE + k, ldf(receivers, i * WORDS + _WO + axis))
    inner = is_inner(ldu(receivers, i * WORDS + _VALID))
    stf(work, _ROW_INNER * TILE + k, f32(1) if inner else f32(0))
    alpha = ldf(receivers, i * WORDS + _ALPHA)
    stf(work, _ROW_ALPHA * TILE + k, alpha)
    return alpha > f32(0)


@jit
def add_to_tile(work, photon, blocks, glossy):
    """Add what a PHOTON brings to the sums of the tile's first blocks.

    glossy  whether any receiver has a glossy lobe
    """
    for block in range(blocks):
        if meets(photon, box_of(work, block)):
            if glossy:
                _add_glossy(photon, work + uint64(block * LANES * 4))
            else:
                _add_diffuse(photon, work + uint64(block * LANES * 4))


@jit
def take_out(work, k, out, i):
    """Write the sums of the tile's receiver k to row `i` of (n, 16) float32."""
    for channel in range(CHANNELS):
        stf(out, i * CHANNELS + channel, ldf(work, (_ROW_SUMS + channel) * TILE + k))


@jit
def box_of(work, block):
    """Return the address of the box of a block: BOX float32."""
    return _boxes(work) + uint64(block * BOX * 4)


@jit
def _boxes(work):
    """Address of the (8, BOX) float32 boxes of a tile's blocks."""
    return work + uint64(_BOXES * 4)


@jit
def _row(work, row, k):
    """A vector of receiver k, float32, from three rows."""
    return ldf(work, row * TILE + k), ldf(work, (row + 1) * TILE + k), ldf(work, (row + 2) * TILE + k)


@jit
def _add_diffuse(photon, work):
    """Add a PHOTON to the sums of a block whose receivers have no glossy lobe."""
    flux, kernel = vector(photon, _FLUX), _kernel(photon)
    for k in range(LANES):
        _add_arriving(work, k, kernel, flux)


@jit
def _add_glossy(photon, work):
    """Add a PHOTON to the sums of a block."""
    flux, kernel = vector(photon, _FLUX), _kernel(photon)
    _, _, wi, _, _, _ = kernel
    least = least_gloss(ldu(photon, _BOUNCE))
    for k in range(LANES):
        add_gloss(work, k, _add_arriving(work, k, kernel, flux), wi, least, flux)


@jit
def least_gloss(bounce):
    """Return the least alpha, float32, of lobes that see a photon of so many bounces; as photon_gloss in
    bsdf.wgsl."""
    return NARROW_ALPHA if bounce > u32(0) else f32(0)


@jit
def add_gloss(work, k, light, wi, least, flux):
    """Add what the glossy lobe of receiver k of a block makes of light from wi.

    light  irradiance over flux, 1/m2;  least  alpha of the narrowest lobe that sees it;  flux  (3,) lm
    """
    alpha, n, wo = ldf(work, _ROW_ALPHA * TILE + k), _row(work, _ROW_N, k), _row(work, _ROW_WO, k)
    # gloss() without its gate: a branch would keep the loop from becoming vectors
    dv, fc = gloss(alpha, n, wo, wi)
    visible = (alpha > f32(0)) & (dot(n, wo) > f32(0)) & (dot(n, wi) > f32(0))
    dv = dv if visible & (alpha >= least) else f32(0)
    fc = fc if visible else f32(0)
    _add(work, 4, k, light * fc, flux)
    _add(work, 8, k, light * dv * (f32(1) - fc), flux)
    _add(work, 12, k, light * dv * fc, flux)


@jit
def _kernel(photon):
    """A PHOTON's kernel: position, normal, wi, radius, height and whether it is INNER, 1 or 0."""
    position, normal, wi = vector(photon, 0), vector(photon, NORMAL), vector(photon, _WI)
    inner = f32(1) if is_inner(ldu(photon, _INSTANCE)) else f32(0)
    return position, normal, wi, ldf(photon, RADIUS), ldf(photon, HEIGHT), inner


@jit
def _add_arriving(work, k, kernel, flux):
    """Add a photon's irradiance and density at receiver k of a block, and return the former over its flux,
    1/m2. Both are zero where the photon does not count.

    kernel  as of `_kernel`;  flux  (3,) lm
    """
    position, normal, wi, radius, height, inner = kernel
    kappa = density_kernel(sub(place(work, k), position), normal, radius, height)
    return add_arriving(work, k, kappa, normal, wi, inner, flux)


@jit
def place(work, k):
    """Return the position of receiver k of a block, m."""
    return _row(work, 0, k)


@jit
def add_arriving(work, k, kappa, normal, wi, inner, flux):
    """Add the irradiance and density of a photon whose kernel is kappa, 1/m2, at receiver k of a block, and
    return the former over its flux, 1/m2; both are zero where it does not count.

    normal  unit, of the photon's surface;  inner  1 if it is INNER, else 0;  flux  (3,) lm
    """
    ng = _row(work, _ROW_NG, k)
    wi_ng = dot(wi, ng)
    kappa = (
        kappa if photon_counts(wi_ng, dot(normal, ng), inner, ldf(work, _ROW_INNER * TILE + k)) else f32(0)
    )
    ratio = cosine_ratio(dot(wi, _row(work, _ROW_N, k)), wi_ng)
    light = kappa * ratio if kappa > f32(0) else f32(0)
    _add(work, 0, k, light, flux)
    _add_one(work, 3, k, kappa)
    return light


@jit
def _add(work, channel, k, weight, flux):
    """Add weight times flux, lm, to three sums of receiver k, from a channel on."""
    _add_one(work, channel, k, weight * flux[0])
    _add_one(work, channel + 1, k, weight * flux[1])
    _add_one(work, channel + 2, k, weight * flux[2])


@jit
def _add_one(work, channel, k, value):
    """Add a float32 to one sum of receiver k."""
    word = (_ROW_SUMS + channel) * TILE + k
    stf(work, word, ldf(work, word) + value)
