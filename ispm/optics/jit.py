"""Numba, set up once for every kernel of the package.

Compiled code is cached under `cache_folder()`, in a folder named by the hash of all kernel sources:
numba by itself does not see that a function called from another file has changed.
"""

from __future__ import annotations

import gc
import hashlib
import os
import pickle
import shutil
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numba
from numba.core.compiler_lock import global_compiler_lock

from ispm.cache import cache_folder

# Contraction and reciprocals only: sums keep their order, NaN and infinity their meaning.
_FASTMATH = {"contract", "nsz", "arcp"}
_KEPT_DAYS = 30.0


def jit(function: Callable[..., Any] | None = None, *, inline: bool = False) -> Any:
    """Compile `function` to machine code that releases the GIL; inline: into its callers.

    It is compiled twice at need: as Python calls it; and as other kernels call it, without what turns
    Python's objects into numbers and back, a quarter of the work of compilation.
    """
    if function is None:
        return lambda f: jit(f, inline=inline)
    folder = _kernel_folder()
    called = _dispatcher(function, folder, inline, wrapped=True)
    inner = _dispatcher(function, folder and f"{folder}/inner", inline, wrapped=False)
    # numba asks these two for a kernel's callees
    called.get_call_template, called.get_overload = inner.get_call_template, inner.get_overload
    called._compile_for_args = _without_collector(called._compile_for_args)
    return called


def _dispatcher(function: Callable[..., Any], folder: str, inline: bool, wrapped: bool) -> Any:
    """The compiler of `function`, which keeps its work in `folder`; not wrapped: for other kernels alone."""
    config: Any = numba.config  # its names are made when numba starts, unseen by type checkers
    compiler: Any = numba.njit  # type checkers do not know of all its options
    before = config.CACHE_DIR
    config.CACHE_DIR = folder or before
    try:
        compiled: Any = compiler(
            nogil=True,
            cache=bool(folder),
            error_model="numpy",
            fastmath=_FASTMATH,
            inline="always" if inline else "never",
            no_cpython_wrapper=not wrapped,
            no_cfunc_wrapper=not wrapped,
        )(function)
    finally:
        config.CACHE_DIR = before
    if folder:
        _forgive(compiled._cache)
    return compiled


def _without_collector(compile_for: Callable[..., Any]) -> Callable[..., Any]:
    """Compile while Python's cycle collector rests: it would look through the compiler's objects in vain."""

    def compile_quietly(*arguments: Any, **named: Any) -> Any:
        with global_compiler_lock:
            running = gc.isenabled()
            gc.disable()
            try:
                return compile_for(*arguments, **named)
            finally:
                if running:
                    gc.enable()

    return compile_quietly


def _forgive(cache: Any) -> None:
    """Let a damaged or full cache cost a compilation, not the picture."""

    def forgiving(method: Callable[..., Any]) -> Callable[..., Any]:
        def attempt(*arguments: Any) -> Any:
            try:
                return method(*arguments)
            except (OSError, EOFError, pickle.UnpicklingError, ValueError, AttributeError, ImportError):
                return None

        return attempt

    cache.load_overload = forgiving(cache.load_overload)
    cache.save_overload = forgiving(cache.save_overload)


@cache
def _kernel_folder() -> str:
    """The folder for this version of the kernels; empty where nothing can be written."""
    root = cache_folder()
    if root is None:
        return ""
    digest = hashlib.sha256(numba.__version__.encode())
    package = files("ispm")
    for chapter in ("optics", "tracer", "stages", "estimators", "reference"):
        for source in sorted((package / chapter).iterdir(), key=lambda p: p.name):
            if source.name.endswith((".py", ".wgsl")):
                digest.update(source.name.encode() + source.read_bytes())
    folder = root / f"kernels-{digest.hexdigest()[:16]}"
    try:
        folder.mkdir(exist_ok=True)
        os.utime(folder)  # says that this version is in use
    except OSError:
        return ""
    _forget_old(root)
    return str(folder)


def _forget_old(root: Path) -> None:
    """Remove the kernels of versions that nobody has used for long."""
    for folder in root.glob("kernels-*"):
        with suppress(OSError):
            if time.time() - folder.stat().st_mtime > _KEPT_DAYS * 86400.0:
                shutil.rmtree(folder, ignore_errors=True)
