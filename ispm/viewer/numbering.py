"""Numbers that name nodes to canvases, for as long as a scene is open."""

from __future__ import annotations

from ispm.scene.node import Node


class Numbering:
    """Gives each node a number at its first sight; nodes are held, so that none is another's."""

    def __init__(self) -> None:
        self._numbers: dict[int, int] = {}
        self._nodes: list[Node] = []

    def of(self, node: Node) -> int:
        """Return a node's number, from 1."""
        number = self._numbers.get(id(node))
        if number is None:
            self._nodes.append(node)
            number = self._numbers[id(node)] = len(self._nodes)
        return number

    def node(self, number: int) -> Node | None:
        """Return the node of a number; None: there is none."""
        return self._nodes[number - 1] if 0 < number <= len(self._nodes) else None
