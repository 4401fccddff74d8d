"""The light of scenes that bring none."""

import json
import math
import warnings

import numpy as np
import pytest
from assets import assets
from transport import box_room

import ispm
from ispm.accel.world import World
from ispm.errors import SceneError
from ispm.framing.light import brings_light, default_light
from ispm.io.load import load
from ispm.library.builtin import BUILTINS, builtin
from ispm.library.shapes import icosphere
from ispm.library.studio_light import FRONT
from ispm.optics.environment import environment_radiance
from ispm.renderer.ready import Ready
from ispm.scene.camera import look_at_pose
from ispm.scene.environment import Environment
from ispm.scene.material import Material, Texture
from ispm.scene.packed import pack
from ispm.scene.scene import Scene
from ispm.scene.sky import Sky
from ispm.settings import Settings

SIZE = (160, 90)


def thing(**looks):
    scene = Scene(name="thing")
    scene.add(icosphere(1.0, 4), material=Material(**looks), translation=(5.0, -3.0, 1.0))
    return scene


def chosen(scene, kind="auto", pose=None):
    packed, world = pack(scene), World(2)
    world.update(packed)
    return default_light(kind, packed, world, np.eye(4) if pose is None else pose)


def prepared(scene, light="auto"):
    said = []
    packed, view = Ready(2, said.append)(scene, Settings(size=SIZE, light=light), 0)
    return packed, view, said


def test_a_room_gets_a_lamp_and_an_object_the_studio():
    room = chosen(box_room())
    assert np.abs(room.node.translation).max() < 0.5 and "near the camera" in room.line
    assert room.environment is None
    light = chosen(thing())
    assert light.node is None and light.environment.name == "studio" and not light.environment.background
    assert light.line == "the scene has no light; a studio lights it"


def test_a_far_lamp_lights_a_white_surface_to_1():
    scene = thing()
    node = chosen(scene, "lamp").node
    distance = np.linalg.norm(node.translation - scene.bounds.mean(axis=0))
    assert distance == pytest.approx(20 * pack(scene).diagonal)
    assert node.light.intensity[0] / distance**2 == pytest.approx(np.pi)


def test_the_studio_lights_a_white_surface_that_faces_up_to_1():
    table = environment_of(chosen(thing()).environment)
    cosine, phi = (np.arange(200) + 0.5) / 200, 2 * math.pi * (np.arange(400) + 0.5) / 400
    total = 0.0
    for y in cosine:
        for angle in phi[::8]:
            total += y * radiance(
                table, (math.sqrt(1 - y * y) * math.cos(angle), y, math.sqrt(1 - y * y) * math.sin(angle))
            )
    assert 2.0 * total / (200 * 50) == pytest.approx(1.0, rel=0.02)


def environment_of(environment):
    scene = thing()
    scene.environment = environment
    return pack(scene).environment


def radiance(table, direction):
    return float(environment_radiance(table, tuple(np.asarray(direction, np.float32)))[0])


@pytest.mark.parametrize("turn", [0.0, 1.0, 2.5, -2.0])
def test_studio_and_sky_are_set_up_for_the_camera(turn):
    """The key light and the sun come from the left of who looks, from any side."""
    azimuth = FRONT + turn
    back = np.array([math.sin(azimuth), 0.3, -math.cos(azimuth)])
    pose = look_at_pose(back, np.zeros(3))
    table = environment_of(chosen(thing(), "studio", pose).environment)
    left = 0.9 * pose[:3, 2] - pose[:3, 0] + 0.9 * pose[:3, 1]
    right = left + 2.0 * pose[:3, 0]
    key, fill = (radiance(table, d / np.linalg.norm(d)) for d in (left, right))
    assert key > 4.0 * fill
    sky = chosen(thing(), "sky", pose).environment
    sun = pack_with(sky).lights[0]["direction"]
    assert -sun @ pose[:3, 0] < -0.5 and -sun @ pose[:3, 2] > 0.2


def pack_with(environment):
    scene = thing()
    scene.environment = environment
    return pack(scene)


