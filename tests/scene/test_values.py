"""What Python hands over and cannot be used is refused in a line that names it."""

import math

import numpy as np
import pytest

from ispm.errors import OutputError, SceneError, SettingsError
from ispm.framing.camera import find_camera
from ispm.io.load import load
from ispm.io.named import builtin, open_named
from ispm.io.save import save
from ispm.scene import placing
from ispm.scene.animation import Animation, Channel
from ispm.scene.camera import Camera
from ispm.scene.light import DirectionalLight, PointLight, RectLight, SpotLight
from ispm.scene.material import AlphaMode, Material, Texture, TextureUse
from ispm.scene.mesh import Mesh
from ispm.scene.packed import pack
from ispm.scene.scene import Node, Part, Scene
from ispm.settings import Settings

CORNERS = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
PIXELS = np.zeros((2, 2, 4), np.uint8)
NAN, INF = math.nan, math.inf


def mesh(**others):
    return Mesh(CORNERS, [[0, 1, 2]], **others)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *[(name, value) for name in ("metallic", "roughness", "specular", "transmission", "clearcoat",
                                     "clearcoat_roughness", "sheen_roughness", "anisotropy",
                                     "diffuse_transmission")
          for value in (-0.1, 1.1, NAN, "a", None, (1.0,))],
        *[("base_color", value)
          for value in ((2, 0, 0), (-1, 0, 0), (1, 1), (1, 1, 1, NAN), 0.5, "red", None)],
        *[("emission", value) for value in ((-1, 0, 0), (INF, 0, 0), (1e13, 0, 0), 1.0)],
        *[("ior", value) for value in (NAN, -1.0, 0.5, 1e9, "glass")],
        *[("specular_color", value) for value in ((-1, 1, 1), (1e5, 1, 1), 1.0)],
        *[(name, value)
          for name in ("attenuation_color", "sheen_color", "diffuse_transmission_color")
          for value in ((3, 1, 1), (NAN, 1, 1))],
        *[("attenuation_distance", value) for value in (0.0, -1.0, NAN)],
        *[("thickness", value) for value in (-1.0, NAN, INF)],
        *[("dispersion", value) for value in (-0.1, 20.1, NAN, INF, "a", None)],
        *[("alpha_cutoff", value) for value in (-1.0, NAN)],
        *[(name, value) for name in ("normal_scale", "clearcoat_normal_scale", "anisotropy_rotation")
          for value in (NAN, 1e30)],
        *[("alpha_mode", value) for value in ("MASK", 7, None)],
        *[("double_sided", value) for value in ("yes", None)],
        *[(f"{slot}_texture", value) for slot in ("base_color", "normal") for value in ("a.png", PIXELS)],
    ],
)  # fmt: skip
def test_a_material_names_the_field_it_refuses(name, value):
    with pytest.raises(SceneError, match=f"^material 'tin': {name} must be "):
        Material(**{name: value}, name="tin")


