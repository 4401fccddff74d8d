"""Compiled kernels: by what they are known, that they come back as they were, and that all are listed."""

import os
import re
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import ModuleType

import numba
import numpy as np
import pytest
from numba.core import codegen, compiler

from ispm.kernels import background, library, manifest, store, workers
from ispm.kernels.fingerprint import Dependencies
from ispm.kernels.jit import KERNELS, jit, kernel_file, seconds_compiling
from ispm.renderer.watch import Watch

SOURCE = '''
from typing import NamedTuple

import numpy as np

class Pair(NamedTuple):
    """Two numbers."""

    low: float
    high: float = 2.0  # never less

FACTOR = 3.0
SHAPE = np.dtype([("x", np.float32)])

@jit
def plain(x, by=2.0):
    return x * by

@jit
def inner(x):
    """Say something."""
    return plain(x) + FACTOR

def made(by):
    @jit
    def scaled(x):
        return by * x
    return scaled

twice, thrice = made(2.0), made(3.0)

@jit(allocates=True)
def outer(x):
    # a remark
    return twice(inner(x)) + sum([k * FACTOR for k in range(2)])

@jit
def other(x):
    return x - 1.0 + Pair(0.0, 0.0).high

@jit
def given(pair):
    return pair.low
'''


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """An empty folder for compiled kernels, for this process and those that it starts."""
    folder = tmp_path / "kernels"
    folder.mkdir()
    monkeypatch.setenv("ISPM_CACHE", str(tmp_path))
    monkeypatch.setattr(store, "written_folder", lambda: folder)
    monkeypatch.setattr(store, "SHIPPED", tmp_path / "shipped")
    monkeypatch.setattr(background, "progress", background.Progress())
    monkeypatch.setattr(background, "_thread", None)
    monkeypatch.setattr(background, "bar", False)
    return folder


def module(source=SOURCE):
    """A new module of that source, with kernels of its own."""
    made = ModuleType("kernels_of_a_test")
    made.jit = jit
    exec(source, vars(made))
    return made


def digests(source=SOURCE):
    made = module(source)
    return [Dependencies(getattr(made, name)).digest for name in ("inner", "outer", "other")]


def changed(old, new):
    """Which of inner, outer and other depend on what is replaced."""
    assert old in SOURCE
    pairs = zip(digests(), digests(SOURCE.replace(old, new)), strict=True)
    return [before != after for before, after in pairs]


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("Say something.", "Say another thing.", [False, False, False]),
        ("# a remark", "# another\\n", [False, False, False]),
        ("FACTOR = 3.0", "FACTOR = 3", [True, True, False]),  # a constant's type is its content
        ("by=2.0", "by=2.5", [True, True, False]),  # a default
        ("x * by", "x / by", [True, True, False]),  # its code
        ("made(2.0)", "made(2.5)", [False, True, False]),  # a closure
        ("k * FACTOR", "k + FACTOR", [False, True, False]),  # within a comprehension
        ("x - 1.0", "x + 1.0", [False, False, True]),
        ("# never less", "# less", [False, False, False]),
        ("Two numbers.", "Numbers.", [False, False, False]),
        ("low: float", "least: float", [False, False, True]),  # a named tuple's field
        ("high: float = 2.0", "high: float = 2.5", [False, False, True]),
        ("twice(inner", "thrice(inner", [False, True, False]),  # functions of one name
        ("@jit\\ndef other", "@jit(inline=True)\\ndef other", [False, False, True]),
    ],
)
def test_a_kernel_is_known_by_all_it_depends_on(old, new, expected):
    assert changed(old.replace("\\n", "\n"), new.replace("\\n", "\n")) == expected


