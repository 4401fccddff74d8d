"""Meshes that deform: shapes by joints and by morph targets, against formulas written here once more."""

import math

import numpy as np
import pytest

import ispm
from ispm.errors import SceneError
from ispm.optics.records import INSTANCE_MIRRORED
from ispm.scene.packed import pack, to_world

# float32 holds coordinates of some 2 m to 2^-23 of them; sums of a few such are 1e-6 off at most.
ROUNDING = 1e-6


def strip(rows=9):
    """A strip 2 m high along y, 0.2 m wide, flat: its lower half follows joint 0, its upper joint 1, the row
    in the middle both."""
    y = np.repeat(np.linspace(0.0, 2.0, rows), 2)
    x = np.tile([-0.1, 0.1], rows)
    quads = 2 * np.arange(rows - 1)[:, None]
    triangles = np.concatenate([quads + np.array(k) for k in ([0, 1, 2], [2, 1, 3])])
    upper = np.clip((y - 0.75) / 0.5, 0.0, 1.0)
    mesh = ispm.Mesh(
        np.stack([x, y, 0 * x], axis=1), triangles, np.tile((0.0, 0.0, 1.0), (len(x), 1)), name="strip"
    )
    mesh.tangents = np.tile((1.0, 0.0, 0.0, 1.0), (len(x), 1))
    mesh.joints = np.tile([0, 1, 0, 0], (len(x), 1))
    mesh.joint_weights = np.stack([1.0 - upper, upper, 0 * x, 0 * x], axis=1)
    return mesh


def arm():
    """A scene of a strip that bends at y = 1 by the node "elbow"."""
    scene = ispm.Scene()
    node = scene.add(strip(), name="arm", translation=(7, 8, 9), scale=(3, 3, 3))
    shoulder = ispm.Node("shoulder")
    elbow = ispm.Node("elbow", translation=(0, 1, 0))
    shoulder.children.append(elbow)
    scene.roots.append(shoulder)
    bind = np.tile(np.eye(4), (2, 1, 1))
    bind[1, 1, 3] = -1.0
    node.skin = ispm.Skin([shoulder, elbow], bind, "arm")
    return scene


def world_points(packed, name="position"):
    """(V, 3) vertices of all instances in world space, and which instance each is of."""
    found = []
    for row in packed.instances:
        kept = packed.geometry.ranges[row["mesh"]]
        matrix = to_world(row).astype(np.float64)
        found.append(packed.geometry.vertices[name][kept.vertices] @ matrix[:, :3].T + matrix[:, 3])
    return np.concatenate(found)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 90.0, 150.0])
def test_a_bend_of_two_joints_is_the_linear_blend(degrees):
    """The closed form: y above the elbow turns about it, shares of both are means of both places."""
    scene, turn = arm(), math.radians(degrees)
    scene["elbow"].rotation = ispm.euler(z=turn)
    x, y, z = strip().positions.astype(np.float64).T
    share = np.clip((y - 0.75) / 0.5, 0.0, 1.0)
    turned = np.stack([
        x * math.cos(turn) - (y - 1) * math.sin(turn), 1 + x * math.sin(turn) + (y - 1) * math.cos(turn), z
    ])  # fmt: skip
    expected = ((1.0 - share) * np.stack([x, y, z]) + share * turned).T
    packed = pack(scene)
    np.testing.assert_allclose(world_points(packed), expected, atol=ROUNDING)
    np.testing.assert_allclose(scene.bounds, [expected.min(axis=0), expected.max(axis=0)], atol=ROUNDING)
    np.testing.assert_allclose(scene.bounds_of("arm"), scene.bounds)
    tangents = packed.geometry.vertices["tangent"][share == 1.0]
    np.testing.assert_allclose(tangents, [[math.cos(turn), math.sin(turn), 0, 1]] * len(tangents), atol=1e-6)


def test_normals_go_by_cofactors():
    """A joint that stretches along y by 3 tilts a normal of slope 1 to one of slope 3."""
    scene = arm()
    mesh = scene["arm"].parts[0].mesh
    mesh.normals = np.tile((0.0, math.sqrt(0.5), math.sqrt(0.5)), (len(mesh.positions), 1))
    mesh.joints = np.zeros((len(mesh.positions), 4), np.uint16)
    scene["shoulder"].scale = (1.0, 3.0, 1.0)
    found = pack(scene).geometry.vertices["normal"]
    np.testing.assert_allclose(found, np.tile([0, 1, 3] / np.sqrt(10.0), (len(found), 1)), atol=1e-6)


def test_skins_ignore_their_node_and_weights_count_by_their_sum():
    scene, plain = arm(), pack(arm())
    scene["arm"].translation = (0.0, -5.0, 0.0)
    scene["arm"].parts[0].mesh.joint_weights *= np.float32(4.0)
    np.testing.assert_array_equal(world_points(pack(scene)), world_points(plain))
    scene["arm"].parts[0].mesh.joint_weights = np.zeros_like(strip().joint_weights)
    scene["elbow"].rotation = ispm.euler(z=1.0)  # none follows it now: all follow their first joint
    np.testing.assert_allclose(world_points(pack(scene)), strip().positions, atol=ROUNDING)


