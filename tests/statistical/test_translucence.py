"""Diffuse transmission: what translucent sheets make of light, exactly and beside slow paths."""

import math

import numpy as np
import pytest
from layered import assert_as_bright_as_paths, made, scatter_often
from transport import Tracer, box_room, lit, render, trace

from ispm.accel.layers import far_side
from ispm.accel.records import Hit
from ispm.accel.surface import SurfacePoint
from ispm.library.shapes import polygons
from ispm.optics.bsdf import eval_bsdf, surface_bsdf
from ispm.optics.coat import NO_COAT
from ispm.optics.jit import jit
from ispm.optics.sheen import NO_SHEEN
from ispm.reference.paths import path_light
from ispm.scene.camera import Camera
from ispm.scene.environment import Environment
from ispm.scene.light import PointLight
from ispm.scene.material import AlphaMode, Material, Texture
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView

f32, u32 = np.float32, np.uint32

SQUARE = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], float)
BASE, THROUGH, SHARE = np.array((0.6, 0.4, 0.2)), np.array((0.9, 0.5, 0.3)), 0.7
INTENSITY = 10.0


def matte(share=SHARE, base=BASE, through=THROUGH, **fields):
    """A translucent Lambert sheet."""
    look = dict(diffuse_transmission=share, diffuse_transmission_color=tuple(through), double_sided=True)
    return Material(tuple(base), **{"specular": 0.0, **look, **fields})


def mapped():
    """The same by textures, of one texel each."""
    share = Texture(np.full((1, 1, 4), (9, 9, 9, 204), np.uint8))  # 0.8
    color = Texture(np.full((1, 1, 4), (255, 0, 255, 7), np.uint8))
    look = matte(0.5, through=(0.4, 1.0, 0.2))
    look.diffuse_transmission_texture, look.diffuse_transmission_color_texture = share, color
    return look, 0.5 * 204 / 255, np.array((0.4, 0.0, 0.2))


def sheet(material):
    mesh = polygons([SQUARE])
    mesh.uv0 = np.full((4, 2), 0.5, f32)
    scene = Scene()
    scene.add(mesh, material=material, name="sheet")
    return scene


def irradiance(place):
    """lx of a lamp of INTENSITY at `place` on the plane z = 0, at its origin."""
    return INTENSITY * abs(place[2]) / np.linalg.norm(place) ** 3


@pytest.mark.parametrize("textured", [False, True])
@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("turned", [False, True])
def test_a_sheet_sends_light_of_a_point_back_and_through(gpu, side, textured, turned):
    """(1 - t) base E / pi on the lamp's side, t color E / pi on the other, whichever is the front; but for
    what the G-buffer's halves and, of textures, 8 bits of t round."""
    material, share, through = mapped() if textured else (matte(), SHARE, THROUGH)
    scene, place = sheet(material), (0.3, 0.2, 2.0 * side)
    if turned:
        scene.nodes[0].rotation = (0.0, 1.0, 0.0, 0.0)
    scene.add(PointLight((INTENSITY,) * 3), translation=place)
    camera = Camera.look_at((0, 0, 4), (0, 0, 0))
    frame, _ = render(gpu, scene, camera, size=(33, 33), antialias=False)
    expected = ((1.0 - share) * BASE if side > 0 else share * through) * irradiance(place) / math.pi
    np.testing.assert_allclose(frame.direct[16, 16], expected, rtol=5e-3 if textured and side > 0 else 1e-3)
    assert (frame.indirect[16, 16] == 0.0).all()  # there is nothing else


def test_a_mirror_shows_a_sheet_lit_from_behind(gpu):
    scene, place = sheet(matte()), (0.0, 0.0, -2.0)
    scene.add(PointLight((INTENSITY,) * 3), translation=place)
    mirror = Material((1.0,) * 3, metallic=1.0, roughness=0.0, double_sided=True)
    turn = (0.0, math.sin(-math.pi / 8), 0.0, math.cos(math.pi / 8))
    scene.add(polygons([SQUARE]), material=mirror, translation=(0.0, 0.0, 3.0), rotation=turn)
    camera = Camera.look_at((3.0, 0.0, 3.0), (0.0, 0.0, 3.0), yfov=0.3)
    frame, _ = render(gpu, scene, camera, size=(33, 33), antialias=False)
    expected = SHARE * THROUGH * irradiance(place) / math.pi
    np.testing.assert_allclose(frame.direct[16, 16], expected, rtol=1e-3)


