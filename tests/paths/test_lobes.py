"""Eye paths that narrow lobes of opaque surfaces send out: against quadrature, and against the BSDF."""

import math

import numpy as np
import pytest
from transport import Tracer

from ispm.library.shapes import polygons
from ispm.lights.openings import NO_OPENINGS
from ispm.optics.bsdf import NARROW_ALPHA, Bsdf, eval_bsdf
from ispm.optics.bsdf_sampling import pdf_bsdf
from ispm.optics.coat import NO_COAT
from ispm.optics.facets import NO_ANISOTROPY
from ispm.optics.jit import jit
from ispm.optics.records import NO_HIT
from ispm.optics.sheen import NO_SHEEN
from ispm.paths.branch import View
from ispm.paths.eye import trace_eye
from ispm.paths.eye_paths import EyeRays
from ispm.paths.facet import lobe_blur, lobe_numbers, sample_lobe
from ispm.scene.material import Material
from ispm.scene.scene import Scene

f32, i64, u32 = np.float32, np.int64, np.uint32

NORMAL = np.array([0.0, 1.0, 0.0])
F0 = (0.9, 0.6, 0.3)
GLOW = (0.5, 0.75, 1.0)


def seen_from(cosine):
    """Unit direction from the middle of the plane towards the eye."""
    return np.array([math.sqrt(1.0 - cosine * cosine), cosine, 0.0])


def reflected(alpha, wo, wi):
    """f(wo, wi) cos, (n, 3), of a metal; from the papers, in float64."""
    h = (wo + wi) / np.linalg.norm(wo + wi, axis=1, keepdims=True)
    nv, nl, nh, vh = wo @ NORMAL, wi @ NORMAL, h @ NORMAL, h @ wo
    a2 = alpha * alpha
    d = a2 / (math.pi * (nh * nh * (a2 - 1.0) + 1.0) ** 2)
    lambda_v, lambda_l = (0.5 * (np.sqrt(1.0 + a2 * (1.0 / (c * c) - 1.0)) - 1.0) for c in (nv, nl))
    fresnel = np.array(F0) + (1.0 - np.array(F0)) * (1.0 - vh[:, None]) ** 5
    return fresnel * (d / (4.0 * nv * (1.0 + lambda_v + lambda_l)))[:, None]


def quadrature(alpha, wo, meets, steps=1200):
    """Integral of f cos over the directions that `meets` accepts, by facets' normals."""
    u = (np.arange(steps) + 0.5) / steps
    tan2 = alpha * alpha * u / (1.0 - u)  # equal shares of D cos
    cos = 1.0 / np.sqrt(1.0 + tan2)
    sin = np.sqrt(1.0 - cos * cos)
    phi = 2.0 * math.pi * (np.arange(steps) + 0.5) / steps
    h = np.stack(
        [np.outer(sin, np.cos(phi)), np.repeat(cos[:, None], steps, 1), np.outer(sin, np.sin(phi))], axis=-1
    ).reshape(-1, 3)
    vh = h @ wo
    wi = 2.0 * vh[:, None] * h - wo
    rows = np.flatnonzero((vh > 0.0) & (wi[:, 1] > 0.0))
    rows = rows[meets(wi[rows])]
    h, wi, vh = h[rows], wi[rows], vh[rows]
    nh = h[:, 1]
    d = alpha**2 / (math.pi * (nh * nh * (alpha**2 - 1.0) + 1.0) ** 2)
    weight = 4.0 * vh / (d * nh)  # d omega_i over the share of D cos
    return (reflected(alpha, wo, wi) * weight[:, None]).sum(axis=0) / steps**2


def plane_under(wall, alpha):
    """A metal plane, with a bright rectangle (`wall`) above it that is no lamp: only paths find it."""
    scene = Scene()
    corners = np.array([(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)], float)
    metal = Material(F0, metallic=1.0, roughness=math.sqrt(alpha))
    scene.add(polygons([corners], "plane"), material=metal, name="plane")
    bright = Material(GLOW, unlit=True, double_sided=True)  # no lamp, which other stages draw from, too
    scene.add(polygons([np.array(wall, float)], "wall"), material=bright, name="wall")
    return scene