def test_materials_at_the_ends_of_their_ranges_are_taken():
    Material((0, 0, 0, 0), 1, 0, 0, (1e4, 0, 0), 0.0, True, 1e9, (0, 0, 0), INF, (1e12, 0, 0), 1)
    assert Material(alpha_mode=1).alpha_mode is AlphaMode.MASK
    assert Material(base_color=np.ones(3, np.float32), metallic=np.float32(1.0)).casts_caustics is False


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Texture(PIXELS.tolist()), "must be a path or a numpy array, not a list"),
        (lambda: Texture("none.png"), "none.png: there is no such file"),
        (lambda: Texture(PIXELS[None]), r"or \(height, width, 1 to 4\), not \(1, 2, 2, 4\)"),
        (lambda: Texture(PIXELS[0, 0]), "shape"),
        (lambda: Texture(PIXELS[:0]), "shape"),
        (lambda: Texture(np.zeros((2, 2, 5), np.uint8)), "shape"),
        (lambda: Texture(np.full((2, 2), 255.0)), "0 to 1, not 255 to 255; divide them, or give uint8"),
        (lambda: Texture(np.full((2, 2, 2), NAN)), "0 to 1, not nan to nan"),
        (lambda: Texture(np.zeros((2, 2), int)), "of uint8 or uint16, or floats of 0 to 1, not of int"),
        (lambda: Texture(np.zeros((2, 2), object)), "not of object"),
        (lambda: Material(normal_texture="a.png"), r"not a str; write Texture\('a.png'\)"),
        (lambda: Material(clearcoat=1.0, transmission=0.5), "a clear coat over glass is not supported"),
        (lambda: Material(anisotropy=1.0, transmission=0.5), "anisotropy of glass is not supported"),
        (lambda: Material(diffuse_transmission=1.0, transmission=0.5), "diffuse transmission of glass"),
        (lambda: Material(normal_texture=PIXELS), r"not a ndarray; write Texture\(...\)"),
        (lambda: Texture(PIXELS, wrap_u="REPEAT"), "wrap_u must be one of Wrap.REPEAT"),
        (lambda: TextureUse(PIXELS), "takes a Texture, not a ndarray"),
        (lambda: TextureUse(Texture(PIXELS), uv_set=2), "uv_set must be"),
        (lambda: TextureUse(Texture(PIXELS), transform=((NAN, 0, 0), (0, 1, 0))), "transform must be"),
        (lambda: mesh(normals=[[NAN, 0, 0]] * 3), r"^mesh '': normals must be .*\[0, 0\] is nan"),
        (lambda: mesh(uv0=[[0, 0], [INF, 0], [0, 0]]), r"uv0 must be .*\[1, 0\] is inf"),
        (lambda: mesh(colors=[[5, 0, 0, 1]] * 3), r"colors must be .*to 1.00196, but \[0, 0\] is 5"),
        (lambda: mesh(colors=[[1, 0, 0]] * 3), "colors must have shape"),
        (lambda: mesh(tangents=[[NAN, 0, 0, 1]] * 3), "tangents must be"),
        (lambda: Mesh("abc", [[0, 1, 2]]), "positions must be numbers of shape"),
        (lambda: Mesh([[0, 1], [1]], [[0, 1, 2]]), "positions must be numbers of shape"),
        (lambda: Mesh([[0, 1]] * 3, [[0, 1, 2]]), r"positions must have shape \(n, 3\), not \(3, 2\)"),
        (lambda: Mesh(np.array(CORNERS) * 1e300, [[0, 1, 2]]), "positions must be"),
        (lambda: Mesh(CORNERS, [[0, 1, -1]]), "index -1 points before the first vertex"),
        (lambda: Mesh(CORNERS, [[0, 1, 2**32]]), "index 4294967296 points past the last of 3 vertices"),
        (lambda: Mesh(CORNERS, [[0, 1, 0.5]]), "triangles must be whole numbers"),
        (lambda: Mesh(CORNERS, [[0, 1, NAN]]), "triangles must be"),
        (lambda: PointLight((NAN, 1, 1), name="sun"), "^light 'sun': intensity must be 3 numbers of 0 to"),
        (lambda: PointLight(100.0), "intensity must be 3 numbers"),
        (lambda: DirectionalLight((-1, 0, 0)), "intensity must be"),
        (lambda: DirectionalLight((1e30, 0, 0)), "intensity must be"),
        *[(lambda r=r: PointLight(range=r), "range must be") for r in (0.0, -1.0, NAN, "far")],
        (lambda: SpotLight(outer_angle=45.0), "in radians, must be a number of 0 to 1.5708, not 45.0"),
        (lambda: SpotLight(inner_angle=0.9), "inner_angle 0.9 must be below outer_angle 0.785398"),
        (lambda: Scene().add("box"), "cannot add a str"),
        (lambda: Scene().add(mesh(), material="red"), "a Mesh and a Material, not a Mesh and a str"),
        (lambda: Scene().add(mesh(), parent="hall"), "parent must be a Node"),
        (lambda: Scene().add(mesh(), translation=(1, 2)), "translation must be 3 numbers"),
        (lambda: Scene().at(NAN), "time, in seconds, must be a number"),
        (lambda: Animation(3), "channels must be a list"),
        (lambda: Channel(Node("n"), "turn", [0], [[0, 0, 0]]), r"^channel of node 'n': path 'turn' is not"),
        (lambda: Channel(Node(), "scale", [1, 0], [[0, 0, 0]] * 2), "times must increase"),
        (lambda: Channel(Node(), "scale", [0], [[0, 0, 0, 1]]), r"values must have shape \(1, 3\)"),
        (lambda: load(3), "a int is not the path of a file"),
        (lambda: load(""), "'' is not the path of a file"),
        (lambda: load("a" * 5000 + ".glb"), "cannot be read: File name too long"),
        (lambda: open_named(""), "'' is no scene"),
        (lambda: open_named(mesh()), "a Mesh is no scene"),
        (lambda: builtin(3), "no built-in scene is called '3'"),
        (lambda: save(3, "a.glb"), "takes a Scene first, not a int"),
    ],
)  # fmt: skip
def test_what_cannot_be_used_is_refused_by_name(make, says):
    with pytest.raises(SceneError, match=says) as caught:
        make()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        (dict(translation=(0, NAN, 0)), "translation must be 3 numbers"),
        (dict(translation="abc"), "translation must be 3 numbers"),
        (dict(rotation=(0, 0, 0)), "rotation must be 4 numbers"),
        (dict(rotation=(0, 0, 0, 0)), "rotation must be a quaternion"),
        (dict(scale=2.0), "scale must be 3 numbers"),
        (dict(scale=(1e19, 1.0, 1.0)), "scale must be 3 numbers"),
        (dict(matrix=np.eye(3)), r"matrix must have shape \(4, 4\), not \(3, 3\)"),
        (dict(matrix=np.full((4, 4), NAN)), "matrix must be"),
        (
            dict(matrix=np.eye(4) + np.eye(4)[3:].T * np.eye(4)[:1]),
            "the last row of its matrix must be 0 0 0 1; is it transposed",
        ),
        (dict(instances=np.eye(4)), r"instances must have shape \(n, 4, 4\)"),
        (dict(instances=np.full((1, 4, 4), NAN)), "instances must be"),
        (dict(parts=[mesh()]), "parts must be a list of Part, not of Mesh"),
        (dict(parts=[Part(mesh(), None)]), "a part must be of a Mesh and a Material"),
        (dict(light="sun"), "light must be an ispm.PointLight or another light, or None, not 'sun'$"),
        (dict(camera=3), "camera must be an ispm.Camera, or None, not 3$"),
        (dict(skin=3), "skin must be an ispm.Skin, or None, not 3$"),
        (dict(children=[mesh()]), "children must be a list of Node"),
        (dict(children=None), "children must be a list of Node"),
    ],
)
def test_a_node_names_the_field_that_cannot_be_placed(tmp_path, fields, says):
    scene = Scene([Node("shelf", **{"parts": [Part(mesh(), Material())]} | fields)])
    for use in (pack, lambda s: save(s, tmp_path / "a.glb")):
        with pytest.raises(SceneError, match=f"node 'shelf': {says}"):
            use(scene)