def test_a_blended_sheet_is_lit_from_behind_by_as_much_as_it_is_opaque(gpu):
    material = matte()
    material.base_color, material.alpha_mode = (*BASE, 0.25), AlphaMode.BLEND
    scene, place = sheet(material), (0.0, 0.0, -2.0)
    scene.add(PointLight((INTENSITY,) * 3), translation=place)
    frame, _ = render(gpu, scene, Camera.look_at((0, 0, 4), (0, 0, 0)), size=(33, 33), antialias=False)
    expected = 0.25 * SHARE * THROUGH * irradiance(place) / math.pi
    np.testing.assert_allclose(frame.direct[16, 16], expected, rtol=1e-3)


@pytest.mark.parametrize("share", [0.3, 1.0, "mapped"])
def test_a_white_sheet_in_even_light_vanishes(gpu, share):
    """Whatever part of the light it lets through, also where a texture tells that, from texel to texel."""
    scene = sheet(matte(1.0 if share == "mapped" else share, (1.0,) * 3, (1.0,) * 3))
    if share == "mapped":
        part = scene.nodes[0].parts[0]
        part.mesh.uv0 = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], f32)
        texels = np.random.default_rng(1).integers(0, 256, (8, 8, 4), np.uint8)
        part.material.diffuse_transmission_texture = Texture(texels, linear=False, mipmaps=False)
    scene.environment = Environment(np.ones((4, 8, 3), f32))
    frame, _ = render(gpu, scene, Camera.look_at((1, 1, 4), (0, 0, 0)), size=(48, 32), antialias=False)
    off = np.abs(frame.radiance - 1.0).max(axis=2)
    if share != "mapped":
        assert off.max() < 2e-3
    else:  # 8 bits of the share; a pixel on the border of two texels shows one of them nearby, one beyond
        assert np.quantile(off, 0.95) < 4e-3


@pytest.mark.parametrize("specular", [0.0, 1.0])
@pytest.mark.parametrize("roughness", [0.0, 0.6])
def test_photons_keep_the_share_that_the_lobes_have(specular, roughness):
    """What goes through, and what comes back, is as much as comes back from an opaque surface whose albedo is
    the sum of both: reflection takes as much of either. Without it, exactly that share."""
    count, sums = 400_000, (1 - SHARE) * BASE + SHARE * THROUGH
    dielectric = made((0.04, (1.0, 1.0, 1.0), specular, 1.5))
    b = made(surface_bsdf((1.0, 1.0, 1.0), 0.0, roughness, 0.0, (*dielectric, False), True))
    up, none = (f32(0), f32(0), f32(1)), (f32(0),) * 3
    sides = tuple(f32((1 - SHARE) * BASE)), tuple(f32(SHARE * THROUGH))
    for cosine in (1.0, 0.5, 0.2):
        wo, found = (f32(math.sqrt(1.0 - cosine**2)), f32(0), f32(cosine)), []
        for diffuse, through in (sides, (tuple(f32(sums)), none)):
            b, hit = b._replace(diffuse=diffuse), Hit(u32(0), u32(0), f32(0), f32(0))
            x = SurfacePoint(hit, none, up, up, b, u32(0), True, NO_COAT, NO_SHEEN, through)
            weights = np.zeros((count, 3), f32)
            scatter_often(x, wo, weights)
            found.append(weights.astype(float))
        means = [weights.mean(axis=0) for weights in found]
        error = np.hypot(*(weights.std(axis=0) / math.sqrt(count) for weights in found))
        assert (np.abs(means[0] - means[1]) < 4.5 * error + 1e-6).all()
        assert specular or (np.abs(means[0] - sums) < 4.5 * error + 1e-6).all()


@jit
def both_ways(x, back, a, b, out):
    """What comes through x from b to a, and through the sheet seen from b's side from a to b, (n, 2)."""
    for i in range(len(out)):
        to_eye, to_light = (a[i, 0], a[i, 1], a[i, 2]), (b[i, 0], b[i, 1], b[i, 2])
        far, through = far_side(x, to_eye)
        out[i, 0] = eval_bsdf(far.bsdf, far.n, far.ng, through, to_light)[0]
        far, through = far_side(back, to_light)
        out[i, 1] = eval_bsdf(far.bsdf, far.n, far.ng, through, to_eye)[0]


