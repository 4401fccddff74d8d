"""What one scene may take of the machine, with all the files that it is made of."""

from __future__ import annotations

from pathlib import Path

from ispm.errors import SceneError
from ispm.settings import LoadLimits

# Bytes of memory for each byte of the files: four RGBA pixels, or a triangle of 12 bytes, which a strip has
# for each index of one byte.
MEMORY_PER_BYTE = 16
WORK_PER_BYTE = 100  # steps for each byte of the files: a second for a megabyte
LOOK = 10_000  # steps to find a file, 0.1 ms
MESH = 20_000  # steps to make a mesh, however small
_ROUND = 1 << 20  # bytes, to whose multiples messages round memory up


class Budget:
    """What is left to the loading of one scene: bytes of memory, steps of work, bytes of files.

    Memory and work grow with the bytes that are read: large files may be large, and small ones stay small.
    Work is counted in steps of some ten nanoseconds rather than timed, so that a file ends in the same way
    on every machine.

    limits  of the whole, and of single items
    files   those that are mapped, each once, by their resolved paths
    memory  bytes that are left
    """

    def __init__(self, limits: LoadLimits) -> None:
        self.limits = limits
        self.files: dict[Path, memoryview] = {}
        self.memory = limits.max_memory
        self._work = limits.max_work
        self._bytes = limits.max_file_bytes

    def read(self, size: int, name: str) -> None:
        """Count a file of `size` bytes. Raises SceneError where all together are larger than allowed."""
        if size > self._bytes:
            others = "" if self._bytes == self.limits.max_file_bytes else " with those before it"
            raise SceneError(
                f"{name} has {size} bytes{others}; max_file_bytes={self.limits.max_file_bytes} "
                "is the most that is read"
            )
        self._bytes -= size
        self.memory += MEMORY_PER_BYTE * size
        self._work += WORK_PER_BYTE * size

    def take(self, what: str, *, memory: int = 0, work: int = 0) -> None:
        """Take bytes of memory and steps of work. Raises SceneError, and takes nothing, where it has less."""
        self.require(what, memory)
        if work > self._work:
            raise SceneError(
                f"{what}: there is no work left for it; raise max_work={self.limits.max_work} if it may "
                "take long"
            )
        self.memory -= memory
        self._work -= work

    def require(self, what: str, memory: int) -> None:
        """Raise SceneError where fewer bytes of memory are left."""
        if memory > self.memory:
            raise SceneError(
                f"{what}: there is no memory left for it; raise max_memory={self.limits.max_memory} "
                f"by {-(-(memory - self.memory) // _ROUND) * _ROUND} at least"
            )
