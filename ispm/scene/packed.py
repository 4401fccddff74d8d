"""A scene as flat arrays, the same bytes for the tracer and the GPU."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from hashlib import sha256

import numpy as np

from ispm.errors import SceneError
from ispm.optics import records
from ispm.optics.environment import EnvironmentTable
from ispm.scene.directions import even_directions
from ispm.scene.layout import layout_of
from ispm.scene.material import Texture
from ispm.scene.mesh import ARRAYS, Mesh
from ispm.scene.names import Names
from ispm.scene.packed_environment import Surround, pack_environment
from ispm.scene.packed_instance import Draw as Draw
from ispm.scene.packed_instance import Placed, place_instances
from ispm.scene.packed_light import Lit, pack_lights
from ispm.scene.packed_material import Looks, pack_materials
from ispm.scene.packed_vertices import Chunk, VertexLayout, fill_vertices, lay_out
from ispm.scene.placing import Tree
from ispm.scene.scene import Scene
from ispm.scene.sky import with_sun
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
    vertex_count: int
    first_index: int
    triangle_count: int
    chunks: list[Chunk]  # rows count from the first vertex and the first index
    box: np.ndarray  # (2, 3) corners in object space
    _digest: bytes = field(default=b"", init=False)

    @property
    def vertices(self) -> slice:
        """Which rows of the vertices are its own."""
        return slice(self.first_vertex, self.first_vertex + self.vertex_count)

    @property
    def indices(self) -> slice:
        """Which rows of the indices are its own."""
        return slice(self.first_index, self.first_index + 3 * self.triangle_count)

    def is_shaped_by(self, mesh: Mesh) -> bool:
        """Whether a mesh has the triangles that were packed, so that its vertices fit in their place."""
        same = mesh.triangles is self.mesh.triangles and len(mesh.positions) == len(self.mesh.positions)
        return same and all(
            (getattr(mesh, name) is None) == (getattr(self.mesh, name) is None) for name in ("normals", "uv0")
        )

    def digest_in(self, geometry: Geometry) -> bytes:
        """Return a hash of the mesh as it is packed in a geometry; found once."""
        if not self._digest:
            told = sha256(geometry.vertices[self.vertices].view(np.uint8).data)
            told.update(geometry.indices[self.indices].data)
            self._digest = told.digest()
        return self._digest

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
        return sha256(b"".join(kept.digest_in(self) for kept in self.ranges)).digest()

    def fits(self, meshes: list[Mesh]) -> bool:
        """Whether these are exactly the meshes packed here, none touched nor given other arrays since."""
        return len(meshes) == len(self.ranges) and all(
            mesh is kept.source and kept.shows(mesh) for mesh, kept in zip(meshes, self.ranges, strict=True)
        )


@dataclass(frozen=True, eq=False)
class Packed:
    """A scene at one moment, in parts that frames share while they stay as they are.

    placed    its meshes and their instances
    looks     its materials
    lit       its lights, lamps with a surface aside, which are instances
    surround  its environment
    """

    placed: Placed
    looks: Looks
    lit: Lit
    surround: Surround

    @property
    def geometry(self) -> Geometry:
        """The meshes."""
        return self.placed.geometry

    @property
    def instances(self) -> np.ndarray:
        """(I,) INSTANCE, world space, by mesh, material, mirrored or not, and node; rays and the G-buffer
        number them so."""
        return self.placed.instances

    @property
    def draws(self) -> list[Draw]:
        """Runs of instances, in order."""
        return self.placed.draws

    @property
    def bounds(self) -> np.ndarray:
        """(2, 3) float64 corners of all instances, world space."""
        return self.placed.bounds

    @property
    def diagonal(self) -> float:
        """m, of the smallest sphere about all instances: the scene's size, however turned; 1 of nothing."""
        return self.placed.diagonal

    @property
    def widths(self) -> np.ndarray:
        """(I,) float32 m: the second largest extent of each instance, what a kernel should fit into."""
        return self.placed.widths

    @property
    def lengths(self) -> np.ndarray:
        """(I,) float32 m: the largest extent of each instance."""
        return self.placed.lengths

    @property
    def boxes(self) -> np.ndarray:
        """(I, 2, 3) float64 corners of each instance, world space."""
        return self.placed.boxes

    @property
    def ids(self) -> np.ndarray:
        """(I,) what `names` calls each instance by: they count in the order of nodes, parts and copies."""
        return self.placed.ids

    @property
    def names(self) -> Names:
        """What ids stand for."""
        return self.placed.layout.names

    @property
    def materials(self) -> np.ndarray:
        """(M,) MATERIAL."""
        return self.looks.rows

    @property
    def textures(self) -> list[Texture]:
        """What the slots of the materials point to."""
        return self.looks.textures

    @property
    def colors(self) -> list[Texture | None]:
        """The base color that goes with each texture's metalness, see `Looks`."""
        return self.looks.colors

    @property
    def lights(self) -> np.ndarray:
        """(L,) LIGHT: those without a surface. Lamps with one are instances of meshes that emit."""
        return self.lit.rows

    @property
    def environment(self) -> EnvironmentTable:
        """The light from all around."""
        return self.surround.table

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


