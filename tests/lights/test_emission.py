"""Photons as they leave the lights: their number, their flux, and that maps and rays send the same."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation
from transport import Tracer, box_room, lit, on_instance

from ispm.accel.surface import SurfaceTable
from ispm.library.common import lambert
from ispm.library.shapes import box, icosphere, polygons
from ispm.lights.emission import emit_rays, emit_texels
from ispm.lights.lightmap import light_maps, texel_measures
from ispm.lights.plan import PlannedMap, map_width, plan_maps, share_photons
from ispm.optics.texture import TextureTable
from ispm.scene.camera import look_at_pose
from ispm.scene.light import DirectionalLight, PointLight, SpotLight
from ispm.scene.material import AlphaMode, Material, Texture, TextureUse
from ispm.scene.packed import pack
from ispm.scene.scene import Scene
from ispm.stages.bounce import BounceStage
from ispm.stages.upload import Upload


def packed_with(light, **where):
    """A light in a room of 4 x 2 x 4 m, packed."""
    scene = box_room((-2, -1, -2), (2, 1, 2))
    scene.add(light, **where)
    return pack(scene)


LIGHTS = {
    "cube": lambda: packed_with(PointLight((2.0, 1.0, 0.5))),
    "far": lambda: packed_with(PointLight((2.0, 1.0, 0.5)), translation=(3.0, 30.0, 5.0)),
    "spot": lambda: packed_with(SpotLight((2.0, 1.0, 0.5), outer_angle=math.radians(5.0))),
    "wide spot": lambda: packed_with(SpotLight((2.0, 1.0, 0.5), outer_angle=math.radians(80.0))),
    "far spot": lambda: packed_with(SpotLight((2.0, 1.0, 0.5), outer_angle=0.5), translation=(9, 0, 30)),
    "sun": lambda: packed_with(DirectionalLight((2.0, 1.0, 0.5)), rotation=(-0.6, 0.15, 0.1, 0.78)),
}


def planned(packed, wanted, offset=0.3, shift=(0.2, -0.4)):
    (map,) = light_maps(packed)
    return PlannedMap(map, wanted, map_width(map, packed.lights[0], wanted), shift, offset)


def thinned(packed, each):
    texels = np.zeros((len(each.map.axes), each.width, each.width, 2), np.uint32)
    surfaces = SurfaceTable(packed, TextureTable.pack(packed.textures, packed.colors), 1.0)
    return emit_texels(packed.lights, surfaces, [each], [texels])


@pytest.mark.parametrize("kind", LIGHTS)
@pytest.mark.parametrize("wanted", [1, 7, 1000, 40_000])
def test_thinned_photons_have_equal_flux_and_the_wanted_number(kind, wanted):
    packed = LIGHTS[kind]()
    photons = thinned(packed, planned(packed, wanted))
    expected = packed.lights["intensity"][0] * light_maps(packed)[0].measure / wanted
    assert (photons["flux"] == photons["flux"][:1]).all()
    assert photons["flux"][:1] == pytest.approx(expected[None], rel=1e-6)
    # each texel survives with a chance of its own: at most as uncertain as so many coins
    assert abs(len(photons) - wanted) <= 4 * math.sqrt(wanted)
    assert len(np.unique(photons["key"])) == len(photons)


@pytest.mark.parametrize("kind", LIGHTS)
def test_thinning_keeps_the_flux_of_every_texel_in_expectation(kind):
    """Over 4096 offsets of its lattice each texel emits in proportion to its measure, to a step."""
    packed, wanted = LIGHTS[kind](), 10
    each = planned(packed, wanted)
    keys = [thinned(packed, replace(each, offset=(k + 0.5) / 4096))["key"] for k in range(4096)]
    measures = texel_measures(each.map, packed.lights[0], each.width, each.shift).ravel()
    emitted = np.bincount(np.concatenate(keys) % len(measures), minlength=len(measures)) / 4096
    assert emitted == pytest.approx(measures * wanted / each.map.measure, abs=2 / 4096)


def test_a_texel_may_emit_several_photons():
    """Of a map that is too narrow none is lost, and each has random numbers of its own."""
    packed = LIGHTS["cube"]()
    photons = thinned(packed, replace(planned(packed, 1000), width=4))
    assert len(photons) == pytest.approx(1000, abs=10)
    assert len(np.unique(photons["key"])) == len(photons)


@pytest.mark.parametrize("kind", LIGHTS)
def test_texels_rarely_emit_more_than_one_photon(kind):
    """Widths suit the photons. Of a handful a shifted map's largest texel may be 2 % above one; a spot's
    few texels may miss its middle, where the others make up for it."""
    packed = LIGHTS[kind]()
    for wanted in (1, 100, 12_345):
        for shift in ((0.0, 0.0), (0.5, -0.5)):
            each = planned(packed, wanted, shift=shift)
            emitted = (
                texel_measures(each.map, packed.lights[0], each.width, shift) * wanted / each.map.measure
            )
            assert emitted.max() <= (1.05 if "spot" in kind else 1.0 + 1e-6)
            assert each.width**2 <= 6 * wanted or each.width == 8


def test_photons_are_shared_by_luminous_flux():
    scene = box_room((-2, -1, -2), (2, 1, 2))
    for intensity in (1.0, 3.0, 0.0):
        scene.add(PointLight((intensity,) * 3))
    packed = pack(scene)
    assert share_photons(packed, 1000).tolist() == [250, 750, 0]
    assert share_photons(packed, 0).tolist() == [0, 0, 0]
    assert share_photons(packed, 1).min() == 0 and share_photons(packed, 1)[:2].min() == 1
    packed.lights["intensity"] = 0.0
    assert share_photons(packed, 1000).tolist() == [0, 0, 0]


def test_flux_counts_for_a_light_not_its_intensity():
    """A spot shines into a part of the sphere; the sun's flux is its illuminance times what it lights."""
    scene = box_room((-2, -1, -2), (2, 1, 2))
    scene.add(PointLight((1.0,) * 3))
    scene.add(SpotLight((1.0,) * 3, inner_angle=1.0, outer_angle=1.0 + 1e-6))
    scene.add(DirectionalLight((1.0,) * 3), rotation=(-(0.5**0.5), 0.0, 0.0, 0.5**0.5))
    flux = np.array([4 * math.pi, 2 * math.pi * (1 - math.cos(1.0)), 16 * 1.02**2])
    assert share_photons(pack(scene), 10_000) == pytest.approx(10_000 * flux / flux.sum(), abs=1)


