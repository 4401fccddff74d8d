"""Skins: the joints that meshes follow, and how these stood when the meshes were bound to them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ispm.errors import SceneError
from ispm.scene.values import Strict, array_of

if TYPE_CHECKING:
    from ispm.scene.node import Node


@dataclass(eq=False)
class Skin(Strict):
    """Joints, which are nodes of the scene: where these stand, the vertices that follow them go.

    joints        numbered in this order by `Mesh.joints`
    inverse_bind  (J, 4, 4) float32, from the mesh to each joint's space when they were bound, last rows
                  0 0 0 1; None: of the identity each
    Compared by identity. Source: glTF 2.0, section 3.7.3.
    """

    joints: list[Node] = field(default_factory=list)
    inverse_bind: np.ndarray | None = None
    name: str = ""

    def __repr__(self) -> str:
        return f"<Skin '{self.name}': {len(self.joints)} joint{'s' * (len(self.joints) != 1)}>"

    def of(self, nodes: Mapping[int, Node]) -> Skin:
        """Return this skin of other nodes.

        nodes  by the ids of those that they stand for; joints that stand for none stay
        """
        return Skin([nodes.get(id(joint), joint) for joint in self.joints], self.inverse_bind, self.name)

    def check(self) -> None:
        """Raise SceneError where the joints are no nodes, or the matrices cannot be used."""
        from ispm.scene.node import Node  # which needs this module

        where = f"skin '{self.name}'"
        if not isinstance(self.joints, list) or not all(isinstance(joint, Node) for joint in self.joints):
            raise SceneError(f"{where}: joints must be a list of Node")
        if not self.joints:
            raise SceneError(f"{where}: has no joints")
        if self.inverse_bind is None:
            return
        shape = (len(self.joints), 4, 4)
        self.inverse_bind = np.asarray(
            array_of(f"{where}: inverse_bind", self.inverse_bind, shape), np.float32
        )
        if (self.inverse_bind[:, 3] != (0.0, 0.0, 0.0, 1.0)).any():
            raise SceneError(
                f"{where}: the last row of each inverse_bind must be 0 0 0 1; are they transposed?"
            )
