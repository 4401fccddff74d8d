"""Hatchling's hook: a wheel takes in the compiled kernels that lie in $ISPM_WHEEL_KERNELS, where that is set.

Such a wheel is for the Python that compiled them, on Linux x86-64; any other is pure Python. Kernels name
nothing of the C library but by way of numba, so that numba's own wheels decide how old that may be.
"""

import os
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

_PLATFORM = "manylinux_2_17_x86_64"


class Kernels(BuildHookInterface[Any]):
    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        folder = os.environ.get("ISPM_WHEEL_KERNELS")
        if version != "standard" or not folder:
            return
        for file in sorted(Path(folder).glob("*.kernel")):
            build_data["force_include"][str(file)] = f"ispm/kernels/compiled/{file.name}"
        build_data["tag"] = f"cp{sys.version_info.major}{sys.version_info.minor}-none-{_PLATFORM}"
        build_data["pure_python"] = False
