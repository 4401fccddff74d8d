"""Copies of a node's mesh in a glTF file (EXT_mesh_gpu_instancing)."""

from __future__ import annotations

import numpy as np

from ispm.errors import SceneError
from ispm.io import gltf_schema as schema
from ispm.io.arrays import wild
from ispm.io.gltf_file import GltfFile
from ispm.scene.rotation import quaternions

UNTURNED = np.array((0.0, 0.0, 0.0, 1.0), np.float32)
PLACING = {
    "TRANSLATION": ("VEC3", np.zeros(3, np.float32)),
    "ROTATION": ("VEC4", UNTURNED),
    "SCALE": ("VEC3", np.ones(3, np.float32)),
}
COPY_BYTES = 4 * 4 * 4
ROWS = ("_ROW0", "_ROW1", "_ROW2")  # our own: of the matrices, to the last bit


def read_instances(file: GltfFile, record: schema.Instancing, where: str) -> np.ndarray:
    """Return the (n, 4, 4) float32 matrices that take the copies to their node.

    Raises SceneError where there are too many, or the attributes differ in length or type.
    """
    counts = {file.count(index) for index in record.attributes.values()}
    if len(counts) != 1:
        raise SceneError(f"{where}: the attributes of its instances are missing or differ in length")
    count = counts.pop()
    if count > file.limits.max_nodes:
        raise SceneError(f"{where}: {count} instances are more than max_nodes={file.limits.max_nodes} allows")
    file.budget.take(where, memory=COPY_BYTES * count)
    translation, rotation, scale = (
        _attribute(file, record, name, count, where, *about) for name, about in PLACING.items()
    )
    strays = np.asarray(wild(np.hstack([translation, rotation, scale])).any(axis=1))
    if strays.any():
        file.notes.add(f"{where}: instances with places that are not finite: {strays.sum()} left out")
        translation, rotation, scale = translation[~strays], rotation[~strays], scale[~strays]
    result = np.zeros((len(translation), 4, 4), np.float32)
    result[:, :3, :3] = rotation_matrices(rotation) * scale[:, None, :]
    result[:, :3, 3] = translation
    result[:, 3, 3] = 1.0
    if record.attributes.keys() >= set(ROWS):
        rows = [_attribute(file, record, name, count, where, "VEC4", UNTURNED) for name in ROWS]
        exact = np.stack(rows, axis=1)[~strays]
        result[:, :3] = np.where(wild(exact), result[:, :3], exact)
    return result


def instance_attributes(matrices: np.ndarray) -> dict[str, np.ndarray]:
    """Return (n, 4, 4) matrices as the attributes of EXT_mesh_gpu_instancing, and by their rows.

    The first three are what other programs read; shear, which they cannot say, is in the rows alone.
    """
    exact = np.asarray(matrices, np.float32)
    turn = exact[:, :3, :3].astype(np.float64)
    scale = np.linalg.norm(turn, axis=1)
    scale[:, 0] *= np.where(np.linalg.det(turn) < 0.0, -1.0, 1.0)
    turn = turn / np.where(scale, scale, 1.0)[:, None, :]
    values = exact[:, :3, 3], quaternions(turn), scale
    return dict(zip(PLACING, values, strict=True)) | {name: exact[:, i] for i, name in enumerate(ROWS)}


def _attribute(
    file: GltfFile,
    record: schema.Instancing,
    name: str,
    count: int,
    where: str,
    kind: str,
    default: np.ndarray,
) -> np.ndarray:
    """The (count, width) values of an attribute, the same for all where it is absent."""
    index = record.attributes.get(name)
    if index is None:
        return np.tile(default, (count, 1))
    values = file.floats(index, (kind,))
    if values is None:
        raise SceneError(f"{where}: {name} of its instances is not a {kind}")
    return values


def rotation_matrices(quaternions: np.ndarray) -> np.ndarray:
    """Return the (n, 3, 3) matrices of quaternions x, y, z, w; those without a length turn nothing."""
    length = np.linalg.norm(quaternions, axis=1, keepdims=True)
    unit = np.where(length > 1e-3, quaternions / np.maximum(length, 1e-3), UNTURNED)
    vector, w = unit[:, :3], unit[:, 3]
    cross = np.zeros((len(unit), 3, 3), np.float32)  # the cross product with `vector`, as a matrix
    cross[:, [2, 0, 1], [1, 2, 0]] = vector
    cross[:, [1, 2, 0], [2, 0, 1]] = -vector
    result: np.ndarray = np.eye(3, dtype=np.float32) + 2.0 * (w[:, None, None] * cross + cross @ cross)
    return result
