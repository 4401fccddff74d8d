"""Render all built-in scenes under the validation layer of Khronos and print what it says.

python -m drivers.validation   # in tests/

VK_LAYER_PATH says where the layer is, if the system does not know. The exit code is 1 where there is a
message, 2 where the layer is not there.
Source: Vulkan-ValidationLayers, LAYERS.md and khronos_validation_layer.html.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import ispm
from ispm.gpu import Gpu
from ispm.gpu.device import _adapters
from ispm.library.builtin import BUILTINS

_LAYER = "VK_LAYER_KHRONOS_validation"
_ACTIVE = "Khronos Validation Layer Active"
_MESSAGE = re.compile(r"^\S+\((?!INFO)\w+ / \w+\): .*$", re.M)
_SETTINGS = """\
khronos_validation.debug_action = VK_DBG_LAYER_ACTION_LOG_MSG
khronos_validation.report_flags = error,warn,perf,info
khronos_validation.log_filename = {log}
khronos_validation.enables = VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT
khronos_validation.duplicate_message_limit = 3
"""
_KNOBS: tuple[dict[str, Any], ...] = (
    {"emission": "rays", "subsampling": 1, "gather": 0, "antialias": False},
    {"preset": "talk", "passes": 2},
)
_KNOBS_OF = "cornell-box", "glass-sphere", "caustic-ring"  # what other settings call depends on no scene


class _Card(Gpu):
    """A device that is used as a graphics card's is, whatever it is."""

    is_software = False


def main() -> int:
    """Render in a process of its own, with the layer; return the exit code."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        Path(folder, "vk_layer_settings.txt").write_text(_SETTINGS.format(log=log), "utf-8")
        layered = os.environ | {"VK_INSTANCE_LAYERS": _LAYER, "VK_LAYER_SETTINGS_PATH": folder}
        done = subprocess.run([sys.executable, "-m", __spec__.name, "--render"], env=layered, check=False)
        said = log.read_text("utf-8", "replace") if log.is_file() else ""
    if _ACTIVE not in said:
        print(f"{_LAYER} is not there", file=sys.stderr)
        return 2
    messages = _MESSAGE.findall(said)
    print(*messages, f"{len(messages)} messages", sep="\n")
    return int(bool(messages) or done.returncode != 0)


def _render() -> None:
    warnings.simplefilter("ignore")
    gpu = _Card(_adapters()[0])
    for name in BUILTINS:
        for knobs in ({}, *_KNOBS) if name in _KNOBS_OF else ({},):
            settings = ispm.Settings(size=(161, 91), photons=4000, **knobs)
            with ispm.Renderer(ispm.builtin(name), settings, gpu=gpu) as renderer:
                renderer.render()
        print(f"{name} rendered on {gpu.name}", flush=True)
    gpu.close()


if __name__ == "__main__":
    sys.exit(_render() if sys.argv[1:] == ["--render"] else main())
