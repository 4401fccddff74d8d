"""The camera of scenes that bring none."""

import json

import numpy as np
import pytest
from assets import assets
from transport import box_room

from ispm.accel.world import World
from ispm.errors import SceneError
from ispm.framing.camera import default_camera, find_camera, rigid
from ispm.framing.interior import interior_viewpoint
from ispm.io.load import load
from ispm.library.builtin import BUILTINS, builtin
from ispm.library.shapes import box, icosphere
from ispm.scene.camera import Camera
from ispm.scene.light import RectLight, SphereLight
from ispm.scene.packed import pack
from ispm.scene.rotation import rotation_matrix
from ispm.scene.scene import Scene


def ready(scene):
    packed, world = pack(scene), World(2)
    world.update(packed)
    return packed, world


def object_scene(scale=(1.0, 1.0, 1.0)):
    scene = Scene()
    scene.add(icosphere(1.0, 4), translation=(5.0, -3.0, 1.0), scale=scale)
    scene.add(box((0, 0, 0), (1, 1, 1)), translation=(6.0, -3.0, 1.0))
    return scene


def seen_from(camera, pose, points):
    """Pinhole coordinates of points, (n, 2) in units of the view's half height; all are ahead."""
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    assert (local[:, 2] < 0.0).all()
    return local[:, :2] / -local[:, 2:] / np.tan(camera.yfov / 2)


@pytest.mark.parametrize("aspect", [0.4, 1.0, 16 / 9])
@pytest.mark.parametrize("scale", [(1, 1, 1), (20, 1, 1), (1, 0.01, 1), (0.01, 0.01, 30)])
def test_an_object_fills_the_picture_but_stays_within(aspect, scale):
    packed, world = ready(object_scene(scale))
    assert interior_viewpoint(packed, world) is None
    camera, pose = default_camera(packed, world, aspect)
    points = []
    for row in packed.instances:
        first = row["first_index"]
        used = packed.geometry.indices[first : first + 3 * row["triangle_count"]]
        matrix = np.stack([row[f"world{k}"] for k in range(3)])
        points.append(packed.geometry.vertices["position"][used] @ matrix[:, :3].T + matrix[:, 3])
    # a margin of 8 % of the picture's half, on the sides that bound the view
    reach = np.abs(seen_from(camera, pose, np.concatenate(points)) / (aspect, 1.0)).max()
    assert reach < 0.93
    assert reach > 0.92 or scale == (0.01, 0.01, 30)  # a pole towards the eye, which keeps off its tip


def test_a_room_is_seen_from_within():
    low, high = (-3.0, 0.0, -1.0), (3.0, 2.5, 1.0)
    for scene in (box_room(low, high), box_room((1e3, 0, 0), (1e3 + 4, 3, 5))):
        packed, world = ready(scene)
        assert interior_viewpoint(packed, world) == pytest.approx(packed.bounds.mean(axis=0))
        _, pose = default_camera(packed, world, 1.5)
        assert (pose[:3, 3] > packed.bounds[0]).all() and (pose[:3, 3] < packed.bounds[1]).all()
    # along the longer side, towards the middle
    packed, world = ready(box_room(low, high))
    _, pose = default_camera(packed, world, 1.5)
    assert abs(pose[0, 2]) > 0.99


def test_a_box_seen_from_outside_is_no_room():
    scene = Scene()
    scene.add(box((0, 0, 0), (1, 1, 1)))
    assert interior_viewpoint(*ready(scene)) is None


@pytest.mark.parametrize("aspect", [0.5, 1.0, 1.5])
def test_a_room_with_an_open_side_is_seen_whole_from_the_middle_before_it(aspect):
    scene = box_room((-2, 0, -2), (2, 2, 2))
    del scene.roots[1]  # the wall at +x
    scene.add(box((-1, 0, -1), (0, 1.5, 2)))  # in the middle
    packed, world = ready(scene)
    camera, pose = default_camera(packed, world, aspect)
    assert pose[0, 3] > 2.0 and pose[2, 3] == pytest.approx(0.0)
    assert pose[0, 2] > 0.99
    corners = np.array([(x, y, z) for x in (-2, 2) for y in (0, 2) for z in (-2, 2)])
    seen = np.abs(seen_from(camera, pose, corners)) / (aspect, 1.0)
    assert seen.max() == pytest.approx(1 / 1.08)


