"""The sheen lobe against its formulas in float64: values, albedo, energy, reciprocity, sampling."""

import math

import numpy as np
import pytest
from layered import made, scatter_often

from ispm.accel.layers import sheen_point
from ispm.accel.records import Hit
from ispm.accel.surface import SurfacePoint
from ispm.optics.bsdf import Bsdf, eval_bsdf
from ispm.optics.bsdf_sampling import pdf_bsdf, sample_bsdf
from ispm.optics.coat import NO_COAT, covered
from ispm.optics.facets import NO_ANISOTROPY
from ispm.optics.jit import jit
from ispm.optics.sheen import eval_sheen, make_sheen, sheen_albedo
from ispm.optics.sheen_albedo import ALBEDO

f32, u32 = np.float32, np.uint32
UP = f32(0), f32(0), f32(1)
NONE = f32(0), f32(0), f32(0)
LOWER, UPPER = (
    (21.5473, 3.82987, 0.19823, -1.97760, -4.32054),
    (25.3245, 3.32435, 0.16801, -1.27393, -4.85967),
)
CASES = [(r, c) for r in (0.1, 0.2, 0.35, 0.6, 1.0) for c in (0.05, 0.3, 0.9)]


def shadowing(cosine, alpha):
    """Lambda of Estevez and Kulla, table 1."""
    a, b, c, d, e = (p + (1.0 - alpha) ** 2 * (q - p) for p, q in zip(LOWER, UPPER, strict=True))
    x = np.where(cosine < 0.5, cosine, 1.0 - cosine)
    below, half = a / (1.0 + b * x**c) + d * x + e, a / (1.0 + b * 0.5**c) + d * 0.5 + e
    return np.exp(np.where(cosine < 0.5, below, 2.0 * half - below))


def lobe(roughness, wo, wi):
    """D V of the papers, (n,), of directions (n, 3) about +z."""
    alpha = roughness**2
    h = wo + wi
    h = h / np.linalg.norm(h, axis=-1, keepdims=True)
    sine = np.hypot(h[..., 0], h[..., 1])
    d = (2.0 + 1.0 / alpha) * sine ** (1.0 / alpha) / (2.0 * math.pi)
    nv, nl = wo[..., 2], wi[..., 2]
    return d / ((1.0 + shadowing(nv, alpha) + shadowing(nl, alpha)) * 4.0 * nv * nl)


def hemisphere(steps):
    """Directions, (n, 3), with more of them near the horizon, and their solid angles."""
    s = (np.arange(steps) + 0.5) / steps
    z, phi = np.meshgrid(s**3, math.pi * s, indexing="ij")  # half of them: wo is in the plane y = 0
    r = np.sqrt(1.0 - z * z)
    area = (3.0 * s**2 / steps)[:, None] * (2.0 * math.pi / steps) * np.ones_like(z)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1).reshape(-1, 3), area.ravel()


def leaning(cosine):
    return np.array([math.sqrt(1.0 - cosine * cosine), 0.0, cosine])


def integral(roughness, cosine, steps=300):
    """The papers' albedo, not held to 1."""
    wi, area = hemisphere(steps)
    return (lobe(roughness, leaning(cosine), wi) * wi[:, 2] * area).sum()


@jit
def eval_many(b, wo, wi, value, pdf):
    for i in range(len(wi)):
        w = wi[i, 0], wi[i, 1], wi[i, 2]
        value[i] = eval_bsdf(b, UP, UP, wo, w)[1]
        pdf[i] = pdf_bsdf(b, UP, wo, w)


def vector(v):
    return tuple(f32(c) for c in v)


def velvet(roughness, cosine, color=(1.0, 1.0, 1.0), base=1.0):
    """A SurfacePoint with sheen over a Lambert surface, seen at a cosine."""
    sheen = made(make_sheen(vector(color), f32(roughness), f32(cosine), f32(1)))
    none = f32(0), f32(1), f32(0), f32(0), NONE, f32(1), f32(0), f32(0), NO_ANISOTROPY
    b = Bsdf(vector((base,) * 3), NONE, *none)
    b = made(covered(b, sheen.shown))
    hit = Hit(u32(0), u32(0), f32(0), f32(0))
    return SurfacePoint(hit, NONE, UP, UP, b, u32(0), True, NO_COAT, sheen, NONE)


def fibers(roughness):
    """The Bsdf of sheen alone, of the color 1."""
    return made(sheen_point(velvet(roughness, 0.5)).bsdf)