def test_eight_joints_of_a_vertex_are_all_met():
    scene, random = arm(), np.random.default_rng(3)
    mesh = scene["arm"].parts[0].mesh
    joints = [ispm.Node(f"joint {k}", random.normal(size=3), random.normal(size=4)) for k in range(8)]
    scene.roots += joints
    scene["arm"].skin = ispm.Skin(joints)
    mesh.joints = np.tile(np.arange(8), (len(mesh.positions), 1))
    mesh.joint_weights = random.random((len(mesh.positions), 8))
    share = mesh.joint_weights / mesh.joint_weights.sum(axis=1, keepdims=True, dtype=np.float64)
    places = np.stack([mesh.positions @ m[:3, :3].T + m[:3, 3] for m in (j.local_matrix() for j in joints)])
    np.testing.assert_allclose(world_points(pack(scene)), np.einsum("vj,jvi->vi", share, places), atol=1e-6)


@pytest.mark.parametrize("flat", [False, True])
def test_a_mirrored_figure_keeps_its_fronts(flat):
    """All below a node that mirrors: as if the mesh itself stood there, triangles and normals alike."""
    scene, twin = arm(), ispm.Scene()
    mesh = scene["arm"].parts[0].mesh
    if flat:
        mesh.normals = None
    root = ispm.Node("mirror", scale=(1.0, 1.0, -1.0), rotation=ispm.euler(y=0.3), children=scene.roots)
    scene.roots = [root]
    scene["arm"].translation, scene["arm"].scale = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    twin.roots = [ispm.Node("mirror", scale=root.scale, rotation=root.rotation, parts=scene["arm"].parts)]
    bent, straight = pack(scene), pack(twin)
    np.testing.assert_allclose(world_points(bent), world_points(straight), atol=ROUNDING)
    for packed in (bent, straight):
        assert (packed.instances["flags"] & INSTANCE_MIRRORED).all()
    normals = []
    for packed in (bent, straight):
        (row,) = packed.instances
        cofactors = np.stack([row[f"normal{k}"][:3] for k in range(3)])
        normals.append(packed.geometry.vertices["normal"] @ cofactors.T)
    np.testing.assert_allclose(*normals, atol=1e-6)


def test_morph_targets_add_exactly():
    random = np.random.default_rng(5)
    scene = ispm.Scene()
    node = scene.add(ispm.shapes.sphere(0.5), name="ball", translation=(1, 2, 3))
    mesh = node.parts[0].mesh
    shape = (len(mesh.positions), 3)
    moves, turns = random.normal(size=(2, 3, *shape)).astype(np.float32)
    mesh.morphs = [ispm.Morph(moves[0], turns[0], name="a"), ispm.Morph(moves[1]), ispm.Morph(None, turns[2])]
    node.weights = (0.25, -1.5, 0.5)
    positions = mesh.positions + 0.25 * moves[0].astype(np.float64) - 1.5 * moves[1].astype(np.float64)
    normals = mesh.normals + 0.25 * turns[0].astype(np.float64) + 0.5 * turns[2].astype(np.float64)
    rows = pack(scene).geometry.vertices
    assert (rows["position"] == positions.astype(np.float32)).all()
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    np.testing.assert_allclose(rows["normal"], normals, atol=1e-6)
    place = np.array([1.0, 2.0, 3.0])
    expected = [positions.min(axis=0) + place, positions.max(axis=0) + place]
    np.testing.assert_allclose(scene.bounds, expected, atol=ROUNDING)
    node.weights = None
    assert (pack(scene).geometry.vertices["position"] == mesh.positions).all()


def test_nodes_that_share_a_mesh_have_shapes_of_their_own():
    scene = ispm.Scene()
    mesh = ispm.shapes.box()
    mesh.morphs = [ispm.Morph(mesh.positions)]  # a weight of 1: twice as large
    for k in range(4):
        scene.add(mesh, name=f"box {k}", translation=(3.0 * k, 0, 0))
    scene["box 1"].weights, scene["box 2"].weights = [1.0], [2.0]
    packed = pack(scene)
    assert len(packed.geometry.ranges) == 3  # boxes 0 and 3 are one
    sizes = np.ptp(packed.boxes, axis=1)[np.argsort(packed.ids), 0]
    np.testing.assert_allclose(sizes, [1, 2, 3, 1])


def test_a_channel_moves_weights_and_not_the_place():
    scene = ispm.Scene()
    node = scene.add(ispm.shapes.box(), name="box")
    node.matrix = np.diag([2.0, 2.0, 2.0, 1.0])
    node.parts[0].mesh.morphs = [ispm.Morph(node.parts[0].mesh.positions)]
    keys = np.array([[0.0], [1.0], [3.0]])
    scene.animations = [ispm.Animation([ispm.Channel(node, "weights", np.arange(3.0), keys)], "grow")]
    for time, size in [(-1.0, 2), (0.5, 3), (1.5, 6), (9.0, 8)]:
        np.testing.assert_allclose(np.ptp(scene.at(time).bounds, axis=0), size)
    later = scene.at(2.0)
    assert later["box"].matrix is node.matrix and later.at_rest()["box"].weights is None
    low, high = scene.at(0.0).default_camera().pose[:3, 3], later.default_camera().pose[:3, 3]
    np.testing.assert_array_equal(low, high)  # one camera for all moments, far enough for the largest