@pytest.mark.parametrize("wanted", [None, 0, "eye"])
def test_what_is_no_camera_is_named_before_it_is_looked_through(wanted):
    with pytest.raises(SceneError, match=r"node 'shelf': camera must be an ispm.Camera, or None, not 5"):
        find_camera(Scene([Node("shelf", camera=5)]), wanted)


def test_what_is_no_skin_is_copied_to_be_refused():
    assert Scene([Node("shelf", skin=5)]).at(0.0)["shelf"].skin == 5


def test_numbers_out_of_range_are_shown_however_long_the_others_are():
    with pytest.raises(SceneError, match=r"3 numbers of 0 to 1e\+12, not \(3.1831e\+39, 0.31831, 0.31831\)$"):
        RectLight.from_lumens((1e40, 1, 1))


@pytest.mark.parametrize("roots", ["abc", 3, [None], [mesh()]])
def test_a_scene_is_made_of_nodes(roots):
    with pytest.raises(SceneError, match="scene '': roots must be a list of Node"):
        pack(Scene(roots))


def test_a_node_that_hangs_below_itself_is_refused():
    upper, lower = Node("upper"), Node("lower")
    upper.children, lower.children = [lower], [upper]
    with pytest.raises(SceneError, match="node 'upper': hangs below itself"):
        pack(Scene([upper]))


