"""Gather rays: each path of light is counted once, by a ray or by a photon."""

import math

import numpy as np
import pytest
from test_specular_paths import still_life
from transport import Tracer, box_room, lit, render, total

from ispm import DirectionalLight, Renderer, Scene, Settings, euler, shapes
from ispm.library.builtin import builtin
from ispm.library.shapes import box, icosphere
from ispm.optics.records import RECEIVER
from ispm.paths.ends import reflect_light
from ispm.paths.gather import Gather, Gathered, RayPlan, average_rays, gather_rays
from ispm.paths.guide import even_guide
from ispm.paths.vertices import PATH_END
from ispm.photons.density import measure_radii
from ispm.photons.grid import PhotonGrid
from ispm.renderer import gather as gather_module
from ispm.renderer.gather import even_numbers
from ispm.scene.camera import Camera
from ispm.scene.material import Material


def receivers_at(position, normal):
    points = np.zeros(len(position), RECEIVER)
    points["position"], points["ng"], points["n"], points["valid"] = position, normal, normal, 1
    return points


def gathered(tracer, points, limit, seed, photons, side=2, guide=None):
    """Return the irradiance that rays find at receivers, (n, 3)."""
    random = np.random.default_rng(seed)
    lifts, keys = np.full(len(points), 1e-5, np.float32), np.arange(len(points), dtype=np.uint32)
    shifts = random.random((len(points), 2), np.float32)
    plan = RayPlan(*(guide or even_guide(len(points))), lifts, keys, shifts, side)
    found = gather_rays(tracer.packed, tracer.world, tracer.surfaces, points, plan, limit, seed, 0)
    radiance = reflect_light(found.ends, PhotonGrid(photons).estimate(found.points, 2), len(found.ends))
    return math.pi * (radiance + found.radiance).reshape(-1, side * side, 3).mean(axis=1, dtype=float)


def test_rays_are_averaged_receiver_by_receiver():
    """As numpy does it, for ends that reflect all channels, of rays that met something and others."""
    random, count, rays = np.random.default_rng(5), 150, 4
    numbers = [random.random((count * rays, *shape), np.float32) for shape in ((3,), (3,), (), ())]
    ends = np.zeros(count * rays, PATH_END)
    ends["slot"] = np.arange(count * rays)
    for name in ("weight", "diffuse", "f0", "f90", "dielectric_f0", "dielectric_f90"):
        ends[name] = random.random(ends[name].shape)
    ends["weight"][random.random(count * rays) < 0.3] = 0.0
    ends["dielectric_f0"] *= 0.5
    light = random.random((count * rays, 16), np.float32)
    light[:, 4:7] *= 0.1 * light[:, :3]  # so that no difference is far smaller than what it is of
    met = Gathered(*numbers, ends, np.zeros(count * rays, RECEIVER))
    out = Gather(*(np.zeros((count, *shape), np.float32) for shape in ((3,), (3,), (3,), (3,), (), ())))
    average_rays(met, light, np.full(count, 1.0 / 0.6), 2, out)
    radiance = met.radiance + reflect_light(ends, light, len(ends))
    gloss, grazing, fresnel = (math.pi * met.lobes[:, k, None] * radiance for k in range(3))
    wanted = math.pi * radiance, fresnel, gloss, grazing, np.minimum(met.nearness, 0.6), met.covered
    for found, each in zip(out, wanted, strict=True):
        mean = each.reshape(count, rays, *each.shape[1:]).mean(axis=1, dtype=float)
        assert found == pytest.approx(
            mean, rel=4e-6
        )  # some thirty roundings of 2^-24, none of them of differences


