"""What deforms meshes of a glTF file: skins with vertices' joints, and morph targets with their weights."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ispm.errors import SceneError
from ispm.io import gltf_schema as schema
from ispm.io.arrays import wild
from ispm.io.gltf_file import GltfFile, item, label
from ispm.scene.mesh import Mesh, Morph
from ispm.scene.node import Node
from ispm.scene.skin import Skin

DELTAS = {"positions": "POSITION", "normals": "NORMAL", "tangents": "TANGENT"}
_TARGET = 2_000  # steps to read a morph target, however small
_POSED_BYTES = 128  # of a vertex in a shape of its own, packed
_BIND_BYTES = 16 * 12  # of a joint: its matrices as they are read and as they are used


class Skins:
    """The skins of a file, and the nodes whose meshes they bend.

    nodes  as the file numbers them;  shown  the numbers of those in the scene
    """

    def __init__(self, file: GltfFile, nodes: Sequence[Node], shown: Sequence[int]) -> None:
        self._file, self._nodes, self._shown = file, nodes, set(shown)
        self._made: dict[int, Skin | None] = {}

    def bend(self, index: int, node: Node) -> None:
        """Give a node its skin and its morph weights; none, with a note, where they have faults.

        Raises SceneError where shapes of its meshes need more memory than is left.
        """
        record, where = self._file.gltf.nodes[index], label("node", index, node.name)
        meshes = [part.mesh for part in node.parts]
        assert record.mesh is not None
        given = record.weights or self._file.gltf.meshes[record.mesh].weights
        if given:
            node.weights = self._weights(given, meshes, where)
        if record.skin is not None:
            node.skin = self._fitting(record.skin, meshes, where)
        if node.skin is not None or node.weights is not None:
            vertices = sum(max(len(m.positions), 3 * len(m.triangles) * (m.normals is None)) for m in meshes)
            self._file.budget.take(where, memory=_POSED_BYTES * vertices, work=vertices)

    def _weights(self, given: list[float], meshes: Sequence[Mesh], where: str) -> np.ndarray | None:
        """Weights for as many targets as there are; None where there are none."""
        count = max((len(mesh.morphs) for mesh in meshes), default=0)
        if not count:
            return None
        if len(given) != count:
            self._file.notes.add(
                f"{where}: {len(given)} weights for {count} morph targets; others count as 0"
            )
        weights = np.zeros(count)
        weights[: len(given)] = given[:count]
        if wild(weights).any():
            self._file.notes.add(f"{where}: weights that are not finite count as 0")
            weights[wild(weights)] = 0.0
        return weights

    def _fitting(self, number: int, meshes: Sequence[Mesh], where: str) -> Skin | None:
        """A skin, if meshes can follow it."""
        joints = [mesh.joints for mesh in meshes if mesh.joints is not None]
        if not joints:
            if meshes:
                self._file.notes.add(
                    f"{where} is drawn as bound: its mesh has no joints and weights to follow"
                )
            return None
        if number not in self._made:
            try:
                self._made[number] = self._skin(number)
            except SceneError as error:
                self._made[number] = None
                self._file.notes.add(f"{error}; what it bends is drawn as bound")
        skin = self._made[number]
        most = max(int(rows.max(initial=0)) for rows in joints)
        if skin is not None and most >= len(skin.joints):
            count = len(skin.joints)
            self._file.notes.add(f"{where} is drawn as bound: a vertex follows joint {most} of {count}")
            return None
        return skin

    def _skin(self, number: int) -> Skin:
        """A skin of nodes of the scene. Raises SceneError where there is none."""
        record = item(self._file.gltf.skins, number, "skin")
        where = label("skin", number, record.name)
        if not record.joints:
            raise SceneError(f"{where} has no joints")
        for joint in record.joints:
            if joint >= len(self._nodes):
                raise SceneError(
                    f"{where}: joint {joint} does not exist; the file has {len(self._nodes)} nodes"
                )
            if joint not in self._shown:
                called = label("node", joint, self._nodes[joint].name)
                raise SceneError(f"{where}: its joint, {called}, is not in the scene")
        skin = Skin([self._nodes[joint] for joint in record.joints], None, record.name)
        if record.inverse_bind_matrices is not None:
            skin.inverse_bind = self._inverse_bind(record.inverse_bind_matrices, len(skin.joints), where)
        return skin

    def _inverse_bind(self, accessor: int, count: int, where: str) -> np.ndarray:
        self._file.budget.take(where, memory=_BIND_BYTES * count, work=count)
        available = self._file.count(accessor)
        if available < count:
            raise SceneError(
                f"{where}: it has {available} of the {count} inverse bind matrices of its joints"
            )
        values = self._file.floats(accessor, ("MAT4",), slice(0, count))
        if values is None:
            raise SceneError(f"{where}: its inverse bind matrices are not of type MAT4")
        matrices = np.ascontiguousarray(values.reshape(-1, 4, 4).transpose(0, 2, 1))
        if wild(matrices).any():
            raise SceneError(f"{where}: inverse bind matrices are not finite")
        if (matrices[:, 3] != (0.0, 0.0, 0.0, 1.0)).any():
            self._file.notes.add(f"{where}: the last rows of its inverse bind matrices count as 0, 0, 0, 1")
            matrices[:, 3] = 0.0, 0.0, 0.0, 1.0
        return matrices


def read_joints(
    file: GltfFile, primitive: schema.Primitive, rows: np.ndarray, where: str
) -> dict[str, np.ndarray]:
    """Return `joints` and `joint_weights` of a Mesh with these rows of a primitive's vertices; nothing, with
    a note, where they have faults."""
    joints, weights = [], []
    for k in range(len(primitive.attributes)):
        if f"JOINTS_{k}" not in primitive.attributes:
            break
        names = f"JOINTS_{k}", f"WEIGHTS_{k}"
        fault, pair = _joint_set(file, primitive, names, rows)
        if pair is None:
            file.notes.add(f"{where} follows no joints: {fault}")
            return {}
        joints.append(pair[0])
        weights.append(pair[1])
    shares = np.hstack(weights)
    strays = wild(shares) | (shares < 0.0)
    if strays.any():
        file.notes.add(f"{where}: joint weights that are negative or not finite count as 0")
        shares[strays] = 0.0
    idle = int((shares.sum(axis=1) == 0.0).sum())
    if idle:
        file.notes.add(f"{where}: vertices whose joint weights are all 0 follow their first joint: {idle}")
    return {"joints": np.hstack(joints), "joint_weights": shares}


def _joint_set(
    file: GltfFile, primitive: schema.Primitive, names: tuple[str, str], rows: np.ndarray
) -> tuple[str, tuple[np.ndarray, np.ndarray] | None]:
    """What is wrong with JOINTS_n and WEIGHTS_n, or both, (V, 4) uint16 and float32."""
    first, second = (primitive.attributes.get(name) for name in names)
    if first is None or second is None:
        return f"it has {names[0]} without {names[1]}", None
    count = file.count(primitive.attributes["POSITION"])
    for name, index in zip(names, (first, second), strict=True):
        if file.count(index) != count:
            return f"the length of {name} is not that of POSITION", None
        if item(file.gltf.accessors, index, "accessor").type != "VEC4":
            return f"{name} is not a VEC4", None
    stored = file.stored(first)
    if stored.dtype.kind != "u" or stored.dtype.itemsize > 2:
        return f"{names[0]} are not unsigned integers of 8 or 16 bits", None
    file.budget.take(names[0], memory=8 * len(rows))
    weights = file.floats(second, ("VEC4",), rows, normalized=True)
    assert weights is not None
    return "", (stored[rows].astype(np.uint16), weights)


def target_names(mesh: schema.Mesh) -> list[str]:
    """Return the names that programs give to morph targets by convention, in a mesh's `extras`."""
    given = mesh.extras.get("targetNames") if isinstance(mesh.extras, dict) else None
    return [name if isinstance(name, str) else "" for name in given] if isinstance(given, list) else []


