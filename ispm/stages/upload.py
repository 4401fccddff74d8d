"""The scene to the device; what did not change stays where it is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ispm.errors import SceneError
from ispm.frame import SLOTS, SPECULAR_SLOTS, GpuScene
from ispm.gpu import Buffer, Gpu, Sampler, Texture
from ispm.optics.texture import mip_chain
from ispm.scene import material as scene_material
from ispm.scene.packed import Geometry, Packed, to_world
from ispm.scene.windows import Window, cut_windows

_WRAP = {
    scene_material.Wrap.REPEAT: "repeat",
    scene_material.Wrap.CLAMP: "clamp-to-edge",
    scene_material.Wrap.MIRROR: "mirror-repeat",
}


class _Loaded(NamedTuple):
    """A texture on the device; `source` is held so that no other texture gets its id."""

    source: scene_material.Texture
    state: tuple[object, ...]
    texels: Texture


class Upload:
    """`Packed` to `GpuScene`; of parts that are the last frame's nothing is done.

    Raises SceneError where an array is larger than the adapter has room for, or a texture too wide for it.
    """

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._scene: GpuScene | None = None
        self._geometry: Geometry | None = None
        self._boxes = np.zeros((0, 2, 3))  # of the meshes, object space
        self._windows: list[Window] = []
        self._vertices = gpu.buffer("vertices", "vertex")
        self._indices = gpu.buffer("indices", "index")
        self._instances = gpu.buffer("instances")
        self._materials = gpu.buffer("materials")
        self._lights = gpu.buffer("lights")
        self._textures: dict[int, _Loaded] = {}
        white = gpu.texture("white", "rgba8unorm", usage=["sampled"]).sized((1, 1))
        self._white = white.write(np.full((1, 1, 4), 255, np.uint8)), gpu.sampler()

    def __call__(self, packed: Packed) -> GpuScene:
        """Return the scene as the device holds it."""
        known, self._scene = self._scene, None  # none, if this fails halfway
        before = known.packed if known else None
        if known is None or before is not packed:
            if before is None or before.placed is not packed.placed:
                self._place(packed)
            if before is None or before.looks is not packed.looks:
                self._write(self._materials, packed.materials)
                self._keep(packed.textures, packed.colors)
            if before is None or before.lit is not packed.lit:
                self._write(self._lights, packed.lights)
            known = GpuScene(
                packed,
                self._draw_boxes(packed),
                self._vertices,
                self._indices,
                self._instances,
                self._materials,
                self._lights,
                self._windows,
                [self._maps(row, packed.textures) for row in packed.materials],
            )
        self._scene = known
        return known

    def _place(self, packed: Packed) -> None:
        geometry, known = packed.geometry, self._geometry
        if geometry is not known:
            self._geometry = None
            if known is not None and known.indices is geometry.indices:
                for now, before in zip(geometry.ranges, known.ranges, strict=True):
                    if now is not before:  # it deformed
                        rows = geometry.vertices[now.vertices]
                        self._vertices.patch(rows, now.first_vertex * rows.itemsize)
            else:
                self._write(self._vertices, geometry.vertices, self._gpu.max_buffer)
                self._write(self._indices, geometry.indices, self._gpu.max_buffer)
                self._windows = cut_windows(geometry.ranges, self._gpu.max_binding)
            self._geometry = geometry
            self._boxes = np.array([kept.box for kept in geometry.ranges])
        self._write(self._instances, packed.instances)

    def _write(self, buffer: Buffer, rows: np.ndarray, most: int | None = None) -> None:
        """Write an array of at most `most` bytes; None: what can be bound at once."""
        most = most or self._gpu.max_binding
        if rows.nbytes > most:
            raise SceneError(
                f"the scene's {buffer.name} take {rows.nbytes >> 20} MiB, but {self._gpu.name} has room for "
                f"{most >> 20} MiB of them at most; use fewer triangles or another adapter"
            )
        buffer.write(rows)

    def _draw_boxes(self, packed: Packed) -> np.ndarray:
        """(draws, 2, 3) bounds of each draw's instances, world space."""
        if not packed.draws:
            return np.zeros((0, 2, 3))
        rows = packed.instances
        matrix = to_world(rows).astype(np.float64)
        low, high = np.moveaxis(self._boxes[rows["mesh"]], 1, 0)
        center = np.einsum("nij,nj->ni", matrix[..., :3], (low + high) / 2.0) + matrix[..., 3]
        extent = np.einsum("nij,nj->ni", np.abs(matrix[..., :3]), (high - low) / 2.0)
        first = [draw.first_instance for draw in packed.draws]
        return np.stack(
            [np.minimum.reduceat(center - extent, first), np.maximum.reduceat(center + extent, first)], axis=1
        )

    def _keep(
        self, textures: list[scene_material.Texture], colors: list[scene_material.Texture | None]
    ) -> None:
        """Load textures that came or changed, drop those that went; colors: see `mip_chain`."""
        kept, self._textures = self._textures, {}
        for texture, color in zip(textures, colors, strict=True):
            known, state = kept.get(id(texture)), (texture.state, color, color and color.state)
            if known is None or known.state != state:
                known = _Loaded(texture, state, self._load(texture, color))
            self._textures[id(texture)] = known

    def _load(self, texture: scene_material.Texture, color: scene_material.Texture | None) -> Texture:
        most = self._gpu.max_texture
        levels = [level for level in mip_chain(texture, color) if max(level.shape[:2]) <= most]
        if not levels:
            raise SceneError(
                f"texture '{texture.name}': {max(texture.pixels.shape[:2])} pixels are more than the "
                f"{most} that {self._gpu.name} can hold; make the picture smaller"
            )
        height, width = levels[0].shape[:2]
        format = "rgba8unorm-srgb" if texture.srgb else "rgba8unorm"
        loaded = self._gpu.texture(texture.name, format, usage=["sampled"])
        loaded.sized((width, height), levels=len(levels))
        for index, level in enumerate(levels):
            loaded.write(level, level=index)
        return loaded

    def _maps(
        self, material: np.void, textures: list[scene_material.Texture]
    ) -> dict[str, tuple[Texture, Sampler]]:
        slots = (*SLOTS, *SPECULAR_SLOTS)
        return {slot: self._map(int(material[f"{slot}_texture"]["texture"]), textures) for slot in slots}

    def _map(self, row: int, textures: list[scene_material.Texture]) -> tuple[Texture, Sampler]:
        if row < 0:
            return self._white
        texture = textures[row]
        wrap = (_WRAP[texture.wrap_u], _WRAP[texture.wrap_v])
        sampler = self._gpu.sampler(wrap, linear=texture.linear, mipmaps=texture.mipmaps)
        return self._textures[id(texture)].texels, sampler