def test_faint_lights_get_photons_too():
    scene = box_room((-2, -1, -2), (2, 1, 2))
    for intensity in (1e6, 1e-3, 1e-9):
        scene.add(PointLight((intensity,) * 3))
    counts = share_photons(pack(scene), 10_000)
    assert counts[1:] == pytest.approx(10_000 / 30, rel=0.1) and counts.sum() == pytest.approx(10_000, abs=2)


def furnished_room():
    """A room with a ball, a mirrored box, a flat box that turns, and two lights."""
    scene = box_room((-2, -1, -2), (2, 1, 2), albedo=0.6)
    scene.add(icosphere(0.4, 4, "ball"), material=Material((0.8, 0.3, 0.2), roughness=0.5),
              translation=(1.0, -0.6, 0.3))  # fmt: skip
    low = box((-0.3, -0.3, -0.3), (0.3, 0.3, 0.3), "block")
    scene.add(low, material=lambert((0.7,) * 3), translation=(-1, -0.6, 0.8), scale=(-1.0, 1.4, 0.7))
    scene.add(low, material=lambert((0.2, 0.7, 0.3)), translation=(-0.8, 0.3, -1.2),
              rotation=(0.2, 0.3, 0.1, 0.9), scale=(2.0, 0.1, 1.0))  # fmt: skip
    scene.add(PointLight((2.0, 2.0, 2.0)), translation=(0.2, 0.7, 0.1))
    scene.add(PointLight((1.0, 0.5, 0.2)), translation=(-1.6, -0.8, -1.5))
    return scene


