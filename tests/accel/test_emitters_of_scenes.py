"""Emitters of scenes: draws from lamps bring what rays meet by chance, and textures say how much that is."""

import math

import numpy as np
import pytest
from exact_light import unit
from transport import Tracer

from ispm import Material, RectLight, Scene, Texture, TextureUse
from ispm.accel.emitters import emitter_flux
from ispm.accel.glow import glow
from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Hit, Scratch
from ispm.accel.surface import closest_surface, surface
from ispm.kernels.simd import alloca
from ispm.library.shapes import icosphere, polygons
from ispm.lights.nee import BY_NOTHING, area_light
from ispm.optics.jit import jit
from ispm.optics.rng import random4
from ispm.optics.sampling import cosine_hemisphere, to_world
from ispm.optics.vector import add, scale
from ispm.scene.mesh import Mesh

f32, u32 = np.float32, np.uint32


def squares(*, at, towards, size=1.0, flip=False):
    """Corners of a square that faces `towards`; flip: its back does."""
    n = unit(np.array(towards, float))
    s = unit(np.cross(n, (0.3, 0.5, 0.81)))
    t = np.cross(n, s)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * size / 2
    corners = np.array(at) + corners[:, :1] * s + corners[:, 1:] * t
    return corners[::-1] if flip else corners


def half_lit():
    """A square with texture coordinates, and an emission that is bright in one corner, dark in another."""
    pixels = np.zeros((8, 8, 3), np.uint8)
    pixels[:, 4:] = (255, 128, 30)
    pixels[:3, :3] = (40, 90, 255)
    corners = squares(at=(0.0, 0.0, 0.0), towards=(0, 0, 1))
    uv = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
    mesh = Mesh(corners, np.array([(0, 1, 2), (0, 2, 3)]), uv0=uv)
    use = TextureUse(Texture(pixels, name="glow"))
    return mesh, Material((0.0,) * 3, specular=0.0, emission=(9.0, 8.0, 7.0), emission_texture=use)


KINDS = "one-sided", "back", "two-sided", "mirrored", "stretched", "textured", "turned", "lamp", "ball"


def bench(kind):
    """A bench of one lamp, of the kind, about 1.5 m from the middle, between blockers."""
    scene = Scene(name=kind)
    glowing = Material((0.0,) * 3, specular=0.0, emission=(3.0, 2.0, 1.0))
    away = dict(at=(0.0, 1.5, 0.0), towards=(0.1, -1.0, 0.2))
    if kind == "one-sided":
        scene.add(polygons([squares(**away)]), material=glowing)
    elif kind == "back":
        scene.add(polygons([squares(**away, flip=True)]), material=glowing)
    elif kind == "two-sided":
        glowing.double_sided = True
        scene.add(polygons([squares(**away, flip=True)]), material=glowing)
    elif kind == "mirrored":
        scene.add(polygons([squares(**away)]), material=glowing, scale=(-1.0, 1.0, 1.0))
    elif kind == "stretched":
        scene.add(polygons([squares(**away)]), material=glowing, scale=(0.4, 1.3, -2.5))
    elif kind == "textured":
        mesh, material = half_lit()
        scene.add(mesh, material=material, translation=(0.1, 1.4, 0.2)).look_at((0.1, 0.0, 0.25))
        scene.add(mesh, material=material, translation=(0.1, -1.4, 0.2), scale=(1, 1, -1)).look_at((0, 5, 0))
    elif kind == "turned":
        turned = scene.add(polygons([squares(**away)]), material=glowing, translation=(1.0, -0.5, 0.3))
        turned.rotation = (0.0, math.sin(0.4), 0.0, math.cos(0.4))
    elif kind == "lamp":
        lamp = RectLight((5.0, 4.0, 3.0), 0.8, 0.4)
        scene.add(lamp, translation=(0.3, 1.4, 0.2)).look_at((0.0, 0.0, 0.0))
    else:
        scene.add(icosphere(0.4, 3), material=glowing, translation=(0.2, 1.2, -0.1), scale=(1.0, -0.7, 1.0))
    blocker = polygons([squares(at=(0.3, 0.7, 0.3), towards=(0, 1, 0), size=0.5)])
    scene.add(blocker, material=Material((0.5,) * 3, double_sided=True))
    floor = polygons([squares(at=(0, -0.8, 0), towards=(0, 1, 0), size=4.0)])
    scene.add(floor, material=Material((1.0,) * 3, specular=0.0))
    sky = polygons([squares(at=(0, 4.0, 0), towards=(0, -1, 0), size=8.0)])
    scene.add(sky, material=Material((1.0,) * 3, specular=0.0))
    return Tracer(scene)