def test_a_camera_that_looks_straight_down_has_a_studio_too():
    pose = look_at_pose(np.array([0.0, 5.0, 0.0]), np.zeros(3))
    assert chosen(thing(), "studio", pose).environment.rotation == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("light", "lamps", "lit", "says"),
    [
        ("auto", 0, True, ["the scene has no light; a studio lights it"]),
        ("studio", 0, True, ["the scene has no light; a studio lights it"]),
        ("sky", 1, True, ["the scene has no light; a clear sky lights it"]),
        ("lamp", 1, False, ["the scene has no light; a lamp far away, like the sun, lights it"]),
        ("none", 0, False, []),
    ],
)
def test_the_setting_says_what_lights_a_scene_without_lights(light, lamps, lit, says):
    scene = thing()
    packed, _, said = prepared(scene, light)
    assert (len(packed.lights), len(packed.environment.rows) > 0, said) == (lamps, lit, says)
    assert scene.environment is None and not scene.lights  # the scene itself stays as it is


@pytest.mark.parametrize("light", ["studio", "sky", "lamp"])
def test_a_scene_with_light_keeps_its_own_and_the_user_is_told(light):
    scene = thing()
    scene.add(ispm.PointLight((10.0, 10.0, 10.0)), translation=(0.0, 9.0, 0.0))
    packed, _, said = prepared(scene, light)
    assert len(packed.lights) == 1 and not len(packed.environment.rows)
    assert said == [f"the scene has light of its own; setting light, {light}, is for scenes without"]
    assert prepared(scene, "auto")[2] == prepared(scene, "none")[2] == []


def test_environments_and_what_glows_all_over_are_light_but_displays_are_not():
    picture = Texture(np.full((2, 2, 4), 255, np.uint8))
    for scene, light in (
        (thing(), False),
        (thing(emission=(0.0, 2.0, 0.0)), True),
        (thing(emission=(1.0, 1.0, 1.0), emission_texture=picture), False),
    ):
        assert brings_light(scene, scene.tree()) is light
    for environment in (Environment(np.ones((2, 4, 3), np.float32)), Sky()):
        scene = thing()
        scene.environment = environment
        assert brings_light(scene, scene.tree())


def test_the_light_is_held_while_the_scene_changes_and_frames_are_kept():
    ready, scene = Ready(2, lambda line: None), thing()
    for light in ("auto", "sky", "lamp"):
        settings = Settings(size=SIZE, light=light)
        first, _ = ready(scene, settings, 0)
        assert ready(scene, settings, 0)[0] is first
        scene.roots[0].translation = (float(len(light)), 0.0, 0.0)
        moved, _ = ready(scene, settings, 0)
        assert moved is not first and moved.surround is first.surround and moved.lit is first.lit
    before = ready(scene, Settings(size=SIZE, light="studio"), 0)[0]
    scene.add(ispm.PointLight())
    after = ready(scene, Settings(size=SIZE), 0)[0]
    assert len(before.environment.rows) and not len(after.environment.rows) and len(after.lights) == 1


# Files of which a lamp or a room's panel glows, and those where a texture does, among those without lamps.
GLOW = {"own_room.obj", "EmissiveStrengthTest.glb", "TextureLinearInterpolationTest.glb"}
DISPLAYS = {"DamagedHelmet.glb", "ClearCoatTest.glb", "MultiUVTest.glb", "TransmissionTest.glb"}


def test_files_without_light_get_the_studio_but_rooms_a_lamp():
    folder, kinds = assets(), {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for entry in json.loads((folder / "manifest.json").read_text()):
            path = folder / entry["file"]
            if path.parts[len(folder.parts)] not in ("scenes", "cornell", "meshes"):
                continue
            try:
                scene = load(path)
            except SceneError:
                continue  # files that are refused have tests of their own
            if not scene.triangle_count:
                continue
            if brings_light(scene, scene.tree()):
                kinds[path.name] = "own"
            elif path.name in DISPLAYS | {"Suzanne.glb", "SheenChair.glb", "living_room_godot.glb"}:
                light = chosen(scene)
                kinds[path.name] = "studio" if light.node is None else "lamp"
            else:
                kinds[path.name] = "none"
    assert all(kinds[name] == "studio" for name in DISPLAYS | {"Suzanne.glb", "SheenChair.glb"})
    assert kinds["living_room_godot.glb"] == "lamp"
    own = {name for name, kind in kinds.items() if kind == "own"}
    lamps = {"LightsPunctualLamp.glb", "ispm_caustic_ring.glb", "ispm_ior_grid.glb", "ispm_light_units.glb"}
    cornell = {name for name in kinds if name.startswith(("CornellBox-", "cornell_glass"))}
    assert own == GLOW | lamps | cornell | {"level_zdm2_lit.glb"}
    assert cornell


@pytest.mark.parametrize("name", sorted(BUILTINS))
def test_built_in_scenes_bring_their_light(name):
    scene = builtin(name)
    assert brings_light(scene, scene.tree())
