"""Lamps with a surface: what they are, and the meshes that they are packed as."""

import math

import numpy as np
import pytest

from ispm import (
    DiskLight,
    Material,
    Node,
    Part,
    PointLight,
    RectLight,
    Scene,
    SceneError,
    SphereLight,
    shapes,
)
from ispm.optics.records import MATERIAL_DOUBLE_SIDED
from ispm.scene.directions import even_directions
from ispm.scene.lamp import lamp_mesh
from ispm.scene.packed import Packed, pack, to_world

LAMPS = {
    "rect": RectLight((3.0, 2.0, 1.0), width=2.0, height=0.5),
    "both ways": RectLight((3.0, 2.0, 1.0), width=0.1, height=0.3, two_sided=True),
    "disk": DiskLight((3.0, 2.0, 1.0), radius=0.7),
    "sphere": SphereLight((3.0, 2.0, 1.0), radius=0.25),
}


def corners_of_instance(packed: Packed, index: int = 0) -> np.ndarray:
    """(T, 3, 3) float64 corners of an instance's triangles, world space."""
    row = packed.instances[index]
    first, count = int(row["first_index"]), 3 * int(row["triangle_count"])
    points = packed.geometry.vertices["position"][packed.geometry.indices[first : first + count]]
    matrix = to_world(row).astype(np.float64)
    return (points @ matrix[:, :3].T + matrix[:, 3]).reshape(-1, 3, 3)


def areas(corners: np.ndarray) -> np.ndarray:
    """(T, 3) normals of triangles, as long as these are large."""
    return 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


@pytest.mark.parametrize("lamp", LAMPS.values(), ids=LAMPS)
def test_a_lamp_sends_out_the_lumens_it_is_made_of(lamp):
    others = {name: getattr(lamp, name) for name in (*lamp.SIZES, "two_sided") if hasattr(lamp, name)}
    made = type(lamp).from_lumens((800.0, 400.0, 0.0), **others)
    assert made.lumens == pytest.approx((800.0, 400.0, 0.0), rel=1e-12)
    assert made == type(lamp)(made.intensity, **others)
    # Lambert: pi times the radiance leaves each square metre
    assert lamp.lumens == pytest.approx(math.pi * lamp.area * np.array(lamp.intensity), rel=1e-12)


def test_the_area_is_that_of_the_shape():
    assert RectLight(width=2.0, height=3.0).area == 6.0
    assert RectLight(width=2.0, height=3.0, two_sided=True).area == 12.0
    assert DiskLight(radius=2.0).area == pytest.approx(4.0 * math.pi)
    assert SphereLight(radius=2.0).area == pytest.approx(16.0 * math.pi)


@pytest.mark.parametrize(
    "make, words",
    [
        (lambda: RectLight(width=0.0), "width, in metres, must be a number"),
        (lambda: RectLight(height=-1.0), "height, in metres"),
        (lambda: DiskLight(radius=math.inf), "radius, in metres"),
        (lambda: SphereLight(radius=math.nan, name="moon"), "light 'moon': radius"),
        (lambda: SphereLight((1.0, -1.0, 1.0)), "intensity must be 3 numbers"),
        (lambda: RectLight(two_sided="yes"), "two_sided"),
        (lambda: DiskLight.from_lumens((1.0, math.nan, 1.0)), "lumens must be 3 numbers"),
        (lambda: DiskLight.from_lumens(800.0), "lumens must be 3 numbers"),
        (lambda: RectLight.from_lumens((1e30,) * 3), "intensity must be 3 numbers"),
    ],
)
def test_what_makes_no_lamp_is_refused_in_one_line(make, words):
    with pytest.raises(SceneError, match=words) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_misspelt_names_are_told():
    with pytest.raises(TypeError, match="radius"):
        SphereLight(radios=1.0)
    with pytest.raises(TypeError, match="width"):
        RectLight.from_lumens((1.0, 1.0, 1.0), widht=2.0)
    with pytest.raises(AttributeError, match="no 'size'"):
        DiskLight().size = 3.0


def test_a_lamp_is_shown_as_the_code_that_makes_it():
    assert repr(RectLight((1, 2, 3), width=0.5)) == "RectLight(intensity=(1, 2, 3), width=0.5)"
    assert repr(SphereLight()) == "SphereLight()"


@pytest.mark.parametrize("lamp", LAMPS.values(), ids=LAMPS)
def test_a_lamp_is_packed_as_a_black_mesh_of_its_area_that_emits(lamp):
    scene = Scene()
    scene.add(lamp, name="lamp")
    packed = pack(scene)
    assert len(packed.lights) == 0 and len(packed.instances) == 1 and packed.glows
    # float32 rounds each coordinate by 6e-8 of it, so areas by less than 1e-6
    whole = lamp.area / (2.0 if lamp.shines_both_ways else 1.0)
    assert packed.surface_area() == pytest.approx(whole, rel=1e-6)
    material = packed.materials[0]
    assert material["emission"].tolist() == [3.0, 2.0, 1.0]
    assert material["base_color"].tolist() == [0.0, 0.0, 0.0, 1.0] and material["specular"] == 0.0
    assert bool(material["flags"] & MATERIAL_DOUBLE_SIDED) == lamp.shines_both_ways
    assert [(c.name, c.node, c.part) for c in packed.names] == [("lamp", 0, 0)]