def far_lit_blocks():
    """Blocks on a floor under a lamp forty metres away, whose one map is narrow."""
    scene = Scene()
    corners = np.array([(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)], float)
    scene.add(polygons([corners], "floor"), material=lambert((0.7,) * 3))
    for x in (-0.5, 0.4):
        scene.add(box((0, 0, 0), (0.3, 0.5, 0.3)), material=lambert((0.5,) * 3), translation=(x, 0, x / 2))
    scene.add(PointLight((9e3,) * 3), translation=(18.0, 30.0, 20.0))
    assert len(light_maps(pack(scene))[0].axes) == 1
    return scene


def mirrors(light, **where):
    """A room with a mirror ball, a shiny block and a matt one, and a light."""
    scene = box_room((-2, -1, -2), (2, 1, 2), albedo=0.6)
    metal = Material((0.9, 0.9, 0.9), metallic=1.0, roughness=0.15)
    scene.add(icosphere(0.15, 3, "ball"), material=metal, translation=(1.0, -0.6, 0.3))
    scene.add(box((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1)), material=metal, translation=(-1.2, -0.9, -0.2))
    scene.add(icosphere(0.15, 3, "matt"), material=lambert((0.5,) * 3), translation=(-0.3, -0.8, 0.5))
    scene.add(light, **where)
    return scene


def turned(position, target):
    """Where a light stands that shines at a point."""
    turn = look_at_pose(np.array(position), np.array(target))[:3, :3]
    return {"translation": position, "rotation": tuple(Rotation.from_matrix(turn).as_quat())}


DOWNWARDS = {"rotation": (-0.6, 0.15, 0.1, 0.78)}
ROOMS = {
    "points": furnished_room,
    "far point": far_lit_blocks,
    "narrow spot": lambda: mirrors(
        SpotLight((9.0,) * 3, inner_angle=math.radians(5), outer_angle=math.radians(8)),
        **turned((-1.9, 0.9, -1.9), (1.0, -0.85, 0.3)),
    ),
    "wide spot": lambda: mirrors(SpotLight((1.0,) * 3, outer_angle=math.radians(80)), **DOWNWARDS),
    "sun": lambda: open_court(DirectionalLight((1.0,) * 3), **DOWNWARDS),
    "1 mm from a wall": lambda: mirrors(PointLight((1.0,) * 3), translation=(1.999, 0.1, 0.2)),
    "far spot": lambda: mirrors_in_the_open(
        SpotLight((900.0,) * 3, outer_angle=0.5),
        translation=(3, 25, 0),
        rotation=(-(0.5**0.5), 0, 0, 0.5**0.5),
    ),
}


def open_court(light, **where):
    scene = mirrors(light, **where)
    scene.roots = [node for node in scene.roots if node.parts == [] or node.parts[0].mesh.name != "+y"]
    return scene


def mirrors_in_the_open(light, **where):
    scene = mirrors(light, **where)
    scene.roots = [
        node for node in scene.roots if node.parts == [] or node.parts[0].mesh.name[1:] not in list("xyz")
    ]
    return scene


