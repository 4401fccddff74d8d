"""Shadow maps of all lights, side by side in one texture of depth."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ispm import wgsl
from ispm.errors import SceneError
from ispm.frame import SPECULAR_SLOTS, GpuScene, ShadowMaps, vertex_layout
from ispm.gpu import Canvas, Gpu, Kept, RasterState, Recording, Target, Texture
from ispm.lights.atlas import GUARD, LEAST, Seen, ShadowAtlas, ShadowTile, plan_atlas
from ispm.lights.lightmap import LightMap, light_maps
from ispm.optics.records import MATERIAL_BLEND, MATERIAL_THIN, MATERIAL_TRANSMITS
from ispm.scene.packed import Geometry, Packed
from ispm.scene.pieces import DrawRange, Pieces
from ispm.stages.camera import CameraView

_PATH = "stages/shadow.wgsl"
_MAP = wgsl.load("stages/shadow_map.wgsl").dtype("ShadowMap")
_TILE = wgsl.load("stages/shadow_map.wgsl").dtype("ShadowTile")
_LEAST_PIXELS = 1 << 18  # of the picture that maps are made for: rays mend edges, not what a map misses
_LEAST_WIDTH = 1.0 / 4.0  # of a texel to a pixel, at least
_FINEST = -15.0  # LEVEL_BIAS with which every lookup takes the finest level
_VIEW, _MIN_ALPHA = wgsl.load(_PATH).dtype("View"), wgsl.load(_PATH).constants["MIN_ALPHA"]
_SHEET_SLOTS = ("base_color", "transmission", *SPECULAR_SLOTS)
_FACES = 6  # rows of a light
_SLANTED = np.float32(8.0)  # at most, of receivers seen aslant: how much longer than wide they are
_ROUND = 256  # texels that the atlas grows by


class ShadowStage:
    """Draws the scene's depth as each light sees it, and the tint of thin sheets; what is drawn is kept while
    it would be drawn alike.

    resolution  texels of a tile's side at most
    Both sides of every surface cast. Raises SceneError where the adapter's largest texture cannot hold
    the maps of all lights.
    """

    def __init__(self, gpu: Gpu, resolution: int) -> None:
        self._gpu = gpu
        self.resolution = max(min(resolution, gpu.max_texture), LEAST)
        corners, masked = vertex_layout("position"), vertex_layout("position", "color", "uv0", "uv1")
        holes = RasterState(vertex="vs_masked", fragment="fs_masked", vertex_layout=masked)
        tint = replace(holes, fragment="fs_sheet", depth_write=False)
        self._opaque = gpu.raster(_PATH, (), RasterState(fragment=None, vertex_layout=corners))
        # A mean of levels has other holes, and no texel beside it tells that rays are to look.
        self._masked = gpu.raster(_PATH, (), holes, LEVEL_BIAS=_FINEST)
        self._sheet = gpu.raster(_PATH, [Target("rgba8unorm", "multiply")], tint)
        self._shared_of: np.ndarray | None = None
        self._pieces: tuple[GpuScene, Pieces] | None = None
        self._kept = Kept()
        self._indices = gpu.buffer("shared indices", "index")
        self._depth = gpu.texture("shadow atlas", "depth32float")
        self._sheets = gpu.texture("sheet atlas", "depth32float")
        self._tints = gpu.texture("tint atlas", "rgba8unorm")

    def __call__(
        self,
        frame: Recording,
        scene: GpuScene,
        receivers: np.ndarray,
        view: CameraView,
        near: float,
    ) -> ShadowMaps:
        """Record the draws and return where their result will be.

        receivers  (n,) RECEIVER, points that the eye sees
        view       the eye's
        near       m, a tiny part of the scene's diagonal
        """
        packed = scene.packed
        if self._pieces is None or self._pieces[0] is not scene:
            self._pieces = scene, Pieces.of(packed, scene.boxes)
        _, pieces = self._pieces
        self._share(packed.geometry)
        seen = _seen(packed, receivers, view)
        limit = self._gpu.max_texture
        maps = light_maps(packed)
        atlas = plan_atlas(packed.lights, maps, pieces.boxes, seen, self.resolution, limit)
        if atlas is None:
            raise SceneError(
                f"the scene has {len(packed.lights)} lights, more than {self._gpu.name} can hold shadow maps "
                f"for in a texture of {self._gpu.max_texture} texels a side; remove some"
            )
        sheets = _are_sheets(packed.materials[[draw.material for draw in scene.draws]])
        views = [view_row(tile, near) for tile in atlas.tiles]
        if self._kept.lacks(frame, packed.placed, packed.looks, *map(_told, atlas.tiles, views)):
            self._draw(frame, scene, pieces, atlas, views, sheets)
        return ShadowMaps(
            map_rows(maps, near),
            tile_rows(atlas, len(maps)),
            self._depth,
            self._sheets,
            self._tints,
            bool(sheets.any()),
        )

    def _draw(
        self,
        frame: Recording,
        scene: GpuScene,
        pieces: Pieces,
        atlas: ShadowAtlas,
        views: list[np.ndarray],
        sheets: np.ndarray,
    ) -> None:
        """Draw the tiles; sheets: (draws,) bool."""
        self._fit(self._depth, atlas.size)
        for texture in (self._sheets, self._tints):
            texture.sized(self._depth.size if sheets.any() else (1, 1))
        self._draw_depth(frame, scene, pieces, atlas, views, self._depth, ~sheets)
        if sheets.any():
            self._draw_tints(frame, scene, pieces, atlas, views, sheets)
            self._draw_depth(frame, scene, pieces, atlas, views, self._sheets, sheets)

    def _fit(self, texture: Texture, size: tuple[int, int]) -> None:
        """Make a texture large enough; it shrinks only where it is far too large."""
        width, height = (min(-(-side // _ROUND) * _ROUND, self._gpu.max_texture) for side in size)
        old_width, old_height = texture.size
        if 2 * width * height < old_width * old_height:
            texture.sized((width, height))
        elif width > old_width or height > old_height:  # one that grows ever less often leaves memory whole
            texture.sized((max(width, old_width), max(height, old_height)))

    def _share(self, geometry: Geometry) -> None:
        """Keep the indices of a geometry, with corners shared."""
        if geometry.indices is not self._shared_of:  # which stay where meshes deform
            self._shared_of = geometry.indices
            self._indices.write(shared_indices(geometry))

    def _draw_depth(
        self,
        frame: Recording,
        scene: GpuScene,
        pieces: Pieces,
        atlas: ShadowAtlas,
        views: list[np.ndarray],
        target: Texture,
        which: np.ndarray,
    ) -> None:
        """Draw the depth of the draws `which`, (draws,) bool, into all tiles."""
        holes = np.array([scene.is_masked(draw.material) for draw in scene.draws], bool)
        opaque, masked = (which & ~holes)[pieces.row], (which & holes)[pieces.row]
        with frame.draw_into(depth=target) as canvas:
            for tile, view in self._each(scene, canvas, atlas, views):
                shared = {"view": frame.uniform(view), "instances": scene.instances}
                canvas.use(self._opaque, self._opaque.bind(0, **shared))
                for run in pieces.runs(tile.seen[opaque[tile.seen]]):
                    _draw_run(canvas, run)
                holed = list(pieces.runs(tile.seen[masked[tile.seen]]))
                draws = scene.each(frame, canvas, (run.draw for run in holed), lambda _: self._masked, shared)
                for _, run in zip(draws, holed, strict=True):
                    _draw_run(canvas, run)

    def _draw_tints(
        self,
        frame: Recording,
        scene: GpuScene,
        pieces: Pieces,
        atlas: ShadowAtlas,
        views: list[np.ndarray],
        sheets: np.ndarray,
    ) -> None:
        """Draw what the sheets before opaque surfaces let through, one on top of the other."""
        white, thin = (1.0, 1.0, 1.0, 1.0), sheets[pieces.row]
        with frame.draw_into(self._tints, depth=self._depth, clear=white, clear_depth=None) as canvas:
            for tile, view in self._each(scene, canvas, atlas, views):
                group = self._sheet.bind(0, frame, view=view, instances=scene.instances)
                for run in pieces.runs(tile.seen[thin[tile.seen]]):
                    material = scene.packed.materials[run.draw.material]
                    maps = scene.material_maps(run.draw.material, *_SHEET_SLOTS)
                    canvas.use(self._sheet, group, self._sheet.bind(1, frame, material=material, **maps))
                    _draw_run(canvas, run)

    def _each(
        self, scene: GpuScene, canvas: Canvas, atlas: ShadowAtlas, views: list[np.ndarray]
    ) -> Iterator[tuple[ShadowTile, np.ndarray]]:
        """Yield the tiles and their VIEW records, each with the canvas set to it."""
        canvas.vertices(scene.vertices)
        canvas.indices(self._indices)
        for tile, view in zip(atlas.tiles, views, strict=True):
            canvas.viewport(*tile.corner, *tile.size)
            yield tile, view


def shared_indices(geometry: Geometry) -> np.ndarray:
    """Return (3 T,) uint32, the indices, where corners of flat meshes with tangents share vertices again.

    They differ in what shadows need not; a third of the vertices are left to place.
    """
    indices = geometry.indices.copy()
    for kept in geometry.ranges:
        if kept.mesh.normals is None and kept.mesh.uv0 is not None:
            _, first, row = np.unique(kept.mesh.triangles.ravel(), return_index=True, return_inverse=True)
            corners = slice(kept.first_index, kept.first_index + 3 * kept.triangle_count)
            indices[corners] = kept.first_vertex + first[row]
    return indices


def _told(tile: ShadowTile, view: np.ndarray) -> tuple[object, ...]:
    """All that a tile of a scene depends on."""
    return tile.corner, tile.size, tile.seen.tobytes(), view.tobytes()


def _draw_run(canvas: Canvas, run: DrawRange) -> None:
    canvas.draw_indexed(
        run.length, run.draw.instance_count, first_index=run.first, first_instance=run.draw.first_instance
    )


def _seen(packed: Packed, receivers: np.ndarray, view: CameraView) -> Seen:
    """The RECEIVER rows as lights see them."""
    points = receivers["position"]
    reaches = receivers["footprint"] * np.minimum(receivers["slant"], _SLANTED)
    through = bool((packed.materials["flags"] & MATERIAL_TRANSMITS).any())
    width, height = view.size
    finer = min(1.0, max(math.sqrt(width * height / _LEAST_PIXELS), _LEAST_WIDTH))
    widths = view.pixel_widths(points) * np.float32(finer)
    return Seen(points, receivers["ng"], widths, reaches, through)


def _are_sheets(materials: np.ndarray) -> np.ndarray:
    """Whether light goes straight through: blended, or thin and smooth materials, (n,) bool."""
    thin = (materials["flags"] & MATERIAL_THIN != 0) & (materials["roughness"] ** 2 < _MIN_ALPHA)
    return np.asarray(thin | (materials["flags"] & MATERIAL_BLEND != 0))


def map_rows(maps: Sequence[LightMap], near: float) -> np.ndarray:
    """Return the (n,) SHADOW_MAP rows of n maps; near in m."""
    rows = np.zeros(len(maps), _MAP)
    for row, map in zip(rows, maps, strict=True):
        (s, t, axis), *_ = map.axes if len(map.axes) == 1 else [np.diag((1.0, -1.0, 1.0))]
        depth = 1.0 / float(np.linalg.norm(axis))
        row["x"], row["y"], row["z"] = (v / np.linalg.norm(v) for v in (s, -t, axis))
        row["origin"], row["faces"], row["parallel"] = map.origin, len(map.axes), map.orthographic
        row["near"], row["slope"] = (0.5, 0.5 / depth) if map.orthographic else (near, 0.0)
    return rows


def tile_rows(atlas: ShadowAtlas, light_count: int) -> np.ndarray:
    """Return the (6 light_count,) SHADOW_TILE rows; zero where a light has no such face or no tile."""
    rows = np.zeros(_FACES * light_count, _TILE)
    for tile in atlas.tiles:
        face = tile.face
        row = rows[_FACES * face.light + face.index]
        size = np.array(tile.size)
        row["scale"] = (size - 2 * GUARD) / face.extent
        row["shift"] = np.array(tile.corner) + size / 2.0 - row["scale"] * face.window.mean(axis=0)
        row["corner"], row["size"] = tile.corner, size
    return rows


def view_row(tile: ShadowTile, near: float) -> np.ndarray:
    """Return the VIEW record that draws a tile."""
    face, row = tile.face, np.zeros((), _VIEW)
    scale_x, scale_y = (1.0 - 2.0 * GUARD / np.array(tile.size)) * 2.0 / face.extent
    x, y = face.window.mean(axis=0)
    right, down, forward = np.column_stack([face.frame, np.zeros(3)])
    if face.depth:
        w = np.array((0.0, 0.0, 0.0, 1.0))
        z, light = 0.5 * w - 0.5 / face.depth * forward, -forward
    else:
        w = forward
        z, light = np.array((0.0, 0.0, 0.0, near)), np.append(face.origin, 1.0)
    matrix = np.stack([scale_x * (right - x * w), scale_y * (y * w - down), z, w])
    row["clip_from_local"] = matrix.T  # WGSL stores columns
    row["origin"], row["light"] = face.origin, light
    return row
