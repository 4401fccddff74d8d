"""Meshes that deform: by the joints of a skin, and by morph targets.

A vertex p with joint weights w_j goes to sum w_j J_j p / sum w_j, where J_j takes the mesh as it was bound to
the world by its joint; normals go by the cofactors of that sum of matrices, tangents by the sum itself. Morph
targets come first. So a skinned mesh stands in the world, wherever its node stands.
Source: glTF 2.0, sections 3.7.2.2 and 3.7.3.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from operator import is_

import numpy as np

from ispm.errors import SceneError
from ispm.scene.mesh import ARRAYS, DELTAS, Mesh
from ispm.scene.node import Node
from ispm.scene.skin import Skin

_AT_ONCE = 1 << 16  # vertices, whose matrices stay in the processor's cache
_MIRRORED = np.diag([-1.0, 1.0, 1.0, 1.0])


def is_skinned(node: Node, mesh: Mesh) -> bool:
    """Whether a node's mesh follows joints, and so stands in the world and not at the node."""
    return node.skin is not None and mesh.joints is not None


def is_posed(node: Node, mesh: Mesh) -> bool:
    """Whether a node's mesh may have another shape than it has by itself."""
    return is_skinned(node, mesh) or (node.weights is not None and bool(mesh.morphs))


def joint_rows(nodes: Sequence[Node], bent: Iterable[Node]) -> list[np.ndarray]:
    """Return of each node's skin the (J,) int64 rows of its joints among `nodes`, the first of each.

    Raises SceneError for a joint that is not among them.
    """
    bent = list(bent)
    skins = [node.skin for node in bent if node.skin is not None]
    wanted = {id(joint) for skin in skins for joint in skin.joints}
    found: dict[int, int] = {}
    for row, node in enumerate(nodes):
        if id(node) in wanted:
            found.setdefault(id(node), row)
    for node in bent:
        for joint in [] if node.skin is None else node.skin.joints:
            if id(joint) not in found:
                raise SceneError(
                    f"node '{node.name}': the joint '{joint.name}' of its skin is not in the scene; "
                    "hang it there"
                )
    return [np.array([found[id(joint)] for joint in skin.joints], np.int64) for skin in skins]


def joint_matrices(skin: Skin, worlds: np.ndarray) -> np.ndarray:
    """Return the (J, 4, 4) float64 matrices that take a mesh as it was bound to the world.

    worlds  (J, 4, 4) joint-to-world matrices
    """
    return worlds if skin.inverse_bind is None else worlds @ skin.inverse_bind.astype(np.float64)


@dataclass(eq=False)
class Shape:
    """A node's mesh in the shape that it has at a moment.

    source  the mesh as it is by itself
    mesh    in that shape; its triangles are the source's
    space   (4, 4) where a skinned mesh stands: the world, mirrored where the joints mirror, so that fronts
            stay in front; None: the mesh follows no joints, and stands at its node
    """

    source: Mesh
    mesh: Mesh
    space: np.ndarray | None = None
    _posed: tuple[object, ...] | None = None  # by what
    _arrays: list[object] = field(default_factory=list)  # of what

    @classmethod
    def of(cls, source: Mesh) -> Shape:
        """Return one that has no shape yet."""
        return cls(source, Mesh(source.positions, source.triangles, name=source.name))

    def take(self, weights: np.ndarray, matrices: np.ndarray | None) -> None:
        """Take the shape of these morph weights, (K,), and joint matrices, (J, 4, 4); None: it has no skin.

        Raises SceneError where a vertex follows a joint that is not there, or arrays cannot be used.
        """
        source = self.source
        posed = source.version, weights.tobytes(), None if matrices is None else matrices.tobytes()
        if posed == self._posed and self._is_of(_arrays(source)):
            return
        source.check()
        held = {name: getattr(source, name) for name in ARRAYS} | morphed(source, weights)
        self.space = None
        if matrices is not None:
            held |= skinned(source, held, matrices)
            self.space = np.eye(4)
            if _mirrors(source, matrices):
                self.space = _MIRRORED
                _mirror(held)
        for name, values in held.items():
            setattr(self.mesh, name, values)
        self.mesh.version = source.version
        self._posed, self._arrays = posed, _arrays(source)

    def _is_of(self, arrays: list[object]) -> bool:
        return len(arrays) == len(self._arrays) and all(map(is_, arrays, self._arrays))


def _arrays(mesh: Mesh) -> list[object]:
    """All arrays that a mesh's shapes come from."""
    owners = [(mesh, (*ARRAYS, "joints", "joint_weights")), *((morph, DELTAS) for morph in mesh.morphs)]
    return [getattr(owner, name) for owner, names in owners for name in names]


