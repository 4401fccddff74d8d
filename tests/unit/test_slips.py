"""Slips that would change nothing, or change it in silence, are told."""

import copy
import multiprocessing
import pickle
import threading

import numpy as np
import pytest

import ispm
from ispm.io.atomic import require_writable
from ispm.library.common import lambert
from ispm.library.shapes import box
from ispm.renderer.limits import without_area
from ispm.renderer.renderer import Renderer
from ispm.scene.packed import pack_geometry

SMALL = ispm.Settings(size=(32, 18), photons=500, antialias=False)


@pytest.mark.parametrize(
    ("thing", "name", "said"),
    [
        (ispm.Node(), "material", "parts[0].material"),
        (ispm.Node(), "visible", "scene.remove"),
        (ispm.Node(), "translaton", "did you mean 'translation'?"),
        (ispm.Material(), "rougness", "did you mean 'roughness'?"),
        (ispm.PointLight(), "intensty", "did you mean 'intensity'?"),
        (ispm.Camera(), "yfow", "did you mean 'yfov'?"),
        (ispm.Scene(), "root", "did you mean 'roots'?"),
        (box((0, 0, 0), (1, 1, 1)), "position", "did you mean 'positions'?"),
        (ispm.Texture(np.zeros((1, 1, 3))), "pixel", "did you mean 'pixels'?"),
    ],
)
def test_attributes_that_are_none_are_refused(thing, name, said):
    with pytest.raises(AttributeError, match=r".") as refused:
        setattr(thing, name, 1)
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: ispm.Material(rougness=0.5), "a Material has no 'rougness'; did you mean 'roughness'?"),
        (lambda: ispm.Material(albedo=(1, 1, 1)), "a Material has no 'albedo'; did you mean 'base_color'?"),
        (lambda: ispm.PointLight(power=(1, 1, 1)), "a PointLight has no 'power'; did you mean 'intensity'?"),
        (lambda: ispm.SpotLight(outer=1.0), "a SpotLight has no 'outer'"),
        (lambda: ispm.DirectionalLight(intensty=(1, 1, 1)), "did you mean 'intensity'?"),
        (lambda: ispm.Camera(fov=1.0), "a Camera has no 'fov'; did you mean 'yfov'?"),
        (lambda: ispm.Node(material=ispm.Material()), "parts[0].material"),
        (lambda: ispm.Mesh(np.zeros((3, 3)), np.zeros((1, 3), int), uvs=None), "a Mesh has no 'uvs'"),
        (lambda: ispm.Texture(np.zeros((1, 1, 3)), linea=False), "did you mean 'linear'?"),
        (lambda: ispm.Scene(nodes=[]), "a Scene has no 'nodes'"),
        (
            lambda: ispm.Scene().add(ispm.PointLight(), position=(0, 1, 0)),
            "add takes no 'position'; did you mean 'translation'?",
        ),
        (lambda: ispm.Scene().merge(ispm.Scene(), scael=2), "merge takes no 'scael'; did you mean 'scale'?"),
        (lambda: ispm.euler(x=1, degree=True), "euler takes no 'degree'; did you mean 'degrees'?"),
        (lambda: ispm.axis_angle((0, 1, 0), 1, radians=True), "axis_angle takes no 'radians'"),
    ],
)
def test_arguments_that_are_none_are_refused_by_the_nearest(call, said):
    with pytest.raises(TypeError) as refused:
        call()
    assert said in str(refused.value)


def test_parents_are_of_the_same_scene():
    scene, other = ispm.Scene(), ispm.builtin("cornell-box")
    lamp = ispm.PointLight()
    for foreign in (ispm.Node("shelf"), other.nodes[0]):
        said = f"node 'lamp': its parent '{foreign.name}' is not in this scene; hang that in it first"
        with pytest.raises(ispm.SceneError, match=said):
            scene.add(lamp, name="lamp", parent=foreign)
        with pytest.raises(ispm.SceneError, match="is not in this scene"):
            scene.merge(other, name="lamp", parent=foreign)
        assert not scene.roots and all(node.name != "lamp" for node in foreign.children)
    shelf = ispm.Node("shelf")
    scene.roots.append(shelf)
    first = scene.add(lamp, parent=shelf)
    assert scene.add(lamp, parent=first) in scene
    scene.remove(first)
    with pytest.raises(ispm.SceneError, match="is not in this scene"):
        scene.add(lamp, parent=first)
    copied = pickle.loads(pickle.dumps(copy.deepcopy(scene)))
    assert copied.add(lamp, parent=copied["shelf"]) in copied
    with pytest.raises(ispm.SceneError, match="is not in this scene"):
        scene.at(0.0).add(lamp, parent=shelf)


