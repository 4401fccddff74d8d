"""Primitives compressed by Draco (KHR_draco_mesh_compression)."""

from __future__ import annotations

from ispm.errors import SceneError
from ispm.io import gltf_schema as schema
from ispm.io.apart import INSTALL, has
from ispm.io.gltf_file import WIDTHS, GltfFile, item

_TRIANGLES = 4
_WORD = 4  # bytes of a number


def provide(file: GltfFile, primitive: schema.Primitive, where: str) -> None:
    """Give the accessors of a primitive what its Draco stream holds, where it has one.

    Without the decoder the accessors' own data are read, where they have any, with a note.
    where  the mesh, for messages
    Raises SceneError where there are none, or the stream is not what the accessors say.
    """
    packed = primitive.extensions.draco
    if packed is None:
        return
    named = {name: primitive.attributes.get(name) for name in packed.attributes}
    targets = {name: index for name, index in named.items() if index is not None}
    if primitive.indices is None or "POSITION" not in targets:
        raise SceneError(f"{where}: its Draco stream has no indices or no POSITION")
    if not has("draco"):
        if any(_lacks_bytes(file, index) for index in (primitive.indices, *targets.values())):
            raise SceneError(f"{where}: {missing('KHR_draco_mesh_compression')}")
        file.notes.add(f"meshes compressed by Draco are read from plain data; for the others: {INSTALL}")
        return
    if primitive.mode != _TRIANGLES:
        raise SceneError(f"{where}: strips of triangles compressed by Draco are not read")
    indices = {index: packed.attributes[name] for name, index in targets.items()}
    if file.provided(primitive.indices, *indices, by=packed.buffer_view):
        return
    counts = {index: file.count(index) for index in (primitive.indices, *indices)}
    size = _WORD * sum(
        count * WIDTHS.get(file.gltf.accessors[index].type, 1) for index, count in counts.items()
    )
    file.budget.take(where, memory=size, work=size)
    try:
        arrays = file.apart.decode("draco", file.view(packed.buffer_view))
        file.provide(primitive.indices, arrays["faces"].reshape(-1, 1), by=packed.buffer_view)
        for index, number in indices.items():
            if str(number) not in arrays:
                raise SceneError(f"it has no attribute {number}")
            file.provide(index, arrays[str(number)], by=packed.buffer_view)
    except SceneError as error:
        raise SceneError(f"{where}: its Draco stream: {error}") from None


def missing(extension: str) -> str:
    """Return what to say of a required extension whose decoder is not installed."""
    return f"it uses {extension}, whose decoder is not installed: {INSTALL}"


def _lacks_bytes(file: GltfFile, index: int) -> bool:
    return item(file.gltf.accessors, index, "accessor").buffer_view is None