def test_the_table_is_the_integral():
    """Where its numbers stand, to their last digit and what quadrature is uncertain by; between them within
    an eighth of the second differences, as linear interpolation is."""
    random = np.random.default_rng(3)
    for j, i in zip(random.integers(0, 17, 40), random.integers(1, 33, 40), strict=True):
        assert ALBEDO[j, i] == pytest.approx(integral(max(j / 16, 0.07), (i / 32) ** 2), abs=5e-4 + 1e-3)
    bends = [np.abs(np.diff(ALBEDO.astype(float), 2, axis=k)).max(axis=1 - k) for k in (0, 1)]
    for _ in range(40):
        roughness, place = random.uniform(2 / 16, 1.0), random.uniform(2 / 32, 1.0)
        j, i = min(int(roughness * 16), 15), min(int(place * 32), 31)
        expected = min(integral(roughness, place**2), 1.0)
        off = (bends[0][max(j - 1, 0) : j + 2].max() + bends[1][max(i - 1, 0) : i + 2].max()) / 8.0
        assert sheen_albedo(f32(roughness), f32(place**2)) == pytest.approx(expected, abs=off + 2e-3)


@pytest.mark.parametrize("roughness", [0.1, 0.2, 0.35, 0.6, 1.0])
def test_the_lobe_is_that_of_the_papers(roughness):
    """Reciprocal, and divided by the larger albedo where that is above 1."""
    random = np.random.default_rng(5)
    wo, wi = random.normal(size=(2, 300, 3))
    for v in (wo, wi):
        v[:, 2] = np.abs(v[:, 2]) + 0.02
        v /= np.linalg.norm(v, axis=1, keepdims=True)
    rows = [min(int(roughness * 16), 15) + k for k in (0, 1)]
    u = roughness * 16 - rows[0]
    places = np.sqrt([wo[:, 2], wi[:, 2]]) * 32
    row = (1 - u) * ALBEDO[rows[0]] + u * ALBEDO[rows[1]]
    albedo = [np.interp(p, range(33), row) for p in places]
    expected = lobe(roughness, wo, wi) / np.maximum(np.maximum(*albedo), 1.0)
    for a, b, f in zip(wo, wi, expected, strict=True):
        h = vector((a + b) / np.linalg.norm(a + b))
        a, b = vector(a), vector(b)
        found = eval_sheen(f32(roughness), UP, a, b, h)
        # sin^(1 / alpha) and the exponents of V raise rounding to some hundredfold
        assert found == pytest.approx(f, rel=2e-3, abs=1e-6)
        assert eval_sheen(f32(roughness), UP, b, a, h) == pytest.approx(found, rel=1e-5)


@pytest.mark.parametrize(("roughness", "cosine"), CASES)
def test_sheen_over_white_gains_no_energy(roughness, cosine):
    """What it hides is what it reflects, so that in even light a white surface stays white, but for what is
    taken from fibers that would gain energy; 4e-3: the table between its numbers."""
    wi, area = hemisphere(300)
    value, pdf = np.zeros((2, len(wi)), f32)
    eval_many(fibers(roughness), vector(leaning(cosine)), wi.astype(f32), value, pdf)
    reflected, x = (value * wi[:, 2] * area).sum(), velvet(roughness, cosine)
    both = reflected + x.bsdf.diffuse[0]
    assert both < 1.0 + 4e-3
    if roughness > 0.3:
        assert both > 1.0 - 4e-3
    assert (pdf * area).sum() == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(("roughness", "cosine"), CASES)
def test_photons_scatter_by_both_layers_as_their_albedos_say(roughness, cosine):
    """N = 200,000, 4.2 sigma: once in 800 runs of the 45 numbers."""
    color, base = (0.9, 0.5, 0.0), 0.6
    wi, area = hemisphere(300)
    value, pdf = np.zeros((2, len(wi)), f32)
    eval_many(fibers(roughness), vector(leaning(cosine)), wi.astype(f32), value, pdf)
    reflected = (value * wi[:, 2] * area).sum()
    x = velvet(roughness, cosine, color, base)
    expected = np.array(color) * reflected + x.bsdf.diffuse[0]
    shown = 1.0 - 0.9 * sheen_albedo(f32(roughness), f32(cosine))
    assert x.bsdf.diffuse[0] == pytest.approx(base * shown, rel=1e-5)
    found = np.zeros((200_000, 3), f32)
    scatter_often(x, vector(leaning(cosine)), found)
    error = found.std(axis=0, dtype=float) / math.sqrt(len(found))
    assert (np.abs(found.mean(axis=0, dtype=float) - expected) < 4.2 * error + 1e-3 * expected).all()


def test_directions_are_drawn_by_the_cosine():
    """Of sheen alone: each sample is f cos / pdf, and never another lobe's."""
    b, wo = fibers(0.5), vector(leaning(0.4))
    for u1, u2, u3 in np.random.default_rng(2).random((50, 3)).astype(f32):
        ok, wi, weight, specular = sample_bsdf(b, UP, UP, wo, u1, u2, u3, True)
        if ok:
            f = eval_bsdf(b, UP, UP, wo, vector(wi))
            assert not specular and weight[0] == pytest.approx(math.pi * f[0], rel=1e-4)
