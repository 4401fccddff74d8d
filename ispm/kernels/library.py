"""How kernels are linked: what only kernels call stays LLVM's IR, what Python calls is compiled as a whole.

Numba by itself optimises and emits every function, and again within each of its callers, and links callees as
weak symbols: the process that compiles then runs other copies than one that reads the cache, and rounds
otherwise. Here a kernel takes in all that it reaches, as functions of its own, and is optimised and emitted
once: fewer instructions to emit, and the same bits whoever compiled it.

This file alone uses private names of numba; `tests/kernels/test_kernels.py` holds it to them.
"""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from typing import Any

import llvmlite
import llvmlite.binding as llvm
import numba
import numpy as np
from numba.core import config as numba_config
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.compiler import Compiler, compile_result
from numba.core.compiler_lock import require_global_compiler_lock
from numba.core.serialize import dumps

from ispm.kernels.fingerprint import Dependencies

# What kernels for x86-64 are compiled for, wherever they run: so that they can be shipped, and round alike on
# every machine. It has AVX2 and FMA, as all but the smallest CPUs since 2013.
BASELINE = "x86-64-v3"
_BASELINE_NEEDS = ("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")
_PASSES = ("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "LLVM_REFPRUNE_PASS", "LLVM_REFPRUNE_FLAGS")
_OPTIONS = (*_PASSES, "BOUNDSCHECK", "DEBUGINFO_DEFAULT", "USING_SVML")

config: Any = numba_config  # its names are made when numba starts, unseen by type checkers


@cache
def cpu() -> tuple[str, str]:
    """Return the name and the features of the CPU to compile for: the baseline where it will do."""
    own = config.CPU_NAME or config.CPU_FEATURES or not config.ENABLE_AVX
    if not own and platform.machine().lower() in ("x86_64", "amd64"):
        features = llvm.get_host_cpu_features()
        if all(features.get(name) for name in _BASELINE_NEEDS):
            return BASELINE, ""
    codegen: Any = numba.core.registry.cpu_target.target_context.codegen()
    return codegen._get_host_cpu_name(), codegen._get_host_cpu_features()


class _Codegen(JITCPUCodegen):
    """Numba's code generator, for the CPU that kernels are compiled for."""

    def _get_host_cpu_name(self) -> str:
        return cpu()[0]

    def _get_host_cpu_features(self) -> str:
        return cpu()[1]


@cache
def _codegen() -> Any:
    return _Codegen("ispm.kernels")


@cache
def environment() -> str:
    """Return what machine code depends on besides the kernel: versions, options and CPU."""
    codegen = _codegen()
    versions = numba.__version__, llvmlite.__version__, ".".join(np.__version__.split(".")[:2])
    python = platform.python_implementation(), *platform.python_version_tuple()[:2]
    options = [f"{name}={getattr(config, name, None)}" for name in _OPTIONS]
    return repr((versions, python, options, codegen.magic_tuple(), str(codegen._data_layout)))


class _WithoutEnvironment:
    """The code generator as an inner library shows it: what is not emitted has no environment to set."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, name: str, env: Any) -> None:
        pass


class _Inner(JITCodeLibrary):
    """IR that kernels link; never machine code."""

    @property
    def codegen(self) -> Any:
        return _WithoutEnvironment(self._codegen)

    def add_llvm_module(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout
        self._final_module.link_in(ll_module)  # whoever links it optimises it

    def finalize(self) -> None:
        self._raise_if_finalized()
        for library in self._linking_libraries:
            self._reload_init.update(library._reload_init)
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        self._ensure_finalized()
        return 0

    def _get_module_for_linking(self) -> Any:
        """Return all IR that this reaches, for callers that plain numba compiles: they look no further."""
        module = super()._get_module_for_linking().clone()
        for library in _reached(self._linking_libraries, {}):
            module.link_in(JITCodeLibrary._get_module_for_linking(library), preserve=True)
        return module


class _Entry(JITCodeLibrary):
    """Machine code of a kernel with all that it calls."""

    def finalize(self) -> None:
        require_global_compiler_lock()
        self._codegen._check_llvm_bugs()
        self._raise_if_finalized()
        own = {f.name for f in self._final_module.functions if not f.is_declaration}
        for library in _reached(self._linking_libraries, {}):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(JITCodeLibrary._get_module_for_linking(library), preserve=True)
        for function in self._final_module.functions:
            if not function.is_declaration and function.name not in own:
                function.linkage = "internal"
        self._optimize_final_module()
        self._final_module.verify()
        self._finalize_final_module()

    def serialize_using_object_code(self) -> Any:
        """Return the object, and of the IR no more than the names that it defines."""
        self._ensure_finalized()
        names = [f.name for f in self._final_module.functions if not f.is_declaration]
        stub = "\n".join(f'define void @"{name}"() {{ ret void }}' for name in names)
        return self.name, "object", (self._get_compiled_object(), llvm.parse_assembly(stub).as_bitcode())


def _reached(libraries: list[Any], found: dict[Any, None]) -> dict[Any, None]:
    """Return the libraries and, of those that hold IR alone, what they link in turn; each once, in order."""
    for library in libraries:
        if library not in found:
            found[library] = None
            if isinstance(library, _Inner):
                _reached(library._linking_libraries, found)
    return found


class _Pipeline(Compiler):
    """Numba's compiler, with symbols that are named by content.

    Two kernels of one name, one of them kept from before, cannot be taken for each other then.
    """

    library: Any

    def define_pipelines(self) -> Any:
        state = self.state
        function = state.func_id
        content = f"{self.library.__name__} {Dependencies(function.func).digest}"
        function.unique_id = int(hashlib.sha256(content.encode()).hexdigest()[:14], 16)
        function.unique_name = f"{function.func_qualname}${function.unique_id}"
        state.library = self.library(_codegen(), function.func_qualname)
        state.library.enable_object_caching()
        return super().define_pipelines()


class InnerCompiler(_Pipeline):
    """For functions that kernels call."""

    library = _Inner


class EntryCompiler(_Pipeline):
    """For kernels that Python calls."""

    library = _Entry


def to_bytes(compiled: Any) -> bytes | None:
    """Return a compiled kernel to be kept; None where it holds addresses of this process."""
    if compiled.library.has_dynamic_globals:
        return None
    description = compiled.fndesc
    description.typemap = description.calltypes = None  # large, and of no use any more
    code = compiled.library.serialize_using_object_code(), description, compiled.environment
    environments = compiled._find_referenced_environments()
    return bytes(dumps((*code, compiled.signature, compiled.reload_init, environments)))


def from_parts(target_context: Any, parts: tuple[Any, ...]) -> Any:
    """Return the compiled kernel whose bytes were unpickled to `parts`."""
    object_code, description, environment, signature, reload_init, environments = parts
    for start in reload_init:
        start()
    library = _codegen().unserialize_library(object_code)
    entry = target_context.get_executable(library, description, environment)
    for each in environments:
        library.codegen.set_env(each.env_name, each)
    return compile_result(
        target_context=target_context,
        typing_context=target_context.typing_context,
        library=library,
        environment=environment,
        entry_point=entry,
        fndesc=description,
        signature=signature,
        objectmode=False,
    )