def test_many_nodes_hang_in_time_of_their_number():
    """Each in the one before, which is not looked for among all."""
    walks = 0

    class Counted(ispm.Scene):
        @property
        def nodes(self):
            nonlocal walks
            walks += 1
            return super().nodes

    scene, node = Counted(), None
    for _ in range(100):
        node = scene.add(ispm.PointLight(), parent=node)
    assert walks == 0 and len(scene.nodes) == 100


@pytest.mark.parametrize("node", ["ball", None, ispm.Scene()])
def test_channels_move_nodes(node):
    with pytest.raises(ispm.SceneError, match=f"a channel moves a Node, not a {type(node).__name__}"):
        ispm.Channel(node, "translation", [0.0, 1.0], np.zeros((2, 3)))


def test_lights_without_a_name_are_told_by_kind_and_number(gpu):
    with pytest.raises(ispm.SceneError, match=r"^SpotLight without a name: outer_angle, in radians, must be"):
        ispm.SpotLight(outer_angle=40)
    with pytest.raises(ispm.SceneError, match=r"^light 'sun': intensity must be 3 numbers"):
        ispm.DirectionalLight(5, name="sun")
    scene = ispm.builtin("cornell-box")
    scene.add(ispm.PointLight())
    wrong, named = scene.add(ispm.PointLight()), scene.add(ispm.PointLight(), name="lamp")
    wrong.light.range = -1.0
    with Renderer(scene, SMALL, gpu=gpu) as renderer:
        with pytest.raises(ispm.SceneError, match=r"^PointLight 2 without a name: range must be"):
            renderer.render()
        wrong.light.range, named.light.intensity = 1.0, (1.0, -1.0, 1.0)
        with pytest.raises(ispm.SceneError, match=r"^light 'lamp': intensity must be"):
            renderer.render()


def flat(name, count, points=((0, 0, 0), (1, 1, 1), (2, 2, 2))):
    return ispm.Mesh(np.array(points), np.tile([0, 1, 2], (count, 1)), name=name)


def test_meshes_of_nothing_but_lines_and_points_are_told(gpu):
    scene = ispm.builtin("cornell-box")
    with Renderer(scene, SMALL, gpu=gpu) as renderer:
        renderer.render()
        scene.add(flat("wire", 5000))
        with pytest.warns(ispm.SceneWarning, match="^mesh 'wire': of 5,000 triangles, none has an area"):
            renderer.render()
        scene.add(flat("point", 3, [(0.1, 0.2, 0.3)] * 3))
        with pytest.warns(ispm.SceneWarning, match="^mesh 'wire' and 1 other: of 5,003 triangles, none"):
            renderer.render()


@pytest.mark.filterwarnings("error::ispm.SceneWarning")
def test_cameras_that_see_nothing_are_told(gpu):
    scene, away = ispm.builtin("cornell-box"), ispm.Camera.look_at((0, 0, 9), (0, 0, 10))
    with Renderer(scene, SMALL, away, gpu=gpu) as renderer:
        with pytest.raises(ispm.SceneWarning, match="the camera sees nothing, so the picture is empty"):
            renderer.render()
        renderer.camera = None
        renderer.render()
    glass = ispm.Scene()  # which nothing lights the pixels of, but which is there
    glass.add(box((-1, -1, -1), (1, 1, 1)), material=ispm.Material(transmission=1.0, roughness=0.0))
    glass.add(ispm.PointLight(), translation=(0, 0, 5))
    with Renderer(glass, SMALL, ispm.Camera.look_at((0, 0, 3), (0, 0, 0)), gpu=gpu) as renderer:
        renderer.render()


@pytest.mark.parametrize(("double_sided", "said"), [(False, "shows its back"), (True, "")])
def test_backs_that_are_not_drawn_are_told(gpu, recwarn, double_sided, said):
    scene = ispm.Scene()
    sheet = ispm.Mesh([[-9, -9, 0], [9, -9, 0], [0, 9, 0]], [[0, 1, 2]])
    scene.add(sheet, material=ispm.Material(double_sided=double_sided))
    scene.add(ispm.PointLight(), translation=(0, 0, -2))
    with Renderer(scene, SMALL, ispm.Camera.look_at((0, 0, -5), (0, 0, 0)), gpu=gpu) as renderer:
        renderer.render()
    lines = [str(each.message) for each in recwarn if "sees nothing" in str(each.message)]
    assert len(lines) == (not double_sided) and all(said in line for line in lines)


