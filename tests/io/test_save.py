"""Scenes that are saved load back equal."""

import json
import math
import warnings
from pathlib import Path

import numpy as np
import pytest
from alike import assert_alike, assert_meshes_alike
from assets import assets
from hypothesis import given, settings
from hypothesis import strategies as st

import ispm
from ispm.errors import OutputError, SceneError, SceneWarning
from ispm.io.gltf_image import uv_rows
from ispm.io.gltf_instances import PLACING, instance_attributes, rotation_matrices
from ispm.io.gltf_schema_material import TextureTransform
from ispm.io.gltf_write_material import split, transform
from ispm.io.load import load
from ispm.io.save import save
from ispm.library.builtin import BUILTINS, builtin
from ispm.library.shapes import box, icosphere
from ispm.scene.animation import Animation, Channel
from ispm.scene.camera import Camera, look_at_pose
from ispm.scene.environment import Environment
from ispm.scene.light import DirectionalLight, DiskLight, PointLight, RectLight, SphereLight, SpotLight
from ispm.scene.material import AlphaMode, Material, Texture, TextureUse, Wrap
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Node, Part, Scene

ENDINGS = ("glb", "gltf")


def asset_names():
    """The scenes among the assets; one that says so where there are none."""
    try:
        folder = assets() / "scenes"
    except pytest.skip.Exception:
        return ["no assets"]
    found = sorted(f for f in folder.rglob("*.gl*") if f.suffix in (".glb", ".gltf"))
    return [str(f.relative_to(folder)) for f in found]


def files_in(folder):
    return {f.relative_to(folder): f.read_bytes() for f in folder.rglob("*") if f.is_file()}


def round_trip(scene, folder, ending):
    """The scene as it loads back; what is saved a second time has the same bytes."""
    path = save(scene, folder / f"room.{ending}")
    first, back = files_in(folder), load(path)
    save(back, path)
    again = files_in(folder)
    assert first.keys() == again.keys() and not [name for name in first if first[name] != again[name]]
    lost = [line for line in back.warnings if "BLEND" not in line and "matrix is zero" not in line]
    assert lost == []
    return back


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("name", BUILTINS)
def test_a_built_in_scene_loads_back_equal(tmp_path, name, ending):
    scene = builtin(name)
    scene.name = scene.name or "room"
    assert_alike(scene, round_trip(scene, tmp_path, ending))


@pytest.mark.parametrize("name", asset_names())
def test_an_asset_loads_back_equal(tmp_path, name):
    try:
        scene = load(assets() / "scenes" / name)
    except SceneError as error:
        pytest.skip(f"cannot be loaded: {error}")
    for ending in ENDINGS:
        (tmp_path / ending).mkdir()
        assert_alike(scene, round_trip(scene, tmp_path / ending, ending))


fractions = st.floats(0.0, 1.0)
colors = st.tuples(fractions, fractions, fractions)
bright = st.tuples(*[st.just(0.0) | st.floats(1e-290, 1e9)] * 3)  # smaller doubles have fewer digits
names = st.text(max_size=5)
metres = st.floats(-1e6, 1e6)
places = st.tuples(metres, metres, metres)


@st.composite
def meshes(draw):
    random = np.random.default_rng(draw(st.integers(0, 1000)))
    count = draw(st.integers(3, 12))
    extra = {
        name: random.random((count, width), np.float32)
        for name, width in (("normals", 3), ("tangents", 4), ("uv0", 2), ("uv1", 2), ("colors", 4))
        if name == "uv0" or draw(st.booleans())
    }
    triangles = random.integers(0, count, (draw(st.integers(0, 6)), 3))
    return Mesh(random.normal(size=(count, 3)), triangles, **extra, name=draw(names))


