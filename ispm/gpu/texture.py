"""Textures that are allocated anew when their size changes, and samplers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import wgpu

View: TypeAlias = wgpu.GPUTextureView
Sampler: TypeAlias = wgpu.GPUSampler

_USAGE = {
    "attachment": wgpu.TextureUsage.RENDER_ATTACHMENT,
    "sampled": wgpu.TextureUsage.TEXTURE_BINDING,
    "storage": wgpu.TextureUsage.STORAGE_BINDING,
}
_COPIES = wgpu.TextureUsage.COPY_SRC | wgpu.TextureUsage.COPY_DST


class Texture:
    """A texture on the device, without texels until it is `sized`; its views live as long as its texels.

    format     WebGPU's name
    dimension  of the default view: 2d, 2d-array, cube, cube-array
    usage      attachment, sampled, storage; default: attachment and sampled
    samples    of a texel: 1 or 4
    size       (width, height) texels
    version    grows with the handle's changes
    """

    def __init__(
        self,
        device: wgpu.GPUDevice,
        name: str,
        format: str,
        dimension: str = "2d",
        layers: int = 1,
        usage: Sequence[str] = (),
        samples: int = 1,
    ) -> None:
        self._device, self.name, self.format = device, name, format
        self.dimension, self.layers, self.levels = dimension, layers, 1
        self._samples = samples
        self._usage = _COPIES if samples == 1 else 0
        for use in usage or ("attachment", "sampled"):
            self._usage |= _USAGE[use]
        self._handle: wgpu.GPUTexture | None = None
        self._views: dict[tuple[str | None, int | None, int | None], View] = {}
        self.size = (0, 0)
        self.version = 0

    @property
    def handle(self) -> wgpu.GPUTexture:
        """The device's texture; a new one after `sized` changed something."""
        assert self._handle is not None, f"texture '{self.name}' is used before it is sized"
        return self._handle

    def sized(self, size: tuple[int, int], *, layers: int | None = None, levels: int = 1) -> Texture:
        """Return this texture with (width, height) texels; allocated anew, contents lost, where size, layers
        or levels differ.

        The old texels are freed when no recorded command uses them any more.
        """
        layers = self.layers if layers is None else layers
        if self._handle is None or (size, layers, levels) != (self.size, self.layers, self.levels):
            self._views.clear()  # not destroyed: commands that are not submitted yet may use them
            self._handle = self._device.create_texture(
                label=self.name,
                size=(*size, layers),
                format=self.format,
                usage=self._usage,
                mip_level_count=levels,
                sample_count=self._samples,
            )
            self.size, self.layers, self.levels = size, layers, levels
            self.version += 1
        return self

    def view(
        self, dimension: str | None = None, *, layer: int | None = None, level: int | None = None
    ) -> View:
        """Return a view of the whole, of one layer or of one mip level; the same one each time."""
        key = (dimension, layer, level)
        if key not in self._views:
            self._views[key] = self.handle.create_view(
                dimension="2d" if layer is not None else dimension or self.dimension,
                base_array_layer=layer or 0,
                array_layer_count=1 if layer is not None else None,
                base_mip_level=level or 0,
                mip_level_count=1 if level is not None else None,
            )
        return self._views[key]

    def write(self, pixels: np.ndarray, *, level: int = 0, layer: int = 0) -> Texture:
        """Copy (height, width, ...) pixels, in the texture's own format, into one mip level of one layer."""
        pixels = np.ascontiguousarray(pixels)
        height, width = pixels.shape[:2]
        self._device.queue.write_texture(
            {"texture": self.handle, "mip_level": level, "origin": (0, 0, layer)},
            pixels,
            {"offset": 0, "bytes_per_row": pixels.nbytes // height, "rows_per_image": height},
            (width, height, 1),
        )
        return self


def make_sampler(
    device: wgpu.GPUDevice, wrap: tuple[str, str], linear: bool, mipmaps: bool, compare: str | None
) -> Sampler:
    """Return a sampler; without `mipmaps` only level 0 is read."""
    mode = "linear" if linear else "nearest"
    return device.create_sampler(
        address_mode_u=wrap[0],
        address_mode_v=wrap[1],
        mag_filter=mode,
        min_filter=mode,
        mipmap_filter="linear" if mipmaps else "nearest",
        lod_max_clamp=32.0 if mipmaps else 0.0,
        compare=compare,
    )