def read_morphs(
    file: GltfFile, primitive: schema.Primitive, rows: np.ndarray, where: str, names: Sequence[str]
) -> list[Morph]:
    """Return the morph targets of a primitive for these rows of its vertices; none where all do nothing.

    What has faults counts as 0, with a note.
    """
    morphs = []
    for k, target in enumerate(primitive.targets):
        file.budget.take(where, work=_TARGET)
        fields: dict[str, Any] = {
            field: _deltas(file, primitive, target[name], rows, f"{where}: {name} of morph target {k}")
            for field, name in DELTAS.items()
            if name in target
        }
        morphs.append(Morph(**fields, name=names[k] if k < len(names) else ""))
    idle = all(getattr(morph, field) is None for morph in morphs for field in DELTAS)
    return [] if idle else morphs


def _deltas(
    file: GltfFile, primitive: schema.Primitive, index: int, rows: np.ndarray, what: str
) -> np.ndarray | None:
    """(V, 3) differences; None where all are 0."""
    if file.count(index) != file.count(primitive.attributes["POSITION"]):
        file.notes.add(f"{what} is left out: its length is not that of POSITION")
        return None
    if file.holds_zeros(index):
        return None
    values = file.floats(index, ("VEC3",), rows)
    if values is None:
        file.notes.add(f"{what} is left out: it is not a VEC3")
        return None
    strays = wild(values)
    if strays.any():
        file.notes.add(f"{what}: values that are not finite count as 0")
        values[strays] = 0.0
    return values