def test_joints_of_copied_scenes_are_their_own():
    scene = arm()
    elbow = scene["elbow"]
    channel = ispm.Channel(elbow, "rotation", [0.0, 1.0], [[0, 0, 0, 1], ispm.euler(z=math.pi / 2)])
    scene.animations = [ispm.Animation([channel])]
    moment = scene.at(1.0)
    assert moment["arm"].skin.joints[1] is moment["elbow"] is not elbow
    np.testing.assert_allclose(
        moment.bounds[0], [-1.0, 0, 0], atol=ROUNDING
    )  # as if it turned about (0, 1, 0)
    np.testing.assert_allclose(scene.bounds[1], [0.1, 2, 0], atol=ROUNDING)
    pair = ispm.Scene()
    pair.merge(scene, name="left")
    pair.merge(scene, name="right", translation=(5, 0, 0))
    assert pair["right"]["arm"].skin.joints == [pair["right"]["shoulder"], pair["right"]["elbow"]]
    np.testing.assert_allclose(pair.bounds[1], [5.1, 2, 0], atol=ROUNDING)
    np.testing.assert_allclose(pair.bounds_of("right")[0], [4.9, 0, 0], atol=ROUNDING)


def test_smooth_normals_follow_positions():
    mesh = ispm.shapes.sphere(0.5)
    mesh.positions = mesh.positions * np.array([1.0, 2.0, 1.0])
    exact = mesh.positions / np.array([1.0, 4.0, 1.0])
    exact /= np.linalg.norm(exact, axis=1, keepdims=True)
    apart = np.degrees(np.arccos(np.clip((mesh.smooth_normals() * exact).sum(axis=1), -1, 1)))
    edge = np.isin(np.arange(len(exact)), np.unique(mesh.triangles)) & (np.abs(mesh.uv0[:, 0] - 0.5) < 0.45)
    # a vertex's normal is off by less than the angle between its faces, 360 degrees over the segments
    assert apart[edge & (np.abs(mesh.uv0[:, 1] - 0.5) < 0.45)].max() < 6.0


def _mesh(name, value):
    return lambda scene: setattr(scene["arm"].parts[0].mesh, name, value)


def _skin(name, value):
    return lambda scene: setattr(scene["arm"].skin, name, value)


def _morph(morph, *weights):
    def spoil(scene):
        scene["arm"].parts[0].mesh.morphs = [morph]
        scene["arm"].weights = weights

    return spoil


SPOILT = [
    (lambda scene: setattr(scene["arm"], "weights", [1.0, "x"]), "node 'arm': weights must be numbers"),
    (lambda scene: setattr(scene["arm"], "skin", "arm"), "node 'arm': skin must be a"),
    (lambda scene: scene.remove("elbow"), "joint 'elbow' of its skin is not in the scene"),
    (_skin("joints", []), "skin 'arm': has no joints"),
    (_skin("joints", ["elbow"]), "skin 'arm': joints must be a list of Node"),
    (_skin("inverse_bind", np.eye(4)), "skin 'arm': inverse_bind must have shape"),
    (lambda scene: scene["arm"].skin.joints.pop(), "skin 'arm': inverse_bind must have shape"),
    (_skin("inverse_bind", np.ones((2, 4, 4))), "last row of each inverse_bind"),
    (_skin("inverse_bind", np.full((2, 4, 4), np.nan)), "inverse_bind must be numbers of finite size"),
    (_mesh("joints", np.full((18, 4), 2)), "follows joint 2, and the skin has 2 joints"),
    (_mesh("joints", np.zeros((17, 4))), "joints of shape"),
    (_mesh("joint_weights", np.full((18, 4), np.nan)), "joint_weights must be numbers"),
    (_mesh("joint_weights", np.full((18, 4), -1.0)), "joint_weights must be numbers"),
    (_mesh("joint_weights", None), "go together"),
    (_mesh("morphs", [1]), "morphs must be a list of Morph"),
    (_morph(ispm.Morph(np.zeros((3, 3))), 1.0), "morph target 0: positions has 3 rows for 18 vertices"),
    (_morph(ispm.Morph(), 1.0, 2.0), "node 'arm': has 2 weights for the 1 morph targets of mesh 'strip'"),
]


@pytest.mark.parametrize(("spoil", "line"), SPOILT)
def test_what_does_not_fit_is_one_line(spoil, line):
    scene = arm()
    spoil(scene)
    with pytest.raises(SceneError, match=line) as error:
        pack(scene)
    assert "\n" not in str(error.value)
