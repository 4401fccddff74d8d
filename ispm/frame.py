"""The data that stages pass on. Readers borrow textures and buffers for the frame only."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import compress
from typing import Any

import numpy as np

from ispm.gpu import Buffer, Canvas, Gpu, Group, Raster, Recording, Sampler, Texture
from ispm.lights.lightmap import LightMap
from ispm.optics import records
from ispm.optics.records import VERTEX, WINDOW
from ispm.scene.packed import Draw, Packed
from ispm.scene.packed_light import NO_LIGHTS
from ispm.scene.windows import Window

SLOTS = ("base_color", "metallic_roughness", "normal", "emission", "transmission")
SPECULAR_SLOTS = ("specular", "specular_color")
_SKIPPED = 1024  # triangles that are not drawn, worth a draw more
_LOOKED_AT = 1 << 16  # instances of a draw at most, which takes as long as to draw some triangles of each


@dataclass(frozen=True, eq=False)
class GpuScene:
    """A `Packed` scene on the device.

    boxes  (draws, 2, 3) float64 bounds of what each draw shows, world space
    vertices, indices, instances, materials, lights  its arrays, at least one row each
    windows  what shaders that fetch their own vertices can bind of the first two at once
    maps  of each material the texture and the sampler of each of SLOTS and SPECULAR_SLOTS; white where it
          has none
    """

    packed: Packed
    boxes: np.ndarray
    vertices: Buffer
    indices: Buffer
    instances: Buffer
    materials: Buffer
    lights: Buffer
    windows: list[Window]
    maps: list[dict[str, tuple[Texture, Sampler]]] = field(repr=False)

    @property
    def draws(self) -> list[Draw]:
        """What to draw."""
        return self.packed.draws

    @property
    def light_count(self) -> int:
        """Rows of `lights` in use."""
        return len(self.packed.lights)

    @cached_property
    def without_lights(self) -> GpuScene:
        """The scene without its lights that have no surface."""
        return replace(self, packed=replace(self.packed, lit=NO_LIGHTS))

    def draw_corners(self, canvas: Canvas, draw: Draw, window: Window) -> None:
        """Draw what a window shows, with a number for each corner of each triangle, for shaders that fetch
        them."""
        first, count = window.corners[draw.mesh]
        canvas.draw(count, draw.instance_count, first=first, first_instance=draw.first_instance)

    def draws_in(self, window: Window, shown: Iterable[Draw]) -> Iterator[Draw]:
        """Yield those of some draws that a window has triangles of."""
        return (draw for draw in shown if draw.mesh in window.corners)

    def seen_by(self, sees: Callable[[np.ndarray], np.ndarray]) -> list[Draw]:
        """Return the draws that may be seen, of those of many instances the runs that may.

        sees  returns (n,) whether each of (n, 2, 3) world-space boxes may be seen
        """
        found: list[Draw] = []
        for draw in compress(self.draws, sees(self.boxes)):
            each, count = self.packed.geometry.ranges[draw.mesh].triangle_count, draw.instance_count
            if count > _LOOKED_AT or each * count < 2 * _SKIPPED:
                found.append(draw)
                continue
            first = draw.first_instance
            for run in _runs(sees(self.packed.boxes[first : first + count]), -(-_SKIPPED // max(each, 1))):
                begin, end = run
                found.append(replace(draw, first_instance=first + begin, instance_count=end - begin))
        return found

    def draw_indexed(self, canvas: Canvas, draw: Draw) -> None:
        """Draw through the canvas's vertex and index buffers, so that corners share work."""
        mesh = self.packed.geometry.ranges[draw.mesh]
        canvas.draw_indexed(
            3 * mesh.triangle_count,
            draw.instance_count,
            first_index=mesh.first_index,
            first_instance=draw.first_instance,
        )

    def corners(self, frame: Recording, window: Window) -> dict[str, Any]:
        """What shaders that fetch their own vertices bind of a window, as they name it."""
        record = np.zeros((), WINDOW)
        record["first_vertex"], record["first_index"] = window.first_vertex, window.first_index
        record["first_shown"], record["shown_count"] = (
            window.first_shown,
            window.end_index - window.first_shown,
        )
        return {
            "vertices": self.vertices.rows(window.first_vertex, window.end_vertex, VERTEX.itemsize),
            "indices": self.indices.rows(window.first_index, window.end_index, 4),
            "instances": self.instances,
            "window": frame.uniform(record),
        }

    def is_masked(self, material: int) -> bool:
        """Whether a material, by its row, has holes: alpha mode MASK or BLEND."""
        flags = self.packed.materials[material]["flags"]
        return bool(flags & (records.MATERIAL_MASK | records.MATERIAL_BLEND))

    def shows_backs(self, draw: Draw, within: int) -> bool:
        """Whether the eye sees a draw's triangles from behind, too; within: the row of the instance whose
        solid it is in, see `solid_about`."""
        is_within = draw.first_instance <= within < draw.first_instance + draw.instance_count
        flags = self.packed.materials[draw.material]["flags"]
        return is_within or bool(flags & records.MATERIAL_DOUBLE_SIDED)

    def is_textured(self, material: int) -> bool:
        """Whether a material, by its row, has a texture in any of SLOTS."""
        row = self.packed.materials[material]
        return any(row[f"{slot}_texture"]["texture"] >= 0 for slot in SLOTS)

    def material_maps(self, material: int, *slots: str) -> dict[str, Texture | Sampler]:
        """Return `<slot>_map` and `<slot>_sampler` for each of `slots`, as shaders name them."""
        found: dict[str, Texture | Sampler] = {}
        for slot in slots:
            found[f"{slot}_map"], found[f"{slot}_sampler"] = self.maps[material][slot]
        return found

    def each(
        self,
        frame: Recording,
        canvas: Canvas,
        draws: Iterable[Draw],
        pipeline: Callable[[Draw], Raster],
        shared: Mapping[str, Any],
    ) -> Iterator[Draw]:
        """Yield each of `draws` with its pipeline set and what it binds bound.

        shared  group 0 of all pipelines; group 1 is what an alpha mask reads, for materials that have one
        """
        groups: dict[Raster, Group] = {}
        used = None
        for draw in draws:
            raster = pipeline(draw)
            if raster not in groups:
                groups[raster] = raster.bind(0, **shared)
            if raster is not used:
                canvas.use(raster, groups[raster])
                used = raster
            if self.is_masked(draw.material):
                material = frame.uniform(self.packed.materials[draw.material])
                maps = self.material_maps(draw.material, "base_color")
                canvas.bind(1, raster.bind(1, material=material, **maps))
            yield draw


