"""Point lights with a radius: spheres that give as much light."""

import json
import math

import numpy as np
import pytest

import ispm
from ispm import Camera, PointLight, Renderer, Scene, SceneError, Settings, SphereLight, shapes
from ispm.library.common import lambert
from ispm.scene.packed import pack
from ispm.viewer import actions, fields

INTENSITY = (30.0, 20.0, 10.0)


def with_light(light, **where):
    scene = Scene()
    scene.add(shapes.plane(2.0, 2.0), material=lambert((0.5,) * 3))
    scene.add(light, name="lamp", **where)
    return scene


def sphere(radius):
    """The sphere lamp of the same candela from afar: it appears as a disk of pi r^2."""
    r, g, b = (i / (math.pi * radius**2) for i in INTENSITY)
    return SphereLight((r, g, b), radius)


def test_without_a_radius_it_is_a_point():
    scene = with_light(PointLight(INTENSITY, radius=0.0), translation=(0, 1, 0))
    packed = pack(scene)
    assert len(packed.lights) == 1 and len(packed.instances) == 1
    assert PointLight(INTENSITY) == PointLight(INTENSITY, radius=0.0)
    assert repr(PointLight()) == "PointLight()"


def test_with_a_radius_it_is_packed_as_a_sphere_that_its_node_does_not_scale():
    place = dict(translation=(0.1, 1.0, -0.2))
    scene = with_light(PointLight(INTENSITY, radius=0.2), **place, scale=(3.0, 0.5, 2.0))
    packed, other = pack(scene), pack(with_light(sphere(0.2), **place))
    assert len(packed.lights) == 0
    assert packed.instances.tobytes() == other.instances.tobytes()
    assert packed.materials.tobytes() == other.materials.tobytes()
    # a radius that comes and goes
    scene["lamp"].light.radius = 0.0
    again = pack(scene, packed)
    assert len(again.lights) == 1 and len(again.instances) == 1
    scene["lamp"].light.radius = 0.1
    larger = pack(scene, again)
    assert len(larger.lights) == 0
    np.testing.assert_allclose(
        larger.materials["emission"][-1], 4 * packed.materials["emission"][-1], rtol=1e-6
    )


@pytest.mark.parametrize(
    "make, words",
    [
        (lambda: PointLight(radius=-1.0), "radius, in metres, must be a number"),
        (lambda: PointLight(radius=math.nan, name="bulb"), "light 'bulb': radius"),
        (lambda: PointLight(radius="wide"), "radius, in metres"),
        (lambda: PointLight(range=5.0, radius=0.1), "range 5 cannot be with radius 0.1"),
        (lambda: PointLight(radius=1e-200), "intensity over the area of its radius"),
    ],
)
def test_what_makes_no_radius_is_refused_in_one_line(make, words):
    with pytest.raises(SceneError, match=words) as caught:
        make()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("radius", [0.05, 0.6])
def test_a_floor_is_lit_as_by_a_point_where_it_sees_the_whole_sphere(gpu, radius):
    """A sphere of even radiance L above the horizon: E = pi L r^2 cos / d^2 = I cos / d^2 for any radius. Its
    mesh brings the same to 2e-4 here. Squares of 4 x 4 pixels draw apart, but are filtered together, so that
    errors are told by 12 pictures of seeds of their own: 4.5 standard errors of their mean, which Student's t
    with 11 degrees of freedom exceeds once in 1,100."""
    scene = with_light(PointLight(INTENSITY, radius=radius), translation=(0.0, 0.8, 0.0))
    camera = Camera.look_at((0.9, 2.0, 0.3), (0.9, 0.0, 0.3001), yfov=1e-3)
    means = []
    for seed in range(12):
        with Renderer(scene, Settings(size=(64, 64), bounces=0, seed=seed), camera, gpu=gpu) as renderer:
            *_, frame = renderer.converge(4)
        means.append(frame.direct.mean(axis=(0, 1), dtype=float))
    square = 0.9**2 + 0.3**2 + 0.8**2
    exact = 0.5 / math.pi * np.array(INTENSITY) * 0.8 / math.sqrt(square) / square
    ratios = np.array(means) / exact
    error = ratios[:, 0].std(ddof=1) / math.sqrt(len(ratios))
    assert ratios[:, 0].mean() == pytest.approx(1.0, abs=4.5 * error + 2e-4) and error < 0.01
    assert ratios == pytest.approx(np.repeat(ratios[:, :1], 3, axis=1), rel=1e-4)


def test_the_camera_sees_it(gpu):
    scene = with_light(PointLight(INTENSITY, radius=0.2), translation=(0.0, 0.8, 0.0))
    camera = Camera.look_at((0.0, 0.8, 3.0), (0.0, 0.8, 0.0), yfov=0.05)
    with Renderer(scene, Settings(size=(8, 8), bounces=0), camera, gpu=gpu) as renderer:
        radiance = renderer.render().radiance
    assert radiance.mean(axis=(0, 1)) == pytest.approx(sphere(0.2).intensity, rel=1e-3)  # of halves


@pytest.mark.parametrize("ending", ["glb", "gltf"])
def test_it_loads_back_equal(tmp_path, ending):
    path = tmp_path / f"lamp.{ending}"
    light = PointLight(INTENSITY, radius=0.25, name="bulb")
    ispm.save(with_light(light), path)
    assert ispm.load(path)["lamp"].light == light


@pytest.mark.parametrize("radius", [-1.0, "wide", 1e-200, [1.0]])
def test_a_radius_that_makes_no_sense_is_passed_over_with_a_note(tmp_path, radius):
    path = tmp_path / "lamp.gltf"
    ispm.save(with_light(PointLight(INTENSITY, radius=0.25)), path)
    text = json.loads(path.read_text())
    text["extensions"]["KHR_lights_punctual"]["lights"][0]["extras"]["radius"] = radius
    path.write_text(json.dumps(text))
    loaded = ispm.load(path)
    assert loaded["lamp"].light == PointLight(INTENSITY)
    assert any("radius is passed over" in line for line in loaded.warnings)


def test_the_viewer_changes_it():
    scene = with_light(PointLight(INTENSITY), translation=(0, 1, 0))
    node = scene["lamp"]
    assert {"radius": 0.0}.items() <= {f["name"]: f["value"] for f in fields.light_fields(node.light)}.items()
    (assign,) = fields.light_edit(node, "radius", 0.3, 1.0, None).steps
    assert assign.value == PointLight(INTENSITY, radius=0.3)
    (assign,) = actions.as_kind(node, "sphere", 1.0).steps
    assert assign.value.radius > 0.0
