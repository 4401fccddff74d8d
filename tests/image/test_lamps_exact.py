"""Pictures lit by emissive surfaces and environments, where the answer is known exactly."""

import math

import numpy as np
import pytest
from exact_light import blocks, polygon_irradiance, sky_irradiance
from layered import made
from transport import Tracer, box_room

from ispm import Camera, Environment, Material, RectLight, Renderer, Scene, Settings, SphereLight
from ispm.accel.layers import without_diffuse
from ispm.library.shapes import icosphere, polygons
from ispm.optics.bsdf import Dielectric, eval_bsdf, surface_bsdf
from ispm.optics.jit import jit
from ispm.optics.vector import dot, scale, sub
from ispm.scene.camera import look_at_pose

f32 = np.float32
WHITE = Material((1.0,) * 3, specular=0.0)
WIDE = (96, 54)
UP = np.array([0.0, 1.0, 0.0])


def plane(scene, reach=6.0):
    corners = np.array([(-reach, 0, -reach), (-reach, 0, reach), (reach, 0, reach), (reach, 0, -reach)])
    scene.add(polygons([corners]), material=WHITE, name="plane")
    return scene


def mean_of(gpu, scene, camera, passes, size=WIDE, **settings):
    """The mean picture of some passes."""
    settings = {"photons": 0, "bounces": 0, **settings}
    with Renderer(scene, Settings(size=size, **settings), camera, threads=2, gpu=gpu) as renderer:
        *_, frame = renderer.converge(passes)
    return frame


def from_above(ymag, height):
    """An orthographic camera looking straight down from (0, height, 0)."""
    return Camera(ymag=ymag, pose=look_at_pose(np.array([0.0, height, 0.0]), np.zeros(3)))


def floor_points(ymag, size=WIDE):
    """(h, w, 3) what the pixels of `from_above` show of the floor."""
    w, h = size
    x = ((np.arange(w) + 0.5) / w * 2 - 1) * ymag * w / h
    z = ((np.arange(h) + 0.5) / h * 2 - 1) * ymag
    return np.stack(np.broadcast_arrays(x, 0.0, z[:, None]), axis=-1)


LAMPS = {
    "above": (RectLight((4.0, 2.0, 1.0), 1.0, 0.6), (0.0, 1.0, 0.0), (0.0, 0.0, 0.001)),
    "tilted": (RectLight((4.0, 2.0, 1.0), 0.5, 0.8), (0.6, 0.9, 0.3), (-0.3, 0.0, 0.0)),
    "through the floor": (RectLight((4.0, 2.0, 1.0), 2.0, 1.0), (-1.6, 0.1, 0.2), (1.0, 0.1, 0.0)),
}


@pytest.mark.parametrize("name", LAMPS)
def test_a_rectangle_lights_a_plane_as_lambert_says(gpu, name):
    """64 passes: the mean within 0.5 %; blocks of 6 x 6 pixels, 2,304 rays each of a spread below 0.7 of
    their mean (0.3 where the lamp is seen whole), within 4.5 sigma, and 0.4 % for what the filter blurs:
    2 px^2 / 2 of the Laplacian, 5 E / m^2, of pixels of 2 cm, 0.2 % in the first pass and less in others."""
    lamp, place, target = LAMPS[name]
    scene = plane(Scene())
    node = scene.add(lamp, translation=place).look_at(target, (0.0, 0.0, 1.0))
    frame = mean_of(gpu, scene, from_above(0.55, 0.5 if name == "above" else 3.0), 64)
    matrix = node.local_matrix()
    half = np.array([(-1, -1, 0), (-1, 1, 0), (1, 1, 0), (1, -1, 0)]) / 2 * (lamp.width, lamp.height, 0)
    corners = half @ matrix[:3, :3].T + matrix[:3, 3]
    shines = -matrix[:3, 2]
    points = floor_points(0.55)
    exact = np.zeros((*points.shape[:2], 1))
    for place in np.ndindex(points.shape[:2]):
        p = points[place]
        if (p - corners[0]) @ shines > 0.0:
            exact[place] = polygon_irradiance(corners, p, UP) / math.pi
    exact = exact * np.array([4.0, 2.0, 1.0])
    found = frame.direct
    lit = frame.instance == 0  # what stands in the eye's way
    assert lit.mean() > 0.5
    assert found[lit].mean(axis=0, dtype=float) == pytest.approx(exact[lit].mean(axis=0), rel=5e-3)
    whole = blocks(np.repeat(lit[..., None], 3, axis=2), 6).min(axis=-1) == 1.0
    one, two = blocks(found, 6)[whole], blocks(exact, 6)[whole]
    bright = two[:, 0] > 0.05 * two[:, 0].max()
    noise = 4.5 * (0.3 if name == "above" else 0.7) / math.sqrt(36 * 64)
    assert (np.abs(one / two - 1.0)[bright]).max() < noise + 4e-3