def test_one_triangle_with_an_area_is_enough():
    points = np.array([(0, 0, 0), (1, 1, 1), (2, 2, 2), (0, 1e-5, 0)])
    lines = np.tile([0, 1, 2], (9000, 1))
    several = [
        ispm.Mesh(points, np.concatenate([lines, [[0, 1, 3]], lines])),
        ispm.Mesh(points * 1e-9, [[0, 1, 3]]),  # small, not flat
    ]
    assert without_area(pack_geometry(several)) == ""
    assert "2 others" in without_area(pack_geometry([flat("a", 1), flat("b", 2), *several, flat("c", 3)]))


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("a.png", {"layers": ["full"]}, "layers: a .png holds one picture"),
        ("a.npy", {"layers": ["full"]}, "layers: a .npy holds one picture"),
        ("a.exr", {"layers": []}, "is not a list of names"),
        ("a.exr", {"layers": "full"}, "is not a list of names"),
        ("a.exr", {"show": "direct"}, r"show: choose what a .exr holds with layers, as layers=\['direct'\]"),
        ("a.npz", {"show": "direct"}, "show: choose what a .npz holds with layers"),
        ("a.npz", {"float32": True}, "float32: is for .exr, not '.npz'"),
        ("a.png", {"float32": True}, "float32: is for .exr, not '.png'"),
        ("a.exr", {"bits": 16}, "bits: 16 is not possible in a .exr"),
        ("a\0b.png", {}, r"'.*a\\x00b.png': no name holds a NUL; give another one"),
    ],
)
def test_files_refuse_what_they_cannot_hold(gpu, tmp_path, name, options, said):
    with Renderer(ispm.builtin("cornell-box"), SMALL, gpu=gpu) as renderer:
        frame = renderer.render()
    with pytest.raises(ispm.IspmError, match=said):
        frame.save(tmp_path / name, **options)
    with pytest.raises(TypeError, match="save takes no 'layer'; did you mean 'layers'"):
        frame.save(tmp_path / "a.png", layer="full")
    assert not list(tmp_path.iterdir())


def test_no_path_holds_a_nul(tmp_path):
    scene = ispm.builtin("cornell-box")
    for write in (lambda path: ispm.save(scene, path), lambda path: require_writable(path)):
        with pytest.raises(ispm.OutputError, match="no name holds a NUL"):
            write(str(tmp_path / "a\0b.glb"))
    for read in (ispm.load, ispm.Texture, ispm.read_names):
        with pytest.raises(ispm.IspmError, match="there is no such file"):
            read(str(tmp_path / "a\0.exr" if read is ispm.read_names else "a\0.glb"))


def test_lights_take_no_material():
    with pytest.raises(ispm.SceneError, match="a PointLight takes no material"):
        ispm.Scene().add(ispm.PointLight(), material=ispm.Material())


def test_textures_show_what_they_are_given(gpu):
    """Other pixels, and with `touch` those edited in place, in the picture and in the light that it sends."""
    texture = ispm.Texture(np.ones((4, 4, 3)))
    scene = ispm.Scene()
    material = lambert((1.0, 1.0, 1.0))
    material.base_color_texture = texture
    scene.add(box((-1, -1, -1), (1, 1, 1)), material=material)
    scene.add(ispm.PointLight((100, 100, 100)), translation=(0, 0, 5))
    camera = ispm.Camera.look_at((0, 0, 3), (0, 0, 0))
    with Renderer(scene, SMALL, camera, gpu=gpu) as renderer:
        assert renderer.render().albedo.max() == 1.0
        texture.pixels = np.zeros((4, 4, 3))
        assert renderer.render().albedo.max() == 0.0
        texture.pixels[...] = 255
        texture.touch()
        frame = renderer.render()
        assert frame.albedo.max() == 1.0 and frame.direct.max() > 0.0


def test_a_renderer_at_work_refuses_another_thread(gpu):
    found = []

    def work():
        try:
            with gpu.frame():
                pass
        except ispm.IspmError as error:
            found.append(str(error))

    with gpu.frame():
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
    assert found == ["this renderer is at work in another thread; give each thread one of its own"]


def _render(queue):
    try:
        ispm.render("cornell-box", SMALL)
    except ispm.AdapterError as error:
        queue.put(str(error))
    else:
        queue.put("rendered")


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="the system does not fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_process_is_told_to_be_spawned(gpu):
    gpu.frame()
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=_render, args=(queue,))
    child.start()
    assert "get_context('spawn')" in queue.get(timeout=60)
    child.join()


def test_render_tells_the_faults_of_files(tmp_path):
    (tmp_path / "a.obj").write_text("mtllib missing.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.warns(ispm.SceneWarning, match="missing.mtl"):
        ispm.render(tmp_path / "a.obj", SMALL)
