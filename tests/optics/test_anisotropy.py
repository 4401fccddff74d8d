"""Anisotropic facets against the extension's formulas in float64: values, energy, samples; their tangents."""

import math

import numpy as np
import pytest
from scipy import stats
from transport import Tracer

from ispm.accel.records import Hit
from ispm.accel.surface import surface
from ispm.library.shapes import icosphere, polygons
from ispm.optics import bsdf, bsdf_sampling, rng
from ispm.optics.facets import NO_ANISOTROPY, Anisotropy, mean_alpha, visible_pdf
from ispm.optics.jit import jit
from ispm.paths.facet import sample_lobe, widened
from ispm.scene.material import Material, Texture
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Scene

f32, u32 = np.float32, np.uint32
UP = f32(0), f32(0), f32(1)
NONE = f32(0), f32(0), f32(0)
X, Y = (f32(1), f32(0), f32(0)), (f32(0), f32(1), f32(0))
WIDTHS = [(0.3, 0.1), (0.9, 0.2), (1.0, 0.6)]  # alpha along the tangent and across it
LEANING = [(0.2, 0.0), (0.6, 0.8), (0.95, 1.57)]  # cosine of wo, and its angle from the tangent
CASES = [(a, v) for a in WIDTHS for v in LEANING]


def facets(widths, tangent=X, reflectance=1.0):
    """The Bsdf of facets alone that all reflect so much."""
    along, across = (f32(a) for a in widths)
    r = f32(reflectance)
    none = f32(0)
    grain = Anisotropy(along, tangent)
    return bsdf.Bsdf(NONE, (r, r, r), r, across, none, none, NONE, f32(1.5), none, none, grain)


def towards(cosine, phi):
    r = math.sqrt(1.0 - cosine * cosine)
    return tuple(f32(c) for c in (r * math.cos(phi), r * math.sin(phi), cosine))


def lobe(widths, wo, wi):
    """D V as the extension writes them, float64: directions (n, 3) of frames (tangent, bitangent, normal)."""
    at, ab = widths
    h = wo + wi
    h = h / np.linalg.norm(h, axis=-1, keepdims=True)
    a2 = at * ab
    f = np.stack([ab * h[..., 0], at * h[..., 1], a2 * h[..., 2]], axis=-1)
    w2 = a2 / (f * f).sum(axis=-1)
    d = a2 * w2 * w2 / math.pi
    scaled = np.array([at, ab, 1.0])
    v = 0.5 / (
        wi[..., 2] * np.linalg.norm(scaled * wo, axis=-1) + wo[..., 2] * np.linalg.norm(scaled * wi, axis=-1)
    )
    return d * v


@jit
def eval_many(b, wo, wi, value, pdf):
    for i in range(len(wi)):
        w = wi[i, 0], wi[i, 1], wi[i, 2]
        value[i] = bsdf.eval_bsdf(b, UP, UP, wo, w)[0]
        pdf[i] = bsdf_sampling.pdf_bsdf(b, UP, wo, w)


@jit
def draw_many(b, wo, wi, weight):
    for i in range(len(wi)):
        u1, u2, u3, _ = rng.random4(u32(i), u32(0), u32(0), u32(3))
        ok, d, w, _ = bsdf_sampling.sample_bsdf(b, UP, UP, wo, u1, u2, u3, False)
        for k in range(3):
            wi[i, k] = d[k] if ok else f32(0)
        weight[i] = w[0] if ok else f32(0)


def grid(rows, columns):
    """Directions at the middles of a grid of equal solid angles over the hemisphere, (rows, columns, 3)."""
    z, phi = np.meshgrid((np.arange(rows) + 0.5) / rows, 2 * math.pi * (np.arange(columns) + 0.5) / columns,
                         indexing="ij")  # fmt: skip
    r = np.sqrt(1.0 - z * z)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)


def evaluated(b, wo, wi):
    value, pdf = np.zeros((2, len(wi)), f32)
    eval_many(b, wo, np.ascontiguousarray(wi, f32), value, pdf)
    return value.astype(float), pdf.astype(float)


def random_directions(count, seed):
    wi = np.random.default_rng(seed).normal(size=(count, 3))
    wi[:, 2] = np.abs(wi[:, 2]) + 0.02
    return wi / np.linalg.norm(wi, axis=1, keepdims=True)


