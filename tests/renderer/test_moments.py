"""Moments of one animation share what they do not bring themselves: a camera and a light."""

import numpy as np
import pytest
from assets import assets
from transport import box_room

from ispm.errors import SceneError, SettingsError
from ispm.io.load import load
from ispm.io.save import save
from ispm.library.shapes import box, icosphere
from ispm.renderer.ready import Ready
from ispm.scene.animation import Animation, Channel
from ispm.scene.camera import Camera
from ispm.scene.scene import Scene
from ispm.settings import Settings

SIZE = (160, 90)
TIMES = (0.0, 0.3, 1.0, 1.7, 2.0, 5.0)


def moving(values=((-4.0, 0, 0), (6.0, 3.0, 0)), name="fly"):
    """A ball that flies past a box within two seconds, in another place at rest."""
    scene = Scene(name="moving")
    scene.add(box((0, 0, 0), (1, 1, 1)), name="box")
    ball = scene.add(icosphere(0.5, 4), name="ball", translation=(0.0, 2.0, 0.0))
    keys = np.array(values, np.float32)
    scene.animations.append(
        Animation([Channel(ball, "translation", np.linspace(0, 2, len(keys)), keys)], name)
    )
    return scene


def prepared(scene):
    said = []
    packed, view = Ready(2, said.append)(scene, Settings(size=SIZE), 0)
    return packed, view, said


def in_view(camera, scene):
    """Half picture heights and widths at which the vertices of a scene lie."""
    for node, world in scene.placed():
        for part in node.parts:
            points = part.mesh.positions @ world[:3, :3].T + world[:3, 3]
            local = (points - camera.pose[:3, 3]) @ camera.pose[:3, :3]
            assert (local[:, 2] < 0.0).all()
            yield np.abs(local[:, :2] / -local[:, 2:] / np.tan(camera.yfov / 2) / (16 / 9, 1.0)).max()


def test_all_moments_share_one_camera_that_sees_them_all():
    scene = moving()
    camera = scene.default_camera(SIZE)
    reach = [max(in_view(camera, moment)) for moment in (scene, *map(scene.at, TIMES))]
    assert max(reach) == pytest.approx(1 / 1.08, abs=0.02)  # framed with its margin, no wider than needed
    for time in TIMES:
        assert (scene.at(time).default_camera(SIZE).pose == camera.pose).all()


def test_all_moments_share_one_light():
    for scene in (moving(), room()):
        lights = [lit(prepared(scene.at(time))[0]) for time in TIMES]
        assert set(lights) == {lit(prepared(scene)[0])}


def lit(packed):
    return packed.lights.tobytes() + packed.surround.digest


def room():
    """A closed room through which a box moves."""
    scene = box_room((-2, 0, -2), (2, 3, 2))
    block = scene.add(box((0, 0, 0), (0.5, 0.5, 0.5)), name="block")
    keys = np.array([(-1.5, 0, 0), (1.0, 0, 1.0)], np.float32)
    scene.animations.append(Animation([Channel(block, "translation", np.array([0.0, 2.0]), keys)]))
    return scene


def test_a_room_keeps_its_camera_too():
    scene = room()
    poses = {scene.at(time).default_camera(SIZE).pose.tobytes() for time in TIMES}
    assert poses == {scene.default_camera(SIZE).pose.tobytes()}


def test_a_lamp_by_a_camera_that_moves_stays():
    """In a room without light, at the place that the scene's own camera has at rest."""
    scene = room()
    eye = scene.add(Camera(), translation=(0.0, 1.5, 1.8))
    keys = np.array([(1.0, 1.5, 1.8), (-1.0, 1.5, 1.8)], np.float32)
    scene.animations.append(Animation([Channel(eye, "translation", np.array([0.0, 2.0]), keys)]))
    first, later = prepared(scene.at(0.0)), prepared(scene.at(2.0))
    assert first[0].lights.tobytes() == later[0].lights.tobytes()
    assert first[1].pose[0, 3] == 1.0 and later[1].pose[0, 3] == -1.0


