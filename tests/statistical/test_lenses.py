"""Refraction by a ball and by water: how much comes through, and where it goes."""

import math

import numpy as np
import pytest
from test_specular_paths import BLACK, glass, rectangle
from transport import Tracer, aim, box_room, lit

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Scratch
from ispm.accel.surface import closest_surface, leave_surface, scene_tables, surface
from ispm.kernels.simd import alloca
from ispm.library.shapes import icosphere
from ispm.optics.bsdf import smooth_split
from ispm.optics.jit import jit
from ispm.optics.vector import scale
from ispm.scene.light import DirectionalLight
from ispm.scene.scene import Scene

f32 = np.float32


@jit
def _refract_twice(tables, origins, directions, out):
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for i in range(len(origins)):
        start = origins[i, 0], origins[i, 1], origins[i, 2]
        d = directions[i, 0], directions[i, 1], directions[i, 2]
        share = f32(1)
        for _ in range(2):
            found, hit = closest_surface(tables, start, d, f32(0), scratch)
            if not found:
                share = f32(0)
                break
            x = surface(tables, hit, d)
            _, transmittance, _, d, _ = smooth_split(x.bsdf, x.n, x.ng, scale(f32(-1), d))
            share *= transmittance[0]
            start = leave_surface(tables, hit, scale(f32(-1), x.ng))
        for k in range(3):
            out[i, k], out[i, 3 + k] = x.position[k], d[k]
        out[i, 6] = share


def through_ball(ior, heights):
    """What comes of rays along +x that miss the axis of a ball of radius 1 by `heights`.

    -> (N, 7): where they leave it, where to, and the share of light that takes the way
    """
    scene = Scene()
    scene.add(icosphere(1.0, 64), material=glass(ior), rotation=(0.1, 0.2, 0.3, 0.9))
    tracer = Tracer(scene)
    origins = np.zeros((len(heights), 3), f32)
    origins[:, 0], origins[:, 1] = -3.0, heights
    directions = np.tile(f32((1, 0, 0)), (len(heights), 1))
    out = np.zeros((len(heights), 7), f32)
    _refract_twice(scene_tables(tracer.packed, tracer.world, tracer.surfaces), origins, directions, out)
    return out


@pytest.mark.parametrize(("ior", "exact"), [(1.5, 0.835544), (1.33, 0.882295)])
def test_a_ball_lets_its_share_of_parallel_light_through(ior, exact):
    """Without what is reflected inside (method, V17). Facets lie up to 4e-5 inside the ball."""
    count = 4000
    heights = np.sqrt((np.arange(count) + 0.5) / count)  # equal areas of the disc
    assert through_ball(ior, heights)[:, 6].mean(dtype=float) == pytest.approx(exact, abs=2e-4)


def test_a_ball_focuses_where_it_should():
    """Paraxial focus 1.5 R from the middle; farther out nearer (method, V17)."""
    heights, exact = np.array([1e-2, 0.3, 0.6]), np.array([1.5, 1.46198, 1.34078])
    x, y, _, dx, dy, *_ = through_ball(1.5, heights).T
    focus = x - y * dx / dy
    # the facets' 4e-5, and rounding over the small slope of the first
    assert focus[0] == pytest.approx(exact[0], abs=3e-3)
    assert focus[1:] == pytest.approx(exact[1:], abs=2e-4)


def scattered_by_a_ball(ior, count=4000, orders=40):
    """Mean and spread of the cosine that all light turns by, reflected inside any number of times."""
    sine = np.sqrt((np.arange(count) + 0.5) / count)
    c, inside = np.sqrt(1 - sine**2), np.sqrt(1 - (sine / ior) ** 2)
    s = (c - ior * inside) / (c + ior * inside)
    p = (ior * c - inside) / (ior * c + inside)
    fresnel = (s * s + p * p) / 2
    i, r = np.arcsin(sine), np.arcsin(sine / ior)
    mean, square = fresnel * np.cos(np.pi - 2 * i), fresnel * np.cos(np.pi - 2 * i) ** 2
    for k in range(orders):
        turned = np.cos(2 * (i - r) + k * (np.pi - 2 * r))
        share = (1 - fresnel) ** 2 * fresnel**k
        mean, square = mean + share * turned, square + share * turned**2
    return mean.mean(), math.sqrt(square.mean() - mean.mean() ** 2)