def _runs(seen: np.ndarray, gap: int) -> Iterator[tuple[int, int]]:
    """Yield where runs of True begin, and end, in (n,) bool; fewer than `gap` False do not part them."""
    rows = np.flatnonzero(seen)
    if not len(rows):
        return
    parts = np.flatnonzero(np.diff(rows) > gap)
    begins, ends = np.append(0, parts + 1), np.append(parts, len(rows) - 1)
    yield from zip(rows[begins].tolist(), (rows[ends] + 1).tolist(), strict=True)


@dataclass(frozen=True, eq=False)
class GBuffer:
    """What each pixel of the eye sees.

    ids       rg32uint: instance row + 1 (0: nothing is there), primitive in its mesh
    points    rgba32uint: the bits of the position, world space; material and transmission in one word, 0
              where nothing is (ispm/stages/material.wgsl)
    normals   rg32uint: shading and geometric normal, packed (ispm/optics/sampling.wgsl), both on the side the
              eye sees
    base      rgba16float: base color, linear; metallic
    emission  rgba16float: cd/m2 as ispm/stages/glow.wgsl packs it; roughness
    depth     r32float: of the points in clip space, reversed; 0 where nothing is
    specular  rgba8unorm-srgb: what textures make of specular color and factor, of MATERIAL_SPECULAR_MAPPED
              alone; one texel where no material has them
    """

    ids: Texture
    points: Texture
    normals: Texture
    base: Texture
    emission: Texture
    depth: Texture
    specular: Texture

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.depth.size

    @property
    def surfaces(self) -> dict[str, Texture]:
        """What shaders that shade pixels bind, as they name it."""
        kept = dict(points=self.points, normals=self.normals, base=self.base, emission=self.emission)
        return kept | dict(specular=self.specular)


