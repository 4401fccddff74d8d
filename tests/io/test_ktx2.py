"""KTX2 pictures of KHR_texture_basisu: made here block by block, decoded to the last bit."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from assets import assets
from gltf_builder import GltfBuilder, quad

import ispm
from ispm.errors import SceneError
from ispm.io import apart
from ispm.io.picture import KTX2

needs_decoder = pytest.mark.skipif(not apart.has("ktx2"), reason="opengl_basisu is not installed")

COLORS = np.array([[[255, 0, 0, 255], [0, 128, 9, 255]], [[1, 2, 3, 4], [90, 80, 70, 255]]], np.uint8)
NAME = "KHR_texture_basisu"


def solid(color: np.ndarray) -> bytes:
    """A UASTC block of one color, mode 8: five bits say so, and four times eight the color."""
    return (0x17 | int.from_bytes(color.tobytes(), "little") << 5).to_bytes(16, "little")


def raw_zstd(data: bytes) -> bytes:
    """A frame of Zstandard whose one block is stored as it is (RFC 8878, 3.1.1)."""
    return (
        b"\x28\xb5\x2f\xfd\xa0"
        + struct.pack("<I", len(data))
        + struct.pack("<I", len(data) << 3 | 1)[:3]
        + data
    )


def ktx2(
    *, size: tuple[int, int] = (8, 8), zstd: bool = False, unpacked: int | None = None, **fields: int
) -> bytes:
    """A picture of COLORS, 4 x 4 pixels each, as KTX 2.0 has it: header, index, descriptor, blocks."""
    blocks = b"".join(solid(color) for color in COLORS.reshape(-1, 4))
    stored = raw_zstd(blocks) if zstd else blocks
    descriptor = struct.pack("<I", 44) + struct.pack(
        "<II4B4B8BHBB3I", 0, 40 << 16 | 2, 166, 1, 2, 0, 3, 3, 0, 0, 16, 0, 0, 0, 0, 0, 0, 0,
        0, 127, 3, 0, 0, 0xFFFFFFFF)  # fmt: skip
    start = 80 + 24 + len(descriptor)
    start += -start % 16
    about = {"form": 0, "kind": 1, "width": size[0], "height": size[1], "depth": 0, "layers": 0, "faces": 1,
             "levels": 1, "packing": 2 if zstd else 0} | fields  # fmt: skip
    head = KTX2 + struct.pack("<9I", *about.values()) + struct.pack("<4I2Q", 104, len(descriptor), 0, 0, 0, 0)
    head += struct.pack("<3Q", start, len(stored), len(blocks) if unpacked is None else unpacked)
    return (head + descriptor).ljust(start, b"\0") + stored


def textured(picture: bytes, **texture: Any) -> GltfBuilder:
    builder = quad({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}, extensionsUsed=[NAME])
    builder.put("images", {"bufferView": builder.view(picture), "mimeType": "image/ktx2"})
    builder.put("textures", {"extensions": {NAME: {"source": 0}}, **texture})
    return builder


def shown(scene: ispm.Scene) -> np.ndarray | None:
    use = scene.materials[0].base_color_texture
    return None if use is None else use.texture.pixels


@needs_decoder
@pytest.mark.parametrize("zstd", [False, True])
def test_uastc_is_decoded_exactly(tmp_path: Path, zstd: bool) -> None:
    scene = textured(ktx2(zstd=zstd)).load(tmp_path)
    assert scene.warnings == []
    assert (shown(scene) == COLORS.repeat(4, axis=0).repeat(4, axis=1)).all()
    assert scene.extensions_honoured == [NAME]


@needs_decoder
def test_pictures_that_no_blocks_end_with_are_cut(tmp_path: Path) -> None:
    scene = textured(ktx2(size=(5, 7))).load(tmp_path)
    assert (shown(scene) == COLORS.repeat(4, axis=0).repeat(4, axis=1)[:7, :5]).all()


@needs_decoder
def test_etc1s_shows_what_the_jpeg_shows() -> None:
    colors = []
    for name in ("ETC1S", "UASTC"):
        pixels = shown(ispm.load(assets() / f"scenes/variants/BoxTextured-KTX2-{name}.glb"))
        assert pixels.shape == (40, 40, 4)
        colors.append(pixels[..., :3].astype(float))
    assert np.abs(colors[0] - colors[1]).mean() < 16.0  # of 255: what ETC1S loses at its quality


@needs_decoder
@pytest.mark.parametrize(
    ("picture", "said"),
    [(ktx2()[:60], "cut short within its header"), (ktx2()[:-20], "cannot be decoded"),
     (ktx2(form=37), "of another kind"), (ktx2(faces=6), "of another kind"), (ktx2(layers=2), "another kind"),
     (ktx2(size=(0, 8)), "of another kind"), (ktx2(size=(9000, 9000)), "max_image_pixels"),
     (ktx2(zstd=True, unpacked=1 << 40), "none of 8 x 8 pixels in UASTC"),
     (ktx2(size=(4000, 4000)), "cannot be decoded"), (b"", "none of PNG")],
)  # fmt: skip
def test_what_is_wrong_with_a_picture_is_one_line(tmp_path: Path, picture: bytes, said: str) -> None:
    scene = textured(picture).load(tmp_path)
    assert shown(scene) is None
    assert said in " ".join(scene.warnings)


@needs_decoder
def test_a_broken_ktx2_leaves_the_plain_picture(tmp_path: Path) -> None:
    builder = textured(ktx2()[:-20], source=1)
    builder.picture(np.full((2, 2, 3), 77, np.uint8))
    scene = builder.load(tmp_path)
    assert (shown(scene)[..., :3] == 77).all()
    assert "left out" in scene.warnings[0]


@needs_decoder
def test_large_pictures_are_halved(tmp_path: Path) -> None:
    assert shown(textured(ktx2()).load(tmp_path, max_texture=4)).shape == (4, 4, 4)


def test_without_the_decoder_the_plain_picture_is_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(apart.MODULES, "ktx2", "no_such_module")
    builder = textured(ktx2(), source=1)
    builder.picture(np.full((2, 2, 3), 77, np.uint8))
    scene = builder.load(tmp_path)
    assert (shown(scene)[..., :3] == 77).all()
    assert scene.warnings == [
        "plain pictures are shown in place of KTX2; for these: pip install 'ispm[gltf]'"
    ]
    assert scene.extensions_honoured == []


def test_without_the_decoder_one_line_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(apart.MODULES, "ktx2", "no_such_module")
    scene = textured(ktx2()).load(tmp_path)
    assert shown(scene) is None
    assert len(scene.warnings) == 1
    assert "KTX2 only, whose decoder is not installed: pip install 'ispm[gltf]'" in scene.warnings[0]
    builder = textured(ktx2())
    builder.json["extensionsRequired"] = [NAME]
    with pytest.raises(SceneError, match=rf"uses {NAME}, whose decoder .*: pip install 'ispm\[gltf\]'$"):
        builder.load(tmp_path)