@st.composite
def textures(draw, srgb):
    random = np.random.default_rng(draw(st.integers(0, 1000)))
    shape = draw(st.integers(1, 4)), draw(st.integers(1, 4)), 4
    pixels = random.integers(0, 256, shape, np.uint8)
    wraps = [draw(st.sampled_from(Wrap)) for _ in range(2)]
    made = Texture(pixels, srgb, *wraps, draw(st.booleans()), draw(st.booleans()), name=f"t{random.random()}")
    turn = draw(st.sampled_from([0.0, 0.5, -math.pi / 2, 2.25]))
    size = st.floats(0.1, 8.0)
    rows = uv_rows(TextureTransform(draw(st.tuples(size, size)), turn, draw(st.tuples(size, size))))
    return TextureUse(made, 0, rows)


@st.composite
def materials(draw):
    slot = {srgb: st.none() | textures(srgb) for srgb in (True, False)}
    normal = draw(slot[False])
    return Material(
        draw(colors | st.tuples(fractions, fractions, fractions, fractions)),
        *draw(st.tuples(fractions, fractions, fractions)),
        specular_color=draw(colors),
        ior=draw(st.floats(1.0, 3.0)),
        emission=draw(colors | bright),
        alpha_mode=draw(st.sampled_from(AlphaMode)),
        alpha_cutoff=draw(fractions),
        double_sided=draw(st.booleans()),
        unlit=draw(st.booleans()),
        normal_texture=normal,
        normal_scale=draw(st.floats(-2.0, 2.0)) if normal else 1.0,
        base_color_texture=draw(slot[True]),
        metallic_roughness_texture=draw(slot[False]),
        emission_texture=draw(slot[True]),
        sheen_color=draw(colors),
        sheen_roughness=draw(fractions),
        sheen_color_texture=draw(slot[True]),
        sheen_roughness_texture=draw(slot[True]),
        anisotropy=draw(fractions),
        anisotropy_rotation=draw(st.floats(-6.0, 6.0)),
        anisotropy_texture=draw(slot[False]),
        diffuse_transmission=draw(fractions),
        diffuse_transmission_color=draw(colors),
        diffuse_transmission_texture=draw(slot[True]),
        diffuse_transmission_color_texture=draw(slot[True]),
        dispersion=draw(st.floats(0.0, 20.0)),
        specular_texture=draw(slot[True]),
        specular_color_texture=draw(slot[True]),
        name=draw(names),
    )


cameras = st.builds(
    Camera,
    st.floats(0.1, 3.0),
    st.none() | st.floats(0.1, 1e3),
    st.none()
    | st.integers(0, 9).map(lambda seed: look_at_pose(*np.random.default_rng(seed).normal(size=(2, 3)))),
    st.none() | st.floats(0.1, 10.0),
    st.tuples(*[st.floats(-2.0, 2.0)] * 2),
    names,
)
points = st.builds(PointLight, bright, st.just(math.inf) | st.floats(0.1, 1e6), names)


@st.composite
def scenes(draw):
    shapes = draw(st.lists(meshes(), min_size=1, max_size=3))
    coats = draw(st.lists(materials(), min_size=1, max_size=2))
    parts = st.builds(Part, st.sampled_from(shapes), st.sampled_from(coats))
    nodes = []
    for _ in range(draw(st.integers(1, 4))):
        node = Node(draw(names), draw(places), (0.0, 0.6, 0.0, 0.8), draw(places))
        if draw(st.booleans()):
            node.matrix = np.vstack(
                [np.reshape(draw(st.lists(metres, min_size=12, max_size=12)), (3, 4)), [0, 0, 0, 1]]
            )
        node.parts = draw(st.lists(parts, max_size=2))
        node.camera, node.light = draw(st.none() | cameras), draw(st.none() | points)
        if nodes and draw(st.booleans()):
            draw(st.sampled_from(nodes)).children.append(node)
        nodes.append(node)
    held = {id(child) for node in nodes for child in node.children}
    scene = Scene([node for node in nodes if id(node) not in held], name="random")
    free = [node for node in nodes if node.matrix is None]
    if free:
        scene.animations = [Animation([channel(draw(st.sampled_from(free)))], draw(names))]
    return scene


