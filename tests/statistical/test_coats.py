"""Clear coats: their energy, how photons scatter at them, and what eye paths find by them."""

import math

import numpy as np
import pytest
from layered import assert_as_bright_as_paths, made, scatter_often
from transport import Tracer, box_room, lit, render, trace

from ispm.accel.records import Hit
from ispm.accel.surface import SurfacePoint
from ispm.library.shapes import polygons
from ispm.optics.bsdf import eval_bsdf
from ispm.optics.bsdf_sampling import pdf_bsdf
from ispm.optics.coat import coat_bsdf, covered, make_coat
from ispm.optics.jit import jit
from ispm.optics.sheen import NO_SHEEN
from ispm.paths.eye import trace_eye
from ispm.paths.eye_paths import EyeRays
from ispm.scene.camera import Camera
from ispm.scene.light import PointLight
from ispm.scene.material import Material, Texture
from ispm.scene.scene import Scene

f32, u32 = np.float32, np.uint32
UP = f32(0), f32(0), f32(1)
GRID = 256, 512
CASES = [(r, c) for r in (0.0, 0.3, 0.5, 1.0) for c in (0.15, 0.6, 0.98)]


def fresnel(cosine):
    return 0.04 + 0.96 * (1.0 - cosine) ** 5


def coat_albedo(alpha, cosine, steps=400):
    """Integral of f cos of a whole coat; from the papers, in float64, over the facets that reflect."""
    if alpha == 0.0:
        return fresnel(cosine)
    wo = np.array([math.sqrt(1.0 - cosine * cosine), 0.0, cosine])
    u, phi = np.meshgrid((np.arange(steps) + 0.5) / steps, 2 * math.pi * (np.arange(steps) + 0.5) / steps)
    cos = 1.0 / np.sqrt(1.0 + alpha * alpha * u / (1.0 - u))  # equal shares of D cos
    sin = np.sqrt(1.0 - cos * cos)
    h = np.stack([sin * np.cos(phi), sin * np.sin(phi), cos], axis=-1)
    vh = h @ wo
    nl = 2.0 * vh * cos - cosine
    seen = (vh > 0.0) & (nl > 0.0)
    vh, nl, nh = vh[seen], nl[seen], cos[seen]
    a2 = alpha * alpha
    lambda_v, lambda_l = (0.5 * (np.sqrt(1.0 + a2 * (1.0 / (c * c) - 1.0)) - 1.0) for c in (cosine, nl))
    return (fresnel(vh) * vh / (cosine * nh * (1.0 + lambda_v + lambda_l))).sum() / steps**2


def coated(base, roughness, cosine, weight=1.0):
    """A SurfacePoint under a coat that is seen at a cosine, and wo."""
    coat = made(make_coat(f32(weight), f32(roughness), UP, f32(cosine)))
    none = f32(0), f32(0), f32(0)
    wo = f32(math.sqrt(1.0 - cosine * cosine)), f32(0), f32(cosine)
    b = made(covered(base, coat.shown))
    return SurfacePoint(
        Hit(u32(0), u32(0), f32(0), f32(0)), none, UP, UP, b, u32(0), True, coat, NO_SHEEN, none
    ), wo


WHITE = made(coat_bsdf(make_coat(f32(0), f32(0), UP, f32(1))))._replace(diffuse=(f32(1),) * 3)


@jit
def grid_of(b, wo, value, pdf):
    for i in range(GRID[0]):
        z = f32((i + 0.5) / GRID[0])
        r = math.sqrt(f32(1) - z * z)
        for j in range(GRID[1]):
            phi = f32(2 * math.pi * (j + 0.5) / GRID[1])
            wi = (r * math.cos(phi), r * math.sin(phi), z)
            value[i, j] = eval_bsdf(b, UP, UP, wo, wi)[1] * z
            pdf[i, j] = pdf_bsdf(b, UP, wo, wi)


@pytest.mark.parametrize(("roughness", "cosine"), CASES)
def test_a_coat_over_white_loses_what_its_facets_shadow(roughness, cosine):
    """What it hides is its reflectance along wo, as the extension has it, so that over a white surface all is
    left but what facets shadow. That their Fresnel terms average to more than the one of n adds 1.31e-3 at
    most, over all alphas and angles."""
    x, wo = coated(WHITE, roughness, cosine)
    assert x.coat.shown == pytest.approx(1.0 - fresnel(cosine), rel=1e-5)
    assert x.bsdf.diffuse[0] == x.coat.shown
    own = coat_albedo(roughness**2, cosine)
    if roughness >= 0.5:
        value, pdf = np.zeros((2, *GRID), f32)
        grid_of(coat_bsdf(x.coat), wo, value, pdf)
        assert 2 * math.pi * value.mean(dtype=float) == pytest.approx(own, rel=3e-3)
        assert 2 * math.pi * pdf.mean(dtype=float) < 1.0 + 3e-3
    assert own + x.bsdf.diffuse[0] < 1.0 + 1.4e-3


