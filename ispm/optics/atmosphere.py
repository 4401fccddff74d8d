"""The clear sky and the sun, computed from what air, haze and ozone scatter and absorb.

Single scattering is integrated along each direction (Nishita et al. 1993, "Display of the Earth taking into
account atmospheric scattering", section 4); light that was scattered more often, also by the ground, is added
as if it were isotropic (Hillaire 2020, "A scalable and production ready sky and atmosphere rendering
technique", section 5.5). It is done in bands of 20 nm, which the color matching functions turn into Rec. 709.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

SUN_RADIUS = 0.00465
"""Radians that the sun's disc is across by half."""

# Bruneton and Neyret 2008, "Precomputed atmospheric scattering", section 2; Bruneton's notes of 2017 on it.
_GROUND, _TOP = 6_360e3, 6_420e3  # m from the earth's center
_RAYLEIGH_HEIGHT, _MIE_HEIGHT = 8_000.0, 1_200.0  # m in which densities fall to 1 / e
_RAYLEIGH = 1.24062e-6  # 1/m at the ground, times um^4
_OZONE_DENSITY = 300.0 * 2.687e20 / 15e3  # 1/m3 at most: 300 Dobson units over a tent from 10 to 40 km
_MIE_ALBEDO = 0.9  # share of what haze takes that it scatters
_MIE_G = 0.76  # mean cosine of that

_BAND = 20.0  # nm
_WAVELENGTHS = np.arange(390.0, 711.0, _BAND)  # nm, the bands' middles
# W/m2/nm of each band above the atmosphere (ASTM G-173).
_SOLAR = np.array([
    1.0798, 1.7291, 1.6506, 1.9734, 2.0213, 1.9459, 1.8733, 1.8808, 1.8509,
    1.8343, 1.7981, 1.7249, 1.6642, 1.5631, 1.5338, 1.4611, 1.3890,
])  # fmt: skip
# 1e-25 m2, cross section of ozone at 233 K (Serdyuchenko et al. 2014, part 2).
_OZONE = 1e-25 * np.array([
    0.0047, 0.0215, 0.0699, 0.1949, 0.4297, 0.8384, 1.541, 2.447, 3.296,
    4.469, 4.550, 4.662, 3.478, 2.450, 1.663, 1.076, 0.7011,
])  # fmt: skip
_TO_REC709 = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)
_EFFICACY = 683.0  # lm/W at 555 nm

_DEPTH_NODES, _DEPTH_WEIGHTS = np.polynomial.legendre.leggauss(16)
# Against several times as many of each, half of a sky is off by 1 %, the horizon of a low sun by 13 %.
_STEPS = 32  # along a direction of the sky
_AZIMUTHS = 13  # from the sun's on one side; between them cosines
_HEIGHTS, _SUNS = 9, 33  # of the table of multiple scattering
_TABLE_STEPS, _TABLE_ZENITHS, _TABLE_AZIMUTHS = 12, 12, 3  # likewise


class _Air(NamedTuple):
    """What a cubic metre of each kind does at its densest, 1/m in each band: air, haze, ozone.

    scattering  (2, bands) of air and haze
    extinction  (3, bands)
    """

    scattering: np.ndarray
    extinction: np.ndarray


def _matching(wavelength: np.ndarray) -> np.ndarray:
    """(n, 3) CIE 1931 color matching functions at (n,) nm (Wyman, Sloan and Shirley 2013, table 1)."""

    def lobe(height: float, middle: float, below: float, above: float) -> np.ndarray:
        width = np.where(wavelength < middle, below, above)
        return np.asarray(height * np.exp(-0.5 * ((wavelength - middle) / width) ** 2))

    x = lobe(1.056, 599.8, 37.9, 31.0) + lobe(0.362, 442.0, 16.0, 26.7) - lobe(0.065, 501.1, 20.4, 26.2)
    y = lobe(0.821, 568.8, 46.9, 40.5) + lobe(0.286, 530.9, 16.3, 31.1)
    z = lobe(1.217, 437.0, 11.8, 36.0) + lobe(0.681, 459.0, 26.0, 13.8)
    return np.stack([x, y, z], axis=-1)


def _photometric() -> np.ndarray:
    """(bands, 3) linear Rec. 709, lx, of the sun's light in each band above the atmosphere."""
    fine = _WAVELENGTHS[:, None] + _BAND * ((np.arange(20) + 0.5) / 20.0 - 0.5)
    matching = _matching(fine.ravel()).reshape(*fine.shape, 3).mean(axis=1)
    return np.asarray(_EFFICACY * _BAND * _SOLAR[:, None] * matching @ _TO_REC709.T)