def channel(node):
    times = np.array([0.0, 0.1, 2.5], np.float32)
    return Channel(
        node, "scale", times, np.random.default_rng(3).random((3, 3, 3), np.float32), "CUBICSPLINE"
    )


@pytest.mark.parametrize("ending", ENDINGS)
@settings(max_examples=25, deadline=None)
@given(scene=scenes())
def test_a_random_scene_loads_back_equal(tmp_path_factory, ending, scene):
    folder = tmp_path_factory.mktemp("saved")
    mesh_names(scene)
    assert_alike(scene, round_trip(scene, folder, ending))


def mesh_names(scene):
    """One name for all meshes: glTF has one for all parts of a node, and the scene may mix them."""
    for node in scene.nodes:
        for part in node.parts:
            part.mesh.name = "mesh"


@pytest.mark.parametrize("values", [(5.0, 5.0, 5.0), (0.3, 0.7, 1e-9), (1e9, 1 / 3, 0.1), (0.0, 0.0, 0.0)])
def test_a_color_is_split_exactly(values):
    color, strength = split(values)
    assert tuple(strength * c for c in color) == values
    assert max(color) <= 1.0


@given(bright)
def test_any_color_is_split_exactly(values):
    color, strength = split(values)
    assert tuple(strength * c for c in color) == values
    assert max(color) <= 1.0


@settings(max_examples=100)
@given(
    st.floats(-3.2, 3.2).map(lambda x: round(x, 3)), places,
    st.tuples(*[st.floats(0.01, 100.0).map(lambda x: round(x, 3))] * 2),
)  # fmt: skip
def test_a_texture_transform_is_found_again(rotation, offset, scale):
    rows = uv_rows(TextureTransform(offset[:2], rotation, scale))
    found = transform(rows)
    made = TextureTransform(
        tuple(found.get("offset", (0.0, 0.0))),
        found.get("rotation", 0.0),
        tuple(found.get("scale", (1.0, 1.0))),
    )
    assert uv_rows(made) == rows


@pytest.mark.parametrize("ending", ENDINGS)
def test_every_kind_of_light_and_glass_loads_back_equal(tmp_path, ending):
    scene = Scene(name="lights")
    scene.add(PointLight((3.0, 2.0, 1.0), 7.0, "p"), name="point")
    scene.add(SpotLight((0.1, 1e6, 2.0), 9.5, 0.2, 0.7, "s"), name="spot")
    scene.add(DirectionalLight((1.0, 1.0, 1.0), "d"), name="sun")
    glass = Material(
        roughness=0.0, transmission=0.9, thickness=0.1, attenuation_color=(0.2, 0.5, 0.9),
        attenuation_distance=0.3, ior=1.33, transmission_texture=grey_texture(), name="glass",
    )  # fmt: skip
    varnish = Material(
        clearcoat=0.7, clearcoat_roughness=0.2, clearcoat_normal_scale=0.5, clearcoat_texture=grey_texture(),
        clearcoat_roughness_texture=grey_texture(), clearcoat_normal_texture=grey_texture(), name="varnish",
    )  # fmt: skip
    mesh = box((-1, -1, -1), (1, 1, 1), "cube")
    mesh.uv0 = np.zeros((8, 2), np.float32)
    scene.add(mesh, material=glass)
    scene.add(mesh, material=varnish)
    scene.add(mesh, material=Material(clearcoat_roughness=0.2, name="what no coat has"))
    back = round_trip(scene, tmp_path, ending)
    assert_alike(scene, back)