@dataclass(frozen=True, eq=False)
class Receivers:
    """Points to be lit that make up an image, so that those beside each other are found.

    points  (h w,) RECEIVER, row by row from the top left
    size    (w, h)
    """

    points: np.ndarray
    size: tuple[int, int]


@dataclass(frozen=True, eq=False)
class LitFrame:
    """The light of a frame's pixels, still on the device: (W, H) rgba32float, linear, cd/m2.

    gbuffer     what the pixels show
    direct      light of lamps; indirect: of photons; emission: what surfaces give off. Their alpha is the
                share of a pixel that shows a surface
    irradiance  of photons, lx
    through     the share of a background that glass shows, or one black texel
    """

    gbuffer: GBuffer
    direct: Texture
    indirect: Texture
    irradiance: Texture
    emission: Texture
    through: Texture


@dataclass(frozen=True, eq=False)
class ShadowMaps:
    """The shadow maps of all lights, tiles of one atlas; depth is reversed.

    maps    SHADOW_MAP rows (ispm/stages/shadow_map.wgsl), one for each light
    tiles   SHADOW_TILE rows, six for each light
    depth   depth32float: the nearest opaque surface of each texel
    sheets  depth32float: its nearest thin surface that lets light straight through
    tints   rgba8unorm: what all of those before the opaque one let through
    The last two are not drawn, and of any size, unless it `has_sheets`.
    """

    maps: np.ndarray
    tiles: np.ndarray
    depth: Texture
    sheets: Texture
    tints: Texture
    has_sheets: bool


@dataclass(frozen=True, eq=False)
class BounceMap:
    """The first hits that a map of a light sees.

    corners  (F, 2) texels right of and below the texture's corner where its faces begin
    width    texels of a face's edge
    """

    map: LightMap
    corners: np.ndarray
    width: int


@dataclass(frozen=True, eq=False)
class BounceMaps:
    """The bounce maps of all lights, side by side.

    texels  rg32uint: instance row, primitive in its mesh; NO_HIT in the first where nothing was hit
    """

    texels: Texture
    maps: list[BounceMap]
    _read: list[np.ndarray] = field(default_factory=list, repr=False)

    def read(self, gpu: Gpu) -> list[np.ndarray]:
        """Return the maps as (F, width, width, 2) uint32, after one wait for all; they are read once."""
        if self.maps and not self._read:
            (texels,) = gpu.read_many([(self.texels, np.uint32, 2)])
            for each in self.maps:
                faces = [texels[y : y + each.width, x : x + each.width] for x, y in each.corners]
                self._read.append(np.stack(faces))
        return self._read


_ATTRIBUTES = {"position": "float32x3", "color": "unorm8x4", "uv0": "float32x2", "uv1": "float32x2"}


def vertex_layout(*fields: str) -> list[dict[str, object]]:
    """WebGPU's layout of these fields of a VERTEX, at locations 0, 1, ..."""
    assert VERTEX.fields is not None
    attributes = [
        {"format": _ATTRIBUTES[name], "offset": VERTEX.fields[name][1], "shader_location": i}
        for i, name in enumerate(fields)
    ]
    return [{"array_stride": VERTEX.itemsize, "step_mode": "vertex", "attributes": attributes}]
