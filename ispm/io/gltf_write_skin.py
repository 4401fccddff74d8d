"""Skins and morph targets as glTF has them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ispm.errors import SceneError
from ispm.io.gltf_skin import DELTAS
from ispm.io.gltf_write import Document
from ispm.io.gltf_write_material import numbers
from ispm.scene.mesh import Mesh
from ispm.scene.node import Node
from ispm.scene.scene import Part

_TOGETHER = 4  # joints of a vertex in an accessor


def write_skins(
    document: Document,
    bent: Sequence[tuple[Node, dict[str, Any]]],
    numbers_of: Mapping[int, Sequence[int]],
) -> None:
    """Write the skins of nodes, and their numbers into the records of these.

    numbers_of  of each node, by its id, the numbers of its records
    Raises SceneError for a joint that is not among them.
    """
    written: dict[int, int] = {}
    for node, record in bent:
        skin = node.skin
        assert skin is not None
        if id(skin) not in written:
            lost = [joint.name for joint in skin.joints if id(joint) not in numbers_of]
            if lost:
                raise SceneError(f"node '{node.name}': the joint '{lost[0]}' of its skin is not in the scene")
            made: dict[str, Any] = {"name": skin.name} if skin.name else {}
            made["joints"] = [numbers_of[id(joint)][0] for joint in skin.joints]
            if skin.inverse_bind is not None:
                columns = skin.inverse_bind.transpose(0, 2, 1).reshape(-1, 16)
                made["inverseBindMatrices"] = document.floats(columns)
            written[id(skin)] = document.put("skins", made)
        record["skin"] = written[id(skin)]


def written_joints(document: Document, mesh: Mesh, rows: np.ndarray) -> dict[str, int]:
    """Return the attributes, by name, of the joints that some vertices of a mesh follow."""
    if mesh.joints is None or mesh.joint_weights is None:
        return {}
    spare = (0, 0), (0, -mesh.joints.shape[1] % _TOGETHER)
    joints, weights = (np.pad(values[rows], spare) for values in (mesh.joints, mesh.joint_weights))
    attributes = {}
    for k in range(joints.shape[1] // _TOGETHER):
        some = slice(_TOGETHER * k, _TOGETHER * (k + 1))
        attributes[f"JOINTS_{k}"] = document.joints(joints[:, some])
        attributes[f"WEIGHTS_{k}"] = document.floats(weights[:, some], vertices=True)
    return attributes


def written_targets(document: Document, mesh: Mesh, rows: np.ndarray) -> dict[str, Any]:
    """Return the morph targets of some vertices of a mesh, as a member of its primitive."""
    targets = []
    for morph in mesh.morphs:
        arrays = {name: getattr(morph, field) for field, name in DELTAS.items()}
        target = {
            name: document.floats(values[rows], bounds=name == "POSITION", vertices=True)
            for name, values in arrays.items()
            if values is not None
        }
        targets.append(target or {"POSITION": document.zeros(len(rows))})
    return {"targets": targets} if targets else {}


def complete_targets(
    document: Document, primitives: Sequence[dict[str, Any]], parts: Sequence[Part]
) -> dict[str, Any]:
    """Give primitives without morph targets as many as others of their mesh have, all zeros, as glTF asks.

    ->  members of the mesh: the names of its targets
    Raises SceneError where meshes of parts have different numbers of them.
    """
    counts = {len(part.mesh.morphs) for part in parts} - {0}
    if len(counts) > 1:
        several = " and ".join(map(str, sorted(counts)))
        raise SceneError(f"mesh '{parts[0].mesh.name}': parts of one node have {several} morph targets")
    for count in counts:
        for primitive, part in zip(primitives, parts, strict=True):
            if not part.mesh.morphs:
                vertices = np.asarray(part.mesh.triangles)
                zeros = document.zeros(len(np.unique(vertices)))
                primitive["targets"] = [{"POSITION": zeros}] * count
    morphs = next((part.mesh.morphs for part in parts if part.mesh.morphs), [])
    names = [morph.name for morph in morphs]
    return {"extras": {"targetNames": names}} if any(names) else {}


def written_weights(node: Node, parts: Sequence[Part]) -> list[float] | None:
    """Return a node's morph weights where parts of it have morph targets."""
    if node.weights is None or not any(part.mesh.morphs for part in parts):
        return None
    return numbers(node.morph_weights())
