"""The list of pixels that show mirrors and glass, and the light that is added to them."""

import numpy as np
import pytest
from exact import quad, view_of

from ispm.optics.records import PIXEL_BACK
from ispm.scene.material import Material, Texture
from ispm.scene.packed import pack
from ispm.scene.scene import Scene
from ispm.stages import specular
from ispm.stages.gbuffer import GBufferStage
from ispm.stages.specular import SpecularStage
from ispm.stages.upload import Upload

MATERIALS = {
    "clay": (Material((0.5,) * 3, specular=0.0, roughness=0.0), False),  # nothing that could mirror
    "plastic": (Material((0.5,) * 3, roughness=0.5), False),
    "varnish": (Material((0.5,) * 3, roughness=0.0), True),
    "metal": (Material((0.5,) * 3, metallic=1.0, roughness=0.1), True),
    "wide metal": (Material((0.5,) * 3, metallic=1.0, roughness=0.5), False),
    "satin": (Material((0.5,) * 3, roughness=0.49), True),
    "satin clay": (Material((0.5,) * 3, specular=0.0, roughness=0.2), False),
    "mirror": (Material((0.5,) * 3, metallic=1.0, roughness=0.0), True),
    "glass": (Material((1.0,) * 3, roughness=0.0, transmission=1.0, thickness=1.0), True),
    "frost": (Material((1.0,) * 3, roughness=0.6, transmission=0.3), True),
    "lamp": (Material((1.0,) * 3, roughness=0.0, unlit=True), False),
}


def drawn(gpu, materials):
    """The G-buffer and the list of a row of squares, and what is drawn where."""
    scene = Scene()
    for k, material in enumerate(materials):
        scene.add(quad(0.3), material=material, translation=(0.5 * k - 2.4, 0.7, 0.0))
    upload, gbuffer, chains, view = Upload(gpu), GBufferStage(gpu), SpecularStage(gpu), view_of((240, 80))
    with gpu.frame() as frame:
        packed = upload(pack(scene))
        out = gbuffer(frame, packed, view)
        chains(frame, packed, out)
    ids, points = gpu.read_many([(out.ids, np.uint32, 2), (out.points, np.uint32, 4)])
    return chains, view, chains.read(), ids, points[..., 3]


def test_pixels_of_mirrors_and_glass_are_listed(gpu):
    *_, seen, ids, _ = drawn(gpu, [material for material, _ in MATERIALS.values()])
    kinds = [kind for kind in range(1, len(MATERIALS) + 1) if list(MATERIALS.values())[kind - 1][1]]
    shown = np.unique(ids[..., 0])
    assert set(range(1, len(MATERIALS) + 1)) <= set(shown)
    expected = np.flatnonzero(np.isin(ids[..., 0].reshape(-1), kinds))
    assert (seen["pixel"] == expected).all()
    shown = ids.reshape(-1, 2)[expected]
    assert (seen["instance"] + 1 == shown[:, 0]).all() and (seen["primitive"] == shown[:, 1]).all()


@pytest.mark.parametrize("name", [*MATERIALS, "mirror by its texture"])
def test_a_material_alone_is_listed_as_among_others(gpu, name):
    """Nothing is looked for where no material may lead on."""
    black = Texture(np.zeros((2, 2, 4), np.uint8), srgb=False)
    mirror = Material((0.5,) * 3, metallic=1.0, roughness=1.0, metallic_roughness_texture=black)
    material, listed = MATERIALS.get(name, (mirror, True))
    *_, seen, ids, _ = drawn(gpu, [material])
    assert len(seen) == (ids[..., 0] == 1).sum() * listed and ids.any()


def test_the_g_buffer_keeps_row_and_transmission_apart(gpu):
    pixels = np.full((2, 2, 4), 128, np.uint8)
    patterned = Material((1,) * 3, transmission=0.5, transmission_texture=Texture(pixels, srgb=False))
    materials = [Material(), Material(transmission=1.0), Material(transmission=0.25), patterned]
    *_, ids, words = drawn(gpu, materials)
    for k, expected in enumerate((0.0, 1.0, 0.25, 0.5 * 128 / 255)):
        word = words[ids[..., 0] == k + 1]
        assert len(word) and ((word & (PIXEL_BACK - 1)) - 1 == k).all()
        assert (word >> 24) / 255 == pytest.approx(expected, abs=0.5 / 255 + 1e-6)


@pytest.mark.parametrize("band", [1 << 18, 128])
def test_light_is_added_to_the_listed_pixels_alone(gpu, monkeypatch, band):
    monkeypatch.setattr(specular, "_BAND", band)
    size, random = (37, 21), np.random.default_rng(1)
    chains = SpecularStage(gpu)
    textures, before = [], []
    for name in ("direct", "indirect", "emission", "irradiance"):
        values = random.random((size[1], size[0], 4), np.float32)
        values[..., 3] = 1.0
        texture = gpu.texture(name, "rgba32float", usage=("storage", "sampled")).sized(size)
        textures.append(texture.write(values))
        before.append(values.reshape(-1, 4))
    pixels = np.sort(random.permutation(37 * 21)[:300])
    light = random.random((300, 17), np.float32)
    with gpu.frame() as frame:
        through = chains.patch(frame, pixels, light, *textures)
    *after, seen = gpu.read_many([(texture, np.float32, 4) for texture in (*textures[:3], through)])
    expected = np.zeros((37 * 21, 3), np.float32)
    expected[pixels] = light[:, 9:12]
    assert (seen[..., :3].reshape(-1, 3) == expected).all()
    before[1][pixels, :3] += (
        light[:, 12:15] / np.float32(np.pi) * before[3][pixels, :3] / (1.0 - light[:, 16:])
    )
    for k, (old, new) in enumerate(zip(before[:3], after, strict=True)):
        kept = 1.0 - (light[:, 16:] if k < 2 else light[:, 15:16])
        old[pixels, :3] = kept * old[pixels, :3] + light[:, 3 * k : 3 * k + 3]
        assert new.reshape(-1, 4) == pytest.approx(old, rel=1e-6)
    for shown in (1.0, 0.0):  # a later picture keeps nothing of this one
        light = random.random((10, 17), np.float32) * np.repeat([1, shown, 1], [9, 3, 5])
        with gpu.frame() as frame:
            through = chains.patch(frame, pixels[:10], light, *textures)
        (seen,) = gpu.read_many([(through, np.float32, 4)])
        assert np.count_nonzero(seen[..., 0]) == 10 * shown
        assert through.size == (size if shown else (1, 1))