@pytest.mark.parametrize("ending", ENDINGS)
def test_instances_load_back_equal_and_mean_the_same_to_others(tmp_path, ending):
    random, scene = np.random.default_rng(4), Scene(name="wood")
    node = scene.add(box((0, 0, 0), (1, 1, 1), "tree"))
    turns = np.linalg.qr(random.normal(size=(50, 3, 3)))[0]  # half of them mirror
    node.instances = np.tile(np.eye(4, dtype=np.float32), (50, 1, 1))
    node.instances[:, :3, :3] = turns * random.uniform(0.1, 3.0, (50, 1, 3))
    node.instances[:, :3, 3] = random.normal(size=(50, 3))
    assert_alike(scene, round_trip(scene, tmp_path, ending))
    places = {k: v for k, v in instance_attributes(node.instances).items() if k in PLACING}
    rebuilt = rotation_matrices(places["ROTATION"].astype(np.float32)) * places["SCALE"][:, None, :]
    assert np.abs(rebuilt - node.instances[:, :3, :3]).max() < 3e-6  # of numbers up to 3, in float32


def grey_texture(srgb=False, name="grey"):
    return Texture(np.full((2, 2, 4), 99, np.uint8), srgb, name=name)


def test_a_shared_mesh_is_stored_once_and_stays_shared(tmp_path):
    ball, scene = icosphere(1.0, 8, "ball"), Scene(name="balls")
    for i in range(20):
        scene.add(ball, material=Material(name=f"m{i % 2}"), translation=(3.0 * i, 0.0, 0.0))
    path = save(scene, tmp_path / "balls.glb")
    assert path.stat().st_size < 1.2 * (ball.positions.nbytes * 2 + ball.triangles.nbytes / 2) + 10_000
    assert len({id(node.parts[0].mesh) for node in load(path).nodes}) == 1


def test_parts_without_triangles_and_loose_vertices_are_left_out(tmp_path):
    loose = Mesh(np.eye(3).repeat(2, axis=0), [[0, 2, 4]])
    scene = Scene(
        [Node(parts=[Part(loose, Material()), Part(Mesh(np.eye(3), np.zeros((0, 3))), Material())])]
    )
    (part,) = load(save(scene, tmp_path / "a.glb")).nodes[0].parts
    assert_meshes_alike(loose, part.mesh)
    assert len(part.mesh.positions) == 3


def test_a_node_in_two_places_moves_in_both(tmp_path):
    ball = Node("ball", parts=[Part(box((0, 0, 0), (1, 1, 1)), Material())])
    scene = Scene([Node("left", children=[ball]), Node("right", children=[ball])])
    scene.animations = [Animation([channel(ball)])]
    back = load(save(scene, tmp_path / "a.glb"))
    assert [node.name for node in back.nodes] == ["left", "ball", "right", "ball"]
    assert {id(c.node) for c in back.animations[0].channels} == {id(back.nodes[1]), id(back.nodes[3])}


def test_a_texture_in_the_other_encoding_is_rounded_with_a_warning(tmp_path):
    ramp = np.repeat(np.arange(256, dtype=np.uint8), 4).reshape(16, 16, 4)
    mesh = box((0, 0, 0), (1, 1, 1))
    mesh.uv0 = np.zeros((8, 2), np.float32)
    scene = Scene(name="ramp")
    scene.add(mesh, material=Material(base_color_texture=Texture(ramp, srgb=False, name="ramp")))
    with pytest.warns(SceneWarning, match="texture 'ramp' is written as sRGB colors"):
        save(scene, tmp_path / "a.glb")
    use = load(tmp_path / "a.glb").materials[0].base_color_texture
    linear = ispm.io.image.srgb_to_linear(use.texture.pixels[..., :3])
    assert np.abs(linear - ramp[..., :3] / 255.0).max() < 0.5 * 2.3 / 255.0  # sRGB's steepest step
    np.testing.assert_array_equal(use.texture.pixels[..., 3], ramp[..., 3])


def test_a_texture_whose_alpha_alone_counts_is_written_as_it_is(tmp_path):
    """Without a warning, whichever encoding its RGB has, which nothing reads."""
    pixels = np.random.default_rng(4).integers(0, 256, (3, 3, 4), np.uint8)
    for srgb in (True, False):
        scene = Scene()
        mesh = Mesh(np.eye(3), np.array([[0, 1, 2]]), uv0=np.zeros((3, 2), np.float32))
        scene.add(mesh, material=Material(specular_texture=Texture(pixels, srgb=srgb)))
        (material,) = load(save(scene, tmp_path / "room.glb")).materials
        assert (material.specular_texture.texture.pixels == pixels).all()


