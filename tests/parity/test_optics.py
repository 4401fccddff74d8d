"""The WGSL and numba twins of `ispm.optics` compute the same numbers."""

from pathlib import Path

import numpy as np

from ispm.optics import bsdf, bsdf_sampling, density, rng, sampling
from ispm.optics.jit import jit
from ispm.optics.vector import cross, dot
from ispm.photons.scatter import adjoint_factor

SHADER = str(Path(__file__).with_name("optics.wgsl"))
N = 4096
EPS = float(np.finfo(np.float32).eps)


def on_gpu(gpu, entry: str, rows: np.ndarray) -> np.ndarray:
    """Run an entry point of optics.wgsl over (N, 8, 4) rows; return (N, 4, 4)."""
    given, result = gpu.buffer("given").write(rows), gpu.buffer("result").sized(len(rows) * 64)
    with gpu.frame() as frame:
        gpu.compute(SHADER, entry)(frame, over=len(rows), given=given, result=result)
    return gpu.read_buffer(result, np.float32, len(rows) * 16).reshape(-1, 4, 4)


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def random_rows(seed: int) -> np.ndarray:
    """(N, 8, 4): base, metallic | f0, specular color | roughness, u1, u2, specular | n, u3 | wo, ior |
    wi, kind (0 solid, 1 thin, 2 solid from within) | ng, transmission | whether the path carries radiance,
    what textures make of specular color, the first of the factor."""
    random = np.random.default_rng(seed)
    rows = random.random((N, 8, 4))
    rows[:, 1, 0] *= 0.2
    rows[:, 3:7, :3] = unit(random.normal(size=(N, 4, 3)))
    rows[:, 6, :3] = unit(rows[:, 3, :3] + 0.2 * rows[:, 6, :3])
    for k in (4, 5):  # mostly above the horizon, else nearly all results would be zero
        flip = (np.einsum("ij,ij->i", rows[:, k, :3], rows[:, 3, :3]) < 0) & (random.random(N) < 0.9)
        rows[flip, k, :3] *= -1
    kind = random.integers(0, 4, N)  # a quarter opaque
    rows[:, 5, 3], rows[:, 4, 3] = np.minimum(kind, 2), rows[:, 4, 3] * 1.2 + 1.0
    rows[kind == 3, 6, 3] = 0.0
    rows[random.random(N) < 0.3, 2, 0] = 0.0  # smooth
    rows[random.random(N) < 0.5, 0, 3] = 0.0  # not metal
    below = (kind < 3) & (random.random(N) < 0.5)
    rows[below, 5, :3] *= -1
    return rows.astype(np.float32)


@jit
def vector(r, k):
    return r[k, 0], r[k, 1], r[k, 2]


@jit
def surface(r):
    specular_color = r[1, 1] * r[7, 1], r[1, 2] * r[7, 2], r[1, 3] * r[7, 3]
    dielectric = bsdf.Dielectric(r[1, 0], specular_color, r[2, 3] * r[7, 1], r[4, 3], r[5, 3] == 1)
    return bsdf.surface_bsdf(vector(r, 0), r[0, 3], r[2, 0], r[6, 3], dielectric, r[5, 3] != 2)


@jit
def bsdf_rows(rows, out):
    for i in range(len(rows)):
        r = rows[i]
        b = surface(r)
        n, wo, wi = vector(r, 3), vector(r, 4), vector(r, 5)
        out[i, 0, :3] = bsdf.eval_bsdf(b, n, vector(r, 6), wo, wi)
        out[i, 0, 3] = bsdf_sampling.pdf_bsdf(b, n, wo, wi)
        out[i, 1, :3] = bsdf.gloss_terms(b.alpha, n, wo, wi)
        out[i, 1, 3] = b.alpha
        out[i, 2] = (b.f0[0], b.f0[1], b.f0[2], b.dielectric_f0)
        out[i, 3] = (b.tint[0], b.tint[1], b.tint[2], b.eta + b.thin)


@jit
def chance_rows(rows, out):
    """The chance that a facet met between wo and wi reflects, (n,)."""
    for i in range(len(rows)):
        b, wo = surface(rows[i]), vector(rows[i], 4)
        h, _ = bsdf.transmitting_facet(b, vector(rows[i], 3), wo, vector(rows[i], 5))
        out[i] = bsdf_sampling.reflection_chance(b, dot(wo, h))


@jit
def sample_rows(rows, out):
    for i in range(len(rows)):
        r = rows[i]
        ok, wi, weight, specular = bsdf_sampling.sample_bsdf(
            surface(r), vector(r, 3), vector(r, 6), vector(r, 4), r[2, 1], r[2, 2], r[3, 3], r[7, 0] > 0.5
        )
        out[i, 0] = (wi[0], wi[1], wi[2], np.float32(ok))
        out[i, 1, :3] = weight
        out[i, 1, 3] = np.float32(specular)