class Emitter:
    """Emits photons of a scene in both ways."""

    def __init__(self, gpu, scene):
        self.gpu, self.tracer = gpu, Tracer(scene)
        self.packed = self.tracer.packed
        self._upload, self._stage = Upload(gpu), BounceStage(gpu)

    def __call__(self, emission, photons, share=0.0, seed=0, seen=None):
        """Return EMITTED."""
        tracer, packed = self.tracer, self.packed
        plan = plan_maps(packed, share_photons(packed, photons), share, seed, 0, seen)
        if emission == "rays":
            return emit_rays(packed, tracer.world, tracer.surfaces, plan, seed, 0)
        with self.gpu.frame() as frame:
            maps = self._stage(frame, self._upload(packed), plan, 1e-4 * packed.diagonal)
        return emit_texels(packed.lights, tracer.surfaces, plan, maps.read(self.gpu))

    def on_objects(self, photons):
        """Return the luminous flux on each instance, (I,)."""
        hit = photons["instance"] < len(self.packed.instances)
        flux = photons["flux"][hit].astype(float).sum(axis=1)
        return np.bincount(photons["instance"][hit], flux, len(self.packed.instances))

    def aimed(self, share, photons=8000):
        """Return how many maps are aimed."""
        plan = plan_maps(self.packed, share_photons(self.packed, photons), share, 0, 0)
        return len(plan) - len(light_maps(self.packed))


def agree(one, other):
    """Whether rows of samples have the same means: Welch's t-test at 1 % for all columns together (Sidak)."""
    used = np.sum(one, axis=0) + np.sum(other, axis=0) > 0.0
    p = stats.ttest_ind(np.array(one)[:, used], np.array(other)[:, used], equal_var=False).pvalue
    return used.sum() >= 2 and p.min() > 1 - 0.99 ** (1 / used.sum())


@pytest.mark.parametrize("kind", ROOMS)
def test_maps_and_rays_light_every_object_alike(gpu, kind):
    """Flux stored on each object after three bounces, over 16 seeds."""
    emit = Emitter(gpu, ROOMS[kind]())

    def stored(emission, seed):
        emitted = emit(emission, 8000, 0.5, seed)
        return emit.on_objects(emit.tracer.walk(emitted, 3, seed).photons)

    assert (emit.aimed(0.5) > 0) == (kind not in ("points", "far point"))
    assert agree(*([stored(emission, seed) for seed in range(16)] for emission in ("map", "rays")))


@pytest.mark.parametrize("emission", ["map", "rays"])
@pytest.mark.parametrize("kind", [kind for kind in ROOMS if "point" not in kind])
def test_aiming_changes_no_flux(gpu, emission, kind):
    """First hits on each object, 24 seeds each: the same for any share, but more photons on the mirrors."""
    emit = Emitter(gpu, ROOMS[kind]())
    emitted = {s: [emit(emission, 4000, s, seed) for seed in range(24)] for s in (0.0, 0.5, 0.95)}
    met = {share: [emit.on_objects(photons) for photons in runs] for share, runs in emitted.items()}
    assert agree(met[0.0], met[0.5]) and agree(met[0.0], met[0.95])
    if emit.aimed(0.5, 4000):
        ball = np.flatnonzero(emit.packed.materials["metallic"][emit.packed.instances["material"]] == 1.0)
        counts = {
            s: sum(np.isin(photons["instance"], ball).sum() for photons in runs)
            for s, runs in emitted.items()
        }
        assert counts[0.95] > counts[0.5] > 1.5 * counts[0.0]


@pytest.mark.parametrize("emission", ["map", "rays"])
def test_looking_at_what_the_eye_sees_changes_no_flux(gpu, emission):
    """Tiles of a plain in the sun, 24 seeds each: the same light, more photons where the eye looks."""
    scene = Scene()
    for x in range(-3, 4):
        for z in range(-3, 4):
            scene.add(box((x - 0.5, -0.2, z - 0.5), (x + 0.5, 0.1 * (x % 2), z + 0.5)))
    scene.add(DirectionalLight(), rotation=(-0.5, 0.2, 0.1, 0.8))
    emit = Emitter(gpu, scene)
    seen = np.random.default_rng(0).uniform((1.6, 0.0, 1.6), (2.4, 0.0, 2.4), (200, 3))
    runs = {k: [emit(emission, 4000, 0.0, seed, places) for seed in range(24)]
            for k, places in enumerate((None, seen))}  # fmt: skip
    assert agree(*([emit.on_objects(photons) for photons in each] for each in runs.values()))
    looked_at = 7 * 5 + 5  # the tile about (2, 2)
    counts = [sum((photons["instance"] == looked_at).sum() for photons in each) for each in runs.values()]
    assert counts[1] > 5 * counts[0]