ROOMS = {
    "atrium", "integrating-sphere", "own_room.obj", "level_zdm2_lit.glb", "living_room_godot.glb",
    "ispm_light_units.glb", "objects-in-box", "missing_material_file.obj", "no_material.obj",
    "ironworks-car", "ironworks-water", "cargo-bay", "cargo-level", "cargo-map", "glass-figure", "million",
}  # fmt: skip
# A level whose walls are thick, in units that are not metres; a table before a backdrop that surrounds it.
HARD_TO_TELL = {"turbine.obj", "glass-sphere"}


def test_rooms_are_told_from_objects_in_all_assets():
    folder, wrong = assets(), []
    files = [folder / entry["file"] for entry in json.loads((folder / "manifest.json").read_text())]
    scenes = [("", name, builtin(name)) for name in BUILTINS]
    for path in files:
        try:
            scenes.append((path.parts[len(folder.parts)], path.name, load(path)))
        except SceneError:
            continue  # files that are refused have tests of their own
    for kind, name, scene in scenes:
        if not scene.triangle_count or kind == "generator" or name in HARD_TO_TELL:
            continue
        room = name in ROOMS or "cornell" in name.lower()
        if (interior_viewpoint(*ready(scene)) is not None) != room:
            wrong.append(name)
    assert len(scenes) > 100
    assert not wrong


def test_cameras_are_found_by_name_index_or_as_the_first():
    scene = Scene()
    assert find_camera(scene, None) is None
    scene.add(Camera(yfov=0.5), name="left", translation=(1, 2, 3))
    scene.add(Camera(yfov=0.9, name="lens"), name="right")
    for wanted, yfov in ((None, 0.5), ("left", 0.5), (1, 0.9), ("1", 0.9), ("lens", 0.9), ("right", 0.9)):
        found = find_camera(scene, wanted)
        assert found is not None and found[0].yfov == yfov
    assert find_camera(scene, "left")[1][:3, 3].tolist() == [1.0, 2.0, 3.0]
    for wanted in ("middle", 2, -1):
        with pytest.raises(SceneError, match="are: 0 'left', 1 'right'"):
            find_camera(scene, wanted)


@pytest.mark.parametrize("scale", [(1, 1, 1), (2, 2, 2), (0.5, 3.0, 2.0), (0.01, 0.01, 0.01)])
def test_a_scaled_nodes_camera_keeps_its_rotation_alone(scale):
    rotation = rotation_matrix(np.array((0.2, 0.3, 0.1, 0.9)))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation * np.array(scale, float), (1, 2, 3)
    pose = rigid(matrix)
    assert pose[:3, :3] == pytest.approx(rotation, abs=1e-12)
    assert pose[:3, 3].tolist() == [1.0, 2.0, 3.0]


def test_a_mirrored_nodes_camera_looks_the_same_way():
    matrix = np.diag([-1.0, 1.0, 1.0, 1.0])
    pose = rigid(matrix)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)
    assert pose[:3, 2].tolist() == [0.0, 0.0, 1.0] and pose[:3, 1].tolist() == [0.0, 1.0, 0.0]


def test_lamps_do_not_change_what_is_framed():
    """Nor where the scene's bounds are; but what is nothing else is framed by its lamp."""
    scene = Scene()
    scene.add(icosphere(0.5, 4))
    alone = scene.default_camera().pose
    scene.add(RectLight(width=4.0, height=4.0), translation=(0.0, 9.0, 0.0))
    np.testing.assert_array_equal(scene.default_camera().pose, alone)
    assert np.abs(scene.bounds).max() == 0.5
    assert scene.nodes[1].light is not None
    lamp = Scene()
    lamp.add(SphereLight(radius=2.0), translation=(9.0, 0.0, 0.0))
    assert lamp.default_camera().pose[0, 3] > 5.0
