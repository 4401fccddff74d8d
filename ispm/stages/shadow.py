"""Shadow maps of all lights, side by side in one texture of depth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ispm import wgsl
from ispm.errors import SceneError
from ispm.frame import GpuScene, ShadowMaps, vertex_layout
from ispm.gpu import Canvas, Gpu, Recording, Target, Texture
from ispm.optics.records import MATERIAL_THIN
from ispm.scene.atlas import GUARD, LEAST, ShadowAtlas, ShadowFace, plan_atlas
from ispm.scene.lightmap import LightMap
from ispm.scene.packed import Draw

_MAP = wgsl.load("stages/shadow_map.wgsl").dtype("ShadowMap")
_TILE = wgsl.load("stages/shadow_map.wgsl").dtype("ShadowTile")
_VIEW = wgsl.load("stages/shadow.wgsl").dtype("View")
_FACES = 6  # rows of a light
_MIN_ALPHA = 1e-3  # MIN_ALPHA of optics/bsdf.wgsl
_ROUND = 256  # texels that the atlas grows by


class ShadowStage:
    """Draws the scene's depth as each light sees it, and the tint of thin sheets.

    resolution  texels of a tile's side at most
    Both sides of every surface cast. Raises SceneError where the adapter's largest texture cannot hold
    the maps of all lights.
    """

    def __init__(self, gpu: Gpu, resolution: int) -> None:
        self._gpu = gpu
        self.resolution = max(min(resolution, gpu.max_texture), LEAST)
        path = "stages/shadow.wgsl"
        layout = vertex_layout("position", "color", "uv0", "uv1")
        self._opaque = gpu.raster(path, fragment=None, vertex_layout=vertex_layout("position"))
        self._masked = gpu.raster(path, vertex="vs_masked", fragment="fs_masked", vertex_layout=layout)
        self._sheet = gpu.raster(
            path, [Target("rgba8unorm", "multiply")], depth_write=False, vertex="vs_masked",
            fragment="fs_sheet", vertex_layout=layout,
        )  # fmt: skip
        self._depth = gpu.texture("shadow atlas", "depth32float")
        self._sheets = gpu.texture("sheet atlas", "depth32float")
        self._tints = gpu.texture("tint atlas", "rgba8unorm")

    def __call__(
        self,
        frame: Recording,
        scene: GpuScene,
        receivers: np.ndarray,
        eye: np.ndarray,
        near: float,
        pass_index: int = 0,
    ) -> ShadowMaps:
        """Record the draws and return where their result will be.

        receivers  (n, 3) points that the eye sees, world space
        eye        (4,) `CameraView.eye_or_direction`
        near       m, a tiny part of the scene's diagonal
        """
        packed = scene.packed
        atlas = plan_atlas(
            packed.lights, packed.maps, scene.boxes, receivers, eye, self.resolution, self._gpu.max_texture
        )
        if atlas is None:
            raise SceneError(
                f"the scene has {len(packed.lights)} lights, more than {self._gpu.name} can hold shadow maps "
                f"for in a texture of {self._gpu.max_texture} texels a side; remove some"
            )
        sheets = np.array([_is_sheet(packed.materials[draw.material]) for draw in scene.draws], bool)
        self._fit(self._depth, atlas.size)
        tiles = [_Tile.of(atlas, k, scene, near, pass_index) for k in range(len(atlas.faces))]
        with frame.draw_into(depth=self._depth) as canvas:
            for tile in self._each(scene, canvas, tiles):
                self._draw(frame, scene, canvas, tile, ~sheets)
        for texture in (self._sheets, self._tints):
            texture.sized(self._depth.size if sheets.any() else (1, 1))
        if sheets.any():
            self._draw_sheets(frame, scene, tiles, sheets)
        return ShadowMaps(
            atlas, map_rows(packed.maps, near), tile_rows(atlas, len(packed.maps)),
            self._depth, self._sheets, self._tints, bool(sheets.any()),
        )  # fmt: skip

    def close(self) -> None:
        """Free the maps."""
        for texture in (self._depth, self._sheets, self._tints):
            texture.close()

    def _fit(self, texture: Texture, size: tuple[int, int]) -> None:
        """Make a texture large enough; it shrinks only where it is far too large."""
        width, height = (min(-(-side // _ROUND) * _ROUND, self._gpu.max_texture) for side in size)
        old = texture.size
        if width > old[0] or height > old[1] or 2 * width * height < old[0] * old[1]:
            texture.sized((width, height))

    def _each(self, scene: GpuScene, canvas: Canvas, tiles: list[_Tile]) -> Iterator[_Tile]:
        """Yield the tiles, each with the canvas set to it."""
        canvas.vertices(scene.vertices)
        canvas.indices(scene.indices)
        for tile in tiles:
            canvas.viewport(*tile.corner, tile.side, tile.side)
            yield tile

    def _draw(
        self, frame: Recording, scene: GpuScene, canvas: Canvas, tile: _Tile, which: np.ndarray
    ) -> None:
        """Draw the depth of the draws `which` into a tile."""
        shared = {"view": frame.uniform(tile.view), "instances": scene.instances}
        visible = [draw for row, draw in tile.draws if which[row]]
        solid = [draw for draw in visible if not scene.is_masked(draw.material)]
        if solid:
            canvas.use(self._opaque, self._opaque.bind(0, **shared))
        for draw in solid:
            scene.draw_indexed(canvas, draw)
        masked = (draw for draw in visible if scene.is_masked(draw.material))
        for draw in scene.each(frame, canvas, masked, lambda _: self._masked, shared):
            scene.draw_indexed(canvas, draw)

    def _draw_sheets(self, frame: Recording, scene: GpuScene, tiles: list[_Tile], sheets: np.ndarray) -> None:
        """Draw the tints of what stands before opaque surfaces, then how near the nearest is."""
        with frame.draw_into(
            self._tints, depth=self._depth, clear=(1.0, 1.0, 1.0, 1.0), clear_depth=None
        ) as canvas:
            for tile in self._each(scene, canvas, tiles):
                group = self._sheet.bind(0, frame, view=tile.view, instances=scene.instances)
                for row, draw in tile.draws:
                    if sheets[row]:
                        material = scene.packed.materials[draw.material]
                        maps = scene.material_maps(draw.material, "base_color")
                        canvas.use(self._sheet, group, self._sheet.bind(1, frame, material=material, **maps))
                        scene.draw_indexed(canvas, draw)
        with frame.draw_into(depth=self._sheets) as canvas:
            for tile in self._each(scene, canvas, tiles):
                self._draw(frame, scene, canvas, tile, sheets)


@dataclass(frozen=True, eq=False)
class _Tile:
    """A face with its place, its VIEW record, and what it sees: rows of the draws, and the draws."""

    corner: tuple[int, int]
    side: int
    view: np.ndarray
    draws: list[tuple[int, Draw]]

    @classmethod
    def of(cls, atlas: ShadowAtlas, k: int, scene: GpuScene, near: float, pass_index: int) -> _Tile:
        face, place, side = atlas.faces[k], atlas.places[k], int(atlas.sides[k])
        seen = face.sees(scene.instance_boxes, float(scene.packed.lights[face.light]["range"]))
        corner = int(place[0]), int(place[1])
        return cls(corner, side, view_row(face, side, near, pass_index), _runs(scene.draws, seen))


def _runs(draws: list[Draw], seen: np.ndarray) -> list[tuple[int, Draw]]:
    """Rows of the draws and draws of the instances in them that are seen, neighbours together."""
    starts = np.array([draw.first_instance for draw in draws] + [len(seen)])
    new = np.zeros(len(seen) + 1, bool)
    new[starts] = True
    padded = np.append(seen, False)
    first = np.flatnonzero(padded & (new | ~np.roll(padded, 1)))
    last = np.flatnonzero(padded[:-1] & (new[1:] | ~padded[1:]))
    rows = np.searchsorted(starts, first, side="right") - 1
    return [
        (row, replace(draws[row], first_instance=begin, instance_count=end - begin + 1))
        for row, begin, end in zip(rows.tolist(), first.tolist(), last.tolist(), strict=True)
    ]


def _is_sheet(material: np.void) -> bool:
    """Whether light goes straight through: thin, and smooth."""
    return bool(material["flags"] & MATERIAL_THIN) and float(material["roughness"]) ** 2 < _MIN_ALPHA


def map_rows(maps: Sequence[LightMap], near: float) -> np.ndarray:
    """Return the SHADOW_MAP rows."""
    rows = np.zeros(len(maps), _MAP)
    for row, map in zip(rows, maps, strict=True):
        s, t, axis = map.axes[0] if len(map.axes) == 1 else np.diag((1.0, -1.0, 1.0))
        depth = 1.0 / float(np.linalg.norm(axis))
        row["x"], row["y"], row["z"] = (v / np.linalg.norm(v) for v in (s, -t, axis))
        row["origin"], row["faces"], row["parallel"] = map.origin, len(map.axes), map.orthographic
        row["near"], row["slope"] = (0.5, 0.5 / depth) if map.orthographic else (near, 0.0)
    return rows


def tile_rows(atlas: ShadowAtlas, light_count: int) -> np.ndarray:
    """Return the SHADOW_TILE rows, six for each light; zero where a light has no such face or no tile."""
    rows = np.zeros(_FACES * light_count, _TILE)
    for face, place, side in zip(atlas.faces, atlas.places, atlas.sides, strict=True):
        row = rows[_FACES * face.light + face.index]
        row["scale"] = (side - 2 * GUARD) / (face.window[1] - face.window[0])
        row["shift"] = place + side / 2.0 - row["scale"] * face.window.mean(axis=0)
        row["corner"], row["side"] = place, side
    return rows


def view_row(face: ShadowFace, side: int, near: float, pass_index: int) -> np.ndarray:
    """Return the VIEW record of a face drawn into a tile of `side` texels."""
    row = np.zeros((), _VIEW)
    row["origin"], row["pass_index"] = face.origin, pass_index
    across = (1.0 - 2.0 * GUARD / side) * 2.0 / (face.window[1] - face.window[0])
    middle = face.window.mean(axis=0)
    right, down, forward = face.frame
    matrix = np.zeros((4, 4))
    w = np.array((0.0, 0.0, 0.0, 1.0)) if face.depth else np.append(forward, 0.0)
    matrix[0] = across[0] * (np.append(right, 0.0) - middle[0] * w)
    matrix[1] = -across[1] * (np.append(down, 0.0) - middle[1] * w)
    matrix[2] = np.append(-0.5 / face.depth * forward, 0.5) if face.depth else (0.0, 0.0, 0.0, near)
    matrix[3] = w
    row["clip_from_local"] = matrix.T
    row["light"] = np.append(-forward, 0.0) if face.depth else np.append(face.origin, 1.0)
    return row
