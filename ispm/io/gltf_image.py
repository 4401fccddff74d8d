"""Textures of a glTF file: pictures decoded by Pillow, and how they are sampled."""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np

from ispm.errors import SceneError
from ispm.io import gltf_schema_material as schema
from ispm.io.apart import INSTALL, has
from ispm.io.gltf_file import GltfFile, item, label
from ispm.io.picture import Pictures
from ispm.scene.material import IDENTITY_UV, Texture, TextureUse, Wrap

WRAPS = {10497: Wrap.REPEAT, 33071: Wrap.CLAMP, 33648: Wrap.MIRROR}
MAG_LINEAR = {9728: False, 9729: True}
MIN_MIPMAPS = {9728: False, 9729: False, 9984: True, 9985: True, 9986: True, 9987: True}
LARGEST_TRANSFORM = 1e6  # a float32 has no digits left inside a texture that repeats more often

Value = TypeVar("Value")
Rows = tuple[tuple[float, float, float], tuple[float, float, float]]


class Textures:
    """The textures of a file: one for all that show equal pictures of one name in the same way."""

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        self._pictures = Pictures(file.budget, file.notes, apart=file.apart)
        self._pixels: dict[tuple[int, bool], np.ndarray | None] = {}
        self._textures: dict[Any, Texture] = {}

    def use(self, slot: schema.TextureSlot | None, *, srgb: bool, where: str) -> TextureUse | None:
        """Return the texture of a material's slot; None, with a note, where it cannot be shown.

        srgb   whether the slot holds colors
        where  the material, for messages
        Raises SceneError where the file has no such texture.
        """
        if slot is None:
            return None
        record = item(self._file.gltf.textures, slot.index, "texture")
        transform = slot.extensions.transform or schema.TextureTransform()
        uv_set = slot.tex_coord if transform.tex_coord is None else transform.tex_coord
        if uv_set > 1:
            self._file.notes.add(f"{where}: a texture is left out: only TEXCOORD_0 and _1 are supported")
            return None
        source = self._source(record, srgb)
        if source is None:
            called = label("texture", slot.index, record.name)
            only = record.extensions.basisu is not None and not has("ktx2")
            why = f"; it is there as KTX2 only, whose decoder is not installed: {INSTALL}" * only
            self._file.notes.add(f"{where}: {called} has no picture to show{why}")
            return None
        if max(map(abs, (transform.rotation, *transform.scale, *transform.offset))) > LARGEST_TRANSFORM:
            self._file.notes.add(f"{where}: a texture's transform is too large and is passed over")
            transform = schema.TextureTransform()
        texture = self._texture(source, record.sampler, srgb)
        return None if texture is None else TextureUse(texture, uv_set, uv_rows(transform))

    def _source(self, record: schema.Texture, srgb: bool) -> int | None:
        """The picture to show: KTX2 or WebP where there is one that can be decoded, else the plain one."""
        basisu, webp = record.extensions.basisu, record.extensions.webp
        if basisu is not None and not has("ktx2"):
            basisu = None
            if record.source is not None:
                self._file.notes.add(f"plain pictures are shown in place of KTX2; for these: {INSTALL}")
        others = [other.source for other in (basisu, webp) if other and other.source is not None]
        shown = [source for source in others if self._picture(source, srgb) is not None]
        return next(iter([*shown, *others] if record.source is None else [*shown, record.source]), None)

    def _texture(self, source: int, sampler: int | None, srgb: bool) -> Texture | None:
        how = schema.Sampler() if sampler is None else item(self._file.gltf.samplers, sampler, "sampler")
        pixels = self._picture(source, srgb)
        if pixels is None:
            return None
        image = self._file.gltf.images[source]
        name = image.name or _short(image.uri)
        ways: dict[str, Any] = dict(
            wrap_u=self._choose(WRAPS, how.wrap_s, Wrap.REPEAT, "wrapS"),
            wrap_v=self._choose(WRAPS, how.wrap_t, Wrap.REPEAT, "wrapT"),
            linear=self._choose(MAG_LINEAR, how.mag_filter, True, "magFilter"),
            mipmaps=self._choose(MIN_MIPMAPS, how.min_filter, True, "minFilter"),
        )
        key = id(pixels), srgb, name, *ways.values()
        if key not in self._textures:
            self._textures[key] = Texture(pixels, srgb, **ways, name=name)
        return self._textures[key]

    def _choose(self, table: dict[int, Value], value: Any, default: Value, what: str) -> Value:
        if value is None:
            return default
        if isinstance(value, int) and value in table:
            return table[value]
        self._file.notes.add(f"a sampler's {what} {str(value)[:20]!r} is unknown; the default is used")
        return default

    def _picture(self, index: int, srgb: bool) -> np.ndarray | None:
        image = item(self._file.gltf.images, index, "image")
        if (index, srgb) not in self._pixels:
            try:
                self._pixels[index, srgb] = self._pictures.decode(image_bytes(self._file, image), srgb=srgb)
            except (SceneError, OSError) as error:
                self._file.notes.add(f"{image_called(image, index)} is left out: {error}")
                self._pixels[index, srgb] = None
        return self._pixels[index, srgb]


def image_bytes(file: GltfFile, image: schema.Image) -> memoryview:
    """Return a picture as it is stored. Raises SceneError where it is nowhere."""
    if image.uri is not None:
        return file.uri(image.uri)
    if image.buffer_view is None:
        raise SceneError("it has neither a file nor a buffer view")
    return file.view(image.buffer_view)


def image_called(image: schema.Image, index: int) -> str:
    """Return what to call a picture in a message."""
    return label("picture", index, image.name or _short(image.uri))


def uv_rows(transform: schema.TextureTransform) -> Rows:
    """Return KHR_texture_transform as two rows of a matrix on (u, v, 1): scaled, turned, then moved.

    v points down, so a positive angle, counter-clockwise as one looks at the picture, has this sign;
    the extension's GLSL has the other, its test model and renderers have this one.
    """
    (sx, sy), (ox, oy) = transform.scale, transform.offset
    c, s = math.cos(transform.rotation), math.sin(transform.rotation)
    rows = ((c * sx, s * sy, ox), (-s * sx, c * sy, oy))
    return IDENTITY_UV if rows == IDENTITY_UV else rows


def _short(uri: str | None) -> str:
    return "" if uri is None or uri[:5].lower() == "data:" else uri[:80]