def test_light_goes_through_both_ways_alike():
    random = np.random.default_rng(2)
    a, b = random.normal(size=(2, 500, 3)).astype(f32)
    a, b = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (a, b))
    a[:, 2], b[:, 2] = abs(a[:, 2]), -abs(b[:, 2])
    dielectric = made((0.04, (1.0, 1.0, 1.0), 1.0, 1.5))
    bsdf = made(surface_bsdf((0.5, 0.5, 0.5), 0.0, 0.5, 0.0, (*dielectric, False), True))
    hit, none, through = Hit(u32(0), u32(0), f32(0), f32(0)), (f32(0),) * 3, (f32(0.6),) * 3
    points = [
        SurfacePoint(hit, none, n, n, bsdf, u32(0), True, NO_COAT, NO_SHEEN, through)
        for n in ((f32(0), f32(0), f32(1)), (f32(0), f32(0), f32(-1)))
    ]
    out = np.zeros((500, 2), f32)
    both_ways(*points, a, b, out)
    np.testing.assert_allclose(out[:, 0], out[:, 1], rtol=1e-5)
    assert (out > 0.0).all() and (out <= 0.6 / math.pi).all() and np.ptp(out) > 0.05


def test_photons_pass_a_wall_of_paper_and_none_is_lost():
    """Two boxes side by side, a lamp in one: what arrives beyond the wall between them is what passes it."""
    scene = lit(box_room((-1, -0.5, -0.5), (1, 0.5, 0.5), albedo=1e-6), (-0.5, 0.0, 0.0))
    corners = np.array([(0, -0.5, -0.5), (0, 0.5, -0.5), (0, 0.5, 0.5), (0, -0.5, 0.5)])
    scene.add(polygons([corners]), material=matte(0.6, through=(0.5, 0.25, 1.0)), name="paper")
    walked = trace(scene, 200_000, 4)
    spent = walked.absorbed + walked.escaped + walked.dropped
    np.testing.assert_allclose(spent, walked.emitted, rtol=1e-9)
    beyond = walked.photons["position"][:, 0] > 1e-3
    assert (walked.photons["bounce"][beyond] == 1).all()
    arrived = walked.photons["flux"][beyond].astype(float)
    sixth = 4.0 * math.pi / 6.0  # of the lamp's flux, that meets each wall of a cube about it
    expected = sixth * 0.6 * np.array((0.5, 0.25, 1.0))  # of photons of equal flux, so of their number
    np.testing.assert_allclose(arrived.sum(axis=0), expected, rtol=4.5 / math.sqrt(len(arrived)))


def shade():
    """A table lamp: a point in an open tube of paper in a room, and a wall before it."""
    scene = lit(box_room((-1.5, 0, -1.5), (1.5, 2, 1.5), 0.6), (0.0, 0.8, 0.0), 60.0)
    turns = 2 * np.pi * np.arange(48) / 48
    low, high = (
        np.stack([radius * np.cos(turns), 0.0 * turns + height, radius * np.sin(turns)], axis=1)
        for radius, height in ((0.3, 0.5), (0.24, 1.1))
    )
    k, n = np.arange(48), (np.arange(48) + 1) % 48
    triangles = np.concatenate([np.stack([k, 48 + k, n], 1), np.stack([n, 48 + k, 48 + n], 1)])
    paper = matte(0.6, (0.8, 0.75, 0.6), (0.9, 0.8, 0.6), specular=0.5, roughness=0.5)
    scene.add(Mesh(np.concatenate([low, high]), triangles), material=paper, name="shade")
    return scene


SHADE_SIZE, SHADE_EYE = (64, 48), Camera.look_at((0.0, 1.35, 1.4), (0.0, 0.8, 0.0), yfov=0.9)


@pytest.fixture(scope="module")
def paths_of_the_shade():
    """(8, 48, 64, 3) radiance by 16 paths a pixel each."""
    tracer, view = Tracer(shade()), CameraView(SHADE_SIZE, SHADE_EYE.pose, SHADE_EYE.yfov, None)
    rays = [np.ascontiguousarray(each).reshape(-1, 3) for each in view.rays()]
    parts = [range(16 * k, 16 * k + 16) for k in range(8)]
    paths = [path_light(tracer.tables, *rays, samples=part, bounces=32, threads=2) for part in parts]
    return np.stack(paths).reshape(8, 48, 64, 3)