def shown_shapes(
    nodes: Sequence[Node], worlds: np.ndarray, which: Iterable[int]
) -> Iterator[tuple[Mesh, np.ndarray]]:
    """Yield the meshes at some of the nodes in the shapes they have, with the (n, 4, 4) places of each.

    nodes, worlds  of a tree: all that joints may be among, and (n, 4, 4) node-to-world matrices
    which          rows of these
    """
    which = list(which)
    bent = [row for row in which if any(is_skinned(nodes[row], part.mesh) for part in nodes[row].parts)]
    joints: Mapping[int, np.ndarray] = dict(
        zip(bent, joint_rows(nodes, [nodes[k] for k in bent]), strict=True)
    )
    for row in which:
        node = nodes[row]
        for part in node.parts:
            if not (len(part.mesh.triangles) and node.copies):
                continue
            if not is_posed(node, part.mesh):
                yield part.mesh, node.places(worlds[row])
                continue
            shape, matrices = Shape.of(part.mesh), None
            if node.skin is not None and part.mesh.joints is not None:
                matrices = joint_matrices(node.skin, worlds[joints[row]])
            shape.take(node.morph_weights(), matrices)
            yield shape.mesh, shape_places(node, shape, worlds[row])


def shape_places(node: Node, shape: Shape, world: np.ndarray) -> np.ndarray:
    """Return the (copies, 4, 4) matrices that take a shape to the world; world: (4, 4), its node's own."""
    if shape.space is None:
        return node.places(world)
    return np.asarray(node.places(np.eye(4)) @ shape.space)


def morphed(mesh: Mesh, weights: np.ndarray) -> dict[str, np.ndarray]:
    """Return the arrays of a mesh that morph targets of these weights, (K,), change; as float32."""
    result: dict[str, np.ndarray] = {}
    for name in DELTAS:
        base = getattr(mesh, name)
        pairs = zip(weights, mesh.morphs, strict=False)  # no weights: no morphs count
        deltas = [(w, getattr(morph, name)) for w, morph in pairs if w != 0.0]
        deltas = [(w, delta) for w, delta in deltas if delta is not None]
        if base is None or not deltas:
            continue
        total = base.astype(np.float64)
        for weight, delta in deltas:
            total[:, :3] += weight * delta
        result[name] = total.astype(np.float32)
    return result


def skinned(mesh: Mesh, held: Mapping[str, np.ndarray], matrices: np.ndarray) -> dict[str, np.ndarray]:
    """Return the arrays of a mesh that joints change, in the world.

    held      its positions, normals and tangents, or None
    matrices  (J, 4, 4) float64, as `joint_matrices` returns them
    Raises SceneError where a vertex follows a joint that is not there.
    """
    assert mesh.joints is not None and mesh.joint_weights is not None
    most = int(mesh.joints.max(initial=0))
    if most >= len(matrices):
        raise SceneError(
            f"mesh '{mesh.name}': a vertex follows joint {most}, and the skin has {len(matrices)} joints"
        )
    names = [name for name in DELTAS if held.get(name) is not None]
    result = {name: np.empty_like(held[name]) for name in names}
    rows = matrices[:, :3].reshape(-1, 12)
    for first in range(0, len(mesh.positions), _AT_ONCE):
        some = slice(first, first + _AT_ONCE)
        shares = _shares(mesh.joint_weights[some])
        sums = np.zeros((len(shares), 12))
        for k in range(shares.shape[1]):
            sums += shares[:, k, None] * rows[mesh.joints[some, k]]
        mean = sums.reshape(-1, 3, 4)
        for name in names:
            values = held[name][some].astype(np.float64)
            if name == "positions":
                result[name][some] = _times(mean[:, :, :3], values) + mean[:, :, 3]
            elif name == "normals":
                cofactors = _cofactors(mean)
                side = np.sign((cofactors[:, 0] * mean[:, 0, :3]).sum(axis=1))  # of the determinant
                result[name][some] = _unit(side[:, None] * _times(cofactors, values))
            else:
                result[name][some, :3] = _unit(_times(mean[:, :, :3], values[:, :3]))
                result[name][some, 3] = values[:, 3]
    return result


def _shares(weights: np.ndarray) -> np.ndarray:
    """(V, n) float64 weights whose sum is 1; all of the first joint where all are 0."""
    shares = weights.astype(np.float64)
    total = shares.sum(axis=1, keepdims=True)
    none = total[:, 0] == 0.0
    shares /= np.where(total, total, 1.0)
    shares[none, 0] = 1.0
    return shares


def _times(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """(V, 3, 3) matrices times (V, 3) vectors."""
    x, y, z = vectors.T
    return np.asarray(
        matrices[:, :, 0] * x[:, None] + matrices[:, :, 1] * y[:, None] + matrices[:, :, 2] * z[:, None]
    )


def _cofactors(matrices: np.ndarray) -> np.ndarray:
    """(V, 3, 3) cofactors of the left of (V, 3, 4), which take normals even where there is no inverse."""
    x, y, z = (matrices[:, k, :3] for k in range(3))
    return np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=1)


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors of length 1; those without a length stay zeros."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0))


def _mirrors(mesh: Mesh, matrices: np.ndarray) -> bool:
    """Whether most of what a mesh follows turns it inside out."""
    assert mesh.joints is not None and mesh.joint_weights is not None
    sides = np.sign(np.linalg.det(matrices[:, :3, :3]))
    if (sides >= 0.0).all():
        return False
    if (sides <= 0.0).all():
        return True
    return float((mesh.joint_weights * sides[mesh.joints]).sum()) < 0.0


def _mirror(held: dict[str, np.ndarray]) -> None:
    """Take arrays of the world to its mirror image, in place of what `held` has."""
    for name in DELTAS:
        if held.get(name) is not None:
            held[name] = held[name].copy()
            held[name][:, 0] *= -1.0
