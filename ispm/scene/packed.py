"""A scene as flat arrays, the same bytes for the tracer and the GPU."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from typing import NamedTuple

import numpy as np

from ispm.errors import SceneError
from ispm.optics import records
from ispm.scene.directions import even_directions
from ispm.scene.extent import corners_of, enclosing_diameter
from ispm.scene.light import light_called
from ispm.scene.material import Material, Texture
from ispm.scene.mesh import ARRAYS, Mesh
from ispm.scene.names import Names, Place, Run
from ispm.scene.node import Node
from ispm.scene.packed_light import light_record
from ispm.scene.packed_material import material_record
from ispm.scene.scene import Scene
from ispm.scene.values import FARTHEST

PIECE = 64  # triangles of a mesh that a view draws or leaves out together, see `scene.pieces`
_HULL_DIRECTIONS = even_directions(64)


@dataclass
class MeshRange:
    """Where one mesh lies in the packed arrays.

    source  the mesh, which may change
    mesh    a copy with the arrays that were packed, which are not to be edited
    """

    source: Mesh
    mesh: Mesh
    first_vertex: int
    first_index: int
    triangle_count: int
    box: np.ndarray  # (2, 3) corners in object space

    def shows(self, mesh: Mesh) -> bool:
        """Whether a mesh has the arrays that were packed, untouched since."""
        return mesh.version == self.mesh.version and all(
            getattr(mesh, name) is getattr(self.mesh, name) for name in ARRAYS
        )

    @cached_property
    def piece_boxes(self) -> np.ndarray:
        """(n, 2, 3) float64 bounds of each PIECE of the triangles, object space."""
        points = self.mesh.positions[self.mesh.triangles.ravel()]
        begins = np.arange(0, len(points), 3 * PIECE)
        bounds = [extreme.reduceat(points, begins, axis=0) for extreme in (np.minimum, np.maximum)]
        return np.stack(bounds, axis=1).astype(np.float64)

    @cached_property
    def hull(self) -> np.ndarray:
        """(k, 3) `farthest_points` of the mesh."""
        return farthest_points(self.mesh)


@dataclass
class Geometry:
    """All meshes of a scene, in object space; kept until a mesh comes, goes or is touched.

    vertices  (V,) VERTEX
    indices   (3 T,) uint32 into `vertices`, absolute
    """

    vertices: np.ndarray
    indices: np.ndarray
    ranges: list[MeshRange]

    @cached_property
    def digest(self) -> bytes:
        """A hash of these meshes, 32 bytes."""
        return sha256(self.vertices.tobytes() + self.indices.tobytes()).digest()

    def fits(self, meshes: list[Mesh]) -> bool:
        """Whether these are exactly the meshes packed here, none touched nor given other arrays since."""
        return len(meshes) == len(self.ranges) and all(
            mesh is kept.source and kept.shows(mesh) for mesh, kept in zip(meshes, self.ranges, strict=True)
        )


@dataclass
class Draw:
    """Consecutive instances of one mesh with one material."""

    mesh: int
    material: int
    first_instance: int
    instance_count: int
    mirrored: bool


@dataclass(frozen=True, eq=False)
class Packed:
    """A scene at one moment.

    geometry   shared between frames
    instances  (I,) INSTANCE, world space, by mesh, material, mirrored or not, and node; rays and the G-buffer
               number them so
    materials  (M,) MATERIAL;  textures: what their slots point to
    lights     (L,) LIGHT;  draws: runs of instances, in order
    bounds     (2, 3) float64 corners of all instances, world space
    diagonal   m, of the smallest sphere about all of them: the scene's size, however it is turned; 1 where
               there is nothing
    widths     (I,) float32 m: the second largest extent of each instance, what a kernel should fit into
    boxes      (I, 2, 3) float64 corners of each instance, world space
    ids        (I,) what `names` calls each instance by: they count in the order of nodes, parts and copies
    """

    geometry: Geometry
    instances: np.ndarray
    materials: np.ndarray
    textures: list[Texture]
    lights: np.ndarray
    draws: list[Draw]
    bounds: np.ndarray
    diagonal: float
    widths: np.ndarray
    boxes: np.ndarray
    ids: np.ndarray
    names: Names

    def surface_area(self) -> float:
        """Return the area of all triangles, m2, world space."""
        total = 0.0
        for row in self.instances:
            mesh = self.geometry.ranges[row["mesh"]].mesh
            corners = (mesh.positions @ to_world(row)[:, :3].T.astype(np.float64))[mesh.triangles]
            edges = corners[:, 1:] - corners[:, :1]
            total += 0.5 * float(np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum())
        return total

    @property
    def caustic_hulls(self) -> np.ndarray:
        """(n, k, 3) points round each instance that casts caustics, worth aiming photons at."""
        flags = self.materials["flags"][self.instances["material"]]
        found = self.instances[(flags & records.MATERIAL_CAUSTIC) != 0]
        hulls = [self.geometry.ranges[mesh].hull for mesh in found["mesh"]]
        if not hulls:
            return np.zeros((0, len(_HULL_DIRECTIONS), 3))
        world = to_world(found).astype(np.float64)
        return np.asarray(np.einsum("nij,nkj->nki", world[:, :, :3], np.stack(hulls)) + world[:, None, :, 3])

    @property
    def glows(self) -> bool:
        """Whether any material emits light or shows its color unlit."""
        unlit = self.materials["flags"] & records.MATERIAL_UNLIT
        return bool(self.materials["emission"].any() or unlit.any())

    @property
    def triangle_count(self) -> int:
        """Triangles as placed."""
        return int(self.instances["triangle_count"].sum(dtype=np.int64))


def farthest_points(mesh: Mesh) -> np.ndarray:
    """Return (k, 3) vertices that lie farthest in evenly spread directions, object space: nearly its hull."""
    used = mesh.positions[np.unique(mesh.triangles)]
    farthest = [int((used @ direction).argmax()) for direction in _HULL_DIRECTIONS]
    return np.asarray(used[farthest], np.float64)


def pack(scene: Scene, geometry: Geometry | None = None) -> Packed:
    """Flatten `scene`; reuse `geometry` of an earlier frame where its meshes are unchanged.

    Raises SceneError where a mesh, material, light or node has a value that cannot be used.
    """
    tree = scene.tree()
    worlds = tree.worlds()
    far = np.flatnonzero(~(np.abs(worlds).max(axis=(1, 2), initial=0.0) <= FARTHEST))
    if len(far):
        name = tree.nodes[far[0]].name
        raise SceneError(f"node '{name}': stands in nodes that together move or scale it too far")
    meshes: dict[int, int] = {}
    mesh_list: list[Mesh] = []
    materials: dict[int, int] = {}
    material_list: list[Material] = []
    rows: list[_Placed] = []
    light_rows: list[np.ndarray] = []
    runs: list[Run] = []
    for index, (node, world) in enumerate(zip(tree.nodes, worlds, strict=True)):
        node.check()
        light = node.light
        if light is not None:
            light_rows.append(light_record(light, world, light_called(light, node.name, len(light_rows))))
        copies = node.copies
        for number, part in enumerate(node.parts):
            if not len(part.mesh.triangles) or not copies:
                continue
            mesh = meshes.setdefault(id(part.mesh), len(meshes))
            if mesh == len(mesh_list):
                mesh_list.append(part.mesh)
            material = materials.setdefault(id(part.material), len(materials))
            if material == len(material_list):
                material_list.append(part.material)
            rows.append(_Placed(mesh, material, index, copies))
            runs.append(Run(index, number, part.mesh.name, material, copies))

    if geometry is None or not geometry.fits(mesh_list):
        geometry = pack_geometry(mesh_list)
    textures: list[Texture] = []
    material_rows = np.zeros(len(material_list), records.MATERIAL)
    for i, item in enumerate(material_list):
        material_rows[i] = material_record(item, textures)
    instances, draws, widths, corners, ids = _instances(rows, tree.nodes, worlds, geometry)
    boxes = np.stack([corners.min(axis=1), corners.max(axis=1)], axis=1)
    bounds = np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)]) if len(boxes) else np.zeros((2, 3))
    diagonal = enclosing_diameter(corners.reshape(-1, 3)) or 1.0
    lights = np.array(light_rows, records.LIGHT)
    nodes = tuple(map(Place, [node.name for node in tree.nodes], tree.parents))
    return Packed(
        geometry,
        instances,
        material_rows,
        textures,
        lights,
        draws,
        bounds,
        diagonal,
        widths,
        boxes,
        ids,
        Names(tuple(runs), tuple(material.name for material in material_list), nodes),
    )


def to_world(instances: np.ndarray | np.void) -> np.ndarray:
    """Return the (..., 3, 4) float32 object-to-world matrices of (...,) INSTANCE."""
    return np.stack([instances["world0"], instances["world1"], instances["world2"]], axis=-2)


def pack_geometry(meshes: list[Mesh]) -> Geometry:
    """Return the vertices and triangles of `meshes`, one behind the other."""
    ranges: list[MeshRange] = []
    vertices: list[np.ndarray] = []
    indices: list[np.ndarray] = []
    vertex_count = index_count = 0
    for source in meshes:
        source.check()
        mesh = copy.copy(source)  # its arrays stay together, whoever gives the mesh others meanwhile
        mesh.check()
        rows, triangles = _vertices(mesh)
        ranges.append(MeshRange(source, mesh, vertex_count, index_count, len(triangles), mesh.bounds))
        vertices.append(rows)
        indices.append((triangles + np.uint32(vertex_count)).astype(np.uint32).ravel())
        vertex_count += len(rows)
        index_count += triangles.size
    empty_vertices, empty_indices = np.zeros(0, records.VERTEX), np.zeros(0, np.uint32)
    return Geometry(
        np.concatenate([empty_vertices, *vertices]), np.concatenate([empty_indices, *indices]), ranges
    )


def _vertices(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """VERTEX rows and triangles; a mesh without normals gets three vertices of its own per triangle."""
    triangles = mesh.triangles
    normals = mesh.normals
    take: np.ndarray | slice = slice(None)
    if normals is None:
        take = triangles.ravel()
        corners = mesh.positions[triangles].astype(np.float64)
        flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals = np.repeat(_unit(flat), 3, axis=0)
        triangles = np.arange(triangles.size, dtype=np.uint32).reshape(-1, 3)
    else:
        normals = _unit(normals.astype(np.float64))
    rows = np.zeros(len(normals), records.VERTEX)
    rows["position"] = mesh.positions[take]
    rows["normal"] = normals
    rows["color"] = _pack_colors(mesh.colors, take, len(rows))
    for name in ("uv0", "uv1"):
        values = getattr(mesh, name)
        if values is not None:
            rows[name] = values[take]
    if mesh.tangents is not None:
        rows["tangent"] = mesh.tangents[take]
    elif mesh.uv0 is not None:
        rows["tangent"] = _tangents(rows, triangles)
    return rows, triangles


def _tangents(rows: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(V, 4) tangents from uv0, area-weighted over each vertex's triangles."""
    p = rows["position"][triangles].astype(np.float64)
    uv = rows["uv0"][triangles].astype(np.float64)
    e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    d1, d2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    det = d1[:, 0] * d2[:, 1] - d2[:, 0] * d1[:, 1]
    sign = np.sign(det)[:, None]
    tangent = (e1 * d2[:, 1:] - e2 * d1[:, 1:]) * sign
    bitangent = (e2 * d1[:, :1] - e1 * d2[:, :1]) * sign
    sums = np.zeros((2, len(rows), 3))
    for corner in range(3):
        np.add.at(sums[0], triangles[:, corner], tangent)
        np.add.at(sums[1], triangles[:, corner], bitangent)
    normal = rows["normal"].astype(np.float64)
    along = sums[0] - normal * np.einsum("ij,ij->i", normal, sums[0])[:, None]
    length = np.linalg.norm(along, axis=1)
    result = np.zeros((len(rows), 4), np.float32)
    good = length > 1e-20
    result[good, :3] = along[good] / length[good, None]
    side = np.einsum("ij,ij->i", np.cross(normal, along), sums[1])
    result[good, 3] = np.where(side[good] < 0.0, 1.0, -1.0)  # glTF's v points down
    return result