def test_a_kernel_is_known_by_the_fields_of_named_tuples_that_it_is_given():
    """It may not name their class, and numba's names of such types leave the fields out."""
    files = set()
    for source in (SOURCE, SOURCE.replace("low: float", "low: float  # m"), SOURCE.replace("low", "first")):
        made = module(source.replace("pair.first", "pair.low"))
        pair = numba.types.NamedUniTuple(numba.float32, 2, made.Pair)
        files |= {kernel_file(made.given, (numba.types.UniTuple(pair, 2),))}
    assert len(files) == 2


def test_what_cannot_be_told_is_no_content():
    source = "class Thing: pass\nthing = Thing()\n@jit\ndef lost(x):\n    return thing\n"
    with pytest.raises(TypeError, match="lost names a Thing, whose content cannot be told"):
        Dependencies(module(source).lost)


def test_contents_are_the_same_in_every_process():
    """Whatever order sets have there."""
    code = (
        "from ispm.kernels import manifest; from ispm.kernels.jit import kernel_file\n"
        "for line in manifest.lines(): print(kernel_file(*manifest.parse(line)))"
    )
    runs = [
        subprocess.run(
            [sys.executable, "-c", code], env=os.environ | {"PYTHONHASHSEED": seed}, capture_output=True,
            text=True, check=True, timeout=120,
        ).stdout
        for seed in ("1", "2")
    ]  # fmt: skip
    assert runs[0] == runs[1] != ""


def test_types_versions_and_cpu_tell_kernels_apart(monkeypatch):
    other = module().other
    names = {kernel_file(other, (numba.float32,)), kernel_file(other, (numba.float64,))}
    monkeypatch.setattr(library.numba, "__version__", "1.0")
    library.environment.cache_clear()
    names.add(kernel_file(other, (numba.float64,)))
    monkeypatch.undo()
    library.environment.cache_clear()
    assert len(names) == 3


def test_a_cpu_below_the_baseline_compiles_for_itself(monkeypatch):
    monkeypatch.setattr(library.platform, "machine", lambda: "x86_64")
    features = library.llvm.get_host_cpu_features()
    features.update(dict.fromkeys(library._BASELINE_NEEDS, True))
    monkeypatch.setattr(library.llvm, "get_host_cpu_features", lambda: features)
    assert library.cpu.__wrapped__() == (library.BASELINE, "")
    features["avx2"] = False
    name, flags = library.cpu.__wrapped__()
    assert name != library.BASELINE and "-avx2" in flags


def test_kernels_come_back_and_are_never_stale(kept):
    assert module().outer(1.0) == 13.0
    (first,) = kept.iterdir()
    written = first.stat().st_mtime_ns
    assert module().outer(1.0) == 13.0  # of the file
    assert [f.stat().st_mtime_ns for f in kept.iterdir()] == [written]
    assert module(SOURCE.replace("FACTOR = 3.0", "FACTOR = 4.0")).outer(1.0) == 16.0
    assert len([*kept.iterdir()]) == 2
    assert module().outer(1.0) == 13.0


@pytest.mark.parametrize(
    "damage",
    [
        lambda data, _: b"",
        lambda data, _: data[:100],
        lambda data, _: data[:-1],
        lambda data, _: data[:200] + bytes([data[200] ^ 1]) + data[201:],
        lambda data, name: store._digest(name, b"no pickle") + b"no pickle",
        lambda data, name: store._digest(name, b"I1\n.") + b"I1\n.",  # a pickle of something else
        lambda data, name: store._digest("other" + name, data[32:]) + data[32:],  # another kernel's file
    ],
)
def test_a_damaged_file_costs_a_compilation_only(kept, damage):
    assert module().other(1.0) == 0.0
    (file,) = kept.iterdir()
    file.write_bytes(damage(file.read_bytes(), file.name))
    assert module().other(1.0) == 0.0
    data = file.read_bytes()
    assert store._digest(file.name, data[32:]) == data[:32] and len(data) > 1000


def test_kernels_that_a_wheel_carries_are_used_and_nothing_is_written(kept, monkeypatch):
    module().other(1.0)
    kept.rename(store.SHIPPED)
    kept.mkdir()
    assert module().other(1.0) == 0.0
    assert not [*kept.iterdir()]