@jit
def both(tables, start, d, seed, drawn, met, normal):
    """Irradiance on what a ray meets, and its normal: by draws from lamps with shadow rays, and by rays of
    the cosine that meet lamps by chance."""
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    _, hit = closest_surface(tables, start, d, f32(0.5), scratch)
    x = surface(tables, hit, d)
    wo = x.ng
    for i in range(len(drawn)):
        u1, u2, u3, _ = random4(u32(i), u32(2), u32(0), seed)
        light, _ = area_light(tables, x, wo, u3, scratch, f32(np.inf), BY_NOTHING)
        wi = to_world(cosine_hemisphere(u1, u2), x.ng)
        away = add(x.position, scale(f32(1e-4), x.ng))
        found, other = closest_surface(tables, away, wi, f32(0.5), scratch)
        seen = glow(tables, other, wi) if found else (f32(0), f32(0), f32(0))
        for c in range(3):
            drawn[i, c] = f32(math.pi) * light[c]
            met[i, c] = f32(math.pi) * seen[c]
    normal[0], normal[1], normal[2] = x.ng[0], x.ng[1], x.ng[2]


@pytest.mark.parametrize("kind", KINDS)
def test_draws_bring_what_rays_meet_by_chance(kind):
    """Both ways on floor and ceiling, with shadows: equal within 4.5 standard errors of the difference, 9
    kinds, 6 places, 3 channels; and each lamp lights one of the two at least."""
    tracer, count, lit = bench(kind), 200_000, 0
    rays = (0, -1, 0), (0.5, -1, 0.5), (-0.7, -1, 0.2), (0, 1, 0), (1, 1, -1), (-2, 1, 0.4)
    for k, (x, up, z) in enumerate(rays):
        start = (f32(x), f32(-0.3 if up < 0 else 3.0), f32(z))
        drawn, met, n = np.zeros((count, 3), f32), np.zeros((count, 3), f32), np.zeros(3)
        both(tracer.tables, start, (f32(0), f32(up), f32(0)), u32(k), drawn, met, n)
        assert n[1] == pytest.approx(-up, abs=1e-5)
        one, two = drawn.mean(axis=0, dtype=float), met.mean(axis=0, dtype=float)
        error = np.sqrt((drawn.var(axis=0, dtype=float) + met.var(axis=0, dtype=float)) / count)
        assert (np.abs(one - two) < 4.5 * error + 1e-3 * two + 1e-12).all(), (k, one, two, error)
        lit += two[0] > 0.0 and error[0] < 0.1 * two[0]
    assert lit >= 2


def test_a_lamp_of_a_texture_is_drawn_by_its_mean_and_sends_out_its_flux():
    """The mean radiance of each triangle's parts is the texture's over it: of each half of the square, by the
    midpoints of 400 x 400 places; those that the code takes are fewer: 5 %."""
    tracer = bench("textured")
    rows = tracer.tables.emitters.triangles
    assert len(rows) == 4 * 64
    flux = emitter_flux(tracer.tables.emitters)
    luminance = rows["radiance"] @ (0.2126, 0.7152, 0.0722)
    assert flux == pytest.approx(math.pi * rows["area"] * luminance, rel=1e-3)
    places = (np.arange(400) + 0.5) / 400
    u, v = np.meshgrid(places, places)
    light = np.zeros((400, 400, 3), f32)
    for primitive, half in ((0, u > v), (1, u < v)):
        parts = rows[(rows["primitive"] == primitive) & (rows["instance"] == rows["instance"][0])]
        a, b = (u - v, v) if primitive == 0 else (u, v - u)
        shown(tracer.tables, parts["instance"][0], primitive, a.astype(f32), b.astype(f32), half, light)
        mean = light[half].mean(axis=0, dtype=float)
        assert parts["radiance"].mean(axis=0) == pytest.approx(mean, rel=0.05)


@jit
def shown(tables, instance, primitive, u, v, where, out):
    for y in range(len(u)):
        for x in range(len(u)):
            if where[y, x]:
                hit = Hit(u32(instance), u32(primitive), u[y, x], v[y, x])
                out[y, x] = glow(tables, hit, (f32(0), f32(0), f32(0)))
