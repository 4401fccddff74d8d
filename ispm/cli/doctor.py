"""`ispm doctor`: whether this machine is ready, and what to do where it is not."""

from __future__ import annotations

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from ispm import __version__
from ispm.cache import cache_folder
from ispm.cli.console import Console
from ispm.cli.options import command
from ispm.errors import AdapterError

_PACKAGES = ("wgpu", "numba", "numpy", "OpenEXR", "pillow", "pooch", "msgspec", "cyclopts", "rich")
_NO_ADAPTER = 3


@command()
def doctor(console: Console) -> int:
    """Say whether this machine is ready.

    Example: ispm doctor

    Lists the adapter, cores, versions and caches; what is missing, and the command that mends it. The table
    goes to stderr; for programs, --json prints it on stdout.
    """
    adapters, device = _graphics()
    packages = {"ispm": __version__} | {name: _version(name) for name in _PACKAGES}
    cache = cache_folder()
    problems = _problems(adapters, device, packages)
    report: dict[str, Any] = {
        "adapters": [vars(adapter) for adapter in adapters],
        "device": device,
        "cores": _cores(),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "packages": packages,
        "cache": str(cache) if cache else None,
        "cache_bytes": sum(f.stat().st_size for f in cache.rglob("*") if f.is_file()) if cache else 0,
        "problems": problems,
    }
    rows: list[tuple[str, object]] = [
        ("adapter", f"{a.name} ({a.type}, {a.backend}, {a.driver})") for a in adapters
    ]
    rows += [("device", f"{name} {value}") for name, value in device.items() if name != "features"]
    rows += [("feature", name) for name in device.get("features", ())]
    rows += [(name, report[name]) for name in ("cores", "python", "platform")]
    rows += [(name, value or "missing") for name, value in packages.items()]
    rows += [("cache", f"{cache}, {report['cache_bytes'] / 1e6:.0f} MB" if cache else "no writable folder")]
    rows += [("problem", problem) for problem in problems] or [("problems", "none")]
    console.table("doctor", rows)
    console.result(report)
    return 0 if "error" not in device else _NO_ADAPTER


def _graphics() -> tuple[list[Any], dict[str, Any]]:
    """The adapters, and what the device made of the preferred one can do or why there is none."""
    try:
        from ispm.gpu.device import list_adapters, open_gpu

        adapters = list_adapters()
        gpu = open_gpu()
    except (AdapterError, ImportError, OSError) as error:
        return [], {"error": str(error)}
    try:
        features = sorted(str(feature) for feature in gpu.device.features)
        return adapters, {"name": gpu.name, "largest_texture": gpu.max_texture, "features": features}
    finally:
        gpu.close()


def _problems(adapters: list[Any], device: dict[str, Any], packages: dict[str, str | None]) -> list[str]:
    found = [device["error"]] if "error" in device else []
    if adapters and all(adapter.type == "CPU" for adapter in adapters):
        found.append("only a software adapter was found; with a graphics card, install its Vulkan driver")
    found += [f"{name} is missing; run: pip install {name}" for name, v in packages.items() if v is None]
    return found


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