def test_nothing_to_write_to_is_no_error(monkeypatch):
    monkeypatch.setattr(store, "written_folder", lambda: None)
    assert module().other(1.0) == 0.0


def test_private_names_of_numba_are_there():
    """What ispm.kernels.library calls that numba may change; the tests above show that it works."""
    assert issubclass(codegen.JITCPUCodegen, codegen.CPUCodegen)
    for name in (
        "_get_module_for_linking", "_optimize_final_module", "_finalize_final_module", "_raise_if_finalized",
        "_finalize_dynamic_globals", "_ensure_finalized", "_get_compiled_object", "_unserialize",
        "enable_object_caching", "has_dynamic_globals",
    ):  # fmt: skip
        assert hasattr(codegen.JITCodeLibrary, name), name
    for name in (
        "_get_host_cpu_name",
        "_get_host_cpu_features",
        "_check_llvm_bugs",
        "set_env",
        "magic_tuple",
    ):
        assert hasattr(codegen.JITCPUCodegen, name), name
    assert hasattr(compiler.CompileResult, "_find_referenced_environments")
    for name in ("_cache", "_compile_for_args", "get_call_template", "get_overload", "targetoptions"):
        assert hasattr(KERNELS["ispm.optics.rng.random4"], name), name


def test_lines_of_the_manifest_are_understood_and_in_order():
    lines = manifest.lines()
    assert lines == sorted(set(lines))
    for line in lines:
        kernel, signature = manifest.parse(line)
        assert manifest.line(kernel, signature) == line


@pytest.mark.parametrize(
    "line", ["", "a b", "ispm.optics.rng.random4", "ispm.optics.rng.random4(list(uint8))"]
)
def test_lines_that_are_none_are_told(line):
    with pytest.raises(ValueError, match=r"kernels\.txt: .*make kernels"):
        manifest.parse(line)


@pytest.mark.parametrize("array", [np.zeros((3, 2)).T, np.zeros((4, 2))[::2], np.zeros(2, "f4,f4")])
def test_types_that_no_line_can_tell_are_refused(array):
    with pytest.raises(ValueError, match="kernels are called with"):
        manifest.line(KERNELS["ispm.optics.rng.random4"], (numba.typeof(array),))