@pytest.mark.parametrize(("widths", "leaning"), CASES)
def test_the_lobe_is_that_of_the_extension(widths, leaning):
    wo, wi = towards(*leaning), random_directions(2000, 1)
    value, pdf = evaluated(facets(widths), wo, wi)
    np.testing.assert_allclose(value, lobe(widths, np.array(wo, float), wi), rtol=2e-4)
    for direction, f, density in zip(wi[:50], value, pdf, strict=False):
        back, backward = evaluated(facets(widths), tuple(f32(c) for c in direction), np.array([wo]))
        assert back[0] == pytest.approx(f, rel=1e-4)  # reciprocal
        assert (density > 0.0) and (backward[0] > 0.0)


@pytest.mark.parametrize(("widths", "leaning"), CASES)
def test_facets_lose_but_never_gain_energy(widths, leaning):
    """In even white light; and densities integrate to less than 1 by what leads below the surface."""
    wi = grid(400, 800).reshape(-1, 3)
    value, pdf = evaluated(facets(widths), towards(*leaning), wi)
    albedo, total = ((each * 2 * math.pi).mean() for each in (value * wi[:, 2], pdf))
    assert 0.4 < albedo <= total < 1.0 + 1e-3


@pytest.mark.parametrize("widths", WIDTHS)
@pytest.mark.parametrize("leaning", LEANING)
def test_the_visible_normals_are_normalised(widths, leaning):
    """Heitz 2014, equation 4: D(h) max(wo.h, 0) over all h is the projected area n.wo / G1; here by the
    lobe's own density, which is D G1 / (4 n.wo) about h."""
    wo, h = np.array(towards(*leaning), float), grid(800, 1600).reshape(-1, 3)
    seen = h @ wo
    h, seen = h[seen > 1e-3], seen[seen > 1e-3]
    density = np.zeros(len(h), f32)
    visible_many(facets(widths), towards(*leaning), h.astype(f32), density)
    whole = (density * 4.0 * seen).sum() * 2 * math.pi / (800 * 1600)
    assert whole == pytest.approx(1.0, abs=3e-3)


@jit
def visible_many(b, wo, h, density):
    for i in range(len(h)):
        density[i] = visible_pdf(b, UP, wo, (h[i, 0], h[i, 1], h[i, 2]))


@pytest.mark.parametrize(("widths", "leaning"), CASES)
def test_samples_follow_the_pdf_and_weigh_what_the_lobe_reflects(widths, leaning):
    """Chi-square, N = 40,000, alpha = 0.01 over all 9 cases (Sidak); and the mean weight, 4 sigma."""
    count, rows, columns, fine = 40_000, 8, 16, 64
    b, wo = facets(widths), towards(*leaning)
    cells = grid(rows * fine, columns * fine)
    value, pdf = evaluated(b, wo, cells.reshape(-1, 3))
    blocks = pdf.reshape(rows, fine, columns, fine).mean(axis=(1, 3))
    expected = np.append(blocks.ravel() * (2 * math.pi / (rows * columns)), 0) * count
    expected[-1] = count - expected[:-1].sum()
    wi, weight = np.zeros((count, 3), f32), np.zeros(count, f32)
    draw_many(b, wo, wi, weight)
    row = np.minimum((wi[:, 2] * rows).astype(int), rows - 1)
    turn = np.arctan2(wi[:, 1], wi[:, 0]) % (2 * math.pi)
    column = np.minimum((turn / (2 * math.pi) * columns).astype(int), columns - 1)
    found = np.bincount(np.where(wi[:, 2] > 0, row * columns + column, rows * columns),
                        minlength=rows * columns + 1)  # fmt: skip
    common = expected >= 5
    pairs = (np.append(found[common], found[~common].sum()),
             np.append(expected[common], expected[~common].sum()))  # fmt: skip
    chi2 = ((pairs[0] - pairs[1]) ** 2 / np.maximum(pairs[1], 5)).sum()
    assert stats.chi2.sf(chi2, common.sum()) > 1 - (1 - 0.01) ** (1 / 9)
    albedo = (value * cells.reshape(-1, 3)[:, 2]).mean() * 2 * math.pi
    sigma = weight.std(dtype=float) / math.sqrt(count)
    assert weight.mean(dtype=float) == pytest.approx(albedo, abs=4 * sigma + 1e-3)


