"""Spots with a radius: spheres that shine in a cone."""

import json
import math

import numpy as np
import pytest
from transport import Tracer

import ispm
from ispm import Camera, Material, PointLight, Renderer, Scene, SceneError, Settings, SpotLight, shapes
from ispm.accel.emitters import emitter_flux
from ispm.accel.surface import SurfaceTable, scene_tables
from ispm.library.common import lambert
from ispm.lights.surface_emission import emissive_flux
from ispm.optics.texture import TextureTable
from ispm.optics.vector import LUMINANCE
from ispm.reference.paths import path_light
from ispm.scene.packed import pack
from ispm.stages.camera import CameraView
from ispm.viewer import actions, fields

INTENSITY = (30.0, 20.0, 10.0)
INNER, OUTER = 0.3, 0.6
DOWN = ispm.axis_angle((1, 0, 0), -math.pi / 2)  # -Z becomes -Y


def spot(radius, **given):
    return SpotLight(INTENSITY, inner_angle=INNER, outer_angle=OUTER, radius=radius, **given)


def falloff(angle):
    """KHR_lights_punctual, inner and outer cone angles."""
    edge = (math.cos(angle) - math.cos(OUTER)) / (math.cos(INNER) - math.cos(OUTER))
    return min(max(edge, 0.0), 1.0) ** 2


def under(light, turn=DOWN, **more):
    scene = Scene()
    scene.add(shapes.plane(8.0, 8.0), material=lambert((0.5,) * 3))
    scene.add(light, name="lamp", translation=(0.0, 1.0, 0.0), rotation=turn, **more)
    return scene


def surfaces_of(packed):
    return SurfaceTable(packed, TextureTable.pack([]), 0.0)


def test_it_is_packed_as_a_sphere_that_its_node_turns_and_does_not_scale():
    packed = pack(under(spot(0.2), scale=(3.0, 0.5, 2.0)))
    assert len(packed.lights) == 0 and len(packed.instances) == 2
    lamp = packed.instances[-1]
    matrix = np.stack([lamp[f"world{k}"] for k in range(3)])
    np.testing.assert_allclose(np.linalg.norm(matrix[:, :3], axis=0), 0.2, rtol=1e-6)
    np.testing.assert_allclose(matrix[:, 2], (0.0, 0.2, 0.0), atol=1e-7)  # its +Z, up
    assert len(pack(under(spot(0.0))).lights) == 1


def test_its_flux_is_that_of_the_point():
    """Of the intensity's integral: 2 pi times that of the falloff by the cosine, here by 1e5 steps."""
    packed = pack(under(spot(0.2)))
    cosines = np.linspace(-1.0, 1.0, 100_001)
    mean = np.mean([falloff(math.acos(c)) for c in cosines])
    expected = 4.0 * math.pi * mean * float(np.array(INTENSITY) @ LUMINANCE)
    assert emissive_flux(packed, surfaces_of(packed)) == pytest.approx(expected, rel=1e-3)
    emitters = scene_tables(packed, None, surfaces_of(packed)).emitters
    assert (emitter_flux(emitters) > 0.0).all()


@pytest.mark.parametrize("radius", [0.05, 0.4])
@pytest.mark.parametrize("angle", [0.2, 0.45])
def test_a_floor_is_lit_as_by_the_cone_where_it_sees_the_sphere(gpu, radius, angle):
    """Each point of the sphere has its own angle; their mean, over the disk that is seen, is integrated here
    over directions. Squares of 4 x 4 pixels draw apart, but are filtered together, so that errors are told by
    12 pictures of seeds of their own: 4.5 standard errors of their mean, which Student's t with 11 degrees of
    freedom exceeds once in 1,100, and 2e-3 for the mesh."""
    scene = under(spot(radius))
    x = math.tan(angle)
    camera = Camera.look_at((x + 0.01, 0.3, 2.5), (x, 0.0, 0.0), yfov=1e-3)
    means = []
    for seed in range(12):
        with Renderer(scene, Settings(size=(64, 64), bounces=0, seed=seed), camera, gpu=gpu) as renderer:
            *_, frame = renderer.converge(4)
        means.append(float(frame.direct[..., 0].mean()))
    exact = 0.5 / math.pi * INTENSITY[0] / (math.pi * radius**2) * irradiance_of_sphere(x, radius)
    ratios = np.array(means) / exact
    error = ratios.std(ddof=1) / math.sqrt(len(ratios))
    assert ratios.mean() == pytest.approx(1.0, abs=4.5 * error + 2e-3) and error < 0.01