def rays_to_middle(wo, count):
    f4 = np.float32
    origins = np.tile((2.0 * wo).astype(f4), (count, 1))
    directions = np.tile((-wo).astype(f4), (count, 1))
    return EyeRays(origins, directions, np.full(count, 2.0, f4), np.arange(count, dtype=u32), (0.0, 1e-3))


@pytest.mark.parametrize("alpha", [0.05, 0.1, 0.2])
@pytest.mark.parametrize("cosine", [0.9, 0.4])
def test_a_lobe_sees_a_bright_wall_as_quadrature_does(alpha, cosine):
    """18 means of 20,000 pixels; none is off by more than 4.2 standard errors, as in one run of 2000."""
    wo = seen_from(cosine)
    wall = [(-1.2, 0.3, -0.5), (-1.2, 0.3, 0.5), (-0.15, 0.3, 0.5), (-0.15, 0.3, -0.5)]

    def meets(wi):
        at = wi * (0.3 / wi[:, 1:2])
        return (at[:, 0] > -1.2) & (at[:, 0] < -0.15) & (np.abs(at[:, 2]) < 0.5)

    tracer = Tracer(plane_under(wall, alpha))
    paths = trace_eye(tracer.packed, tracer.world, tracer.surfaces, rays_to_middle(wo, 20_000), 1, 0)
    expected = quadrature(alpha, wo, meets) * GLOW
    error = paths.emission.std(axis=0) / math.sqrt(len(paths.emission))
    assert (error < 0.02 * expected).all()
    assert (np.abs(paths.emission.mean(axis=0, dtype=float) - expected) < 4.2 * error).all()
    assert not paths.direct.any() and not paths.through.any()


def test_a_lobe_within_light_from_all_sides_reflects_its_albedo():
    """Nothing is as bright as the wall that fills the lobe; none of its light is lost or counted twice."""
    wo = seen_from(0.8)
    wall = [(-500, 0.5, -500), (-500, 0.5, 500), (500, 0.5, 500), (500, 0.5, -500)]
    tracer = Tracer(plane_under(wall, 0.1))
    paths = trace_eye(tracer.packed, tracer.world, tracer.surfaces, rays_to_middle(wo, 20_000), 2, 0)
    expected = quadrature(0.1, wo, lambda wi: wi[:, 1] > 1e-3) * GLOW
    error = paths.emission.std(axis=0) / math.sqrt(len(paths.emission))
    assert (np.abs(paths.emission.mean(axis=0, dtype=float) - expected) < 3.5 * error + 1e-3 * expected).all()
    assert (paths.emission.mean(axis=0) < 1.001 * np.array(GLOW)).all()


@jit
def _draw(x, wo, u, out):
    for k in range(len(u)):
        alive, wi, factor, pdf = sample_lobe(x, wo, u[k, 0], u[k, 1])
        f = eval_bsdf(x.bsdf, x.n, x.ng, wo, wi)
        cosine = x.n[0] * wi[0] + x.n[1] * wi[1] + x.n[2] * wi[2]
        out[k, 0] = f32(1) if alive else f32(0)
        out[k, 1] = factor[0] * pdf
        out[k, 2] = f[0] * max(cosine, f32(0))
        out[k, 3] = pdf
        out[k, 4] = pdf_bsdf(x.bsdf, x.n, wo, wi)