def _pack_colors(colors: np.ndarray | None, take: np.ndarray | slice, count: int) -> np.ndarray:
    if colors is None:
        return np.full(count, 0xFFFFFFFF, np.uint32)
    bytes_ = np.rint(np.clip(colors[take], 0.0, 1.0) * 255.0).astype(np.uint32)
    return np.asarray(bytes_[:, 0] | bytes_[:, 1] << 8 | bytes_[:, 2] << 16 | bytes_[:, 3] << 24)


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors; +Y where a vector has no length."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    good = np.isfinite(length) & (length > 0.0)
    return np.where(good, vectors / np.where(good, length, 1.0), (0.0, 1.0, 0.0))


class _Placed(NamedTuple):
    """A mesh with a material at a node: the number of each, and of its copies there."""

    mesh: int
    material: int
    node: int
    copies: int


def _instances(
    rows: list[_Placed], nodes: list[Node], worlds: np.ndarray, geometry: Geometry
) -> tuple[np.ndarray, list[Draw], np.ndarray, np.ndarray, np.ndarray]:
    """INSTANCE rows, the draws that show them, their widths in m, (n, 8, 3) corners of their own boxes,
    turned with them, in world space, and the index that each has in the order of `rows`."""
    if not rows:
        none = np.zeros(0, np.int64)
        return np.zeros(0, records.INSTANCE), [], np.zeros(0, np.float32), np.zeros((0, 8, 3)), none
    *numbers, copies = np.array(rows, np.int64).T
    mesh, material, node = (np.repeat(each, copies) for each in numbers)
    world = worlds[node]
    first = 0
    for row in rows:
        here = nodes[row.node]
        if here.instances is not None:
            world[first : first + row.copies] = here.places(worlds[row.node])
        first += row.copies
    mirrored = np.linalg.det(world[:, :3, :3]) < 0.0
    order = np.lexsort((node, mirrored, material, mesh))
    mesh, material, node, mirrored = mesh[order], material[order], node[order], mirrored[order]
    world = world[order]
    instances = np.zeros(len(world), records.INSTANCE)
    cofactors = _cofactors(world[:, :3, :3])
    for k in range(3):
        instances[f"world{k}"] = world[:, k]
        instances[f"normal{k}"][:, :3] = cofactors[:, k]
    instances["first_index"] = np.array([r.first_index for r in geometry.ranges])[mesh]
    instances["triangle_count"] = np.array([r.triangle_count for r in geometry.ranges])[mesh]
    instances["material"], instances["node"], instances["mesh"] = material, node, mesh
    instances["flags"] = np.where(mirrored, records.INSTANCE_MIRRORED, 0)
    boxes = np.stack([kept.box for kept in geometry.ranges])[mesh]
    corners = np.einsum("nij,nkj->nki", world[:, :3, :3], corners_of(boxes)) + world[:, None, :3, 3]
    extents = (boxes[:, 1] - boxes[:, 0]) * np.linalg.norm(world[:, :3, :3], axis=1)
    widths = np.sort(extents, axis=1)[:, 1].astype(np.float32)
    draws = _draws(mesh, material, mirrored)
    return instances, draws, widths, corners, order


def _draws(mesh: np.ndarray, material: np.ndarray, mirrored: np.ndarray) -> list[Draw]:
    """Runs of instances of the same mesh and material, turned the same direction."""
    new = np.ones(len(mesh), bool)
    new[1:] = (np.diff(mesh) != 0) | (np.diff(material) != 0) | (mirrored[1:] != mirrored[:-1])
    first = np.flatnonzero(new)
    counts = np.diff(np.append(first, len(mesh)))
    return [
        Draw(int(mesh[i]), int(material[i]), int(i), int(n), bool(mirrored[i]))
        for i, n in zip(first, counts, strict=True)
    ]


def _cofactors(m: np.ndarray) -> np.ndarray:
    """Cofactors of (n, 3, 3) matrices, which take normals to world space even where there is no inverse."""
    x, y, z = m[:, 0], m[:, 1], m[:, 2]
    stacked = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=1)
    mirrored = np.einsum("ni,ni->n", stacked[:, 0], x) < 0.0
    return np.where(mirrored[:, None, None], -stacked, stacked)