@pytest.mark.parametrize("emission", ["map", "rays"])
@pytest.mark.parametrize("kind", ROOMS)
def test_emitted_flux_is_that_of_the_lights(gpu, emission, kind):
    """Without aimed maps each pass has it, to the chance of the thinning; with them it has in the mean."""
    emit = Emitter(gpu, ROOMS[kind]())
    measures = np.array([map.measure for map in light_maps(emit.packed)])
    flux = float(measures @ emit.packed.lights["intensity"].astype(float).sum(axis=1))
    alone = emit(emission, 20_000)["flux"].astype(float).sum()
    # maps: 20 000 photons, at most as uncertain as coins of 1 in 2, 4 sigma; rays of equal flux: exact
    equal = emission == "rays" and "far" not in kind
    assert alone == pytest.approx(flux, rel=1e-6 if equal else 4 * math.sqrt(0.5 / 20_000))
    aimed = np.array([emit(emission, 4000, 0.5, seed)["flux"].astype(float).sum() for seed in range(24)])
    outside = 0.02 if kind == "far spot" else 0.0  # aimed maps of a light that sees the scene alone stick out
    error = 4 * aimed.std() / math.sqrt(24) + 1e-5 * flux
    assert -error < aimed.mean() - flux < error + outside * flux


@pytest.mark.parametrize("emission", ["map", "rays"])
@pytest.mark.parametrize(("inner", "outer"), [(29.9999, 30.0), (0.0, 30.0), (2.0, 5.0), (50.0, 80.0)])
def test_spots_light_discs_by_their_falloff(gpu, emission, inner, outer):
    """Flux within circles of a floor 2 m below: 2 pi I times the integral of the falloff over the cosine."""
    scene = Scene()
    corners = np.array([(-40, 0, -40), (-40, 0, 40), (40, 0, 40), (40, 0, -40)], float)
    scene.add(polygons([corners], "floor"), material=lambert((0.5,) * 3))
    light = SpotLight((3.0,) * 3, inner_angle=math.radians(inner), outer_angle=math.radians(outer))
    scene.add(light, translation=(0, 2, 0), rotation=(-(0.5**0.5), 0, 0, 0.5**0.5))
    emit = Emitter(gpu, scene)
    photons = np.concatenate([emit(emission, 20_000, 0.0, seed) for seed in range(16)])
    photons = photons[photons["instance"] == 0]
    triangles = corners[np.array([(0, 1, 2), (0, 2, 3)])[photons["primitive"]]]
    u, v = photons["u"][:, None], photons["v"][:, None]
    points = triangles[:, 0] * (1 - u - v) + triangles[:, 1] * u + triangles[:, 2] * v
    cosines = 2 / np.sqrt(4 + (points**2).sum(axis=1))
    flux = photons["flux"][:, 0].astype(float) / 16
    low, high = math.cos(math.radians(outer)), math.cos(math.radians(inner))

    def fade(cosine):
        return (min(max(cosine, low), high) - low) ** 3 / (3 * (high - low) ** 2)

    def within(cosine):
        return 2 * math.pi * 3.0 * (fade(high) - fade(cosine) + 1 - max(high, cosine))

    for degrees in (0.3 * outer, 0.6 * outer, 0.9 * outer, 0.97 * outer):
        cosine = math.cos(math.radians(degrees))
        # stratified: some thousand photons lie on a circle's edge, half of them by chance; measured: 0.2 %
        assert flux[cosines > cosine].sum() == pytest.approx(within(cosine), rel=0.004)
    assert flux[cosines < low - 1e-6].sum() <= 1e-3 * flux.sum()  # a texel's centre may round across


