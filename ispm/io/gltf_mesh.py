"""Meshes of a glTF file: each primitive with triangles becomes a Mesh and a material."""

from __future__ import annotations

from typing import Any

import numpy as np

from ispm.errors import SceneError
from ispm.io import gltf_schema as schema
from ispm.io.arrays import wild
from ispm.io.budget import MESH
from ispm.io.gltf_draco import provide
from ispm.io.gltf_file import GltfFile, item, label
from ispm.io.gltf_material import Materials
from ispm.io.gltf_skin import read_joints, read_morphs, target_names
from ispm.scene.compact import compact
from ispm.scene.material import Material
from ispm.scene.mesh import Mesh
from ispm.scene.node import Part
from ispm.scene.values import FARTHEST

TRIANGLES, STRIP, FAN = 4, 5, 6
TRIANGLE_BYTES = 12
ATTRIBUTES = {
    "normals": ("NORMAL", ("VEC3",)),
    "tangents": ("TANGENT", ("VEC4",)),
    "uv0": ("TEXCOORD_0", ("VEC2",)),
    "uv1": ("TEXCOORD_1", ("VEC2",)),
    "colors": ("COLOR_0", ("VEC3", "VEC4")),
}


class Meshes:
    """The meshes of a file. Primitives over the same accessors share one Mesh, whatever their materials."""

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        self._materials = Materials(file)
        self._parts: dict[int, list[Part]] = {}
        self.variants = variant_names(file)
        self._made: dict[Any, Mesh | None] = {}
        self._triangle_count = 0

    def parts(self, index: int) -> list[Part]:
        """Return the parts of a glTF mesh, of the same meshes and materials each time."""
        if index not in self._parts:
            record = item(self._file.gltf.meshes, index, "mesh")
            made = [(self._mesh(p, index, record.name), p) for p in record.primitives]
            self._parts[index] = [self._part(mesh, p) for mesh, p in made if mesh is not None]
        return [Part(part.mesh, part.material, dict(part.variants)) for part in self._parts[index]]

    def _part(self, mesh: Mesh, primitive: schema.Primitive) -> Part:
        """A mesh with what the primitive wears, always or in each variant."""
        worn: dict[str | None, Material] = {}
        for mapping in primitive.extensions.variants.mappings:
            material = self._materials.get(mapping.material, mesh)
            for variant in mapping.variants:
                worn.setdefault(item(self.variants, variant, "variant"), material)
        material = self._materials.get(primitive.material, mesh)
        return Part(mesh, material, {None: material, **worn} if worn else {})

    def _mesh(self, primitive: schema.Primitive, index: int, name: str) -> Mesh | None:
        targets = tuple(tuple(sorted(target.items())) for target in primitive.targets)
        key = primitive.mode, primitive.indices, tuple(sorted(primitive.attributes.items())), targets
        if key not in self._made:
            self._made[key] = self._make(primitive, index, name)
        return self._made[key]

    def _make(self, primitive: schema.Primitive, index: int, name: str) -> Mesh | None:
        """A primitive's mesh, of the vertices that its triangles use; None where nothing is left."""
        where = label("mesh", index, name)
        if primitive.mode not in (TRIANGLES, STRIP, FAN):
            self._file.notes.count(
                "primitive of points or lines is not drawn", "primitives of points or lines are not drawn"
            )
            return None
        if "POSITION" not in primitive.attributes:
            self._file.notes.add(f"{where}: a primitive without POSITION is not drawn")
            return None
        provide(self._file, primitive, where)
        self._file.budget.take(where, work=MESH)
        triangles, rows = compact(self._triangles(primitive, where))
        positions = self._file.floats(primitive.attributes["POSITION"], ("VEC3",), rows)
        if positions is None:
            raise SceneError(f"{where}: POSITION is not a VEC3")
        far = np.asarray(wild(positions).any(axis=1))
        if far.any():
            lost = far[triangles].any(axis=1)
            self._file.notes.add(
                f"{where}: triangles with vertices beyond {FARTHEST:g} m or not finite: {lost.sum()} left out"
            )
            triangles, kept = compact(triangles[~lost])
            positions, rows = positions[kept], rows[kept]
        if not len(triangles):
            self._file.notes.add(f"{where}: a primitive without triangles is not drawn")
            return None
        others: dict[str, Any] = {
            field: self._attribute(primitive, *asked, rows, where) for field, asked in ATTRIBUTES.items()
        }
        deform: dict[str, Any] = {}
        if "JOINTS_0" in primitive.attributes:
            deform |= read_joints(self._file, primitive, rows, where)
        if primitive.targets:
            names = target_names(self._file.gltf.meshes[index])
            deform["morphs"] = read_morphs(self._file, primitive, rows, where, names)
        return Mesh(positions, triangles, **others, **deform, name=name)

    def _triangles(self, primitive: schema.Primitive, where: str) -> np.ndarray:
        """(T, 3) numbers of the primitive's vertices; checked before memory is asked for."""
        vertex_count = len(self._file.stored(primitive.attributes["POSITION"]))
        corner_count = vertex_count if primitive.indices is None else self._file.count(primitive.indices)
        count = corner_count // 3 if primitive.mode == TRIANGLES else max(0, corner_count - 2)
        self._triangle_count += count
        if self._triangle_count > self._file.limits.max_triangles:
            raise SceneError(
                f"{where}: more triangles than max_triangles={self._file.limits.max_triangles} allows"
            )
        self._file.budget.take(where, memory=TRIANGLE_BYTES * count)
        if primitive.indices is None:
            corners = np.arange(vertex_count, dtype=np.uint32)
        else:
            corners = self._file.indices(primitive.indices)
            last = int(corners.max()) if corner_count else -1
            if last >= vertex_count:
                raise SceneError(f"{where}: index {last} points past the last of {vertex_count} vertices")
        if primitive.mode == TRIANGLES and corner_count % 3:
            self._file.notes.add(
                f"{where}: {corner_count} corners are no multiple of 3; the rest is left out"
            )
        return assemble(corners, primitive.mode)

    def _attribute(
        self,
        primitive: schema.Primitive,
        attribute: str,
        types: tuple[str, ...],
        rows: np.ndarray,
        where: str,
    ) -> np.ndarray | None:
        """`rows` of an attribute; None where it is absent or, with a note, does not fit."""
        index = primitive.attributes.get(attribute)
        if index is None:
            return None
        if self._file.count(index) != self._file.count(primitive.attributes["POSITION"]):
            self._file.notes.add(f"{where}: {attribute} is left out: its length is not that of POSITION")
            return None
        color = attribute == "COLOR_0"
        values = self._file.floats(index, types, rows, normalized=color)
        if values is None:
            self._file.notes.add(f"{where}: {attribute} is left out: it is not a {' or '.join(types)}")
            return None
        strays = wild(values)
        if strays.any():
            self._file.notes.add(f"{where}: values of {attribute} that are not finite count as 0")
            values[strays] = 0.0
        return opaque(values) if color else values


def variant_names(file: GltfFile) -> list[str]:
    """Return the names of KHR_materials_variants, in the file's order; without one, its number."""
    names = [record.name or f"variant {i}" for i, record in enumerate(file.gltf.extensions.variants.variants)]
    for name in {name for name in names if names.count(name) > 1}:
        file.notes.add(f"several variants are called '{name}'; they count as one")
    return names


def assemble(corners: np.ndarray, mode: int) -> np.ndarray:
    """Return the (T, 3) triangles of a list, strip or fan of vertex numbers (glTF 2.0, 3.7.2.1)."""
    if mode == TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    first = np.arange(max(0, len(corners) - 2))
    odd = first & 1  # every other triangle of a strip is wound the other way
    columns = (first, first + 1 + odd, first + 2 - odd)
    if mode == FAN:
        columns = (first + 1, first + 2, np.zeros_like(first))
    triangles: np.ndarray = corners[np.stack(columns, axis=1)]
    return triangles


def opaque(colors: np.ndarray) -> np.ndarray:
    """Return colors within 0..1, with an alpha of 1 where they have none."""
    result = np.ones((len(colors), 4), np.float32)
    np.clip(colors, 0.0, 1.0, out=result[:, : colors.shape[1]])
    return result