def test_the_manifest_lists_what_pictures_call():
    """All of it and nothing else, and each line leads to the kernel that a picture asks for."""
    run = subprocess.run(
        [sys.executable, "-m", "every_kernel"], cwd=Path(__file__).parents[1], capture_output=True, text=True,
        timeout=280,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines() == manifest.lines(), f"to list them again, {manifest.MEND}"


LINE = "ispm.optics.rng.random4(uint32, uint32, uint32, uint32)"


def test_what_is_missing_is_compiled_by_other_processes_and_said_once(kept, monkeypatch):
    monkeypatch.setattr(manifest, "lines", lambda: [LINE])
    said = []
    monkeypatch.setattr(background, "say", said.append)
    name = kernel_file(*manifest.parse(LINE))
    assert background.brings(name)
    background.finish()
    assert [f.name for f in kept.iterdir()] == [name]
    assert said[0] == "compiling 1 kernel, once: about 1 s"
    assert said[1].startswith("compiled in ") and len(said) == 2
    assert not workers.missing()
    background.start()
    background.finish()
    assert len(said) == 2


def test_long_compilation_says_what_is_left_at_the_pace_so_far(kept, monkeypatch):
    said, told = [], threading.Event()

    def compile_two(progress, begin, wait):
        progress.what, progress.left = "compiling 2 kernels, once", 2
        begin()
        hear(1)
        progress.left, progress.share, progress.begun = 1, 0.25, progress.begun - 100.0
        hear(2)
        progress.left, progress.share = 0, 1.0

    def hear(which):
        while len(said) <= which and told.wait(10.0):
            told.clear()

    def say(line):
        if line not in said:
            said.append(line)
            told.set()

    monkeypatch.setattr(workers, "compile_missing", compile_two)
    monkeypatch.setattr(background, "_EVERY", 0.01)
    monkeypatch.setattr(background, "say", say)
    background.start()
    background.finish()
    assert said[1] == "compiling: 2 kernels left"
    seconds = re.fullmatch(r"compiling: 1 kernel left, about (\d+) s more", said[2])
    assert seconds and 300 <= int(seconds[1]) < 330  # three times the 100 s and at most the wait for a line


def test_who_finds_another_process_at_it_waits_and_says_so(kept, monkeypatch):
    fcntl = pytest.importorskip("fcntl")
    monkeypatch.setattr(manifest, "lines", list)
    said = []
    monkeypatch.setattr(background, "say", said.append)
    with open(kept.with_suffix(".lock"), "w") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        background.start()
        background._thread.join(0.5)
        assert background._thread.is_alive()
    background.finish()
    assert said == ["waiting for another process that compiles kernels"]


def test_a_kernel_that_cannot_be_compiled_is_told(kept, monkeypatch):
    monkeypatch.setattr(manifest, "lines", lambda: [LINE.replace("uint32)", "tuple(uint32))"), LINE])
    monkeypatch.setattr(background, "say", lambda line: None)
    background.start()
    background.finish()
    (problem,) = background.progress.failures
    assert problem.startswith("ispm.optics.rng.random4: TypingError: ")
    assert len([*kept.iterdir()]) == 1


def test_without_processes_kernels_are_compiled_here(kept, monkeypatch):
    monkeypatch.setattr(background.sys, "executable", "/usr/bin/an-app")
    assert not background.brings("a.kernel")
    said = []
    monkeypatch.setattr(background, "_warned", False)
    monkeypatch.setattr(background, "say", said.append)
    background.tell("small", 100)
    background.tell("large", 10**6)
    background.tell("larger", 10**7)
    assert said == ["compiling large and what else is needed, once; that may take a minute"]


def test_compilation_is_not_counted_as_rendering(kept):
    watch, before, started = Watch(), seconds_compiling(), time.perf_counter()
    with watch("trace"):
        module().outer(1.0)
    spent = seconds_compiling() - before
    assert spent > 0.05  # numba takes longer for any kernel
    assert watch.milliseconds["trace"] + 1e3 * spent <= 1e3 * (time.perf_counter() - started)


FRESH_OR_KEPT = """
import hashlib, sys
import numpy as np
from ispm.kernels import background
from ispm.stages.tonemap import tonemap
background.enabled = False  # the first process compiles what the second one reads, and no more
picture = np.random.default_rng(1).exponential(1.0, (64, 64, 3)).astype(np.float32)
print(hashlib.sha256(tonemap(picture, 0.3, "agx", bits=16)).hexdigest())
"""
PICTURE = """
import hashlib, sys
import ispm
scene = ispm.builtin("cornell-box")
with ispm.Renderer(scene, ispm.Settings(size=(64, 36), photons=2000), threads=int(sys.argv[1])) as renderer:
    frame = renderer.render()
    print(hashlib.sha256(frame.radiance.tobytes() + renderer.photons().tobytes()).hexdigest())
"""


def _runs(folder, code, threads):
    environment = os.environ | {"ISPM_CACHE": str(folder)}
    return {
        subprocess.run(
            [sys.executable, "-c", code, count], env=environment, capture_output=True, text=True, check=True
        ).stdout
        for count in threads
    }


def test_who_compiles_has_the_bits_of_who_reads(tmp_path):
    assert len(_runs(tmp_path, FRESH_OR_KEPT, ["1", "1"])) == 1


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_pictures_have_the_same_bytes_fresh_and_kept_by_one_thread_and_two(tmp_path):
    assert len(_runs(tmp_path, PICTURE, ["2", "1", "2"])) == 1