@pytest.mark.parametrize("leaning", LEANING)
def test_facets_as_wide_across_are_those_alike_in_all_directions(leaning):
    """Whatever the tangent: both formulas are the same there, but for rounding."""
    wo, wi = towards(*leaning), random_directions(500, 2)
    even, even_pdf = evaluated(facets((0.3, 0.3))._replace(anisotropy=NO_ANISOTROPY), wo, wi)
    for tangent in (X, Y, (f32(0.6), f32(-0.8), f32(0)), UP):  # the last lies in no direction of the surface
        value, pdf = evaluated(facets((0.3, 0.3), tangent), wo, wi)
        np.testing.assert_allclose(value, even, rtol=1e-4)
        np.testing.assert_allclose(pdf, even_pdf, rtol=1e-4)


def test_a_quarter_turn_swaps_the_directions():
    wi = random_directions(500, 4)
    turned = np.stack([-wi[:, 1], wi[:, 0], wi[:, 2]], axis=1)
    value, _ = evaluated(facets((0.9, 0.1), X), towards(0.6, 0.3), wi)
    same, _ = evaluated(facets((0.9, 0.1), Y), towards(0.6, 0.3 + math.pi / 2), turned)
    np.testing.assert_allclose(same, value, rtol=1e-4)
    other, _ = evaluated(facets((0.9, 0.1), Y), towards(0.6, 0.3), wi)
    assert np.abs(other / value - 1.0).max() > 1.0


@pytest.mark.parametrize("sign", [1, -1])
def test_neither_the_tangents_sign_nor_what_lies_along_the_normal_counts(sign):
    wi = random_directions(500, 5)
    value, _ = evaluated(facets((0.9, 0.1), X), towards(0.6, 0.3), wi)
    same, _ = evaluated(facets((0.9, 0.1), (f32(0.8 * sign), f32(0), f32(0.6))), towards(0.6, 0.3), wi)
    np.testing.assert_allclose(same, value, rtol=1e-4)


def test_eye_paths_draw_by_the_same_density():
    """Weight times density is f cos for each direction that the lobe of a surface draws."""
    b, wo = facets((0.6, 0.05)), towards(0.5, 0.7)
    x = surface_of(Material(metallic=1.0, anisotropy=0.5))._replace(n=UP, ng=UP, bsdf=b)
    for u1, u2 in np.random.default_rng(6).random((100, 2)).astype(f32):
        ok, wi, factor, pdf = sample_lobe(x, wo, u1, u2)
        if ok:
            value, density = evaluated(b, wo, np.array([wi]))
            assert pdf == pytest.approx(density[0], rel=1e-3)
            assert factor[0] * pdf == pytest.approx(value[0] * wi[2], rel=1e-3)
    wide = widened(x, wo, f32(0.2)).bsdf
    assert (wide.alpha, wide.anisotropy.alpha) == (f32(0.2), f32(0.6))
    assert widened(x, wo, f32(0.01)).bsdf.alpha == f32(0.05)
    assert mean_alpha(b) == pytest.approx(math.sqrt(0.6 * 0.05))


def quad(**more):
    """Two triangles in the plane z = 0, facing +Z, whose u goes along +X and v along -Y, as glTF's."""
    positions = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], f32)
    uv = np.array([(0, 1), (1, 1), (1, 0), (0, 0)], f32)
    triangles = np.array([(0, 1, 2), (0, 2, 3)], u32)
    return Mesh(positions, triangles, **{"uv0": uv, **more})


def surface_of(material, mesh=None, **place):
    """The SurfacePoint in the middle of the first triangle, met from +Z."""
    scene = Scene()
    scene.add(quad() if mesh is None else mesh, material=material, **place)
    tracer = Tracer(scene, threads=1)
    hit = Hit(u32(0), u32(0), f32(1 / 3), f32(1 / 3))
    return surface(tracer.tables, hit, (f32(0), f32(0), f32(-1)))


def grain_of(material, mesh=None, **place):
    grain = surface_of(material, mesh, **place).bsdf.anisotropy
    return grain.alpha, np.array(grain.tangent)


def along(found, expected):
    """Whether a direction is another or its opposite."""
    return abs(abs(np.dot(found, expected)) - 1.0) < 1e-5


def brushed(**more):
    return Material(metallic=1.0, roughness=0.5, anisotropy=0.6, **more)