_SUNLIGHT = _photometric()


def _air(turbidity: float) -> _Air:
    """The atmosphere with haze for a turbidity: how many times as much optical depth air with haze has as air
    alone, about. Haze has Angstrom's exponent 1.3, and his coefficient as Preetham et al. 1999 fit it ("A
    practical analytic model for daylight", appendix 1)."""
    microns = _WAVELENGTHS / 1000.0
    rayleigh = _RAYLEIGH * microns**-4
    mie = (0.04608 * turbidity - 0.04586) * microns**-1.3 / _MIE_HEIGHT
    return _Air(np.stack([rayleigh, _MIE_ALBEDO * mie]), np.stack([rayleigh, mie, _OZONE_DENSITY * _OZONE]))


def _densities(height: np.ndarray) -> np.ndarray:
    """(..., 3) of air, haze and ozone at (...,) m above the ground, as shares of the greatest."""
    ozone = np.maximum(1.0 - np.abs(height - 25e3) / 15e3, 0.0)
    return np.stack([np.exp(-height / _RAYLEIGH_HEIGHT), np.exp(-height / _MIE_HEIGHT), ozone], axis=-1)


def _way_out(radius: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """m from a point to the top of the atmosphere: from its radius and the cosine of its zenith angle."""
    return np.asarray(np.sqrt(np.maximum(_TOP**2 - radius**2 * (1.0 - cosine**2), 0.0)) - radius * cosine)


def _sunlight(radius: np.ndarray, cosine: np.ndarray, air: _Air) -> np.ndarray:
    """(..., bands) share of the sun's light that comes to points; none where the earth is in between.

    radius  (...,) m from the earth's center
    cosine  (...,) of the sun's zenith angle there
    """
    way = _way_out(radius, cosine)
    amount = np.zeros((*way.shape, 3))
    for node, weight in zip(0.5 + 0.5 * _DEPTH_NODES, _DEPTH_WEIGHTS, strict=True):
        t = way * node**2  # most air is near the start
        height = np.sqrt(radius**2 + t * (t + 2.0 * radius * cosine)) - _GROUND
        amount += (weight * node * way)[..., None] * _densities(np.maximum(height, 0.0))
    hidden = (cosine < 0.0) & (radius**2 * (1.0 - cosine**2) < _GROUND**2)
    return np.where(hidden[..., None], 0.0, np.exp(-amount @ air.extinction))


def _march(
    way: np.ndarray, radius: np.ndarray, cosine: np.ndarray, steps: int, air: _Air
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return of each step along directions: its middle, m; the radius there, m; what reaches the start of
    light scattered in it, of each kind, (..., steps, 2, bands); what is left at the end, (..., bands).

    way, radius, cosine  (...,) m to go, m from the earth's center at the start, of the zenith angle there
    """
    edges = way[..., None] * np.linspace(0.0, 1.0, steps + 1) ** 2
    middle, length = 0.5 * (edges[..., 1:] + edges[..., :-1]), np.diff(edges, axis=-1)
    there = np.sqrt(radius[..., None] ** 2 + middle * (middle + 2.0 * (radius * cosine)[..., None]))
    density = _densities(np.maximum(there - _GROUND, 0.0))
    extinction = density @ air.extinction
    depth = extinction * length[..., None]
    passed = np.exp(-np.cumsum(depth, axis=-2))
    before = np.concatenate([np.ones_like(passed[..., :1, :]), passed[..., :-1, :]], axis=-2)
    # Exact for a step of constant density (Hillaire 2015, "Physically based sky", slide 28).
    reached = (before - passed) / np.maximum(extinction, 1e-30)
    return (
        middle,
        there,
        (density[..., :2, None] * air.scattering) * reached[..., None, :],
        passed[..., -1, :],
    )


def _many_times(air: _Air, albedo: float) -> np.ndarray:
    """(_HEIGHTS, _SUNS, bands) mean radiance of light scattered once and more, as seen from all around, for
    sunlight of irradiance 1: what is scattered again."""
    height, sun = _table_height(np.arange(_HEIGHTS)), _table_sun(np.arange(_SUNS))
    zenith, weight = np.polynomial.legendre.leggauss(_TABLE_ZENITHS)
    azimuth = math.pi * (np.arange(_TABLE_AZIMUTHS) + 0.5) / _TABLE_AZIMUTHS
    radius = np.broadcast_to((_GROUND + height)[:, None], (_HEIGHTS, _TABLE_ZENITHS))
    cosine = np.broadcast_to(zenith, radius.shape)
    below = (cosine < 0.0) & (radius**2 * (1.0 - cosine**2) < _GROUND**2)
    to_ground = -radius * cosine - np.sqrt(np.maximum(_GROUND**2 - radius**2 * (1.0 - cosine**2), 0.0))
    way = np.where(below, np.maximum(to_ground, 0.0), _way_out(radius, cosine))
    t, there, scattered, left = _march(way, radius, cosine, _TABLE_STEPS, air)
    scattered = scattered.sum(axis=-2)  # heights, zeniths, steps, bands
    between = sun[:, None, None] * zenith[:, None] + np.sqrt(
        (1.0 - sun[:, None, None] ** 2) * (1.0 - zenith[:, None] ** 2)
    ) * np.cos(azimuth)  # cosine of sun and direction: suns, zeniths, azimuths
    radius = radius[:, None, :, None]
    t, there = t[:, None, :, None, :], there[:, None, :, None, :]
    lit = (radius * sun[:, None, None])[..., None] + t * between[..., None]
    light = _sunlight(np.broadcast_to(there, lit.shape), lit / there, air)
    once = np.einsum("hzkb,hszakb->hszb", scattered, light) / (4.0 * math.pi * _TABLE_AZIMUTHS)
    end = way[:, None, :, None]
    at_ground = np.clip((radius * sun[:, None, None] + end * between) / _GROUND, -1.0, 1.0)
    ground = np.maximum(at_ground, 0.0)[..., None] * _sunlight(
        np.full(at_ground.shape, _GROUND), at_ground, air
    )
    ground = ground.mean(axis=3) * (below[:, :, None] * left)[:, None] * albedo / math.pi
    twice = np.einsum("z,hszb->hsb", 0.5 * weight, once + ground)
    again = np.einsum("z,hzkb->hb", 0.5 * weight, scattered)
    return np.asarray(twice / (1.0 - again)[:, None])


def _table_height(row: np.ndarray) -> np.ndarray:
    return np.asarray((_TOP - _GROUND) * (row / (_HEIGHTS - 1)) ** 2)


def _table_sun(column: np.ndarray) -> np.ndarray:
    place = -0.5 + 1.5 * column / (_SUNS - 1)
    return np.asarray(place * np.abs(place))


def _look_up(table: np.ndarray, height: np.ndarray, sun: np.ndarray) -> np.ndarray:
    """(..., bands) of the table, bilinear, at (...,) m and cosines of the sun's zenith angle."""
    row = np.sqrt(np.clip(height / (_TOP - _GROUND), 0.0, 1.0)) * (_HEIGHTS - 1)
    place = np.sign(sun) * np.sqrt(np.abs(sun))
    column = np.clip((place + 0.5) / 1.5, 0.0, 1.0) * (_SUNS - 1)
    i, j = np.minimum(row.astype(int), _HEIGHTS - 2), np.minimum(column.astype(int), _SUNS - 2)
    u, v = (row - i)[..., None], (column - j)[..., None]
    upper = (1.0 - v) * table[i, j] + v * table[i, j + 1]
    lower = (1.0 - v) * table[i + 1, j] + v * table[i + 1, j + 1]
    return np.asarray((1.0 - u) * upper + u * lower)


def sun_direction(elevation: float, azimuth: float) -> np.ndarray:
    """Return the (3,) unit direction to the sun, world space.

    elevation  radians above the horizon
    azimuth    radians from -Z, to +X
    """
    flat = math.cos(elevation)
    return np.array([flat * math.sin(azimuth), math.sin(elevation), -flat * math.cos(azimuth)])


def sun_irradiance(elevation: float, turbidity: float) -> np.ndarray:
    """Return the (3,) lx, linear Rec. 709, of the sun on a surface at the ground that faces it.

    elevation  radians above the horizon, of the disc's middle; what is below the horizon does not shine
    turbidity  as of `sky_radiance`
    """
    across = (np.arange(16) + 0.5) / 8.0 - 1.0
    share = np.sqrt(1.0 - across**2)
    angles = elevation + SUN_RADIUS * across
    light = _sunlight(np.full(16, _GROUND), np.sin(angles), _air(turbidity))
    return np.asarray(np.maximum((share / share.sum()) @ light @ _SUNLIGHT, 0.0))


@lru_cache(maxsize=4)
def sky_radiance(
    sun_elevation: float,
    sun_azimuth: float,
    turbidity: float = 3.0,
    ground_albedo: float = 0.3,
    height: int = 256,
) -> np.ndarray:
    """Return the radiance from all around at the ground, without the sun's disc: (height, 2 height, 3)
    float32 cd/m2, linear Rec. 709, not to be edited.

    sun_elevation  radians above the horizon; below it there is twilight
    sun_azimuth    radians from -Z, to +X
    turbidity      of the air: 1 pure, 2 very clear, 3 clear, 6 hazy, 10 mist; see `_air`
    ground_albedo  of a ground without end, seen below the horizon and by the sky
    height         rows, even; the image's center column lies along -Z, right of it +X, row 0 on top
    Takes 0.15 s; the last few are kept. Of what a Monte Carlo simulation brings down, it has 87 to 104 %.
    """
    air = _air(turbidity)
    rows, columns = height // 2, 2 * height
    zenith = math.pi * (np.arange(rows) + 0.5) / height
    azimuth = 2.0 * math.pi * ((np.arange(columns) + 0.5) / columns - 0.5) - sun_azimuth
    sun = math.sin(sun_elevation), math.cos(sun_elevation)
    cosine, sine = np.cos(zenith), np.sin(zenith)
    start = np.full(rows, _GROUND)
    t, there, scattered, _ = _march(_way_out(start, cosine), start, cosine, _STEPS, air)
    nodes = math.pi * np.arange(_AZIMUTHS) / (_AZIMUTHS - 1)
    between = sun[0] * cosine[:, None] + sun[1] * sine[:, None] * np.cos(nodes)
    lit = (_GROUND * sun[0] + t[:, None] * between[..., None]) / there[:, None]
    there = np.broadcast_to(there[:, None], lit.shape)
    light = _sunlight(there, lit, air)
    once = np.einsum("rksb,rakb->rasb", scattered, light)
    often = np.einsum(
        "rksb,rakb->rab", scattered, _look_up(_many_times(air, ground_albedo), there - _GROUND, lit)
    )
    kinds = np.concatenate([once, often[:, :, None]], axis=2) @ _SUNLIGHT  # rows, nodes, 3 kinds, 3 channels
    # What the nodes hold changes slowly with azimuth, unlike the phase functions: cosines go through it.
    orders = np.arange(_AZIMUTHS)
    through = np.cos(np.outer(azimuth, orders)) @ np.linalg.inv(np.cos(np.outer(nodes, orders)))
    kinds = np.einsum("ca,raxk->rcxk", through, kinds)
    between = sun[0] * cosine[:, None] + sun[1] * sine[:, None] * np.cos(azimuth)
    image = np.empty((height, columns, 3), np.float32)
    phases = np.stack([_rayleigh_phase(between), _mie_phase(between), np.ones_like(between)], axis=-1)
    image[:rows] = np.maximum(np.einsum("rcx,rcxk->rck", phases, kinds), 0.0)
    horizontal = horizontal_irradiance(image) + max(sun[0], 0.0) * sun_irradiance(sun_elevation, turbidity)
    image[rows:] = ground_albedo / math.pi * horizontal
    image.flags.writeable = False
    return image


def _rayleigh_phase(cosine: np.ndarray) -> np.ndarray:
    """1/sr of air, from the cosine of the angle between the sun and the direction."""
    return np.asarray(3.0 / (16.0 * math.pi) * (1.0 + cosine**2))


def _mie_phase(cosine: np.ndarray) -> np.ndarray:
    """Likewise of haze (Cornette and Shanks 1992)."""
    g = _MIE_G
    norm = 3.0 / (8.0 * math.pi) * (1.0 - g * g) / (2.0 + g * g)
    return np.asarray(norm * (1.0 + cosine**2) / (1.0 + g * g - 2.0 * g * cosine) ** 1.5)


def horizontal_irradiance(image: np.ndarray) -> np.ndarray:
    """Return the (3,) lx on a surface that faces up, from an image (h, w, 3) of radiance from all around."""
    edges = np.linspace(0.0, math.pi, len(image) + 1)[: len(image) // 2 + 1]
    rings = math.pi * np.diff(np.sin(edges) ** 2)
    return np.asarray(rings @ image[: len(rings)].mean(axis=1, dtype=np.float64))
