"""From linear radiance to what a screen shows: exposure, tone curve, sRGB."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from ispm.kernels.threads import run_threads, thread_count
from ispm.optics.jit import jit
from ispm.optics.vector import LUMINANCE
from ispm.scene.color import encoded

MIDDLE_GREY = 0.18
_LAMP = 16.0  # times the middle, from which on light is a lamp's
_TRIM = 10.0  # per cent left out at either end, so that lamps and corners do not set the exposure
_METERED_PIXELS = 1 << 16  # pixels that auto exposure looks at

_TABLE_SIZE = 1 << 14  # its steps are at most 0.2 of a step of sRGB, where sRGB is steepest
_CODES = {8: np.uint8, 16: np.uint16}
_NONE, _NEUTRAL, _AGX = range(3)
_MODES = {"none": _NONE, "neutral": _NEUTRAL, "agx": _AGX}

# Khronos PBR Neutral 1.0, in the letters of its specification.
_F90 = np.float32(0.04)
_START = np.float32(0.8 - 0.04)
_DESATURATION = np.float32(0.15)

# AgX: the range of light it shows, in stops about middle grey, and the sigmoid through its middle, of
# slope 2, whose toe and shoulder end in 0 and 1. Source: Sobotka, AgX-S2O3, AgX.py.
_BELOW, _ABOVE = 10.0, 6.5
_PIVOT = _BELOW / (_BELOW + _ABOVE)
_TOE, _SHOULDER = 3.0, 3.25
_TOE_SCALE = 4.0**_TOE - _PIVOT**-_TOE
_SHOULDER_SCALE = 4.0**_SHOULDER - (1.0 - _PIVOT) ** -_SHOULDER
# Its primaries, narrowed before the sigmoid and widened again after it. Source: Chow, AgX_LUT_Gen,
# AgXBaseRec2020.py, as Blender and Filament have them; between them and Rec. 709 ITU-R BT.2087.
_REC2020 = np.array(
    [[0.627404, 0.329283, 0.043313], [0.069097, 0.919541, 0.011362], [0.016391, 0.088013, 0.895595]]
)
_INSET = np.array(
    [
        [0.856627153315983, 0.0951212405381588, 0.0482516061458583],
        [0.137318972929847, 0.761241990602591, 0.101439036467562],
        [0.11189821299995, 0.0767994186031903, 0.811302368396859],
    ]
)
_OUTSET = np.linalg.inv(
    [
        [0.899796955911611, 0.0871996192028351, 0.013003424885555],
        [0.11142098895748, 0.875575586156966, 0.0130034248855548],
        [0.11142098895748, 0.0871996192028349, 0.801379391839686],
    ]
)
_TO_AGX = tuple(tuple(row) for row in (_INSET @ _REC2020).astype(np.float32))
_WIDENED = tuple(tuple(row) for row in _OUTSET.astype(np.float32))
_FROM_REC2020 = tuple(tuple(row) for row in np.linalg.inv(_REC2020).astype(np.float32))
_DARKEST = np.float32(0.18 * 2.0**-_BELOW)

_BRIGHTEST = np.float32(1e8)  # keeps the curve's divisions finite for infinite radiance
_0, _1 = np.float32(0.0), np.float32(1.0)


def auto_exposure(radiance: np.ndarray, emission: np.ndarray | None = None) -> float:
    """Return the exposure in stops that shows a picture's middle luminance as middle grey, or less, so
    that no more than a tenth of what is lit is brighter than white; lamps aside, which are white at any
    exposure that shows the rest: what is more than 16 times as bright as the middle, most of it by emission.

    radiance  (h, w, 3) float32, cd/m^2, linear
    emission  (h, w, 3) float32, what of it is emitted, also in mirrors; None: nothing
    The middle is the mean of log luminance over the pixels that are not black, without the darkest and
    the brightest tenth. It depends on nothing but the picture; a black picture has exposure 0.
    Source: the log-average of Reinhard et al. 2002, eq. 1, trimmed.
    """
    step = max(1, math.isqrt(radiance.shape[0] * radiance.shape[1] // _METERED_PIXELS))
    luminance = _luminance(radiance[::step, ::step])
    is_lit = np.isfinite(luminance) & (luminance > 0.0)
    lit = luminance[is_lit]
    if not len(lit):
        return 0.0
    last = len(lit) - 1 - _trimmed(lit)
    middle = float(np.log2(np.partition(lit, (_trimmed(lit), last))[_trimmed(lit) : last + 1]).mean())
    if emission is not None:
        glows = _luminance(emission[::step, ::step])[is_lit] > 0.5 * lit
        lit = lit[~(glows & (lit > _LAMP * 2.0**middle))]
        last = len(lit) - 1 - _trimmed(lit)
    return min(math.log2(MIDDLE_GREY) - middle, -math.log2(np.partition(lit, last)[last]))


def _trimmed(lit: np.ndarray) -> int:
    """How many of (n,) values are left out at either end."""
    return int(len(lit) * _TRIM / 100.0)


def _luminance(seen: np.ndarray) -> np.ndarray:
    """(h, w) float64 luminance of (h, w, 3) radiance."""
    luminance = np.zeros(seen.shape[:2])
    for c in range(3):
        luminance += np.float64(LUMINANCE[c]) * seen[..., c]
    return luminance


def tonemap(
    radiance: np.ndarray,
    exposure: float,
    mode: str = "neutral",
    threads: int | None = None,
    bits: int = 8,
    behind: np.ndarray | None = None,
) -> np.ndarray:
    """Return (h, w, 3) sRGB, uint8 or with 16 bits uint16, for (h, w, 3) float32 linear radiance.

    exposure  stops: radiance is multiplied by 2 ** exposure
    mode      `neutral`: Khronos PBR Neutral; `agx`: AgX; `none`: clipped at 1
    behind    (h, w, 3) float32, linear light of the screen that is added as it is
    NaN and negative values are shown as black. Cost about 10 ms at 1280 x 720 on two cores, `agx` 100.
    """
    values = np.ascontiguousarray(radiance, np.float32)
    out = np.empty(values.shape, _CODES[bits])
    count = thread_count(threads)
    edges = np.linspace(0, values.size // 3, count + 1).astype(np.int64)
    flat, result, table = values.reshape(-1), out.reshape(-1), _srgb_table(bits)
    more = np.zeros(0, np.float32) if behind is None else np.ascontiguousarray(behind, np.float32).reshape(-1)
    scale = np.float32(2.0**exposure)
    run_threads(
        lambda k: _tonemap(flat, scale, _MODES[mode], table, more, edges[k], edges[k + 1], result), count
    )
    return out


def tonemap_transparent(
    radiance: np.ndarray,
    alpha: np.ndarray,
    exposure: float,
    mode: str = "neutral",
    bits: int = 8,
) -> np.ndarray:
    """Return (h, w, 4) sRGB as `tonemap` does, with straight alpha, as PNG has it.

    radiance  of what covers a pixel times the share that it covers, `alpha` (h, w)
    """
    covered = radiance / np.where(alpha > 0.0, alpha, np.float32(1.0))[..., None]
    color = tonemap(covered, exposure, mode, bits=bits)
    opacity = np.rint(alpha * (2.0**bits - 1.0)).astype(color.dtype)
    return np.concatenate([color, opacity[..., None]], axis=2)


@cache
def _srgb_table(bits: int) -> np.ndarray:
    """Return sRGB codes of linear values from 0 to 1, _TABLE_SIZE or, of 16 bits, 256 times as many."""
    linear = np.linspace(0.0, 1.0, _TABLE_SIZE << (bits - 8))
    return np.asarray(np.rint(encoded(linear) * (2**bits - 1)), _CODES[bits])


@jit
def _tonemap(radiance, scale, mode, table, behind, first, last, out):
    """Write the sRGB codes of pixels first to last into `out`, (3 n,) uint8 or uint16.

    radiance  (3 n,) float32 linear;  scale  float32, 2^exposure;  mode  one of _MODES
    table     (k,) codes of linear 0..1;  behind  (3 n,) float32 linear that is added, or empty
    """
    top, half = np.float32(len(table) - 1), np.float32(0.5)
    for p in range(first, last):
        r = _clean(radiance[3 * p] * scale)
        g = _clean(radiance[3 * p + 1] * scale)
        b = _clean(radiance[3 * p + 2] * scale)
        if mode == _NEUTRAL:
            r, g, b = neutral(r, g, b)
        elif mode == _AGX:
            r, g, b = agx(r, g, b)
        if len(behind) > 0:
            r, g, b = r + behind[3 * p], g + behind[3 * p + 1], b + behind[3 * p + 2]
        out[3 * p] = table[int(min(r, _1) * top + half)]
        out[3 * p + 1] = table[int(min(g, _1) * top + half)]
        out[3 * p + 2] = table[int(min(b, _1) * top + half)]


@jit
def neutral(r, g, b):
    """Return the Khronos PBR Neutral tone curve of a linear color, three float32.

    The Fresnel offset that a 4 % reflection adds is taken off, so base colors come out as they went in;
    above _START the peak is compressed towards 1 and the color drawn towards white.
    Source: Khronos PBR Neutral Tone Mapper, specification 1.0.
    """
    low = min(r, g, b)
    # The parabola meets the constant offset at twice F90 with equal slope.
    offset = low - low * low / (np.float32(4.0) * _F90) if low < np.float32(2.0) * _F90 else _F90
    r, g, b = r - offset, g - offset, b - offset
    peak = max(r, g, b)
    if peak <= _START:
        return r, g, b
    room = _1 - _START
    new_peak = _1 - room * room / (peak + room - _START)
    shrink = new_peak / peak
    white = _1 - _1 / (_DESATURATION * (peak - new_peak) + _1)
    keep = shrink * (_1 - white)
    rest = new_peak * white
    return r * keep + rest, g * keep + rest, b * keep + rest


@jit
def agx(r, g, b):
    """Return the AgX tone curve of a linear color, three float32, "base" look: per channel a sigmoid of the
    logarithm of light, in narrowed primaries, so that bright colors fade to white within their hue.

    Source: Sobotka's AgX with the primaries of Chow's, which Blender shows by default.
    """
    r, g, b = _times(_TO_AGX, r, g, b)
    r, g, b = _times(_WIDENED, _agx_curve(r), _agx_curve(g), _agx_curve(b))
    r, g, b = _times(_FROM_REC2020, _decoded(r), _decoded(g), _decoded(b))
    return max(r, _0), max(g, _0), max(b, _0)


@jit
def _agx_curve(value):
    """Return the display's code, float32 0 to 1, of one channel of linear light."""
    stops = math.log2(max(value, _DARKEST) / _DARKEST)
    x = min(stops / np.float32(_BELOW + _ABOVE), _1) - np.float32(_PIVOT)
    power = np.float32(_TOE) if x < _0 else np.float32(_SHOULDER)
    scale = np.float32(_TOE_SCALE) if x < _0 else np.float32(_SHOULDER_SCALE)
    return np.float32(0.5) + np.float32(2.0) * x / (_1 + scale * abs(x) ** power) ** (_1 / power)


@jit
def _decoded(code):
    """Return the linear float32 light of a code of the display that AgX is made for, of exponent 2.2."""
    return max(code, _0) ** np.float32(2.2)


@jit
def _times(m, r, g, b):
    """Return a (3, 3) matrix times a color, three float32."""
    return (
        m[0][0] * r + m[0][1] * g + m[0][2] * b,
        m[1][0] * r + m[1][1] * g + m[1][2] * b,
        m[2][0] * r + m[2][1] * g + m[2][2] * b,
    )


@jit
def _clean(value):
    """Return a float32 within [0, _BRIGHTEST]; NaN as 0."""
    return min(value, _BRIGHTEST) if value > _0 else _0