def test_the_width_along_the_tangent_is_the_extensions():
    """mix(alpha, 1, strength^2), across it alpha; no strength: no anisotropy."""
    x = surface_of(brushed())
    assert x.bsdf.alpha == pytest.approx(0.25)
    assert x.bsdf.anisotropy.alpha == pytest.approx(0.25 + 0.75 * 0.36)
    assert surface_of(Material(metallic=1.0, anisotropy_rotation=1.0)).bsdf.anisotropy == (
        0.0,
        (0.0, 0.0, 0.0),
    )
    mirror = surface_of(Material(metallic=1.0, roughness=0.0, anisotropy=1.0)).bsdf
    assert (mirror.alpha, mirror.anisotropy.alpha) == (pytest.approx(1e-3), pytest.approx(1.0))


@pytest.mark.parametrize(
    ("angle", "expected"), [(0.0, (1, 0, 0)), (math.pi / 2, (0, 1, 0)), (0.5, (0.8776, 0.4794, 0))]
)
def test_the_direction_turns_counterclockwise_from_the_tangent(angle, expected):
    assert along(
        grain_of(brushed(anisotropy_rotation=angle))[1], np.array(expected) / np.linalg.norm(expected)
    )


def test_tangents_of_the_mesh_count_before_those_of_its_texture_coordinates():
    tangents = np.tile(np.array([0.6, 0.8, 0.0, 1.0], f32), (4, 1))
    normals = np.tile(np.array([0.0, 0.0, 1.0], f32), (4, 1))
    mesh = quad(tangents=tangents, normals=normals)
    assert along(grain_of(brushed(), mesh)[1], (0.6, 0.8, 0.0))
    mesh = quad(tangents=tangents * np.array([1, 1, 1, -1], f32), normals=normals)
    assert along(grain_of(brushed(anisotropy_rotation=math.pi / 2), mesh)[1], (0.8, -0.6, 0.0))


def test_a_mirrored_mesh_mirrors_the_direction():
    """By 0.5 radians from +X, seen in the mirror x -> -x."""
    found = grain_of(brushed(anisotropy_rotation=0.5), scale=(-1.0, 1.0, 1.0))[1]
    assert along(found, (-math.cos(0.5), math.sin(0.5), 0.0))


def test_without_tangents_it_goes_around_the_y_axis():
    mesh = icosphere(1.0, 3)
    mesh.uv0 = None
    tracer = Tracer(scene_of(mesh, brushed()), threads=1)
    for primitive in range(0, len(mesh.triangles), 37):
        x = surface(tracer.tables, Hit(u32(0), u32(primitive), f32(0.3), f32(0.3)), (f32(0), f32(0), f32(-1)))
        n, grain = np.array(x.n), x.bsdf.anisotropy.tangent
        around = np.cross((0.0, 1.0, 0.0), n)
        assert along(grain, around / np.linalg.norm(around))
    top = polygons([np.array([(0, 0, 0), (0, 0, 1), (1, 0, 0)], float)], "top")
    x = surface_of(brushed(), top)
    assert (
        abs(np.linalg.norm(x.bsdf.anisotropy.tangent) - 1.0) < 1e-5
        and abs(np.dot(x.bsdf.anisotropy.tangent, x.n)) < 1e-5
    )


def scene_of(mesh, material):
    scene = Scene()
    scene.add(mesh, material=material)
    return scene


@pytest.mark.parametrize(
    ("texel", "expected", "strength"),
    [((255, 128, 255), (1, 0, 0), 0.6), ((128, 255, 102), (0, 1, 0), 0.24),
     ((255, 255, 255), (0.7071, 0.7071, 0), 0.6), ((128, 128, 255), (1, 0, 0), 0.6)],
)  # fmt: skip
def test_a_texture_tells_direction_and_strength(texel, expected, strength):
    """A texel's middle, 128, is 0.004 off; without a direction it is the tangent's."""
    picture = Texture(np.full((1, 1, 3), texel, np.uint8), srgb=False)
    alpha, tangent = grain_of(brushed(anisotropy_texture=picture))
    assert abs(np.dot(tangent, expected)) > 1.0 - 1e-4
    assert alpha == pytest.approx(0.25 + 0.75 * strength**2, rel=1e-3)
    _, turned = grain_of(brushed(anisotropy_texture=picture, anisotropy_rotation=math.pi / 2))
    assert abs(np.dot(turned, tangent)) < 1e-5
