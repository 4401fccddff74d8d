"""The filter's radius where the light of photons changes faster than the filter expects.

Its radius follows from how dense photons lie, or how far gather rays go, and neither tells where a metal
shade gathers light or a lamp stands close to a wall. So the light is filtered with the whole radius h and
with a quarter of it. Where they differ by more than noise explains, their difference is the bias b of the
wide one. That of a radius x h is b x^2, its variance s^2 / x^2 for s^2 that of h, and the sum of squared bias
and variance is least at x^6 = s^2 / (2 b^2) (a plug-in bandwidth: Silverman, Density Estimation, 1986, 3.4).
What differs is itself a mean over a quarter of the radius, so one receiver in 4 x 4 stands for those nearby.
"""

from __future__ import annotations

import numpy as np

from ispm.optics.incident import channels
from ispm.optics.vector import LUMINANCE
from ispm.stages.filter import filter_some
from ispm.stages.lattice import radius_of, set_radius

_NARROW = 0.25  # of the radius: to compare with, and the least that is left
_SIGNIFICANT = 3.0  # standard deviations that are taken for noise
_BLOCK = 4  # receivers to a side, of which one is a pilot
_CLOSE = _NARROW / 2  # of the radius from it: means over a quarter of the radius differ little there
_FACING = 0.97  # least cosine of the two normals, where the filter's weight, its 16th power, is .6
_SPREAD = 1.8  # of the filter's weights: the variance of its mean over that of an even one over its disc
# Of fewer within the whole radius not even a difference of all of their light is more than noise.
LEAST_PHOTONS = _SPREAD * (_SIGNIFICANT / _NARROW) ** 2


def narrow_radius(
    light: np.ndarray,
    of_photons: np.ndarray,
    flux: float,
    receivers: np.ndarray,
    size: tuple[int, int],
    diagonal: float,
    smoothing: float,
    threads: int,
    *,
    others: float = 0.0,
    passes: int = 1,
) -> None:
    """Shrink the filter's radius, kept in `light`, where the light of photons asks for it; in place.

    light       (h w, 16) float32 at receivers, before it is filtered
    of_photons  (h w, 16) the part of its irradiance that photons bring
    flux        lm, of one of these photons: the mean, weighted by flux
    receivers, size, diagonal, smoothing, threads   as of `filter_estimate`
    others      relative variance of the rest of the light, once it is filtered
    passes      of whose mean this is one: noise is less there, and bias is not
    """
    if not channels(of_photons)["irradiance"].any() or not receivers["valid"].any():
        return
    told = receivers, diagonal, smoothing
    radius = radius_of(light, *told)
    used, pilots, of = _pilots(receivers, size, radius)
    pilot = of_photons.copy()
    channels(pilot)["fresnel"] = channels(light)["irradiance"]  # filtered alike

    def filtered(share: float) -> tuple[np.ndarray, np.ndarray]:
        """Light of photons and of all, lx, at the pilots, by a share of the radius."""
        set_radius(pilot, share * radius, smoothing)
        found = channels(filter_some(pilots, receivers, pilot, size, diagonal, smoothing, threads))
        photons, whole = (found[name].astype(np.float64) @ LUMINANCE for name in ("irradiance", "fresnel"))
        return photons, np.maximum(whole, 1e-30)

    wide, whole = filtered(1.0)
    close, _ = filtered(_NARROW)
    known = (radius_of(pilot, *told)[pilots] / radius[pilots]).astype(np.float64)  # the share that it came to
    # Photons of one flux are a Poisson count: its variance, relative to all light, by the whole radius.
    most = np.maximum(np.maximum(wide, close), 0.0)  # a fit over normals may fall below
    variance = _SPREAD * flux * most / (np.pi * (radius[pilots] * whole).astype(np.float64) ** 2)
    bias = ((wide - close) / whole) ** 2 - _SIGNIFICANT**2 * variance / known**2
    noise = (variance + others) / passes
    share = np.clip((noise / np.maximum(2.0 * bias, 1e-30)) ** (1.0 / 6.0), _NARROW, 1.0)
    share = np.where(bias > 0.0, share, 1.0)[of]
    changed = share < 1.0
    set_radius(pilot, radius, smoothing)
    density, rows = channels(pilot)["density"], used[changed]
    channels(light)["density"][rows] = density[rows] / share[changed] ** 2


def _pilots(
    receivers: np.ndarray, size: tuple[int, int], radius: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the rows of the receivers that are used, (n,), of the pilots at which light is filtered, (m,),
    and which of these stands for each, (n,): the one in the middle of its block, where that lies close and
    faces the same way, or itself.

    radius  (h w,) m, of the filter
    """
    used = np.flatnonzero(receivers["valid"])
    y, x = np.divmod(used, size[0])
    middle = [
        np.minimum(each // _BLOCK * _BLOCK + _BLOCK // 2, most - 1)
        for each, most in ((x, size[0]), (y, size[1]))
    ]
    other = middle[1] * size[0] + middle[0]
    position, n = receivers["position"], receivers["n"]
    apart = np.linalg.norm(position[used] - position[other], axis=1)
    alike = (apart < _CLOSE * radius[used]) & (np.einsum("ij,ij->i", n[used], n[other]) > _FACING)
    pilots, of = np.unique(
        np.where(alike & (receivers["valid"][other] > 0), other, used), return_inverse=True
    )
    return used, pilots, of


def mean_flux(flux: np.ndarray) -> float:
    """Return the luminous flux of photons, (n, 3) lm: the mean, weighted by flux; of none 0."""
    luminous = flux.astype(np.float64) @ LUMINANCE
    return float((luminous**2).sum() / luminous.sum()) if luminous.any() else 0.0