def test_gltf_files_lie_beside_with_names_that_need_quoting(tmp_path):
    scene = builtin("cornell-box")
    mesh = scene.nodes[0].parts
    path = save(scene, tmp_path / "my room 50%.gltf")
    names_ = {str(f) for f in files_in(tmp_path)}
    assert names_ == {"my room 50%.gltf", "my room 50%.bin"}
    assert load(path).triangle_count == scene.triangle_count and mesh is not None


def test_what_is_written_is_valid_in_the_eyes_of_another_reader(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    scene = builtin("cornell-box")
    read = trimesh.load(save(scene, tmp_path / "a.glb"))
    assert sum(len(g.faces) for g in read.geometry.values()) == scene.triangle_count


def test_records_say_what_the_specification_asks_for(tmp_path):
    path = save(builtin("cornell-box"), tmp_path / "a.gltf")
    text = json.loads(path.read_text())
    assert text["asset"]["version"] == "2.0"
    for mesh in text["meshes"]:
        for primitive in mesh["primitives"]:
            position = text["accessors"][primitive["attributes"]["POSITION"]]
            assert len(position["min"]) == len(position["max"]) == 3
    assert all(view["byteOffset"] % 4 == 0 for view in text["bufferViews"])
    assert text["buffers"][0]["byteLength"] == (tmp_path / "a.bin").stat().st_size
    used = set(text.get("extensionsUsed", ()))
    assert {name for m in text["materials"] for name in m.get("extensions", ())} <= used


@pytest.mark.parametrize("name", ["a.obj", "a", "a.glb.txt"])
def test_another_ending_is_refused_with_those_there_are(tmp_path, name):
    with pytest.raises(OutputError, match=rf"{name}: .*use one of \.glb, \.gltf"):
        save(Scene(), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def sheared():
    use = TextureUse(grey_texture(True), 0, ((1.0, 0.5, 0.0), (0.0, 1.0, 0.0)))
    return Part(box((0, 0, 0), (1, 1, 1)), Material(base_color_texture=use))


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Node("n", translation=(math.nan, 0.0, 0.0)), "finite"),
        (lambda: Node("n", parts=[sheared()]), "shear"),
    ],
)
def test_what_gltf_cannot_hold_is_refused_and_nothing_is_left(tmp_path, make, says):
    (tmp_path / "a.glb").write_text("old")
    with pytest.raises(SceneError, match=f"a.glb: .*{says}"):
        save(Scene([make()]), tmp_path / "a.glb")
    assert files_in(tmp_path) == {Path("a.glb"): b"old"}


def test_an_animated_matrix_is_refused(tmp_path):
    node = Node("door", matrix=np.eye(4))
    with pytest.raises(SceneError, match="node 'door' is placed by a matrix and animated"):
        save(Scene([node], [Animation([channel(node)])]), tmp_path / "a.glb")


def test_an_empty_scene_can_be_saved(tmp_path):
    for ending in ENDINGS:
        assert load(save(Scene(), tmp_path / f"a.{ending}")).nodes == []


