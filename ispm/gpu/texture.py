"""Textures that are allocated anew when their size changes, and samplers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import wgpu

from ispm.gpu import memory, traffic

Sampler: TypeAlias = wgpu.GPUSampler

_USAGE = {
    "attachment": wgpu.TextureUsage.RENDER_ATTACHMENT,
    "sampled": wgpu.TextureUsage.TEXTURE_BINDING,
    "storage": wgpu.TextureUsage.STORAGE_BINDING,
}
_COPIES = wgpu.TextureUsage.COPY_SRC | wgpu.TextureUsage.COPY_DST


class Texture:
    """A 2D texture on the device, without texels until it is `sized`; its view lives as long as its texels.

    format   WebGPU's name
    usage    attachment, sampled, storage; default: attachment and sampled
    samples  of a texel: 1 or 4
    size     (width, height) texels
    """

    def __init__(
        self, device: wgpu.GPUDevice, name: str, format: str, usage: Sequence[str] = (), samples: int = 1
    ) -> None:
        self._device, self.name, self.format = device, name, format
        self._samples = samples
        self._usage = _COPIES if samples == 1 else 0
        for use in usage or ("attachment", "sampled"):
            self._usage |= _USAGE[use]
        self._handle: wgpu.GPUTexture | None = None
        self._view: wgpu.GPUTextureView | None = None
        self.size, self._levels = (0, 0), 1

    @property
    def handle(self) -> wgpu.GPUTexture:
        """The device's texture; a new one after `sized` changed something."""
        assert self._handle is not None, f"texture '{self.name}' is used before it is sized"
        return self._handle

    @property
    def view(self) -> wgpu.GPUTextureView:
        """The device's view of the whole; the same one each time."""
        self._view = self._view or self.handle.create_view()
        return self._view

    def sized(self, size: tuple[int, int], *, levels: int = 1) -> Texture:
        """Return this texture with (width, height) texels; allocated anew, contents lost, where size or
        mip levels differ.

        The old texels are freed when no recorded command uses them any more.
        """
        if self._handle is None or (size, levels) != (self.size, self._levels):
            self._view = None
            memory.changed()
            self._handle = self._device.create_texture(
                label=self.name,
                size=(*size, 1),
                format=self.format,
                usage=self._usage,
                mip_level_count=levels,
                sample_count=self._samples,
            )
            self.size, self._levels = size, levels
        return self

    def write(self, pixels: np.ndarray, *, level: int = 0) -> Texture:
        """Copy (height, width, ...) pixels, in the texture's own format, into one mip level."""
        pixels = np.ascontiguousarray(pixels)
        height, width = pixels.shape[:2]
        traffic.count(sent=pixels.nbytes)
        self._device.queue.write_texture(
            {"texture": self.handle, "mip_level": level},
            pixels,
            {"offset": 0, "bytes_per_row": pixels.nbytes // height, "rows_per_image": height},
            (width, height, 1),
        )
        return self


def make_sampler(device: wgpu.GPUDevice, wrap: tuple[str, str], linear: bool, mipmaps: bool) -> Sampler:
    """Return a sampler; without `mipmaps` only level 0 is read."""
    mode = "linear" if linear else "nearest"
    return device.create_sampler(
        address_mode_u=wrap[0],
        address_mode_v=wrap[1],
        mag_filter=mode,
        min_filter=mode,
        mipmap_filter="linear" if mipmaps else "nearest",
        lod_max_clamp=32.0 if mipmaps else 0.0,
    )