def test_nodes_of_too_many_places_are_refused_before_all_are_visited(monkeypatch):
    """Sixty of them, each twice below the next, have 2^60 places."""
    monkeypatch.setattr(placing, "_MOST_AGAIN", 10_000)
    node = Node("leaf")
    for _ in range(60):
        node = Node("twig", children=[node, node])
    scene = Scene([node])
    for use in (pack, repr, lambda s: s.nodes, lambda s: s.at_rest(), lambda s: s["none"]):
        with pytest.raises(SceneError, match=r"nodes that hang in several places multiply, .* than 10,000"):
            use(scene)


def test_nodes_that_scale_each_other_beyond_all_numbers_are_refused():
    inner = Node("inner", scale=(1e18, 1e18, 1e18), light=PointLight())
    with pytest.raises(SceneError, match="node 'inner': stands in nodes that together"):
        pack(Scene([Node(scale=(1e18, 1e18, 1e18), children=[inner])]))


def test_a_node_may_hang_in_two_places():
    shared = Node("shared", parts=[Part(mesh(), Material())])
    scene = Scene([Node("left", children=[shared]), Node("right", (2, 0, 0), children=[shared]), shared])
    assert [node.name for node in scene.nodes] == ["left", "shared", "right", "shared", "shared"]
    assert sorted(pack(scene).instances["world0"][:, 3]) == [0.0, 0.0, 2.0]


@pytest.mark.parametrize(
    "make",
    [
        *[lambda v=v: Camera(yfov=v) for v in (0.0, math.pi, NAN, "wide", None)],
        *[lambda v=v: Camera(ymag=v) for v in (0.0, INF, "a")],
        *[lambda v=v: Camera(pose=v) for v in ("a", np.eye(3), np.zeros((4, 4)), np.diag([2, 2, 2, 1]))],
        *[lambda v=v: Camera(principal=v) for v in (3, "ab", (1, NAN))],
        lambda: Camera(aspect="a"),
        lambda: Camera.look_at((0, 0), (1, 1, 1)),
        lambda: Camera.look_at((NAN, 0, 0), (1, 1, 1)),
        lambda: Camera.from_intrinsics("a", (3, 3), np.eye(4)),
        lambda: Camera.from_intrinsics(np.eye(3), 3, np.eye(4)),
        lambda: Camera.from_intrinsics(np.eye(3), (3, 3), np.eye(4), []),
    ],
)
def test_a_camera_without_sense_is_refused(make):
    with pytest.raises(SettingsError, match=r"^camera: "):
        make()


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Settings(size="x"), "size: 'x' is not 2 numbers"),
        (lambda: Settings(photnos=3), "no setting 'photnos'; did you mean 'photons'"),
        (lambda: Settings(photons=10**400), "photons: "),
    ],
)
def test_settings_name_what_they_refuse(make, says):
    with pytest.raises(SettingsError, match=says):
        make()


def test_a_path_must_be_one():
    with pytest.raises(OutputError, match="a int is not the path of a file"):
        save(Scene(), 3)


def test_arrays_set_since_are_made_into_arrays_of_their_types():
    plain = mesh()
    plain.positions, plain.uv0 = CORNERS[::-1], [[0, 0]] * 3
    plain.touch()
    packed = pack(Scene([Node(parts=[Part(plain, Material())])]))
    assert packed.geometry.vertices["position"].tolist() == CORNERS[::-1]
    assert plain.positions.dtype == np.float32


def test_materials_of_arrays_are_those_of_tuples():
    made = Material(np.array([0.5, 0.25, 1.0]), emission=[0.0, 1, 2.5])
    assert made == Material((0.5, 0.25, 1.0), emission=(0.0, 1.0, 2.5))
    made.base_color = np.float32([0.5, 0.5, 0.5])
    made.check()
    assert made.base_color == (0.5, 0.5, 0.5)