def pack(scene: Scene, before: Packed | None = None, tree: Tree | None = None) -> Packed:
    """Flatten a scene.

    before  of an earlier frame: what of it is still so is used again; where all is, it is returned itself
    tree    the scene's, or one with more in it; a sky's sun comes to it
    Raises SceneError where a mesh, material, light or node has a value that cannot be used.
    """
    tree = with_sun(scene.tree() if tree is None else tree, scene.environment)
    worlds = tree.worlds()
    if not np.abs(worlds).max(initial=0.0) <= FARTHEST:  # NaN is not
        far = ~(np.abs(worlds).max(axis=(1, 2)) <= FARTHEST)
        name = tree.nodes[int(far.argmax())].name
        raise SceneError(f"node '{name}': stands in nodes that together move or scale it too far")
    layout = layout_of(tree, before.placed.layout if before else None)
    lit = pack_lights(layout, worlds, before.lit if before else None)
    layout.pose(worlds)
    geometry = pack_geometry(layout.meshes, before.geometry if before else None)
    looks = pack_materials(layout.looks(), before.looks if before else None)
    placed = place_instances(layout, worlds, geometry, before.placed if before else None)
    surround = pack_environment(scene.environment, before.surround if before else None)
    parts = placed, looks, lit, surround
    if before and parts == (before.placed, before.looks, before.lit, before.surround):
        return before
    return Packed(*parts)


def to_world(instances: np.ndarray | np.void) -> np.ndarray:
    """Return the (..., 3, 4) float32 object-to-world matrices of (...,) INSTANCE."""
    return np.stack([instances["world0"], instances["world1"], instances["world2"]], axis=-2)


def pack_geometry(meshes: list[Mesh], before: Geometry | None = None) -> Geometry:
    """Return the vertices and triangles of `meshes`, one behind the other.

    before  of an earlier frame: itself where all is as then, and its indices where meshes only deformed
    """
    if before is not None:
        if before.fits(meshes):
            return before
        if deformed := _deformed(meshes, before):
            return deformed
    ranges, layouts = list[MeshRange](), list[VertexLayout]()
    vertex_count = index_count = 0
    for source in meshes:
        source.check()
        mesh = copy.copy(source)  # its arrays stay together, whoever gives the mesh others meanwhile
        mesh.check()
        layout = lay_out(mesh)
        place = vertex_count, layout.count, index_count, len(layout.triangles)
        ranges.append(MeshRange(source, mesh, *place, layout.chunks, mesh.bounds))
        layouts.append(layout)
        vertex_count += layout.count
        index_count += layout.triangles.size
    vertices, indices = np.zeros(vertex_count, records.VERTEX), np.empty(index_count, np.uint32)
    for part, layout in zip(ranges, layouts, strict=True):
        fill_vertices(vertices[part.vertices], part.mesh, layout)
        np.add(layout.triangles.ravel(), np.uint32(part.first_vertex), out=indices[part.indices])
    return Geometry(vertices, indices, ranges)


def _deformed(meshes: list[Mesh], before: Geometry) -> Geometry | None:
    """A geometry that differs from one before in its vertices alone; None where more does."""
    if len(meshes) != len(before.ranges):
        return None
    ranges, changed = list(before.ranges), list[MeshRange]()
    for k, (source, kept) in enumerate(zip(meshes, before.ranges, strict=True)):
        if source is kept.source and kept.shows(source):
            continue
        source.check()
        mesh = copy.copy(source)
        if source is not kept.source or not kept.is_shaped_by(mesh):
            return None
        ranges[k] = replace(kept, mesh=mesh, box=mesh.bounds)
        changed.append(ranges[k])
    vertices = before.vertices.copy()
    for part in changed:
        vertices[part.vertices] = np.zeros((), records.VERTEX)
        fill_vertices(vertices[part.vertices], part.mesh, lay_out(part.mesh))
    return Geometry(vertices, before.indices, ranges)
