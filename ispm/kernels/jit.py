"""Numba, set up once for every kernel of the package."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numba
from numba.core.caching import NullCache
from numba.core.compiler_lock import global_compiler_lock

from ispm.kernels import background, manifest, store
from ispm.kernels.fingerprint import Dependencies, type_text
from ispm.kernels.library import EntryCompiler, InnerCompiler, environment, from_parts, to_bytes

# Contraction only: sums keep their order, NaN and infinity their meaning. With `arcp` roots and quotients
# would be refined estimates (`rsqrtss`), which differ between processors.
_FASTMATH = {"contract", "nsz"}

KERNELS: dict[str, Any] = {}  # all kernels of the process by module and name


def jit(function: Callable[..., Any] | None = None, *, inline: bool = False, allocates: bool = False) -> Any:
    """Compile `function` to machine code that releases the GIL; inline: into its callers.

    It counts no references to arrays, which its caller keeps alive: with them a walk takes a quarter longer.
    One that makes arrays says so by `allocates`; if it returns them, only Python calls it.

    It is compiled twice at need: as Python calls it, with all that it calls in turn; and as other kernels
    call it, without what turns Python's objects into numbers and back, and not to the end.
    """
    if function is None:
        return lambda f: jit(f, inline=inline, allocates=allocates)
    called = _dispatcher(function, inline, allocates, EntryCompiler)
    inner = _dispatcher(function, inline, allocates, InnerCompiler)
    # numba asks these two for a kernel's callees
    called.get_call_template, called.get_overload = inner.get_call_template, inner.get_overload
    called._cache = _Kept(called)
    called._compile_for_args = _timed(called._compile_for_args)
    KERNELS[f"{function.__module__}.{function.__qualname__}"] = called
    return called


def _dispatcher(function: Callable[..., Any], inline: bool, allocates: bool, compiler_class: type) -> Any:
    """The compiler of `function` for those who call it: Python or other kernels."""
    compiler: Any = numba.njit  # type checkers do not know of all its options
    return compiler(
        nogil=True,
        _nrt=allocates,
        error_model="numpy",
        fastmath=_FASTMATH,
        inline="always" if inline else "never",
        no_cpython_wrapper=compiler_class is InnerCompiler,
        no_cfunc_wrapper=True,
        pipeline_class=compiler_class,
    )(function)


def kernel_file(kernel: Any, signature: tuple[Any, ...]) -> str:
    """Return the name under which `kernel` is kept for arguments of these types."""
    types = map(type_text, signature)
    return store.file_name(kernel.py_func, types, Dependencies(kernel).digest, environment())


def seconds_compiling() -> float:
    """Return how long this process has spent on making kernels ready: compiling, waiting and loading."""
    return _seconds


_seconds = 0.0


class _Kept(NullCache):
    """What numba asks for a kernel before it compiles one, and hands one to afterwards."""

    def __init__(self, kernel: Any) -> None:
        self._kernel = kernel

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        target_context.refresh()
        name = kernel_file(self._kernel, sig)
        parts = store.read(name)
        if parts is None and _is_listed(self._kernel, sig) and background.brings(name):
            parts = store.read(name)
        if parts is not None:
            try:
                return from_parts(target_context, parts)
            except Exception:  # whatever is wrong with it, it can be compiled
                pass
        background.tell(self._kernel.py_func.__qualname__, Dependencies(self._kernel).weight)
        return None

    def save_overload(self, sig: Any, cres: Any) -> None:
        data = to_bytes(cres)
        if data is not None:
            store.write(kernel_file(self._kernel, sig), data)


def _is_listed(kernel: Any, signature: tuple[Any, ...]) -> bool:
    """Whether others can be told to compile this."""
    try:
        return manifest.line(kernel, signature) in manifest.lines()
    except ValueError:
        return False


def _timed(compile_for: Callable[..., Any]) -> Callable[..., Any]:
    """Measure compilation; meanwhile Python's cycle collector, which would look through it in vain, rests."""

    def compile_quietly(*arguments: Any, **named: Any) -> Any:
        with global_compiler_lock, _clock(), _without_collector():
            return compile_for(*arguments, **named)

    return compile_quietly


@contextmanager
def _clock() -> Iterator[None]:
    global _seconds
    started = time.perf_counter()
    try:
        yield
    finally:
        _seconds += time.perf_counter() - started


@contextmanager
def _without_collector() -> Iterator[None]:
    running = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if running:
            gc.enable()