@pytest.mark.parametrize("ior", [1.33, 1.5])
def test_photons_leave_a_ball_as_theory_says(ior):
    """All orders of reflection inside: no flux is lost, and on average it turns by the exact angle."""
    count = 40_000
    scene = box_room((-50,) * 3, (50,) * 3, albedo=1e-6)
    scene.add(icosphere(1.0, 48), material=glass(ior))
    scene.add(DirectionalLight(), rotation=(0, -math.sqrt(0.5), 0, math.sqrt(0.5)))  # along +x
    tracer = Tracer(scene)
    random = np.random.default_rng(9)
    radius, turn = np.sqrt(random.random(count)) * 0.9999, random.random(count) * 2 * np.pi
    origins = np.stack([np.full(count, -3.0), radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    path = tracer.walk(aim(tracer, origins, np.tile((1.0, 0.0, 0.0), (count, 1))), 1)
    first = path.photons[path.photons["bounce"] == 0]
    assert first["flux"][:, 0].sum(dtype=float) == pytest.approx(
        1.0, abs=1e-3
    )  # grazing rays that miss facets
    mean, spread = scattered_by_a_ball(ior)
    found = np.sum(-first["wi"][:, 0] * first["flux"][:, 0], dtype=float)
    assert found == pytest.approx(mean, abs=4.5 * spread / math.sqrt(count) + 1e-3)


def test_the_floor_of_a_pool_is_lit_through_the_surface():
    """Light h above water, floor d below it (method, V18): on the axis T0 I / (h + d / n)^2; over a disc
    what Fresnel lets through of the cone that Snell's law leads there."""
    h, d, n, intensity, radius = 1.0, 0.8, 1.5, 3.0, 0.5

    def landing(angle):
        return h * np.tan(angle) + d * np.tan(np.arcsin(np.sin(angle) / n))

    def flux_within(limit):
        low, high = 0.0, 1.5
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if landing(middle) < limit else (low, middle)
        angle = (np.arange(4000) + 0.5) / 4000 * low
        c, inside = np.cos(angle), np.sqrt(1 - (np.sin(angle) / n) ** 2)
        s, p = (c - n * inside) / (c + n * inside), (n * c - inside) / (n * c + inside)
        return intensity * 2 * np.pi * np.mean((1 - (s * s + p * p) / 2) * np.sin(angle)) * low

    assert flux_within(1e-3) / (np.pi * 1e-6) == pytest.approx(0.4083176 * intensity, rel=1e-5)
    scene = Scene()
    scene.add(rectangle((-20, -20, 0), (40, 0, 0), (0, 40, 0)), material=glass(n))
    scene.add(rectangle((-20, -20, -d), (40, 0, 0), (0, 40, 0)), material=BLACK)
    tracer = Tracer(lit(scene, (0, 0, h), 4 * np.pi * intensity))
    count, cone = 60_000, 0.8  # photons in the cone of cosines above 0.8, which covers the disc
    random = np.random.default_rng(13)
    z, turn = 1 - random.random(count) * (1 - cone), random.random(count) * 2 * np.pi
    r = np.sqrt(1 - z * z)
    directions = np.stack([r * np.cos(turn), r * np.sin(turn), -z], axis=1)
    emitted = aim(tracer, np.tile((0.0, 0.0, h), (count, 1)), directions, 2 * np.pi * (1 - cone) * intensity)
    photons = tracer.walk(emitted, 1).photons
    here = (np.hypot(*photons["position"][:, :2].T) < radius) & (photons["position"][:, 2] < -0.5)
    assert landing(math.acos(cone)) > radius and here.sum() > 10_000
    assert photons["flux"][here, 0].sum(dtype=float) == pytest.approx(
        flux_within(radius), rel=4.5 / math.sqrt(here.sum())
    )
