"""Every asset that loads with a surface renders; pictures are finite and not negative."""

import json
import warnings
from pathlib import Path

import numpy as np
import pytest
from assets import assets

from ispm.errors import SceneError
from ispm.gpu import Gpu
from ispm.io.load import load
from ispm.renderer import Renderer
from ispm.settings import Settings

TINY = Settings(size=(64, 36), photons=500)
SOME = [  # a file of each format and extension
    "cornell/CornellBox-Water.obj", "cornell/cornell_glass.glb", "meshes/bunny.ply", "meshes/own_room.obj",
    "meshes/own_torus.stl", "meshes/spot/spot_triangulated.obj", "scenes/LightsPunctualLamp.glb",
    "scenes/SimpleInstancing.glb", "scenes/TransmissionTest.glb", "scenes/UnlitTest.glb",
    "scenes/ispm_ior_grid.glb", "scenes/variants/BoxTextured-WebP.glb",
    "scenes/variants/CesiumMan-Quantized.glb",
]  # fmt: skip


def rendered(gpu: Gpu, path: Path) -> str:
    """How rendering a file ends: 'light', 'dark', 'not finite', or the line that refuses it."""
    try:
        scene = load(path)
        with warnings.catch_warnings(), Renderer(scene, TINY, gpu=gpu) as renderer:
            warnings.simplefilter("ignore")
            radiance = renderer.render().radiance
    except SceneError as error:
        return str(error)
    if not np.isfinite(radiance).all() or radiance.min() < 0.0:
        return "not finite"
    return "light" if radiance.any() else "dark"


@pytest.mark.parametrize("name", SOME)
def test_asset_of_each_kind_renders(gpu: Gpu, name: str) -> None:
    assert rendered(gpu, assets() / name) == "light"


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_all_assets_render_or_say_why_not(gpu: Gpu) -> None:
    """Two minutes on two cores."""
    folder = assets()
    entries = json.loads((folder / "manifest.json").read_text())
    ends = {entry["file"]: rendered(gpu, folder / entry["file"]) for entry in entries}
    refused = {name: end for name, end in ends.items() if end not in ("light", "dark")}
    assert all("ispm does not read" in e or "version 2.1" in e or "no surface" in e for e in refused.values())
    assert len(ends) - len(refused) > 140
