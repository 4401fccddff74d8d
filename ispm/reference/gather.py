"""The density estimate by brute force in float64: every photon at every receiver."""

from __future__ import annotations

import numpy as np

from ispm.optics.records import INNER

_PHOTON_CHUNK = 256  # bounds the memory: receivers x chunk x 3 doubles at a time


def gather(receivers: np.ndarray, photons: np.ndarray) -> np.ndarray:
    """Return (n, 16) float64, the channels of `estimators.Estimator`, for (n,) RECEIVER and (m,) PHOTON.

    Written without the kernels of `ispm.optics`, so that it can judge them.
    """
    out = np.zeros((len(receivers), 16))
    seen = np.flatnonzero(receivers["valid"])
    for first in range(0, len(photons), _PHOTON_CHUNK):
        out[seen] += _chunk(receivers[seen], photons[first : first + _PHOTON_CHUNK])
    return out


def _chunk(receivers: np.ndarray, photons: np.ndarray) -> np.ndarray:
    """The sum over a few photons."""
    x, ng, n, wo = (receivers[k].astype(float) for k in ("position", "ng", "n", "wo"))
    y, normal, wi, flux = (photons[k].astype(float) for k in ("position", "normal", "wi", "flux"))
    offset = x[:, None] - y[None]
    z = np.einsum("rpk,pk->rp", offset, normal)
    planar2 = np.einsum("rpk,rpk->rp", offset, offset) - z * z
    r2, h2 = photons["radius"].astype(float) ** 2, photons["height"].astype(float) ** 2
    kappa = 3 / (np.pi * r2) * np.maximum(1 - planar2 / r2 - z * z / h2, 0) ** 2
    wi_ng = ng @ wi.T
    kappa *= (wi_ng > 0) & (ng @ normal.T > 0.5)
    kappa *= ((receivers["valid"][:, None] ^ photons["instance"]) & INNER) == 0
    wi_n = n @ wi.T
    ratio = np.minimum(np.maximum(wi_n, 0) / np.where(wi_ng > 0, wi_ng, 1), 10)
    light = kappa * ratio

    out = np.zeros((len(receivers), 16))
    out[:, 0:3] = light @ flux
    out[:, 3] = kappa.sum(axis=1)
    glossy, dv, fc = _gloss(receivers["alpha"].astype(float)[:, None], n, wo, wi, wi_n)
    light = np.where(glossy, light, 0)
    out[:, 4:7] = (light * fc) @ flux
    out[:, 8:11] = (light * dv * (1 - fc)) @ flux
    out[:, 12:15] = (light * dv * fc) @ flux
    return out


def _gloss(
    alpha: np.ndarray, n: np.ndarray, wo: np.ndarray, wi: np.ndarray, nl: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where there is a glossy lobe to see, and its D V and Fc; all (receivers, photons)."""
    nv = np.einsum("rk,rk->r", n, wo)[:, None]
    glossy = (alpha > 0) & (nl > 0) & (nv > 0)
    h = wo[:, None] + wi[None]
    h /= np.maximum(np.linalg.norm(h, axis=2, keepdims=True), 1e-30)
    a2 = np.where(alpha > 0, alpha, 1) ** 2
    nl, nv = np.maximum(nl, 1e-30), np.maximum(nv, 1e-30)
    sine2 = (np.cross(n[:, None], h) ** 2).sum(axis=2)
    d = a2 / (np.pi * (a2 * (1 - sine2) + sine2) ** 2)
    v = 0.5 / (nl * np.sqrt(nv * nv * (1 - a2) + a2) + nv * np.sqrt(nl * nl * (1 - a2) + a2))
    fc = np.clip(1 - np.einsum("rk,rpk->rp", wo, h), 0, 1) ** 5
    return glossy, d * v, fc