def test_weights_are_the_bsdf_over_the_density_that_is_handed_on():
    from ispm.accel.records import Hit
    from ispm.accel.surface import SurfacePoint

    zero, up = (f32(0),) * 3, (f32(0), f32(1), f32(0))
    rest = f32(1), f32(0.15), f32(0), f32(0), zero, f32(1.5), f32(0), f32(0), NO_ANISOTROPY
    b = Bsdf(zero, (f32(0.9),) * 3, *rest)
    x = SurfacePoint(
        Hit(u32(0), u32(0), f32(0), f32(0)), zero, up, up, b, u32(0), True, NO_COAT, NO_SHEEN, zero
    )
    wo = tuple(f32(c) for c in seen_from(0.3))
    u = np.random.default_rng(5).random((2000, 2)).astype(np.float32)
    out = np.zeros((len(u), 5), np.float32)
    _draw(x, wo, u, out)
    alive = out[:, 0] > 0
    assert 0.8 < alive.mean() < 1.0  # some facets lead below
    assert out[alive, 1] == pytest.approx(out[alive, 2], rel=2e-3)
    assert out[alive, 3] == pytest.approx(out[alive, 4], rel=1e-4)
    assert not out[~alive, 1].any()


@jit
def _numbers(view, out):
    for key in range(len(out)):
        out[key, 0], out[key, 1] = lobe_numbers(view, u32(key), i64(0), i64(1), False)


@jit
def _blur(b, pdf):
    return lobe_blur(b, pdf)


def lattice(pass_index, columns=64):
    view = View(
        *[f32(0)] * 4,
        u32(pass_index),
        u32(0),
        u32(columns),
        i64(1),
        i64(4),
        f32(1),
        *[False] * 4,
        u32(NO_HIT),
        NO_OPENINGS,
    )
    out = np.zeros((columns * columns, 2), np.float32)
    _numbers(view, out)
    assert (out >= 0).all() and (out < 1).all()
    return out.reshape(columns, columns, 2)


def test_numbers_of_neighbors_are_even_and_of_passes_differ():
    first, second = lattice(0), lattice(1)
    assert (np.abs(first - second) > 1e-6).all()
    for y, x in ((0, 0), (16, 48), (32, 32)):
        square = first[y : y + 16, x : x + 16].reshape(-1, 2)
        for axis in (0, 1):  # by chance some of the 16 bins would have 8 or 24
            counts = np.bincount((square[:, axis] * 16).astype(int), minlength=16)
            assert counts.min() >= 13 and counts.max() <= 19


def test_a_lobe_blurs_the_tail_of_the_one_before_little():
    """Light in the tail of a lobe, at four times its alpha, is blurred to at most 2.5 times as much, and in
    its middle to at least .35; by the whole width that the density tells to 2.8 and more, and .3 and less."""
    alpha, zero, step = 0.05, (f32(0),) * 3, 0.02
    rest = f32(1), f32(alpha), f32(0), f32(0), zero, f32(1.5), f32(0), f32(0), NO_ANISOTROPY
    b = Bsdf(zero, (f32(0.9),) * 3, *rest)
    # facets' angles over alpha, half of them
    x, y = np.meshgrid(np.arange(-12.0, 12.0, step), np.arange(step / 2.0, 12.0, step))
    squares = x * x + y * y

    def density(width, squares):
        return width**2 / (math.pi * (width**2 + squares) ** 2)

    def blurred(width, angle):
        seen = density(1.0, squares) * density(width, (x - angle) ** 2 + y * y)
        return 2.0 * step**2 * seen.sum() / density(1.0, angle**2)

    apart = np.arange(0.0, 300.0, 0.5)
    widths = [_blur(b, f32(d)) / alpha for d in density(alpha, apart * alpha**2) / 4.0]
    width = np.minimum(np.interp(squares, apart, widths), NARROW_ALPHA / alpha)
    assert blurred(width, 0.0) > 0.35 and blurred(width, 4.0) < 2.5
    told = np.minimum(1.0 + squares, NARROW_ALPHA / alpha)  # lobes that wide are not widened
    assert blurred(told, 0.0) < 0.3 and blurred(told, 4.0) > 2.8
    assert _blur(b, f32(0)) == 0.0