@jit
def specular_rows(rows, out):
    for i in range(len(rows)):
        r = rows[i]
        b = surface(r)
        split = bsdf.smooth_split(b, vector(r, 3), vector(r, 6), vector(r, 4))
        out[i, 0, :3], out[i, 0, 3] = split[0], np.float32(split[4])
        out[i, 1, :3], out[i, 1, 3] = split[1], np.float32(bsdf.has_finite(b))
        out[i, 2, :3], out[i, 3, :3] = split[2], split[3]


@jit
def density_rows(rows, out):
    for i in range(len(rows)):
        r = rows[i]
        n, m = (r[3, 0], r[3, 1], r[3, 2]), (r[4, 0], r[4, 1], r[4, 2])
        out[i, 0, 0] = density.density_kernel((r[0, 0], r[0, 1], r[0, 2]), n, r[1, 0], r[1, 1])
        out[i, 0, 1] = density.cosine_ratio(r[2, 0], r[2, 1])
        sides = r[1, 0] > np.float32(0.5), r[1, 1] > np.float32(0.5)
        out[i, 0, 2] = np.float32(density.photon_counts(r[2, 2], r[2, 1], *sides))
        out[i, 0, 3] = adjoint_factor(r[2, 0], r[2, 1], r[2, 2], r[1, 2])
        out[i, 1, :2] = sampling.octahedral_encode(n)
        x, y = sampling.octahedral_encode(m)
        out[i, 1, 2], out[i, 1, 3] = x, y
        out[i, 2, :3] = sampling.octahedral_decode(x, y)
        out[i, 2, 3] = density.ellipse_kernel((r[0, 0], r[0, 1], r[0, 2]), m, cross(n, m), n, r[1, 1])


def test_rng_is_bit_equal(gpu):
    keys = np.random.default_rng(1).integers(0, 2**32, (N, 4), dtype=np.uint32)
    keys[0], keys[1] = 0, 2**32 - 1
    hashes = gpu.buffer("hashes").sized(N * 32)
    with gpu.frame() as frame:
        compute = gpu.compute(SHADER, "rng")
        compute(frame, over=N, keys=gpu.buffer("keys").write(keys), hashes=hashes)
    found = gpu.read_buffer(hashes, np.uint32, N * 8).reshape(N, 2, 4)
    for key, (bits, floats) in zip(keys, found, strict=True):
        assert rng.pcg4d(*key) == tuple(bits)
        assert np.array(rng.random4(*key), np.float32).view(np.uint32).tolist() == floats.tolist()


