"""Lobes too narrow for a grid over the sphere: their samples about the way a smooth surface sends light."""

import math

import numpy as np
import pytest
from scipy import stats
from test_bsdf import N, samples, surface, towards
from test_transmission import glass

from ispm.optics import bsdf, bsdf_sampling
from ispm.optics.jit import jit
from ispm.optics.sampling import orthonormal_basis

f32 = np.float32
COLOR = (0.9, 0.5, 0.2)
MAKE = {
    "metal": lambda roughness: surface(COLOR, 1.0, roughness),
    "plastic": lambda roughness: surface(COLOR, 0.0, roughness),
    "glass, from outside": lambda roughness: glass(roughness, COLOR),
    "glass, from within": lambda roughness: glass(roughness, COLOR, ior=1.3, entering=False),
    "sheet": lambda roughness: glass(roughness, COLOR, thin=True),
}
CASES = [
    (kind, roughness, cosine, side)
    for kind in MAKE
    for roughness in (0.05, 0.1, 0.2)
    for cosine in (0.3, 0.9)
    for side in ("reflected", "transmitted")
    if side == "reflected" or kind not in ("metal", "plastic")
    if (kind, cosine, side) != ("glass, from within", 0.3, "transmitted")  # total reflection
]
COUNT = 200_000
RINGS = np.array([0.0, 0.2, 0.4, 0.7, 1.0, 1.5, 2.2, 3.5, 6.0])  # angles from the axis over alpha
SECTORS = 8


@jit
def pdf_along(b, wo, directions, out):
    for i in range(len(directions)):
        out[i] = bsdf_sampling.pdf_bsdf(b, N, wo, (directions[i, 0], directions[i, 1], directions[i, 2]))


def axis_of(b, wo, side):
    """Where a smooth surface of this kind sends light, (3,) unit."""
    smooth = b._replace(alpha=f32(0))
    _, _, above, beyond, _ = bsdf.specular_split(smooth, N, wo)
    return np.array(above if side == "reflected" else beyond, float)


def frame(axis):
    """(3, 3) rows: two tangents and the axis."""
    t, s = orthonormal_basis(tuple(f32(c) for c in axis))
    return np.array([t, s, axis], float)


def expected_shares(b, wo, axes, alpha, finer=24):
    """The pdf's integral over each ring and sector about an axis, (rings, sectors), by the midpoint rule."""
    theta = (
        np.interp((np.arange(finer * (len(RINGS) - 1)) + 0.5) / finer, np.arange(len(RINGS)), RINGS) * alpha
    )
    width = np.repeat(np.diff(RINGS) * alpha / finer, finer)
    phi = (np.arange(finer * SECTORS) + 0.5) / (finer * SECTORS) * 2 * math.pi
    t, p = np.meshgrid(theta, phi, indexing="ij")
    local = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
    pdf = np.zeros(t.size, f32)
    pdf_along(b, wo, (local.reshape(-1, 3) @ axes).astype(f32), pdf)
    cells = pdf.reshape(t.shape).astype(float) * np.sin(t) * (width * 2 * math.pi / len(phi))[:, None]
    return cells.reshape(len(RINGS) - 1, finer, SECTORS, finer).sum(axis=(1, 3))


def found_counts(wi, axes, alpha):
    """How many directions, (n, 3), lie in each ring and sector."""
    x, y, z = axes @ wi.T.astype(float)
    theta = np.arctan2(np.hypot(x, y), z)
    counts, *_ = np.histogram2d(
        theta, np.arctan2(y, x) % (2 * math.pi), [RINGS * alpha, np.linspace(0, 2 * math.pi, SECTORS + 1)]
    )
    return counts


@pytest.mark.parametrize(("kind", "roughness", "cosine", "side"), CASES)
def test_samples_of_narrow_lobes_follow_the_pdf(kind, roughness, cosine, side):
    """Chi-square over 64 bins and the rest, N = 200,000, seed 29, alpha = 0.01 over all 45 cases (Sidak).

    A density wrong by 2 % throughout is 7 standard deviations of it.
    """
    b, wo = MAKE[kind](roughness), towards(cosine)
    axes = frame(axis_of(b, wo, side))
    wi, _ = samples(b, wo, COUNT, 29)
    wi = wi[np.abs(wi).max(axis=1) > 0]
    expected = expected_shares(b, wo, axes, roughness**2).ravel() * COUNT
    found = found_counts(wi, axes, roughness**2).ravel()
    assert expected.sum() > 1000
    assert expected.sum() <= COUNT * (1 + 1e-3)
    common = expected >= 5
    rest = COUNT - expected[common].sum(), COUNT - found[common].sum()
    chi2 = ((found[common] - expected[common]) ** 2 / expected[common]).sum()
    chi2 += (rest[1] - rest[0]) ** 2 / max(rest[0], 5)
    assert stats.chi2.sf(chi2, common.sum()) > 1 - (1 - 0.01) ** (1 / len(CASES))


WHITE = (1.0, 1.0, 1.0)


@pytest.mark.parametrize("cosine", [0.05, 0.3, 0.98])
@pytest.mark.parametrize("roughness", [0.04, 0.1, 0.3, 0.6, 1.0])
def test_no_photon_gains_flux_at_white_facets(roughness, cosine):
    """Metal, solid glass from both sides and sheets: each weight is the share that other facets leave,
    G2 / G1, which is 1 at most; and nearly 1 where they are smooth. A white furnace, photon by photon."""
    wo = towards(cosine)
    for b in (
        surface(WHITE, 1.0, roughness), glass(roughness), glass(roughness, entering=False),
        glass(roughness, thin=True),
    ):  # fmt: skip
        _, weight = samples(b, wo, 20_000, 37)
        # D is that of the same half vector in f and in the pdf, so that its steepness does not count
        assert weight.max() <= 1 + 1e-4
        assert weight.mean() > (0.99 if roughness <= 0.1 and cosine > 0.1 else 0.3)
