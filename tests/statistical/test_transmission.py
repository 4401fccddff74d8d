"""Surfaces that let light through: each lobe carries what theory says, and is sampled as its pdf says."""

import math

import numpy as np
import pytest
from scipy import stats
from test_bsdf import N, samples, surface, towards

from ispm.optics import bsdf, bsdf_sampling
from ispm.optics.jit import jit

f32 = np.float32
COLOR = (0.9, 0.5, 0.2)
COSINES = (0.15, 0.6, 0.98)
BELOW = tuple(-x for x in N)


def glass(roughness=0.0, color=(1.0, 1.0, 1.0), metallic=0.0, transmission=1.0, ior=1.5, **how):
    """Glass with the reflectance along the normal that its index gives."""
    f0 = ((ior - 1) / (ior + 1)) ** 2
    return surface(color, metallic, roughness, f0, transmission=transmission, ior=ior, **how)


LOBES = {
    "mirror": surface(COLOR, 1.0, 0.0),
    "polished plastic": surface(COLOR, 0.0, 0.0),
    "solid, from outside": glass(0.0, COLOR),
    "solid, from within": glass(0.0, COLOR, entering=False),
    "sheet": glass(0.0, COLOR, thin=True),
    "rough solid, from outside": glass(0.7, COLOR),
    "rough solid, from within": glass(0.7, COLOR, ior=1.3, entering=False),
    "rough sheet": glass(0.6, COLOR, thin=True),
    "milky solid": glass(0.7, COLOR, transmission=0.6),
    "milky polished solid": glass(0.0, COLOR, transmission=0.6),
    "milky sheet, part metal": glass(0.7, COLOR, metallic=0.3, transmission=0.5, thin=True),
}
CASES = [(lobe, cosine) for lobe in LOBES for cosine in COSINES]
ROUGH = [case for case in CASES if LOBES[case[0]].alpha > 0]


@jit
def sphere_grid(b, wo, rows, columns, value, pdf):
    """f |cos| and pdf at midpoints of a grid of equal solid angles over the sphere, z upwards."""
    for i in range(rows):
        z = f32(2 * (i + 0.5) / rows - 1)
        r = math.sqrt(f32(1) - z * z)
        for j in range(columns):
            phi = f32(2 * math.pi * (j + 0.5) / columns)
            wi = (r * math.cos(phi), r * math.sin(phi), z)
            f = bsdf.eval_bsdf(b, N, N, wo, wi)
            for k in range(3):
                value[i, j, k] = f[k] * abs(z)
            pdf[i, j] = bsdf_sampling.pdf_bsdf(b, N, wo, wi)


def integrate_sphere(b, wo, rows=1024, columns=1024):
    """Reflected and transmitted shares of light, each (3,), of the lobes that spread, and the grid of pdf."""
    value, pdf = np.zeros((rows, columns, 3), f32), np.zeros((rows, columns), f32)
    sphere_grid(b, wo, rows, columns, value, pdf)
    halves = value.reshape(2, -1, 3).mean(axis=1, dtype=np.float64) * 2 * math.pi
    return halves[1], halves[0], pdf


def smooth_shares(b, wo):
    """Reflected and transmitted shares of a smooth surface's own directions."""
    if b.alpha > 0:
        return np.zeros(3), np.zeros(3)
    reflectance, transmittance, *_ = bsdf.specular_split(b, N, wo)
    return np.array(reflectance, float), np.array(transmittance, float)


@pytest.mark.parametrize(("lobe", "cosine"), CASES)
def test_mean_weight_is_what_the_lobe_reflects_and_transmits(lobe, cosine):
    """Each side of the surface on its own (method, V16). N = 40,000, seed 17.

    33 cases of 2 sides and 3 channels at 4.5 sigma: 1 in 740 to fail by chance.
    """
    b, wo = LOBES[lobe], towards(cosine)
    *spread, _ = integrate_sphere(b, wo)
    wi, weight = samples(b, wo, 40_000, 17)
    for share, specular, side in zip(spread, smooth_shares(b, wo), (wi[:, 2] > 0, wi[:, 2] < 0), strict=True):
        drawn = np.where(side[:, None], weight, 0).astype(np.float64)
        expected = share + specular
        sigma = drawn.std(axis=0) / math.sqrt(len(drawn))
        assert (np.abs(drawn.mean(axis=0) - expected) < 4.5 * sigma + 1e-3 * expected + 1e-7).all()


