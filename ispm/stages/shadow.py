"""Shadow maps of all lights, side by side in one texture of depth."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import compress

import numpy as np

from ispm import wgsl
from ispm.errors import SceneError
from ispm.frame import GpuScene, ShadowMaps, vertex_layout
from ispm.gpu import Canvas, Gpu, Raster, Recording, Texture
from ispm.scene.atlas import GUARD, LEAST, ShadowAtlas, ShadowFace, plan_atlas
from ispm.scene.lightmap import LightMap

_MAP = wgsl.load("stages/shadow_map.wgsl").dtype("ShadowMap")
_TILE = wgsl.load("stages/shadow_map.wgsl").dtype("ShadowTile")
_VIEW = wgsl.load("stages/shadow.wgsl").dtype("View")
_FACES = 6  # rows of a light
_ROUND = 256  # texels that the atlas grows by


class ShadowStage:
    """Draws the scene's depth as each light sees it.

    resolution  texels of a tile's side at most
    Raises SceneError where the adapter's largest texture cannot hold the maps of all lights.
    """

    def __init__(self, gpu: Gpu, resolution: int) -> None:
        self._gpu = gpu
        self.resolution = max(min(resolution, gpu.max_texture), LEAST)
        path = "stages/shadow.wgsl"
        self._opaque = gpu.raster(path, fragment=None, vertex_layout=vertex_layout("position"))
        self._masked = gpu.raster(
            path, vertex="vs_masked", fragment="fs_masked",
            vertex_layout=vertex_layout("position", "color", "uv0", "uv1"),
        )  # fmt: skip
        self._depth = gpu.texture("shadow atlas", "depth32float")
        self._maps = gpu.buffer("shadow maps")
        self._tiles = gpu.buffer("shadow tiles")

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
        self._maps.write(map_rows(packed.maps, near))
        self._tiles.write(tile_rows(atlas, len(packed.maps)))
        self._fit(self._depth, atlas.size)
        with frame.draw_into(depth=self._depth) as canvas:
            canvas.vertices(scene.vertices)
            canvas.indices(scene.indices)
            for face, place, side in zip(atlas.faces, atlas.places, atlas.sides, strict=True):
                canvas.viewport(int(place[0]), int(place[1]), int(side), int(side))
                self._draw(frame, canvas, scene, face, view_row(face, int(side), near, pass_index))
        return ShadowMaps(atlas, self._depth, self._maps, self._tiles)

    def close(self) -> None:
        """Free the maps."""
        self._depth.close()
        self._maps.close()
        self._tiles.close()

    def _fit(self, texture: Texture, size: tuple[int, int]) -> None:
        """Make a texture large enough; it shrinks only where it is far too large."""
        width, height = (min(-(-side // _ROUND) * _ROUND, self._gpu.max_texture) for side in size)
        old = texture.size
        if width > old[0] or height > old[1] or 2 * width * height < old[0] * old[1]:
            texture.sized((width, height))

    def _draw(
        self, frame: Recording, canvas: Canvas, scene: GpuScene, face: ShadowFace, view: np.ndarray
    ) -> None:
        shared = {"view": frame.uniform(view), "instances": scene.instances}
        seen = face.sees(scene.boxes, float(scene.packed.lights[face.light]["range"]))
        solid = [draw for draw in compress(scene.draws, seen) if not scene.is_masked(draw.material)]
        if solid:
            canvas.use(self._opaque, self._opaque.bind(0, **shared))
        for draw in solid:
            scene.draw_indexed(canvas, draw)
        masked = (draw for draw in compress(scene.draws, seen) if scene.is_masked(draw.material))
        for draw in scene.each(frame, canvas, masked, lambda _: self._masked, shared):
            scene.draw_indexed(canvas, draw)


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
    return row