@pytest.mark.parametrize("lamp", [RectLight(width=2.0, height=0.5), DiskLight()], ids=["rect", "disk"])
@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (2.0, 0.5, 3.0), (-1.0, 1.0, 1.0), (1.0, 1.0, -1.0)])
def test_flat_lamps_shine_where_their_node_looks(lamp, scale):
    """Fronts are counter-clockwise; a node that mirrors turns what is clockwise to the front (glTF 2.0)."""
    scene = Scene()
    node = scene.add(lamp, translation=(1.0, 2.0, 3.0), scale=scale).look_at((4.0, 0.0, 1.0))
    if scale[2] > 0.0:
        ahead = np.array((3.0, -2.0, -2.0)) / math.sqrt(17.0)
    else:  # the node's -Z is behind it
        ahead = -np.array((3.0, -2.0, -2.0)) / math.sqrt(17.0)
    packed = pack(scene)
    fronts = areas(corners_of_instance(packed))
    if packed.instances["flags"][0]:
        fronts = -fronts
    size = np.linalg.norm(fronts, axis=1, keepdims=True)
    np.testing.assert_allclose(fronts / size, np.tile(ahead, (len(fronts), 1)), atol=1e-5)
    assert np.linalg.norm(node.local_matrix()[:3, 0]) == pytest.approx(abs(scale[0]))
    assert float(size.sum()) == pytest.approx(lamp.area * abs(scale[0] * scale[1]), rel=1e-6)


def test_a_sphere_is_closed_and_as_large_from_all_sides_together():
    corners = lamp_mesh(SphereLight()).positions[lamp_mesh(SphereLight()).triangles].astype(float)
    fronts = areas(corners)
    assert len(corners) == 1280
    assert ((fronts * corners.mean(axis=1)).sum(axis=1) > 0.0).all()  # all look outwards
    assert np.abs(fronts.sum(axis=0)).max() < 1e-6
    shadows = 0.5 * np.abs(even_directions(4096) @ fronts.T).sum(axis=1)
    # Cauchy: a convex body's mean shadow is a quarter of its surface, here 4 pi, to the points' evenness
    assert shadows.mean() == pytest.approx(math.pi, rel=1e-4)
    assert np.abs(shadows / math.pi - 1.0).max() < 0.01


def two_lamps() -> Scene:
    scene = Scene()
    scene.add(shapes.box(), material=Material(roughness=0.4), name="box")
    scene.add(RectLight(width=2.0), name="one", translation=(0.0, 2.0, 0.0))
    scene.add(RectLight((2.0, 2.0, 2.0), height=0.1), name="two", translation=(0.0, 3.0, 0.0))
    scene.add(PointLight(), name="point")
    return scene


def test_lamps_of_a_kind_share_a_mesh_across_scenes():
    first, second = pack(two_lamps()), pack(two_lamps())
    assert len(first.geometry.ranges) == 2 and len(first.instances) == 3
    assert first.geometry.ranges[1].source is second.geometry.ranges[1].source
    assert len(first.lights) == 1


def test_what_changes_of_a_lamp_is_packed_again_and_nothing_else():
    scene = two_lamps()
    packed = pack(scene)
    assert pack(scene, packed) is packed
    lamp = scene["one"].light

    lamp.intensity = (5.0, 6.0, 7.0)
    brighter = pack(scene, packed)
    assert brighter.placed is packed.placed and brighter.lit is packed.lit
    assert brighter.materials["emission"].tolist() == [[0.0] * 3, [5.0, 6.0, 7.0], [2.0] * 3]

    lamp.width = 4.0
    wider = pack(scene, brighter)
    assert wider.looks is brighter.looks and wider.geometry is packed.geometry
    assert wider.surface_area() - packed.surface_area() == pytest.approx(2.0, rel=1e-5)

    scene["one"].translation = (0.0, 1.0, 0.0)
    moved = pack(scene, wider)
    assert (
        moved.looks is wider.looks and moved.geometry is packed.geometry and moved.placed is not wider.placed
    )
    assert pack(scene, moved) is moved


def test_a_lamp_given_to_several_nodes_shows_in_each():
    scene, lamp = Scene(), SphereLight()
    for name in ("left", "right"):
        scene.add(lamp, name=name)
    packed = pack(scene)
    assert [copy.name for copy in packed.names] == ["left", "right"]
    lamp.intensity = (0.0, 9.0, 0.0)
    assert pack(scene, packed).materials["emission"].tolist() == [[0.0, 9.0, 0.0]]


def test_a_lamp_beside_parts_is_placed_once_behind_them():
    node = Node("lamp", parts=[Part(shapes.box(), Material())], light=DiskLight(name="shade"))
    node.instances = np.tile(np.eye(4), (3, 1, 1))
    node.instances[:, 0, 3] = 0.0, 2.0, 4.0
    packed = pack(Scene([node, Node("next", parts=[Part(shapes.box(), Material())])]))
    assert [(c.node, c.part, c.copy) for c in packed.names] == [
        (0, 0, 0),
        (0, 0, 1),
        (0, 0, 2),
        (0, 1, 0),
        (1, 0, 0),
    ]
    assert packed.names.materials[packed.names[3].material] == "shade"
    places = np.empty((5, 3))
    places[packed.ids] = to_world(packed.instances)[:, :, 3]
    assert places[:, 0].tolist() == [0.0, 2.0, 4.0, 0.0, 0.0]


def test_a_lamp_spoilt_later_is_named_when_it_is_packed():
    scene = two_lamps()
    scene["two"].light.height = math.nan
    with pytest.raises(SceneError, match="light 'two': height, in metres"):
        pack(scene)
    scene["two"].light = "bright"
    with pytest.raises(SceneError, match="node 'two': light must be a"):
        pack(scene)


def test_scenes_of_lamps_count_them_as_lights():
    scene = two_lamps()
    assert [node.name for node in scene.lights] == ["one", "two", "point"]
    assert repr(scene) == "<Scene '': 12 triangles, 3 lights, 0 cameras>"
    with pytest.raises(SceneError, match="RectLight takes no material"):
        scene.add(RectLight(), material=Material())