@pytest.mark.parametrize(("roughness", "cosine"), CASES)
@pytest.mark.parametrize("weight", [0.5, 1.0])
def test_photons_scatter_by_both_layers_as_their_albedos_say(roughness, cosine, weight):
    """N = 100,000, 4.2 sigma: once in 1,500 runs of the 24 cases."""
    x, wo = coated(WHITE, roughness, cosine, weight)
    found = np.zeros((100_000, 3), f32)
    scatter_often(x, wo, found)
    found = found[:, 0]
    expected = weight * coat_albedo(roughness**2, cosine) + 1.0 - weight * fresnel(cosine)
    error = found.std(dtype=float) / math.sqrt(len(found))
    assert abs(found.mean(dtype=float) - expected) < 4.2 * error + 1e-3 * expected


@pytest.mark.parametrize("roughness", [0.2, 0.7])
def test_a_coat_is_reciprocal(roughness):
    b = coat_bsdf(make_coat(f32(0.8), f32(roughness), UP, f32(0.5)))
    random = np.random.default_rng(2)
    for _ in range(50):
        wo, wi = random.normal(size=(2, 3))
        wo[2], wi[2] = abs(wo[2]) + 0.05, abs(wi[2]) + 0.05
        wo, wi = (tuple((v / np.linalg.norm(v)).astype(f32)) for v in (wo, wi))
        assert eval_bsdf(b, UP, UP, wo, wi) == pytest.approx(eval_bsdf(b, UP, UP, wi, wo), rel=2e-4)


def floor(material, uv=None):
    """A square of 20 m at y = 0."""
    scene = Scene()
    mesh = polygons([np.array([(-10, 0, -10), (-10, 0, 10), (10, 0, 10), (10, 0, -10)], float)], "floor")
    if uv is not None:
        mesh.uv0 = np.full((len(mesh.positions), 2), uv, f32)
        mesh.tangents = np.tile(f32([1, 0, 0, 1]), (len(mesh.positions), 1))
    scene.add(mesh, material=material, name="floor")
    return scene


def paths_of(scene, directions):
    """EyePaths of the coats that rays from (0, 1, 0) show."""
    tracer, count = Tracer(scene), len(directions)
    distances = (-1.0 / directions[:, 1]).astype(f32)
    origins = np.tile(f32([0, 1, 0]), (count, 1))
    keys = np.arange(count, dtype=u32)
    rays = EyeRays(origins, directions.astype(f32), distances, keys, (0.0, 1e-3), of_coats=True)
    return trace_eye(tracer.packed, tracer.world, tracer.surfaces, rays, 1, 0)


def seen_at(angles):
    """Directions down to the floor, at angles from its normal."""
    return np.stack([np.sin(angles), -np.cos(angles), np.zeros_like(angles)], axis=1)


def closed_form(alpha, places, light, place, eye=(0.0, 1.0, 0.0)):
    """Radiance of a whole coat at floor `places` by a point light, (n,), and F(n.wo); in float64."""
    wo, to_light = np.array(eye) - places, np.array(place) - places
    square = (to_light**2).sum(axis=1)
    wo /= np.linalg.norm(wo, axis=1, keepdims=True)
    wi = to_light / np.sqrt(square)[:, None]
    h = wo + wi
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    nv, nl, nh, vh = wo[:, 1], wi[:, 1], h[:, 1], (wo * h).sum(axis=1)
    a2 = alpha * alpha
    d = a2 / (math.pi * (nh * nh * (a2 - 1.0) + 1.0) ** 2)
    v = 0.5 / (nl * np.sqrt(nv * nv * (1 - a2) + a2) + nv * np.sqrt(nl * nl * (1 - a2) + a2))
    return fresnel(vh) * d * v * nl * light / square, fresnel(nv), nl * light / square


@pytest.mark.parametrize("roughness", [0.2, 0.45, 0.8])
def test_a_coat_reflects_a_point_light_as_the_formula_says(roughness):
    directions = seen_at(np.linspace(0.05, 1.3, 40))
    material = Material((0.0,) * 3, specular=0.0, clearcoat=0.6, clearcoat_roughness=roughness)
    scene = floor(material)
    scene.add(PointLight((50.0,) * 3), translation=(1.0, 1.5, 0.2))
    paths = paths_of(scene, directions)
    places = np.array([0.0, 1.0, 0.0]) - directions / directions[:, 1:2]
    own, hidden, _ = closed_form(roughness**2, places, 50.0, (1.0, 1.5, 0.2))
    np.testing.assert_allclose(paths.firsts["own"], 0.6 * own[:, None].repeat(3, 1), rtol=2e-3)
    np.testing.assert_allclose(paths.firsts["hidden"], 0.6 * hidden, rtol=1e-4)