@pytest.mark.parametrize(("lobe", "cosine"), ROUGH)
def test_samples_follow_the_pdf_on_both_sides(lobe, cosine):
    """Chi-square, N = 40,000, seed 19, alpha = 0.01 over all 15 cases (Sidak)."""
    count, rows, columns = 40_000, 16, 16
    b, wo = LOBES[lobe], towards(cosine)
    *_, pdf = integrate_sphere(b, wo)
    blocks = pdf.reshape(rows, 1024 // rows, columns, 1024 // columns).mean(axis=(1, 3), dtype=np.float64)
    expected = np.append(blocks.ravel() * (4 * math.pi / (rows * columns)), 0) * count
    expected[-1] = count - expected[:-1].sum()  # absorbed: on the wrong side of the surface
    assert expected[-1] > -2e-3 * count  # pdf integrates to 1 at most
    wi, _ = samples(b, wo, count, 19)
    row = np.minimum(((wi[:, 2] + 1) / 2 * rows).astype(int), rows - 1)
    turn = np.arctan2(wi[:, 1], wi[:, 0]) % (2 * math.pi)
    column = np.minimum((turn / (2 * math.pi) * columns).astype(int), columns - 1)
    place = np.where(np.abs(wi).max(axis=1) > 0, row * columns + column, rows * columns)
    found = np.bincount(place, minlength=rows * columns + 1)
    common = expected >= 5
    rest = found[~common].sum(), max(expected[~common].sum(), 5)
    chi2 = ((found[common] - expected[common]) ** 2 / expected[common]).sum() + (
        rest[0] - rest[1]
    ) ** 2 / rest[1]
    assert stats.chi2.sf(chi2, common.sum()) > 1 - (1 - 0.01) ** (1 / 15)


@pytest.mark.parametrize("how", [{}, {"entering": False}, {"thin": True}], ids=str)
@pytest.mark.parametrize("cosine", COSINES)
def test_clear_glass_keeps_all_light(how, cosine):
    """Reflection and transmission of a white tint add up to 1, and so each photon keeps its flux."""
    b, wo = glass(**how), towards(cosine)
    reflectance, transmittance, *_, through = bsdf.specular_split(b, N, wo)
    assert np.add(reflectance, transmittance) == pytest.approx([1, 1, 1], abs=1e-6)
    assert bool(through) == (how != {"entering": False} or cosine > math.sqrt(1 - 1 / 1.5**2))
    wi, weight = samples(b, wo, 20_000, 23)
    assert weight == pytest.approx(np.ones_like(weight), abs=1e-5)
    sigma = math.sqrt(reflectance[0] * (1 - reflectance[0]) / len(wi))
    assert np.mean(wi[:, 2] > 0) == pytest.approx(float(reflectance[0]), abs=4 * sigma + 1e-9)


@pytest.mark.parametrize("roughness", [0.3, 0.6, 1.0])
@pytest.mark.parametrize("how", [{}, {"entering": False}, {"thin": True}], ids=str)
@pytest.mark.parametrize("cosine", COSINES)
def test_rough_glass_loses_but_never_gains_light(how, roughness, cosine):
    """White glass; what is lost is light between facets. The grid misses narrow lobes by up to 0.3 %."""
    reflected, transmitted, _ = integrate_sphere(glass(roughness, **how), towards(cosine))
    assert (reflected + transmitted).max() <= 1.003
    assert (reflected + transmitted).min() > 0.3
    if roughness == 1.0 and how == {"thin": True}:  # a mirror's at alpha 1, however Fresnel shares it
        assert reflected + transmitted == pytest.approx([1 - cosine * math.log(1 + 1 / cosine)] * 3, abs=1e-4)


def test_rough_glass_is_reciprocal_but_for_the_square_of_its_index():
    """f(wo, wi) / eta^2 from one side is f(wi, wo) from the other (Walter et al. 2007, section 5.1)."""
    random, lit = np.random.default_rng(3), 0
    for _ in range(300):
        wo, wi = random.normal(size=(2, 3))
        wo[2], wi[2] = abs(wo[2]) + 0.05, -abs(wi[2]) - 0.05
        wo, wi = (tuple((v / np.linalg.norm(v)).astype(f32)) for v in (wo, wi))
        roughness, ior = random.uniform(0.3, 1), random.uniform(1.2, 2)
        for thin in (False, True):
            outside, within = (glass(roughness, COLOR, ior=ior, thin=thin, entering=e) for e in (True, False))
            there = np.array(bsdf.eval_bsdf(outside, N, N, wo, wi))
            back = np.array(bsdf.eval_bsdf(within, BELOW, BELOW, wi, wo)) * (1 if thin else f32(ior) ** 2)
            # rounding of the half vector, of length ior - 1 at least, and of Fresnel's near total reflection
            assert there == pytest.approx(back, rel=2e-3, abs=1e-6)
            lit += there[0] > 1e-3
    assert lit > 200


@pytest.mark.parametrize("lobe", LOBES)
def test_reflection_is_reciprocal(lobe):
    """f(wo, wi) = f(wi, wo) above the surface, whatever goes through it."""
    b, random = LOBES[lobe], np.random.default_rng(31)
    for _ in range(200):
        wo, wi = random.normal(size=(2, 3))
        wo[2], wi[2] = abs(wo[2]) + 0.05, abs(wi[2]) + 0.05
        wo, wi = (tuple((v / np.linalg.norm(v)).astype(f32)) for v in (wo, wi))
        # the order of rounding; alpha is 0.36 at least, and Fresnel within is steep near total reflection
        assert bsdf.eval_bsdf(b, N, N, wo, wi) == pytest.approx(bsdf.eval_bsdf(b, N, N, wi, wo), rel=2e-4)


@pytest.mark.parametrize("entering", [True, False])
def test_radiance_is_compressed_by_the_square_of_the_index(entering):
    """The same random numbers lead the eye and photons alike; refracted radiance is 1 / eta^2 of it."""
    eta = 1.5 if entering else 1 / 1.5
    for roughness in (0.0, 0.5):
        b, wo, seen = glass(roughness, entering=entering), towards(0.9), set()
        for u in np.random.default_rng(5).random((50, 3)).astype(f32):
            (ok, wi, flux, _), (_, same, radiance, _) = (
                bsdf_sampling.sample_bsdf(b, N, N, wo, *u, r) for r in (False, True)
            )
            if ok:
                factor = 1 / eta**2 if wi[2] < 0 else 1
                assert wi == same and radiance == pytest.approx([factor * f for f in flux], rel=1e-5)
                seen.add(wi[2] < 0)
        assert True in seen


@pytest.mark.parametrize("cosine", COSINES)
def test_shading_normals_do_not_lead_to_the_wrong_side(cosine):
    """A normal far off the surface's: all that leaves does so on the side it is meant for."""
    n = towards(0.8)
    for b in LOBES.values():
        wo = tuple(f32(v) for v in (-math.sqrt(1 - cosine**2), 0.0, cosine))
        if np.dot(n, wo) <= 0:
            wo = towards(cosine)
        _, transmittance, above, beyond, through = bsdf.smooth_split(b, n, N, wo)
        assert above[2] > 0 and (not through or beyond[2] < 0)
        assert max(transmittance) == 0 or through
        for u in np.random.default_rng(7).random((50, 3)).astype(f32):
            ok, wi, _, specular = bsdf_sampling.sample_bsdf(b, n, N, wo, *u, False)
            assert not ok or specular or np.dot(n, wi) * wi[2] > 0