@pytest.mark.parametrize("away", [1.0, 40.0])
def test_a_lamp_near_to_a_surface_lights_it_as_seen_from_afar(gpu, away):
    """Shadow rays start above the surface by as much as the eye's distance makes depth err; a lamp 0.1 m over
    a plane is no farther from those that start 40 m from the eye. The middle of it: Lambert's
    formula, 16 passes, within 2 %: 9 x 9 pixels, 1,296 rays of a spread below 0.7."""
    lamp = RectLight((2.0,) * 3, 0.3, 0.3)
    scene = plane(Scene())
    scene.add(lamp, translation=(0.0, 0.1, 0.0)).look_at((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    pose = look_at_pose(np.array([0.0, away, 1e-3 * away]), np.zeros(3))
    camera = Camera(yfov=2 * math.atan(0.05 / away), pose=pose)
    frame = mean_of(gpu, scene, camera, 16, (9, 9))
    corners = np.array([(-0.15, 0.1, -0.15), (0.15, 0.1, -0.15), (0.15, 0.1, 0.15), (-0.15, 0.1, 0.15)])
    steps = (np.arange(9) - 4) / 9 * 0.1
    exact = np.mean([polygon_irradiance(corners, np.array([x, 0, z]), UP) for x in steps for z in steps])
    assert (frame.instance == 0).all()
    assert frame.direct.mean(dtype=float) == pytest.approx(2.0 * exact / math.pi, rel=2e-2)


@pytest.mark.parametrize("height", [0.5, 2.0])
def test_a_sphere_lights_a_plane_by_the_square_of_its_sine(gpu, height):
    """E = pi L (r / d)^2 cos, as long as all of it is above the horizon. The mesh that stands for it has its
    area, and so its mean shadow; what that brings from near is the sum of its triangles, which is within 1 %
    of the sphere's, and which 64 passes are within 0.5 % of in the mean. Blocks of 6 x 6 pixels: 2,304 rays
    of a spread below 0.5, 4.5 sigma, and 0.4 % of the filter, as above."""
    scene, radius = plane(Scene()), 0.3
    scene.add(SphereLight((3.0, 2.0, 1.0), radius), translation=(0.1, height, 0.0))
    frame = mean_of(gpu, scene, from_above(0.45, 0.15), 64)
    rows = Tracer(scene).tables.emitters.triangles
    assert len(rows) == 1280
    points = floor_points(0.45)
    brought = np.zeros(points.shape[:2])
    at = [(y, x) for y in range(3, 54, 12) for x in range(3, 96, 12)]
    for y, x in at:
        p = points[y, x]
        front = np.einsum("nk,nk->n", p - rows["corner"], rows["normal"]) > 0.0
        a = rows["corner"][front].astype(float)
        triangles = np.stack([a, a + rows["edge1"][front], a + rows["edge2"][front]], axis=1)
        brought[y, x] = sum(polygon_irradiance(t, p, UP) for t in triangles) / math.pi
    segment = np.array([0.1, height, 0.0]) - points
    d = np.linalg.norm(segment, axis=-1)
    sphere = (radius / d) ** 2 * height / d
    there = tuple(np.array(at).T)
    ratio = brought[there] / sphere[there]
    assert np.abs(ratio - 1.0).max() < 1e-2
    exact = (sphere * ratio.mean())[..., None] * np.array([3.0, 2.0, 1.0])
    assert frame.direct.mean(axis=(0, 1), dtype=float) == pytest.approx(exact.mean(axis=(0, 1)), rel=5e-3)
    noise = 4.5 * 0.5 / math.sqrt(36 * 64)
    assert np.abs(blocks(frame.direct, 6) / blocks(exact, 6) - 1.0).max() < noise + 4e-3 + np.ptp(ratio)


EVEN = np.ones((4, 8, 3))
AHEAD = Camera(yfov=math.radians(30.0), pose=look_at_pose(np.array((0.0, 0.0, 4.0)), np.zeros(3)))
SQUARE = (64, 64)


def ball(material, environment):
    scene = Scene(environment=environment)
    scene.add(icosphere(0.9, 40), material=material, name="ball")
    return scene


@pytest.mark.parametrize("passes", [1, 16])
@pytest.mark.parametrize("albedo", [1.0, 0.5])
def test_a_matt_ball_in_an_even_sky_shows_its_albedo(gpu, albedo, passes):
    """White in white cannot be seen. Base color has 8 bits: 0.5 %. 16 passes: blocks of 8 x 8 pixels, 1,024
    draws each of a spread of at most 1, within 4.5 sigma of those; the mean of 2,000 pixels within 0.5 %.
    In one pass light that nothing shades is exact."""
    frame = mean_of(
        gpu, ball(Material((albedo,) * 3, specular=0.0), Environment(EVEN)), AHEAD, passes, SQUARE
    )
    inside = frame.alpha == 1.0
    assert 1500 < inside.sum() < 3500
    assert frame.radiance[inside].mean(dtype=float) == pytest.approx(albedo, rel=5e-3)
    if albedo == 1.0:
        assert frame.radiance.mean(dtype=float) == pytest.approx(1.0, rel=5e-3)
        noise = 4.5 / math.sqrt(64 * 16) if passes > 1 else 5e-3
        assert np.abs(blocks(frame.radiance, 8) - 1.0).max() < noise


@jit
def reflected_of(b, wo, gloss, rows, out):
    """f cos over a density, of a white surface whose normal is along z, for rows x rows directions: of the
    facets' lobe over that of normals drawn as they lie (D cos), of the others over a cosine."""
    n = f32(0), f32(0), f32(1)
    a2 = b.alpha * b.alpha
    for i in range(rows):
        u = f32((i + 0.5) / rows)
        for j in range(rows):
            phi = f32(2 * math.pi * (j + 0.5) / rows)
            tangent2 = a2 * u / (f32(1) - u) if gloss else u / (f32(1) - u)
            z = f32(1) / f32(math.sqrt(f32(1) + tangent2))
            r = f32(math.sqrt(tangent2)) * z
            h = (r * f32(math.cos(phi)), r * f32(math.sin(phi)), z)
            if gloss:
                along = dot(wo, h)
                wi = sub(scale(f32(2) * along, h), wo)
                t = z * z * (a2 - f32(1)) + f32(1)
                pdf = a2 / (f32(math.pi) * t * t) * z / (f32(4) * along)
                if along > f32(0) and wi[2] > f32(0):
                    out[i, j] = eval_bsdf(without_diffuse(b), n, n, wo, wi)[0] * wi[2] / pdf
            else:
                f = eval_bsdf(b, n, n, wo, h)[0] - eval_bsdf(without_diffuse(b), n, n, wo, h)[0]
                out[i, j] = f * f32(math.pi)


def directional_albedo(metallic, roughness, cosine, rows=512):
    """The share of light from all around alike that a white surface sends along a cosine, by quadrature."""
    white, factors = (f32(1),) * 3, (f32(metallic), f32(roughness), f32(0))
    dielectric = Dielectric(f32(0.04), white, f32(1), f32(1.5), False)
    b = made(surface_bsdf(white, *factors, dielectric, True))
    wo, total = (f32(math.sqrt(1 - cosine**2)), f32(0), f32(cosine)), 0.0
    for gloss in (False, True):
        out = np.zeros((rows, rows), f32)
        reflected_of(b, wo, gloss, rows, out)
        total += out.mean(dtype=float)
    return total


@pytest.mark.parametrize("metallic", [1.0, 0.0])
@pytest.mark.parametrize("roughness", [0.1, 0.2, 0.3, 0.5, 0.75, 1.0])
def test_a_rough_ball_in_an_even_sky_shows_its_directional_albedo(gpu, roughness, metallic):
    """That of a single scatter, by quadrature of f, at the cosine of each pixel, of 0.6 at least: beyond, it
    changes faster than over the filter's 5 pixels. 16 passes of some 1,200 pixels, whose draws have a spread
    of 1 at most: a standard error of 0.7 %, and of rings of 0.1 some 1.6 %, were they not even over squares
    of pixels; 1 % and 2 %, of which the loss of facets, 1 to 40 %, stands out."""
    material = Material((1.0,) * 3, metallic=metallic, roughness=roughness)
    frame = mean_of(gpu, ball(material, Environment(EVEN)), AHEAD, 16, SQUARE)
    view = (np.arange(64) + 0.5) / 64 * 2 - 1
    x, y = np.meshgrid(view * math.tan(math.radians(15)), view * math.tan(math.radians(15)))
    d = np.stack([x, -y, -np.ones_like(x)], axis=-1)
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    eye = np.array([0.0, 0.0, 4.0])
    along = -(d @ eye)
    inside = along**2 - (16 - 0.81)
    point = eye + (along - np.sqrt(np.maximum(inside, 0.0)))[..., None] * d
    cosine = np.where(inside > 0, -np.einsum("...k,...k", d, point / 0.9), 0.0)
    grid = np.linspace(0.6, 1.0, 9)
    albedo = [directional_albedo(metallic, roughness, c) for c in grid]
    exact = np.interp(cosine, grid, albedo)
    used = cosine > 0.6
    found = frame.radiance[..., 0].astype(float)
    assert found[used].mean() == pytest.approx(exact[used].mean(), rel=1e-2)
    for low in (0.6, 0.7, 0.8, 0.9):
        ring = (cosine > low) & (cosine <= low + 0.1)
        assert found[ring].mean() == pytest.approx(exact[ring].mean(), rel=2e-2), low


def patch(value, others):
    image = np.full((32, 64, 3), others)
    image[6:8, 40:42] = value, 0.5 * value, 0.1 * value
    return image


@pytest.mark.parametrize("value", [30.0, 5000.0])
def test_a_patch_of_sky_lights_a_plane_by_its_irradiance(gpu, value):
    """The image's integral, by 1,024 x 2,048 places. One pass: 0.5 %, of a table of what is not shaded. 64: a
    pass of 5,184 pixels has a standard error of 0.8 %, as rays within squares are even; so 4.5 sigma are
    0.5 %; blocks of 6 x 6 pixels, 2,304 draws of a spread of at most 1, within 4.5 sigma."""
    image = patch(value, 0.1)
    scene = plane(Scene(environment=Environment(image, 0.9)))
    exact = sky_irradiance(image, 0.9, UP, 1024) / math.pi
    for passes in (1, 64):
        frame = mean_of(gpu, scene, from_above(1.0, 1.0), passes)
        assert frame.direct.mean(axis=(0, 1), dtype=float) == pytest.approx(exact, rel=5e-3)
        if passes > 1:
            assert np.abs(blocks(frame.direct, 6) / exact - 1.0).max() < 4.5 / math.sqrt(36 * 64)


@pytest.mark.parametrize("albedo", [0.5, 0.8])
def test_a_furnace_of_glowing_walls_is_evenly_bright(gpu, albedo):
    """Method, V3: L = L_e / (1 - albedo) along all rays, of which L_e is seen as emission, albedo L_e is
    direct, the rest indirect. 16 passes of 10,000 photons; direct light of walls: draws of a spread below
    1.5, 1,024 in a block: 4.5 sigma of 5 %, and the mean within 0.7 %; 40 bounces leave out 0.8^41 = 1e-4."""
    scene = box_room((-1, -0.7, -1), (1, 0.7, 1.2), albedo=albedo)
    for node in scene.nodes:
        node.parts[0].material.emission = (1.0, 2.0, 3.0)
    eye = Camera.look_at((0.6, 0.3, 0.9), (-0.5, -0.5, -0.6), yfov=1.2)
    frame = mean_of(gpu, scene, eye, 16, photons=10_000, bounces=40)
    for c, emitted in enumerate((1.0, 2.0, 3.0)):
        assert np.allclose(frame.emission[..., c], emitted, rtol=1e-3)
        direct = albedo * emitted
        assert frame.direct[..., c].mean(dtype=float) == pytest.approx(direct, rel=7e-3)
        rest = emitted / (1 - albedo) - emitted - direct
        assert frame.indirect[..., c].mean(dtype=float) == pytest.approx(rest, rel=1e-2)
        assert frame.radiance[..., c].mean(dtype=float) == pytest.approx(emitted / (1 - albedo), rel=7e-3)
    assert np.abs(blocks(frame.radiance, 8) * (1 - albedo) / (1.0, 2.0, 3.0) - 1.0).max() < 0.05


@pytest.mark.parametrize("radiance", [1e3, 4e4, 9e4, 2e9])
def test_what_shines_brighter_than_half_floats_hold_is_seen_as_bright(gpu, radiance):
    scene = Scene()
    lamp = polygons([np.array([(-9, 0, -9), (-9, 0, 9), (9, 0, 9), (9, 0, -9)], float)])
    scene.add(lamp, material=Material(emission=(radiance, radiance / 2, 1.0)))
    found = mean_of(gpu, scene, from_above(1.0, 3.0), 1).radiance[27, 48]
    # a half's half unit is 2^-12 of it; above 2^15 it is a root's, and counts twice
    assert found == pytest.approx([radiance, radiance / 2, 1.0], rel=2**-10)