def irradiance_of_sphere(x, radius, steps=400):
    """The integral of falloff and cosine over the directions from (x, 0, 0) to a sphere at (0, 1, 0), sr."""
    to_middle = np.array((-x, 1.0, 0.0))
    distance = np.linalg.norm(to_middle)
    w = to_middle / distance
    u = np.array((0.0, 0.0, 1.0))
    v = np.cross(w, u)
    least = math.sqrt(1.0 - (radius / distance) ** 2)
    z = least + (np.arange(steps) + 0.5) / steps * (1.0 - least)
    phi = (np.arange(steps) + 0.5) * (2.0 * math.pi / steps)
    s = np.sqrt(1.0 - z * z)[:, None]
    d = z[:, None, None] * w + s[..., None] * (np.cos(phi)[:, None] * u + np.sin(phi)[:, None] * v)
    edge = (d[..., 1] - math.cos(OUTER)) / (math.cos(INNER) - math.cos(OUTER))
    shares = np.clip(edge, 0.0, 1.0) ** 2 * d[..., 1]
    return float(shares.mean()) * 2.0 * math.pi * (1.0 - least)


def test_beside_its_cone_it_is_dark(gpu):
    scene = under(spot(0.1))
    x = math.tan(OUTER + 0.15)
    camera = Camera.look_at((x + 0.01, 0.3, 2.5), (x, 0.0, 0.0), yfov=1e-3)
    with Renderer(scene, Settings(size=(16, 16), bounces=0), camera, gpu=gpu) as renderer:
        assert not renderer.render().direct.any()


@pytest.mark.parametrize("angle", [0.0, 0.45, 0.8])
def test_the_camera_and_mirrors_see_it_as_bright_as_its_cone_says(gpu, angle):
    """Straight, from below at an angle to the axis; and in a mirror that lies halfway."""
    light = spot(0.1)
    eye = np.array((2.0 * math.sin(angle), 1.0 - 2.0 * math.cos(angle), 0.0))
    scene = Scene()
    scene.add(light, translation=(0.0, 1.0, 0.0), rotation=DOWN)
    expected = falloff(angle) * np.array(light.radiance)
    camera = Camera.look_at(eye, (0.0, 1.0, 0.0), yfov=0.02, up=(0.0, 0.0, 1.0))
    with Renderer(scene, Settings(size=(8, 8), bounces=0), camera, gpu=gpu) as renderer:
        seen = renderer.render().radiance.mean(axis=(0, 1))
    np.testing.assert_allclose(seen, expected, rtol=0.02, atol=1e-3)
    mirror = Scene()
    mirror.add(light, translation=(0.0, 1.0, 0.0), rotation=DOWN)
    mirror.add(shapes.plane(40.0, 40.0), material=Material((1.0,) * 3, metallic=1.0, roughness=0.0))
    # the mirrored eye stands as far below the mirror as it is above it
    reach = 1.6  # below the sphere, which would hide it
    eye = np.array((reach * math.sin(angle), reach * math.cos(angle) - 1.0, 0.0))
    image = Camera.look_at(eye, (0.0, -1.0, 0.0), yfov=0.02, up=(0.0, 0.0, 1.0))
    with Renderer(mirror, Settings(size=(8, 8), bounces=0), image, gpu=gpu) as renderer:
        shown = renderer.render().radiance.mean(axis=(0, 1))
    np.testing.assert_allclose(shown, expected, rtol=0.02, atol=1e-3)


LOOK = Camera.look_at((1.5, 0.2, 1.7), (-0.5, -0.8, -0.5), yfov=1.2)


def room(light):
    """A room of 4 m; the spot stands on a side of the middle and shines down."""
    scene = Scene()
    scene.add(shapes.box((4.0, 4.0, 4.0)), material=Material((0.7,) * 3, roughness=1.0, double_sided=True))
    scene.add(shapes.box(0.5), material=lambert((0.7, 0.3, 0.1)), translation=(0.1, 0.0, -0.2))
    scene.add(light, translation=(0.3, 1.0, -0.2), rotation=DOWN)
    return scene


@pytest.mark.parametrize("emission", ["rays", "map"])
def test_its_photons_carry_the_light_of_the_point(gpu, emission):
    """Indirect light of a room by a sphere of 2 cm is that by a point, whose first flights fill the same cone
    (of the whole picture, within 3.5 standard errors of four passes each)."""
    means = []
    for radius in (0.0, 0.02):
        settings = Settings(size=(64, 36), photons=50_000, emission=emission)
        with Renderer(room(spot(radius)), settings, LOOK, gpu=gpu) as renderer:
            passes = [renderer.render_pass(k).indirect.mean(axis=(0, 1)) for k in range(4)]
        means.append(np.stack(passes))
    error = np.hypot(*(each.std(axis=0, ddof=1) / 2.0 for each in means))
    ratio = means[1].mean(axis=0) / means[0].mean(axis=0)
    assert (np.abs(ratio - 1.0) < 3.5 * error / means[0].mean(axis=0)).all(), ratio
    assert (error < 0.05 * means[0].mean(axis=0)).all()