def test_textures_drive_a_coat():
    """Factor by R, roughness by G; the coat's normals by a map of its own, and not by the base's."""
    flat, tilted = np.array([128, 128, 255]), np.array([218, 128, 218])  # n leans by 45 degrees along +x
    directions = seen_at(np.array([0.3]))

    def found(**maps):
        pictures = {
            f"{name}_texture": Texture(np.full((1, 1, 3), value, np.uint8), srgb=False)
            for name, value in maps.items()
        }
        coat = Material((0.5,) * 3, clearcoat=0.8, clearcoat_roughness=0.9, **pictures)
        return paths_of(floor(coat, uv=0.5), directions).firsts[0]

    plain = found()
    half = found(clearcoat=(102, 9, 9), clearcoat_roughness=(9, 51, 9))
    assert plain["hidden"] == pytest.approx(0.8 * fresnel(math.cos(0.3)), rel=1e-4)
    assert half["hidden"] == pytest.approx(0.4 * plain["hidden"], rel=1e-4)
    assert plain["alpha"] == pytest.approx(0.81, rel=1e-4)
    assert half["alpha"] == pytest.approx(0.18**2, rel=1e-3)
    assert found(normal=tilted)["n"] == pytest.approx((0, 1, 0), abs=1e-6)
    assert found(clearcoat_normal=flat)["n"] == pytest.approx((0, 1, 0), abs=6e-3)
    leaning = found(clearcoat_normal=tilted, normal=flat)["n"]
    assert leaning == pytest.approx((math.sqrt(0.5), math.sqrt(0.5), 0), abs=6e-3)


def test_a_smooth_coat_mirrors_a_wall_with_its_reflectance():
    """The wall fills all that the floor mirrors, so each path finds it whole."""
    scene = floor(Material((0.2,) * 3, clearcoat=1.0))
    ceiling = polygons([np.array([(-90, 3, -90), (-90, 3, 90), (90, 3, 90), (90, 3, -90)], float)], "ceiling")
    glow = Material((0.0,) * 3, specular=0.0, emission=(5.0,) * 3, double_sided=True)
    scene.add(ceiling, material=glow)
    directions = seen_at(np.linspace(0.1, 1.4, 30))
    paths = paths_of(scene, directions)
    expected = 5.0 * fresnel(-directions[:, 1])
    np.testing.assert_allclose(paths.emission, expected[:, None].repeat(3, 1), rtol=1e-4)
    assert not paths.direct.any()


def test_photons_lose_nothing_uncounted_at_coats():
    scene = box_room(albedo=0.8)
    for k, node in enumerate(scene.nodes):
        node.parts[0].material.clearcoat, node.parts[0].material.clearcoat_roughness = 1.0, 0.2 * k
    sums = trace(lit(scene), 20_000, 8)
    left = sums.emitted - sums.absorbed - sums.escaped - sums.dropped
    assert np.abs(left).max() < 1e-4 * sums.emitted.max()


@pytest.mark.parametrize("roughness", [0.0, 0.3, 0.7])
def test_a_picture_of_a_coated_floor_is_the_formula(gpu, roughness):
    """Direct light of a matte floor under a coat, from above and aslant; 1 % of the brightest, which pixels'
    halves and normals round."""
    material = Material((0.5,) * 3, specular=0.0, clearcoat=1.0, clearcoat_roughness=roughness)
    scene, eye, place = floor(material), (0.0, 1.0, 3.0), (0.5, 2.0, -0.5)
    scene.add(PointLight((50.0,) * 3), translation=place)
    frame, _ = render(gpu, scene, Camera.look_at(eye, (0, 0, 0), yfov=0.6), size=(64, 36), antialias=False)
    x, y = np.meshgrid((np.arange(64) + 0.5) / 64 * 2 - 1, 1 - (np.arange(36) + 0.5) / 36 * 2)
    tangent = math.tan(0.3)
    back = np.array(eye) / np.linalg.norm(eye)
    right = np.array([1.0, 0.0, 0.0])
    up = np.cross(back, right)
    d = (x * 64 / 36 * tangent)[..., None] * right + (y * tangent)[..., None] * up - back
    d = d.reshape(-1, 3)
    places = np.array(eye) - d * (eye[1] / d[:, 1:2])
    own, hidden, irradiance = closed_form(max(roughness**2, 1e-4), places, 50.0, place, eye)
    expected = (1.0 - hidden) * 0.5 / math.pi * irradiance + (own if roughness else 0.0)
    np.testing.assert_allclose(
        frame.direct.reshape(-1, 3), expected[:, None].repeat(3, 1), rtol=2e-3, atol=1e-2 * expected.max()
    )


@pytest.mark.parametrize(
    "coat",
    [
        dict(clearcoat_roughness=0.0, roughness=0.7),
        dict(clearcoat_roughness=0.3, roughness=0.3, metallic=1.0),
        dict(clearcoat_roughness=0.6, roughness=0.6, metallic=0.5),
    ],
)
def test_a_coated_ball_is_as_bright_as_paths_find_it(gpu, coat):
    assert_as_bright_as_paths(gpu, Material((0.6, 0.1, 0.1), clearcoat=1.0, **coat), samples=384)