@pytest.mark.parametrize("name", ["BoxAnimated.glb", "InterpolationTest.glb", "AnimatedTriangle.gltf"])
def test_files_without_camera_do_not_jump(name):
    scene = load(assets() / "scenes" / name)
    assert scene.animations and not scene.cameras
    seen = [prepared(moment)[:2] for moment in (scene, *map(scene.at, TIMES))]
    assert len({view.pose.tobytes() for _, view in seen}) == 1
    assert len({packed.lights.tobytes() for packed, _ in seen}) == 1


def test_only_the_animation_that_plays_is_framed():
    scene = moving()
    far = np.array([(0, 0, 0), (500.0, 0, 0)], np.float32)
    channel = Channel(scene["ball"], "translation", np.array([0.0, 2.0]), far)
    scene.animations.append(Animation([channel], "away"))
    near = scene.at(1.0, "fly").default_camera(SIZE)
    assert (near.pose == moving().default_camera(SIZE).pose).all()
    assert scene.at(1.0, "away").default_camera(SIZE).pose[2, 3] > 10 * near.pose[2, 3]


def test_what_is_added_to_a_moment_is_framed_as_well():
    moment = moving().at(1.0)
    moment.add(box((0, 0, 0), (60, 1, 1)))
    assert moment.default_camera(SIZE).pose[2, 3] > 2 * moving().default_camera(SIZE).pose[2, 3]


def test_a_scene_s_own_camera_is_its_default():
    scene = moving()
    scene.add(Camera(yfov=0.7), translation=(1, 2, 3))
    camera = scene.default_camera(SIZE)
    assert camera.yfov == 0.7 and camera.pose[:3, 3].tolist() == [1, 2, 3]


def test_a_default_camera_needs_something_to_see_and_a_size():
    with pytest.raises(SceneError, match="no surface"):
        Scene().default_camera(SIZE)
    with pytest.raises(SettingsError, match="size"):
        moving().default_camera((0, 5))


def places(scene):
    return [world.tolist() for _, world in scene.placed()]


def test_moments_of_moments_are_those_of_the_scene():
    scene = moving()
    assert places(scene.at(0.3).at(1.7)) == places(scene.at(1.7))
    assert places(scene.at(0.3).at_rest()) == places(scene)
    scene.animations.append(
        Animation([Channel(scene["box"], "translation", np.array([0.0, 2.0]), np.eye(3)[:2])], "slide")
    )
    assert places(scene.at(1.0).at(1.0, "slide")) == places(scene.at(1.0, "slide"))
    assert scene["ball"].translation == (0.0, 2.0, 0.0)  # the scene itself is left alone


def test_a_moment_is_saved_with_its_animations(tmp_path):
    scene = moving()
    save(scene.at(1.7), tmp_path / "moment.glb")
    again = load(tmp_path / "moment.glb")
    assert np.allclose(again["ball"].translation, scene.at(1.7)["ball"].translation)
    assert np.allclose(again.at(0.3)["ball"].translation, scene.at(0.3)["ball"].translation)


def test_copies_that_turn_stay_in_the_picture():
    """Copies about a node that turns once: their own places, and an arc between keys far apart."""
    scene = Scene()
    ring = scene.add(icosphere(0.2, 2), name="ring")
    ring.instances = np.tile(np.eye(4), (6, 1, 1))
    ring.instances[:, 0, 3] = np.arange(6) + 1.0
    half = np.sqrt(0.5)
    turns = np.array([(0, 0, 0, 1), (0, half, 0, half), (0, 1, 0, 0)], np.float32)
    scene.animations.append(Animation([Channel(ring, "rotation", np.array([0.0, 1.0, 2.0]), turns)]))
    camera = scene.default_camera(SIZE)
    for time in (0.0, 0.5, 1.0, 1.5, 2.0):
        node = scene.at(time)["ring"]
        for place in node.places(node.local_matrix()):
            local = (place[:3, 3] - camera.pose[:3, 3]) @ camera.pose[:3, :3]
            x, y = np.abs(local[:2]) / -local[2] / np.tan(camera.yfov / 2)
            assert local[2] < 0 and x < 16 / 9 and y < 1