def test_a_room_is_as_bright_as_paths_find_it(gpu):
    """Direct and indirect light by a sphere of 15 cm, in quarters of the picture: within 2 % and 3.5 standard
    errors of both."""
    size, scene = (64, 36), room(spot(0.15))
    settings = Settings(size=size, photons=50_000, antialias=False)
    with Renderer(scene, settings, LOOK, gpu=gpu) as renderer:
        ours = np.stack([renderer.render_pass(k).radiance for k in range(4)])
    tracer, view = Tracer(scene), CameraView(size, LOOK.pose, LOOK.yfov, None)
    rays = [np.ascontiguousarray(each).reshape(-1, 3) for each in view.rays()]
    parts = [range(32 * k, 32 * k + 32) for k in range(8)]
    paths = [path_light(tracer.tables, *rays, samples=part, bounces=32, threads=2) for part in parts]
    truths = np.stack(paths).reshape(8, 36, 64, 3)
    a, b = (each.reshape(len(each), 2, 18, 2, 32, 3).mean(axis=(2, 4)) for each in (ours, truths))
    error = np.hypot(*(e.std(axis=0, ddof=1) / math.sqrt(len(e)) for e in (a, b)))
    off = np.abs(a.mean(axis=0) - b.mean(axis=0))
    assert (off < 0.02 * b.mean(axis=0) + 3.5 * error).all(), (off / b.mean(axis=0), error)


@pytest.mark.parametrize("passes", [1, 4])
def test_the_edge_of_its_beam_is_as_sharp_as_that_of_a_point_at_a_grazing_angle(gpu, passes):
    """A row of pixels shows 5 cm of the floor, of the .38 m between the cones. The mean of a picture's row is
    that of some hundred draws of points of a sphere of 2 cm, which moves the edge by as much: a tenth of what
    it falls by from row to row, and 2 % of the greatest."""
    size, camera = (64, 48), Camera.look_at((0.0, 0.15, 2.5), (0.0, 0.0, 0.0), yfov=0.12)
    found = []
    for radius in (0.0, 0.02):
        settings = Settings(size=size, bounces=0, antialias=False)
        with Renderer(under(spot(radius)), settings, camera, gpu=gpu) as renderer:
            *_, frame = renderer.converge(passes)
        found.append(frame.direct[..., 1].astype(float))
    exact, ours = (picture[:, 24:40].mean(axis=1) for picture in found)
    falls = np.abs(np.diff(exact, prepend=exact[0])) + np.abs(np.diff(exact, append=exact[-1]))
    assert falls.max() > 0.2 * exact.max()
    assert (np.abs(ours - exact) < 0.1 * falls + 0.02 * exact.max()).all()


@pytest.mark.parametrize("ending", ["glb", "gltf"])
def test_it_loads_back_equal(tmp_path, ending):
    path = tmp_path / f"lamp.{ending}"
    light = spot(0.25, name="bulb")
    ispm.save(under(light), path)
    assert ispm.load(path)["lamp"].light == light


def test_a_radius_that_makes_no_sense_is_refused_or_passed_over(tmp_path):
    with pytest.raises(SceneError, match=r"range 5 cannot be with radius 0\.1"):
        SpotLight(range=5.0, radius=0.1)
    path = tmp_path / "lamp.gltf"
    ispm.save(under(spot(0.25)), path)
    text = json.loads(path.read_text())
    text["extensions"]["KHR_lights_punctual"]["lights"][0]["extras"]["radius"] = -1.0
    path.write_text(json.dumps(text))
    loaded = ispm.load(path)
    assert loaded["lamp"].light.radius == 0.0
    assert any("radius is passed over" in line for line in loaded.warnings)


def test_the_viewer_changes_it():
    node = under(spot(0.0))["lamp"]
    assert {"radius": 0.0}.items() <= {f["name"]: f["value"] for f in fields.light_fields(node.light)}.items()
    (assign,) = fields.light_edit(node, "radius", 0.3, 1.0, None).steps
    assert assign.value == spot(0.3)
    (assign,) = actions.as_kind(node, "point", 1.0).steps
    assert isinstance(assign.value, PointLight) and assign.value.radius == 0.0
