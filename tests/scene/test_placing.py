"""Where nodes stand, all at once and one by one."""

import numpy as np
import pytest
import trimesh.transformations as tf

import ispm
from ispm.errors import SceneError
from ispm.scene.node import Node
from ispm.scene.packed import pack
from ispm.scene.placing import local_matrices, tree_of


def expected(node):
    """The matrix from a node's space to its parent's, by trimesh."""
    if node.matrix is not None:
        return np.asarray(node.matrix, float)
    x, y, z, w = node.rotation
    turn = tf.quaternion_matrix((w, x, y, z))
    return tf.translation_matrix(node.translation) @ turn @ np.diag([*node.scale, 1.0])


def forest(rng, count):
    """Roots of nodes below one another at random, a third by matrix, some by lists and arrays."""
    nodes, roots = [], []
    for k in range(count):
        node = Node(f"{k}", tuple(rng.normal(size=3)), rng.normal(size=4), list(rng.uniform(0.5, 2.0, 3)))
        if k % 3 == 0:
            node.matrix = np.eye(4)
            node.matrix[:3] = rng.normal(size=(3, 4))
        (nodes[rng.integers(k)].children if k and rng.random() < 0.8 else roots).append(node)
        nodes.append(node)
    return roots


def test_all_matrices_are_those_of_each_node():
    """Against trimesh, in a tree some eight deep; float64 products of so many differ by less than 1e-12."""
    tree = tree_of(forest(np.random.default_rng(2), 200))
    worlds = tree.worlds()
    assert len(worlds) == 200 and max(tree.parents) > 0
    for index, (node, parent) in enumerate(zip(*tree, strict=True)):
        world = expected(node) if parent < 0 else worlds[parent] @ expected(node)
        assert worlds[index] == pytest.approx(world, rel=1e-12, abs=1e-12)
        assert (tree.world(index) == worlds[index]).all()
        assert (local_matrices([node])[0] == node.local_matrix()).all()


@pytest.mark.parametrize("count", [0, 1, 3])
def test_a_chain_of_few_nodes_or_none(count):
    node = None
    for k in range(count):
        node = Node(translation=(1.0, 0.0, k), children=[] if node is None else [node])
    worlds = tree_of([] if node is None else [node]).worlds()
    assert worlds.shape == (count, 4, 4)
    assert worlds[:, 0, 3].tolist() == [1.0, 2.0, 3.0][:count]


@pytest.mark.parametrize("change", ["rotation", "scale", "translation", "matrix"])
def test_of_many_nodes_the_one_without_a_place_is_named(change):
    scene = ispm.Scene([Node(f"n{k}") for k in range(9)])
    wrong = {
        "rotation": (0, 0, 0, 0),
        "scale": (1, 2),
        "translation": (1, np.nan, 0),
        "matrix": np.ones((4, 4)),
    }
    setattr(scene.nodes[5], change, wrong[change])
    with pytest.raises(SceneError, match="node 'n5'.*" + change):
        pack(scene)


def test_many_nodes_take_their_matrices_at_once():
    scene = ispm.Scene([Node(f"n{k}", translation=(9.0, 9.0, 9.0)) for k in range(4)])
    matrices = np.stack([tf.translation_matrix((k, 0.0, 1.0)) for k in range(3)])
    scene.set_transforms(scene.nodes[:3], matrices)
    places = scene.tree().worlds()[:, :3, 3]
    assert places.tolist() == [[0, 0, 1], [1, 0, 1], [2, 0, 1], [9, 9, 9]]
    matrices[0] = 7.0  # which is the caller's
    assert (scene.tree().worlds()[:, :3, 3] == places).all()


@pytest.mark.parametrize(
    ("matrices", "says"),
    [
        (np.zeros((2, 4, 4)), "shape"),
        (np.stack([np.eye(4), np.eye(4), tf.translation_matrix((1, 2, 3)).T]), "number 2 .* transposed"),
        (np.full((3, 4, 4), np.nan), "numbers"),
        ("matrices", "numbers"),
    ],
)
def test_matrices_that_are_none_change_nothing(matrices, says):
    scene = ispm.Scene([Node() for _ in range(3)])
    with pytest.raises(SceneError, match="matrices.*" + says):
        scene.set_transforms(scene.nodes, matrices)
    with pytest.raises(SceneError, match="nodes must be of Node, not of str"):
        scene.set_transforms(["n"] * 3, np.stack([np.eye(4)] * 3))
    assert all(node.matrix is None for node in scene)