def test_a_scene_can_be_saved_over_its_own_file(tmp_path):
    path = save(builtin("cornell-box"), tmp_path / "a.glb")
    scene = load(path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        save(scene, path)
    assert_alike(scene, load(path))


@pytest.mark.parametrize("extras", [{"ispm": 3}, {"ispm": {"aspect": -1.0}}, {"ispm": {"zoom": 1}}])
def test_extras_of_a_camera_that_make_no_sense_are_passed_over(tmp_path, extras):
    path = save(builtin("cornell-box"), tmp_path / "a.gltf")
    text = json.loads(path.read_text())
    text["cameras"][0]["extras"] = extras
    path.write_text(json.dumps(text))
    back = load(path)
    assert back.cameras and "its extras are passed over" in back.warnings[0]


def lamps():
    """A scene of all lamps with a surface: alone, two of one object, beside a mesh, below another node."""
    scene = Scene(name="lamps")
    panel = RectLight((1 / 3, 2e6, 0.0), 0.3, 1.7, True, "sky panel")
    top = scene.add(panel, name="panel", translation=(0.1, 2.0, 0.0), scale=(1.0, 2.0, 1.0))
    scene.add(panel, name="twin", translation=(1.0, 2.0, 0.0))
    scene.add(DiskLight((5.0, 4.0, 3.0), 0.1), name="disk", rotation=(0.1, 0.2, 0.3, 0.9), parent=top)
    shade = scene.add(box((0, 0, 0), (1, 1, 1)), material=Material((0.2, 0.4, 0.6)), name="shade")
    shade.light = SphereLight((0.5, 0.25, 0.125), 0.2)
    scene.add(SphereLight((0.0, 0.0, 0.0)), name="dark")
    return scene


@pytest.mark.parametrize("ending", ENDINGS)
def test_lamps_with_a_surface_load_back_equal(tmp_path, ending):
    scene = lamps()
    back = round_trip(scene, tmp_path, ending)
    assert_alike(scene, back)
    assert [type(node.light) for node in back.lights] == [type(node.light) for node in scene.lights]
    assert back["shade"].light == SphereLight((0.5, 0.25, 0.125), 0.2) and len(back["shade"].parts) == 1


def written(scene, folder):
    """The JSON of a scene's .gltf file, and its path."""
    path = save(scene, folder / "scene.gltf")
    return json.loads(path.read_text("utf-8")), path


def test_others_see_lamps_as_meshes_that_emit(tmp_path):
    """Read without the extras a lamp is a mesh of its size, with its emission."""
    scene = Scene()
    scene.add(RectLight((1e3, 500.0, 0.0), width=3.0, height=0.5), name="panel")
    record, path = written(scene, tmp_path)
    for node in record["nodes"]:
        del node["extras"]
    path.write_text(json.dumps(record), "utf-8")
    panel = load(path)["panel"]
    assert panel.light is None
    assert panel.parts[0].material.emission == (1e3, 500.0, 0.0) and not panel.parts[0].material.double_sided
    assert panel.parts[0].mesh.bounds.tolist() == [[-1.5, -0.25, 0.0], [1.5, 0.25, 0.0]]


@pytest.mark.parametrize(
    "spoilt",
    [7, {}, {"type": "cube"}, {"type": "rect", "intensity": [1, 1, 1], "width": -1.0}, {"type": "disk"},
     {"type": "sphere", "intensity": [1, 1, 1], "width": 1.0}],
)  # fmt: skip
def test_a_lamp_that_makes_no_sense_stays_a_mesh_with_a_note(tmp_path, spoilt):
    scene = Scene()
    scene.add(SphereLight(), name="globe")
    record, path = written(scene, tmp_path)
    record["nodes"][0]["extras"]["ispm_light"] = spoilt
    path.write_text(json.dumps(record), "utf-8")
    back = load(path)
    assert back["globe"].light is None and len(back["globe"].parts) == 1
    assert len(back.warnings) == 1 and "ispm_light is passed over" in back.warnings[0]


def test_a_lamp_beside_instances_is_refused_by_name(tmp_path):
    node = Node("chandelier", parts=[Part(box((0, 0, 0), (1, 1, 1)), Material())], light=DiskLight())
    node.instances = np.tile(np.eye(4), (2, 1, 1))
    with pytest.raises(SceneError, match="'chandelier' holds a lamp and instances"):
        save(Scene([node]), tmp_path / "scene.glb")


def test_an_environment_is_left_out_with_a_line(tmp_path):
    scene = Scene(environment=Environment(np.ones((2, 4, 3))))
    with pytest.warns(SceneWarning, match=r"a\.glb: the environment is not in it: glTF has none"):
        save(scene, tmp_path / "a.glb")
    assert load(tmp_path / "a.glb").environment is None