def conditioning(rows: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """(N,) how much f and its pdf amplify an error of their directions, relative to them.

    The GGX distribution: an error e of n x h moves it by 4 e / alpha near its peak; a refracting half vector
    has e = EPS / |wo + eta wi|. 1 - F of Fresnel grows like the root of (eta cos)^2 beyond total reflection.
    """
    r = rows.astype(np.float64)
    n, wo, wi, ior = r[:, 3, :3], r[:, 4, :3], r[:, 5, :3], r[:, 4, 3]
    eta = np.where(r[:, 5, 3] == 2, 1 / ior, ior)
    nl = np.einsum("ij,ij->i", n, wi)
    through = r[:, 6, 3] > 0
    bent = (nl < 0) & through & (r[:, 5, 3] != 1)
    flat = (nl < 0) & ~bent
    both = np.where(bent[:, None], wo + eta[:, None] * wi, wo + wi - 2 * np.where(flat, nl, 0)[:, None] * n)
    length = np.linalg.norm(both, axis=1)
    cosine = np.einsum("ij,ij->i", wo, both) / length
    beyond = np.where(through, np.abs(eta**2 - 1 + cosine**2), 1)
    facet = np.abs(np.einsum("ij,ij->i", wi, both)) / length
    width = np.where(alpha > 0, alpha, 1)
    return 4 / width / np.where(bent, length, 1) + 2 / beyond + 2 / np.abs(nl) + 2 / facet


def quotients_error(rows: np.ndarray, pdf: np.ndarray) -> np.ndarray:
    """(N,) how much a quotient's error changes a pdf, of which one less a chance is a factor: WGSL (section
    15.7.4) grants 2.5 units in the last place, and one less what is nearly 1 amplifies them.

    Above the surface the Lambert lobe's share is that factor, of cos / pi at most; below, transmission's.
    """
    chances = np.zeros(N, np.float32)
    chance_rows(rows, chances)
    nl = np.einsum("ij,ij->i", rows[:, 3, :3], rows[:, 5, :3])
    below = pdf * chances / np.maximum(1.0 - chances, EPS)
    return 2.5 * EPS * np.where(nl > 0, nl / np.pi, below)


def test_bsdf_agrees(gpu):
    rows = random_rows(2)
    expected = np.zeros((N, 4, 4), np.float32)
    bsdf_rows(rows, expected)
    found = on_gpu(gpu, "bsdf", rows)
    tolerance = 1e-5 + EPS * conditioning(rows, expected[:, 1, 3])
    smooth = expected[:, 1, 3] == 0
    found[smooth, 1, :3] = expected[smooth, 1, :3]  # a lobe that a smooth surface has not, not a number
    tolerances = tolerance[:, None, None] * (np.abs(expected) + 1e-6)
    tolerances[:, 0, 3] += quotients_error(rows, expected[:, 0, 3])
    worst = (np.abs(found - expected) / tolerances).max(axis=0)
    assert (worst <= 1.0).all(), worst  # by what a card's driver gets wrong
    lit, through = expected[:, 0, 0] > 0, rows[:, 6, 3] > 0
    below = np.einsum("ij,ij->i", rows[:, 3, :3], rows[:, 5, :3]) < 0
    for case in (~through, through & ~below, through & below & (rows[:, 5, 3] == 1), smooth & ~below):
        assert lit[case].mean() > 0.5
    assert lit[through & below & (rows[:, 5, 3] != 1)].mean() > 0.1  # not all directions refract


def test_sampled_directions_agree(gpu):
    rows = random_rows(3)
    expected = np.zeros((N, 4, 4), np.float32)
    sample_rows(rows, expected)
    found = on_gpu(gpu, "bsdf_sample", rows)
    above = np.einsum("ij,ij->i", rows[:, 3, :3], rows[:, 4, :3]) > 0
    above &= np.einsum("ij,ij->i", rows[:, 6, :3], rows[:, 4, :3]) > 0
    # Within rounding of a threshold (choice of the lobe, horizon) a sample may fall on the other side.
    same = (found[:, 0, 3] == expected[:, 0, 3]) & (found[:, 1, 3] == expected[:, 1, 3]) & above
    # WGSL (section 15.7.4) grants sine and cosine an error of 2^-11; a reflection doubles their angle's.
    near = np.abs(found[:, 0, :3] - expected[:, 0, :3]).max(axis=1) < 2.0 * np.sqrt(2.0) * 2.0**-11
    absorbed = expected[:, 0, 3] == 0
    assert (same & (near | absorbed)).sum() > 0.999 * above.sum()
    both = same & near & ~absorbed
    assert np.median(np.abs(found[both, 1] - expected[both, 1]).max(axis=1)) < 1e-5
    assert (expected[both, 1, 3] == 1).sum() > 200 and (expected[both, 1, 3] == 0).sum() > 200


def test_smooth_surfaces_split_light_alike(gpu):
    rows = random_rows(5)
    expected = np.zeros((N, 4, 4), np.float32)
    specular_rows(rows, expected)
    found = on_gpu(gpu, "specular", rows)
    n, wo = rows[:, 3, :3], rows[:, 4, :3]
    above = (np.einsum("ij,ij->i", n, wo) > 0) & (np.einsum("ij,ij->i", rows[:, 6, :3], wo) > 0)
    # Where refraction grazes the surface, errors of the sine grow like 1 / cosine.
    grazing = np.abs(np.einsum("ij,ij->i", n, expected[:, 3, :3])) < 1e-2
    clear = above & ~(grazing & (rows[:, 6, 3] > 0))
    # The same side of the thresholds (total reflection, ng) but for rounding; then some ten roundings.
    same = clear & (found[:, 0, 3] == expected[:, 0, 3])
    assert same.sum() > 0.999 * clear.sum()
    error = np.abs(found - expected)[same].max(axis=(1, 2))
    assert np.quantile(error, 0.999) < 1e-5
    assert (found[:, 1, 3] == expected[:, 1, 3]).all()


def test_density_and_octahedral_agree(gpu):
    rows = random_rows(4)
    rows[:, 0, :3] = (rows[:, 0, :3] - 0.5) * rows[:, 1, :1]
    rows[:, 1, :2] += 0.01
    rows[:, 2] = rows[:, 2] * 2 - 1
    expected = np.zeros((N, 4, 4), np.float32)
    density_rows(rows, expected)
    found = on_gpu(gpu, "density", rows)
    peak = 3 / np.pi / rows[:, 1, 0] ** 2
    # t^2 is a difference of numbers up to d^2 / h^2, so kappa carries eps times that, relative to its peak
    d2 = (rows[:, 0, :3] ** 2).sum(axis=1) / rows[:, 1, :2].min(axis=1) ** 2
    assert (np.abs(found[:, 0, 0] - expected[:, 0, 0]) <= peak * EPS * 16 * (1 + d2)).all()
    front = rows[:, 2, 1] > 1e-3
    np.testing.assert_allclose(found[front, 0, 1], expected[front, 0, 1], rtol=1e-5)
    np.testing.assert_array_equal(found[:, 0, 2], expected[:, 0, 2])
    np.testing.assert_allclose(found[:, 0, 3], expected[:, 0, 3], rtol=1e-5)
    np.testing.assert_allclose(found[:, 1:], expected[:, 1:], atol=1e-5)
    np.testing.assert_allclose(expected[:, 2, :3], rows[:, 4, :3], atol=1e-6)