def test_rays_in_a_sphere_find_its_direct_light():
    """The same from everywhere (method, V1), so that no ray errs; facets of 32 cuts are 0.05 % off."""
    tracer = Tracer(builtin("integrating-sphere", albedo=0.6))
    random = np.random.default_rng(1)
    normal = random.normal(size=(2000, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    empty = tracer.walk(tracer.emit(10), 0).photons
    found = gathered(tracer, receivers_at(-1.99 * normal, normal), math.inf, 3, empty)
    assert found == pytest.approx(0.6 * 100 / (4 * math.pi * 2**2), rel=5e-3)


def test_metal_that_hardly_a_photon_meets_is_lit_by_rays(gpu):
    """A plate of 1 cm in a sphere of 2 m, which sees its walls' radiance alone (V1), and reflects of it what
    GGX does. Some 600 receivers have four rays each, which a lobe of alpha .36 weighs by 0 to 4: 4 % of
    noise. By photons alone it is black, or as here, where one meets it, eight times as bright."""
    scene, alpha = builtin("integrating-sphere", albedo=0.6), 0.36
    metal = Material((1.0,) * 3, metallic=1.0, roughness=math.sqrt(alpha))
    scene.add(shapes.box((0.002, 0.01, 0.01)), material=metal, translation=(0.8, 0.0, 0.0), name="plate")
    camera = Camera.look_at((1.8, 0.0, 0.0), (0.0, 0.0, 0.0), yfov=0.012)
    with Renderer(scene, Settings(size=(160, 120)), camera, gpu=gpu) as renderer:
        frame = renderer.render()
    plate = frame.instance == frame.names.find("plate")
    assert plate.mean() > 0.4
    radiance = 0.6 / 0.4 * 100.0 / (math.pi * 4.0 * math.pi * 2.0**2)
    expected = radiance * reflected_by_metal(alpha)
    assert frame.indirect[plate].mean() == pytest.approx(expected, rel=0.15)


def reflected_by_metal(alpha):
    """The share of even light that facets of a white metal reflect along their normal, by quadrature."""
    cosine = (np.arange(4000) + 0.5) / 4000
    half = np.sqrt((1.0 + cosine) / 2.0)
    facets = alpha**2 / (math.pi * (half**2 * (alpha**2 - 1.0) + 1.0) ** 2)
    masking = 0.5 / (cosine + np.sqrt(alpha**2 + (1.0 - alpha**2) * cosine**2))
    return 2.0 * math.pi * (facets * masking * cosine).mean()


def crowded():
    """`still_life`, and rough metal."""
    scene = still_life()
    metal = Material((0.9, 0.7, 0.4), metallic=1.0, roughness=0.25)
    scene.add(icosphere(0.2, 8), material=metal, translation=(-0.4, 0.7, 0.6))
    return scene


def light_on_wall(tracer, wall, bounces, limit, seed):
    """Flux that photons alone bring to a wall 2 m wide, rays and photons together, and those photons; lm."""
    path = tracer.walk(tracer.emit(60_000, seed), bounces, seed, limit)
    scattered = path.photons["bounce"] > 0
    there = scattered & (path.photons["instance"] == wall)
    y, z = np.random.default_rng(100 + seed).uniform(-1.0, 1.0, (2, 10_000))
    points = receivers_at(np.stack([np.full_like(y, -1.0), y, z], axis=1), (1.0, 0.0, 0.0))
    ends = path.photons[scattered & (path.photons["bounce"] < bounces)]
    measure_radii(ends, tracer.packed.diagonal)
    by_rays = 4.0 * gathered(tracer, points, limit, seed, ends).mean(axis=0)
    straight = total(path.photons[there & path.not_gathered])
    return total(path.photons[there]), by_rays + straight, straight


@pytest.mark.parametrize(
    ("limit", "least", "most"), [(math.inf, 0.05, 0.6), (3.0, 0.1, 0.9), (0.0, 1.0, 1.0)]
)
def test_every_path_is_counted_once(limit, least, most):
    """First bounce among glass, rough glass, a mirror, metal, plastic and panes: no kernels, so no bias.

    Differences of 8 seeds, in the same photons: Student's t of 7 degrees, 99.9 %.
    """
    tracer = Tracer(crowded())
    photons, both, straight = np.stack(
        [light_on_wall(tracer, 0, 1, limit, seed) for seed in range(8)], axis=1
    ).mean(axis=2)
    share = straight.mean() / photons.mean()
    assert least <= share <= most
    difference = both - photons
    error = difference.std(ddof=1) / math.sqrt(8)
    assert error < 0.015 * photons.mean()
    assert abs(difference.mean()) <= 5.4 * error


def test_light_of_all_bounces_is_counted_once():
    """Kernels at the rays' ends lose light past edges: up to 2 % of a small room's."""
    tracer = Tracer(crowded())
    photons, both, _ = np.stack([light_on_wall(tracer, 0, 6, 3.0, seed) for seed in range(4)], axis=1)
    assert both.mean() / photons.mean() == pytest.approx(1.0, abs=0.025)


def furnished():
    scene = box_room((-2, -1, -2), (2, 1, 2), albedo=0.6)
    scene.add(icosphere(0.4, 8), material=Material((0.8, 0.3, 0.2), roughness=0.3), translation=(0, -0.5, 0))
    return lit(scene, (0.3, 0.7, 0.2))


EYE = Camera.look_at((0.5, 0.3, 1.9), (-0.2, -0.3, -1.0), yfov=1.2)


def test_pictures_have_the_same_light_wherever_spots_begin_to_be_bright(gpu, monkeypatch):
    """As photons alone have. Means of 3 seeds; kernels and the filter err by 1 to 2 %."""

    def mean(rays):
        return np.mean([
            render(gpu, furnished(), EYE, seed=s, gather=rays)[0].indirect.mean() for s in range(3)
        ])  # fmt: skip

    photons = mean(0)
    for bright in (0.0, 5.0, math.inf):
        monkeypatch.setattr(gather_module, "_BRIGHT_RATIO", bright)
        assert mean(16) == pytest.approx(photons, rel=0.025), bright


def test_a_dark_room_stays_dark_behind_its_wall(gpu):
    """Rays leave the near side of a wall 0.1 mm thick, whose far side is lit."""
    scene = lit(box_room((-2, -1, -1), (-1e-4, 1, 1), albedo=0.7), (-1.0, 0.1, 0.2))
    scene.roots += box_room((0, -1.5, -1.5), (2, 1.5, 1.5), albedo=0.7).nodes
    eye = Camera.look_at((1.8, 0.3, 0.2), (0.0, -0.2, 0.0), yfov=1.6)
    frame, _ = render(gpu, scene, eye, bounces=4, gather=16)
    assert not frame.indirect.any()


def test_numbers_are_even_in_every_neighbourhood():
    """Each aligned square of 8 x 8 pixels puts 2 to 6 of its 64 points into each of 16 equal cells."""
    numbers = even_numbers((48, 40), 7, 2)
    assert numbers.shape == (1920, 2) and numbers.min() >= 0.0 and numbers.max() < 1.0
    cells = (4 * numbers).astype(int) @ (4, 1)
    blocks = cells.reshape(5, 8, 6, 8).swapaxes(1, 2).reshape(30, 64)
    counts = np.array([np.bincount(block, minlength=16) for block in blocks])
    assert counts.min() >= 2 and counts.max() <= 6
    assert (even_numbers((48, 40), 7, 3) != numbers).any()


def bars_over_lawn(count):
    """A table among bars of steel, of 4 m by 6 cm, over a lawn of 60 m in the sun."""
    scene = Scene()
    scene.add(box((-30.0, -1.0, -30.0), (30.0, 0.0, 30.0)), material=Material((0.3,) * 3, roughness=1.0))
    scene.add(box((-1.0, 0.9, -1.0), (1.0, 1.0, 1.0)), material=Material((0.8,) * 3, roughness=1.0))
    steel = Material((0.8,) * 3, metallic=1.0, roughness=0.35)
    for k in range(count):
        bar = box((-2.0, 2.2, -0.03), (2.0, 2.26, 0.03))
        scene.add(bar, material=steel, translation=(0.0, 0.0, 0.5 * k - 1.0))
    scene.add(DirectionalLight((1e5,) * 3), rotation=euler(math.radians(-50.0), 0.6, 0.0))
    return scene


@pytest.mark.parametrize(("gather", "least"), [(64, 4.0 * 0.06), (0, 0.06 / 4.0)])
def test_kernels_at_the_ends_of_rays_are_wider_than_thin_bars(gpu, gather, least):
    """Pixels see bars, and light past their edges; rays average it. The picture's pixels are smaller."""
    camera = Camera.look_at((0.0, 2.25, 2.0), (0.0, 2.2, 0.0), yfov=0.02)
    settings = Settings(size=(64, 36), gather=gather, photons=4000)
    with Renderer(bars_over_lawn(5), settings, camera, gpu=gpu) as renderer:
        renderer.render()
        photons = renderer.photons()
    on_bars = photons["instance"] > 1
    assert np.count_nonzero(on_bars) > 2
    assert photons["radius"][on_bars].min() == pytest.approx(least, rel=1e-3)


def test_few_photons_on_bars_make_no_spots(gpu, monkeypatch):
    """Were kernels as narrow as those that pixels see, few rays would meet one, and each would be a spot."""
    camera = Camera.look_at((0.0, 1.9, 1.0), (0.0, 1.0, 0.0), yfov=0.5)

    def deviation():
        found = []
        for seed in (0, 1):
            with Renderer(bars_over_lawn(5), Settings(size=(64, 36), seed=seed), camera, gpu=gpu) as renderer:
                passes = np.stack([renderer.render_pass(k).indirect.mean(axis=-1) for k in range(16)])
            found.append((passes.std(axis=0, ddof=1) / np.median(passes, axis=0)).mean())
        return np.mean(found)

    wide = deviation()
    monkeypatch.setattr(gather_module, "_end_widths", lambda packed: packed.widths)
    assert wide < 0.4
    assert wide < 0.75 * deviation()
