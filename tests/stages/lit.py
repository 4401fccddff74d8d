"""Direct light of made-up scenes as the stages draw it, and where their shadow maps' texels are."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from exact import Triangles, cast

from ispm.accel.surface import SurfaceTable
from ispm.accel.world import World
from ispm.frame import ShadowMaps
from ispm.gpu import Gpu
from ispm.optics.texture import TextureTable
from ispm.renderer.one_pass import Pass
from ispm.renderer.shadows import ShadowRays
from ispm.scene.packed import Packed
from ispm.settings import Settings
from ispm.stages.camera import CameraView
from ispm.stages.direct import DirectStage
from ispm.stages.downsample import Downsample
from ispm.stages.gbuffer import GBufferStage
from ispm.stages.shadow import ShadowStage
from ispm.stages.upload import Upload


@dataclass
class Lit:
    """What the stages made of a scene.

    radiance    (h, w, 3);  ids  (h, w) instance rows + 1;  points  (h, w, 3) float64, nan where nothing is
    primitives  (h, w) triangles of the meshes
    doubts      (n,) DOUBT, which rays decided
    """

    radiance: np.ndarray
    ids: np.ndarray
    primitives: np.ndarray
    points: np.ndarray
    shadows: ShadowMaps
    doubts: np.ndarray

    def texels(self, points: np.ndarray, light: int = 0) -> np.ndarray:
        """Width in m, at (n, 3) points, of the widest texels of a light's map."""
        row = self.shadows.maps[light]
        tiles = self.shadows.tiles[6 * light : 6 * light + 6]
        p = np.abs((points - row["origin"]) @ np.stack([row["x"], row["y"], row["z"]]).T.astype(float))
        ahead = p.max(axis=1) if row["faces"] == 6 else p[:, 2]
        scale = tiles["scale"][tiles["size"][:, 0] > 0.0].min()
        return np.asarray((np.ones_like(ahead) if row["parallel"] else ahead) / scale)


@dataclass
class Lamp:
    """The stages of direct light, kept between scenes."""

    gpu: Gpu
    stages: tuple[Upload, GBufferStage, DirectStage] = field(init=False)
    downsample: Downsample = field(init=False)

    def __post_init__(self) -> None:
        self.stages = Upload(self.gpu), GBufferStage(self.gpu), DirectStage(self.gpu)
        self.downsample = Downsample(self.gpu, 4)

    def __call__(
        self,
        packed: Packed,
        view: CameraView,
        resolution: int = 256,
        near: float = 1e-3,
        antialias: bool = False,
    ) -> Lit:
        upload, gbuffer, direct = self.stages
        shadow = ShadowStage(self.gpu, resolution)
        with self.gpu.frame() as frame:
            scene = upload(packed)
            seen = gbuffer(frame, scene, view)
        depth, ids = self.gpu.read_many([(seen.depth, np.float32), (seen.ids, np.uint32, 2)])
        points = _points(view, depth)
        with self.gpu.frame() as frame:
            self.downsample(frame, scene, seen, view)
        receivers = self.downsample.read(self.gpu, view)
        with self.gpu.frame() as frame:
            maps = shadow(frame, scene, receivers[receivers["valid"] > 0], view, near)
            radiance = direct(frame, scene, seen, maps, view)
        doubts = direct.doubts()
        pixels = self.gpu.read_texture(radiance, np.float32, 4)[..., :3].copy()
        surfaces = SurfaceTable(
            packed, TextureTable.pack(packed.textures, packed.colors), 0.005 * packed.diagonal
        )
        world = World(2)
        world.update(packed)
        rays = ShadowRays(
            Pass(packed, world, surfaces, view, Settings(antialias=antialias), threads=2, photon_seed=0)
        )
        places, light = rays.light(doubts)
        pixels.reshape(-1, 3)[places] += light
        return Lit(pixels, ids[..., 0], ids[..., 1], points, maps, doubts)


def _points(view: CameraView, depth: np.ndarray) -> np.ndarray:
    height, width = depth.shape
    ndc = np.ones((height, width, 4))
    ndc[..., 0] = 2.0 * (np.arange(width) + 0.5) / width - 1.0
    ndc[..., 1] = 1.0 - 2.0 * (np.arange(height)[:, None] + 0.5) / height
    ndc[..., 2] = np.where(depth > 0.0, depth, np.nan)
    world = ndc @ view.world_from_clip.T
    return np.asarray(world[..., :3] / world[..., 3:])


def seen_surfaces(
    lit: Lit, triangles: Triangles, eye: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points, geometric normals on the eye's side and brightness of the pixels whose triangle is certain:
    a ray meets the one that the G-buffer has there, which snapped corners change at its edges."""
    points, ids = lit.points.reshape(-1, 3), lit.ids.ravel()
    some = np.flatnonzero(ids)
    ways = points[some] - eye
    distance = np.linalg.norm(ways, axis=1)
    d = ways / distance[:, None]
    same = triangles.instance[None] + 1 == ids[some][:, None]
    row, t, _ = cast(triangles, np.broadcast_to(eye, d.shape), d, same)
    seen = (row >= 0) & (triangles.primitive[row] == lit.primitives.ravel()[some])
    certain = seen & (np.abs(t - distance) < 1e-3 * distance)
    normals = triangles.front[row] * -np.sign(np.einsum("nk,nk->n", triangles.front[row], d))[:, None]
    return points[some][certain], normals[certain], lit.radiance.reshape(-1, 3)[some][certain].sum(-1)