@pytest.mark.parametrize("settings", [{}, dict(gather=0), dict(passes=8)], ids=["one", "photons", "passes"])
def test_a_lamp_shade_is_as_bright_as_paths_find_it(gpu, settings, paths_of_the_shade):
    """The shade, all the rest, and each wall: within 2 % and 3.5 standard errors. Pixels on edges are left
    out, over which passes move."""
    kept = dict(size=SHADE_SIZE, antialias=False, photons=20_000, **settings)
    frames = [render(gpu, shade(), SHADE_EYE, seed=seed, **kept)[0] for seed in range(4)]
    ours, truths = np.stack([frame.radiance for frame in frames]), paths_of_the_shade
    shown, inner = frames[0].instance, np.zeros((48, 64), bool)
    around = [
        shown[1 + y : 47 + y, 1 + x : 63 + x] == shown[1:-1, 1:-1] for x in (-1, 0, 1) for y in (-1, 0, 1)
    ]
    inner[1:-1, 1:-1] = np.all(around, axis=0)
    paper = shown == shown[24, 32]
    regions = [paper & inner, ~paper & inner, *(inner & (shown == i) for i in np.unique(shown[~paper]))]
    assert regions[0].sum() > 300 and sum(region.sum() > 100 for region in regions) >= 5
    for region in regions:
        if region.sum() > 100:
            a, b = (each[:, region].mean(axis=1) for each in (ours, truths))
            error = np.hypot(*(e.std(axis=0, ddof=1) / math.sqrt(len(e)) for e in (a, b)))
            off = np.abs(a.mean(axis=0) - b.mean(axis=0))
            assert (off < 0.02 * b.mean(axis=0) + 3.5 * error).all(), (off / b.mean(axis=0), error)


@pytest.mark.parametrize(
    "look",
    [
        dict(base_color=(0.5, 0.7, 0.2), diffuse_transmission=0.5, diffuse_transmission_color=(0.7, 0.9, 0)),
        dict(base_color=(0.8,) * 3, diffuse_transmission=1.0, roughness=0.2),
        dict(base_color=(0.6,) * 3, diffuse_transmission=0.5, clearcoat=0.7, sheen_color=(0.5,) * 3,
             sheen_roughness=0.5),
    ],
    ids=["leaf", "glossy", "coated"],
)  # fmt: skip
def test_a_translucent_ball_is_as_bright_as_paths_find_it(gpu, look):
    assert_as_bright_as_paths(gpu, Material(double_sided=True, **look), samples=256)


def reflectance_of_stack(count, back, forth):
    """Of so many Lambert sheets that reflect `back` and pass `forth`, added one by one (Stokes 1862)."""
    whole = 0.0
    for _ in range(count):
        whole = back + forth**2 * whole / (1.0 - back * whole)
    return whole


@pytest.mark.parametrize("gather", [0, 64])
@pytest.mark.parametrize("count", [2, 12])
def test_a_stack_of_sheets_reflects_what_all_add_up_to(gpu, count, gather):
    """Sheets 1 m wide and .4 mm apart: kernels are centimetres wide, and each would reach all of them."""
    share, albedo = 0.35, 0.85
    paper = matte(share, (albedo,) * 3, (albedo,) * 3)
    scene = Scene()
    for k in range(count):
        scene.add(polygons([0.5 * SQUARE]), material=paper, translation=(0.0, 0.0, 4e-4 * k))
    scene.add(PointLight((INTENSITY,) * 3), translation=(0.0, 0.0, 1.0))
    camera = Camera.look_at((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), yfov=0.3)
    frames = [render(gpu, scene, camera, size=(64, 36), gather=gather, seed=seed)[0] for seed in range(4)]
    direct, indirect = frames[0].direct.mean(), np.array([frame.indirect.mean() for frame in frames])
    first = (1.0 - share) * albedo
    expected = direct * (reflectance_of_stack(count, first, share * albedo) / first - 1.0)
    # Student's t of 3 degrees, 99.9 %
    assert abs(indirect.mean() - expected) <= 12.9 * indirect.std(ddof=1) / 2.0
