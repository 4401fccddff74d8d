"""Where nodes stand: a tree of them as two lists, and all of its matrices at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import reduce
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ispm.errors import SceneError
from ispm.scene.node import Node, listed
from ispm.scene.rotation import place_matrices
from ispm.scene.values import FARTHEST

_MOST_AGAIN = 100_000  # times that nodes are met again, below another parent


class Tree(NamedTuple):
    """Nodes, parents before children, and of each the place of its parent among them; -1: it has none."""

    nodes: list[Node]
    parents: list[int]

    def worlds(self) -> np.ndarray:
        """Return the (n, 4, 4) float64 node-to-world matrices.

        Raises SceneError where a node has no place that can be used.
        """
        worlds = local_matrices(self.nodes) + 0.0  # of no -0, as products have it
        parents = np.array(self.parents, np.int64)
        if not (parents >= 0).any():
            return worlds
        depths = np.zeros(len(parents), np.int64)
        for index, parent in enumerate(self.parents):
            if parent >= 0:
                depths[index] = depths[parent] + 1
        order = np.argsort(depths, kind="stable")
        levels = np.searchsorted(depths[order], np.arange(1, depths.max(initial=0) + 2))
        for first, last in pairwise(levels):
            rows = order[first:last]
            worlds[rows] = worlds[parents[rows]] @ worlds[rows]
        return worlds

    def world(self, index: int) -> np.ndarray:
        """Return the (4, 4) float64 node-to-world matrix of one node. Raises SceneError likewise."""
        chain = []
        while index >= 0:
            chain.append(self.nodes[index])
            index = self.parents[index]
        return reduce(np.matmul, [node.local_matrix() for node in reversed(chain)], np.eye(4))


def tree_of(roots: Sequence[Node]) -> Tree:
    """Return the tree of all nodes at and below `roots`; one that hangs in several places is met in each.

    Raises SceneError where something else stands among them, a node hangs below itself, or there are too
    many places: a few dozen nodes, each twice below the next, have more than can ever be visited.
    """
    tree = Tree([], [])
    waiting: list[tuple[Iterator[Node], int]] = [(iter(roots), -1)]
    met: set[int] = set()
    while waiting:
        siblings, parent = waiting[-1]
        for node in siblings:
            met.add(id(node))
            index = len(tree.nodes)
            tree.nodes.append(node)
            tree.parents.append(parent)
            if index - len(met) >= _MOST_AGAIN:
                _refuse(tree)
            if node.children or type(node.children) is not list:
                waiting.append((iter(listed(node, "children", Node)), index))
                break
        else:
            waiting.pop()
    return tree


def _refuse(tree: Tree) -> None:
    """Raise SceneError for a tree that has no end, or next to none, by its last node."""
    nodes, parents = tree
    above: set[int] = set()
    index = len(nodes) - 1
    while index >= 0:
        node = nodes[index]
        if id(node) in above:
            raise SceneError(f"node '{node.name}': hangs below itself; take it out of its descendants")
        above.add(id(node))
        index = parents[index]
    raise SceneError(
        f"node '{nodes[-1].name}': nodes that hang in several places multiply, here to more than "
        f"{_MOST_AGAIN:,}; let each hang in one, with instances where parts repeat"
    )


def local_matrices(nodes: Sequence[Node]) -> np.ndarray:
    """Return the (n, 4, 4) float64 matrices from each node's space to its parent's.

    Raises SceneError where a node has none.
    """
    together = _together(nodes)
    if together is not None:
        return together
    return np.stack([node.local_matrix() for node in nodes])


def _together(nodes: Sequence[Node]) -> np.ndarray | None:
    """`local_matrices`; None where a value cannot be used, which asking node by node names."""
    result = np.empty((len(nodes), 4, 4))
    given = np.array([node.matrix is not None for node in nodes], bool)
    placed = [node for node in nodes if node.matrix is None]
    try:
        if given.any():
            result[given] = _rows([node.matrix for node in nodes if node.matrix is not None], 4, 4)
        if placed:
            rotations = _rows([node.rotation for node in placed], 4)
            if not rotations.any(axis=1).all():
                return None
            translations = _rows([node.translation for node in placed], 3)
            result[~given] = place_matrices(translations, rotations, _rows([n.scale for n in placed], 3))
    except (TypeError, ValueError):
        return None
    usable = (result[:, 3] == (0.0, 0.0, 0.0, 1.0)).all() and np.abs(result).max(initial=0.0) <= FARTHEST
    return result if usable else None


def _rows(values: Sequence[object], *shape: int) -> np.ndarray:
    """Arrays of one shape as one of float64. Raises ValueError or TypeError where they are not of that."""
    rows: np.ndarray
    arrays = [value for value in values if isinstance(value, np.ndarray) and value.shape == shape]
    if len(arrays) == len(values) > 0:
        rows = np.concatenate(arrays, dtype=np.float64).reshape(-1, *shape)  # two thirds of the time
    else:
        rows = np.array(values, np.float64)
    if rows.shape != (len(values), *shape):
        raise ValueError
    return rows