def test_the_sun_lights_a_floor_by_its_cosine(gpu):
    """E A cos, whatever share is aimed, and where it comes in through a hole only what fits."""
    scene = Scene()
    corners = np.array([(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)], float)
    scene.add(polygons([corners], "floor"), material=lambert((0.5,) * 3))
    mirror = Material(metallic=1.0, roughness=0.0)
    scene.add(box((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1)), material=mirror, translation=(0.4, -1, 0.1))
    scene.add(DirectionalLight((2.0,) * 3), rotation=(-0.6, 0.0, 0.0, 0.8))
    emit = Emitter(gpu, scene)
    cosine = -float(emit.packed.lights["direction"][0][1])
    for emission in ("map", "rays"):
        for share in (0.0, 0.5):
            runs = [emit.on_objects(emit(emission, 10_000, share, seed))[0] for seed in range(8)]
            # the floor's edge crosses some 400 of 10 000 cells
            assert np.mean(runs) == pytest.approx(
                3 * 2.0 * 4.0 * cosine, rel=4 * math.sqrt(400 / 8) / 10_000 + 1e-4
            )


def pane(opacity, height):
    """A square of side 2 at a height, BLEND with this opacity."""
    corners = np.array([(-1, height, -1), (-1, height, 1), (1, height, 1), (1, height, -1)])
    return polygons([corners], "pane"), Material((1, 1, 1, opacity), alpha_mode=AlphaMode.BLEND)


@pytest.mark.parametrize("opacities", [(0.5,), (0.5, 0.5), (0.2, 0.6), (0.9, 0.3, 0.5)])
def test_rays_pass_blended_panes_one_after_the_other(opacities):
    """Straight down through panes: what is left is the product of their transmittances."""
    scene = Scene()
    for k, opacity in enumerate(opacities):
        mesh, material = pane(opacity, -0.001 * k)
        scene.add(mesh, material=material)
    tracer = Tracer(lit(scene, (0, 0.5, 0)))
    met = tracer.emit(100_000)["instance"]
    # the first pane covers a share of the sphere; rays that pass it meet all the others (thin gaps)
    reached = [np.count_nonzero(met == k) for k in range(len(opacities))]
    share = 4 * math.atan2(1.0, 0.5 * math.sqrt(2.25)) / (4 * math.pi)
    left = 1.0
    for count, opacity in zip(reached, opacities, strict=True):
        expected = 100_489 * share * left * opacity  # the next square number
        assert count == pytest.approx(expected, abs=4 * math.sqrt(expected) + 100_489 * share * 0.005)
        left *= 1 - opacity


def test_rays_pass_the_open_share_of_a_masked_plane():
    """One quarter of a square under the light is a hole, and a quarter of the square's photons pass."""
    pixels = np.full((2, 2, 4), 255, np.uint8)
    pixels[0, 0, 3] = 0
    texture = TextureUse(Texture(pixels, linear=False, mipmaps=False))
    corners = np.array([(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)], float)
    square = polygons([corners], "square")
    square.uv0 = np.array([(0, 0), (0, 1), (1, 1), (1, 0)], np.float32)
    scene = Scene()
    scene.add(square, material=Material(alpha_mode=AlphaMode.MASK, base_color_texture=texture))
    tracer = Tracer(lit(scene, (0, 1, 0)))
    hits = np.count_nonzero(tracer.emit(160_000)["instance"] == 0)
    # one photon in each cell: only those along the outline are by chance, some 1 % of them
    assert hits == pytest.approx(160_000 / 6 * 0.75, rel=0.01)


def test_unlit_and_black_surfaces_keep_what_they_get():
    for material in (Material(unlit=True), lambert((0.0, 0.0, 0.0)), Material((0, 0, 0), metallic=1.0)):
        scene = box_room()
        scene.nodes[0].parts[0].material = material
        tracer = Tracer(lit(scene))
        path = tracer.walk(on_instance(tracer.packed, 0, 1000, seed=0), 3)
        black = material.metallic == 1.0  # F90 = 1 at grazing angles
        assert (path.absorbed[0] / path.emitted[0] > 0.9) if black else (path.absorbed == path.emitted).all()
