"""Glass whose index of refraction depends on the wavelength: red, green and blue light go ways of their own.

A path carries all three bands until it meets such glass; from there on it has one of them, which decides the
index there and in all such glass that it meets later. Where it can it goes on as three paths, a band each.
Source: KHR_materials_dispersion, implementation notes.
"""

from __future__ import annotations

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.rng import random4

f32, i64, u32 = np.float32, np.int64, np.uint32

BANDS = 3  # red, green, blue, by number
ALL_BANDS = i64(-1)  # of a path that has met no such glass
MIDDLE_BAND = i64(1)  # whose index is the material's own

_DIMENSION = 9 << 20  # of the random numbers by which passes differ
_GOLDEN = 0.6180339887498949  # steps of which lie evenly in a line


@jit
def of_band(band, light):
    """Return what light, RGB, has in a band; of `ALL_BANDS` all."""
    r, g, b = light
    none = f32(0)
    if band == i64(0):
        return r, none, none
    if band == i64(1):
        return none, g, none
    return (none, none, b) if band == i64(2) else light


@jit
def only_band(light):
    """Return the band that has all of a light, RGB; `ALL_BANDS` where several have some, or none has any."""
    none, (r, g, b) = f32(0), light
    if (r > none) + (g > none) + (b > none) != 1:
        return ALL_BANDS
    return i64(0) if r > none else (i64(1) if g > none else i64(2))


@jit
def draw_band(flux, b, u):
    """Draw the band with which a photon of `flux`, RGB lm, goes on from a surface of the Bsdf b, the one band
    it has, if it has but one.

    u  uniform in [0, 1)
    -> the band, and its chance: its share of what reflection and transmission keep of the flux together
    """
    red, green, blue = _kept(flux, b, 0), _kept(flux, b, 1), _kept(flux, b, 2)
    total = red + green + blue
    if not total > f32(0):
        return MIDDLE_BAND, f32(1)
    if u * total < red:
        return i64(0), red / total
    if u * total < red + green or blue <= f32(0):
        return i64(1), green / total
    return i64(2), blue / total


@jit
def _kept(flux, b, band):
    """What a surface of the Bsdf b, met along its normal, keeps of a band of a photon's flux, lm."""
    return flux[band] * (b.diffuse[band] + b.f0[band] + (f32(1) - b.dielectric_f0) * b.tint[band])


@jit
def band_number(key, pass_index, seed):
    """Return the float32 number in [0, 1) that draws a photon's band, even over photons of following keys:
    of three in a row each is in another third, as neighbors in a caustic should be."""
    turn, shift, _, _ = random4(u32(0), u32(_DIMENSION), pass_index, seed)
    third = (u32(key) % u32(3) + u32(turn * f32(3))) % u32(3)
    within = np.float64(u32(key) // u32(3)) * _GOLDEN + shift
    return min((f32(third) + f32(within - np.floor(within))) * f32(1 / 3), f32(1 - 2.0**-24))
