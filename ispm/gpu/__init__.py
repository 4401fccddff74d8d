"""Access to the graphics adapter; nothing outside this package imports wgpu.

In come shaders, arrays and commands; out go textures, buffers and what is read back. It knows of no scene.
What is made on a device is freed with the last reference to it; `Gpu.close` frees all at once.
"""

from ispm.gpu.buffer import Buffer
from ispm.gpu.compute import Compute
from ispm.gpu.counted import Counted
from ispm.gpu.device import AdapterInfo, Gpu, list_adapters, open_gpu, within_memory
from ispm.gpu.kept import Kept
from ispm.gpu.raster import FLAT, Canvas, Group, Raster, RasterState, Target
from ispm.gpu.recording import Recording
from ispm.gpu.texture import Sampler, Texture

__all__ = [
    "FLAT",
    "AdapterInfo",
    "Buffer",
    "Canvas",
    "Compute",
    "Counted",
    "Gpu",
    "Group",
    "Kept",
    "Raster",
    "RasterState",
    "Recording",
    "Sampler",
    "Target",
    "Texture",
    "list_adapters",
    "open_gpu",
    "within_memory",
]
