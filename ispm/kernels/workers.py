"""Compile the kernels of the manifest that are not kept yet, in as many processes as there are cores."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from subprocess import DEVNULL, PIPE, Popen

from ispm.kernels import manifest, store
from ispm.kernels.background import Progress

_SECONDS = 1.3e-4  # of a core for each byte of bytecode that a kernel is made of
_MOST_PROCESSES = 8  # more gain nothing: the largest kernel takes a seventh of the time of all
WORK = "--work"


def compile_missing(progress: Progress, begin: Callable[[], None], wait: Callable[[], None]) -> None:
    """Compile what is missing; `begin` is called where there is any.

    One process at a time works for a folder; others `wait`, and find its work. What is there costs a second.
    """
    with _alone(wait):
        weights = missing()
        if not weights:
            return
        count, total = min(_cores(), len(weights), _MOST_PROCESSES), sum(weights.values())
        progress.what = f"compiling {len(weights)} kernel{'s' * (len(weights) > 1)}, once"
        progress.seconds = max(_SECONDS * max(total / count, max(weights.values())), 1.0)
        progress.left = len(weights)
        begin()
        answers = _work_off(list(weights), count)
        for line, problem in (answers.get() for _ in weights):
            if problem:
                progress.failures.append(f"{line.partition('(')[0]}: {problem}")
            progress.left -= 1
            progress.share += weights[line] / total


def missing() -> dict[str, int]:
    """Return the lines of the manifest whose kernels are not kept, the largest first, with their weight."""
    from ispm.kernels.fingerprint import Dependencies
    from ispm.kernels.jit import kernel_file

    found = {}
    for line in manifest.lines():
        with suppress(ImportError, AttributeError, ValueError):  # of another version; the tests tell
            kernel, signature = manifest.parse(line)
            if store.find(kernel_file(kernel, signature)) is None:
                found[line] = Dependencies(kernel).weight
    return {line: found[line] for line in sorted(found, key=found.__getitem__, reverse=True)}


def work() -> None:
    """Compile the kernels whose lines stdin brings; answer each with an empty line or what is wrong."""
    from ispm.kernels import background

    background.enabled = False
    for line in sys.stdin:
        problem = ""
        try:
            kernel, signature = manifest.parse(line.strip())
            kernel.compile(signature)
        except Exception as error:  # numba raises many kinds; whoever asked is told which
            problem = " ".join(f"{type(error).__name__}: {error}".split())
        print(problem, flush=True)


def _work_off(lines: list[str], count: int) -> SimpleQueue[tuple[str, str]]:
    """Have kernels compiled by `count` processes; return where each line will come, and what was wrong.

    The processes end with their stdin, so also where this one is killed.
    """
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(part for part in sys.path if part)}
    command = [sys.executable, "-P", "-m", "ispm.kernels", WORK]
    waiting: SimpleQueue[str] = SimpleQueue()
    answers: SimpleQueue[tuple[str, str]] = SimpleQueue()
    for line in lines:
        waiting.put(line)

    def feed(process: Popen[str]) -> None:
        with process, suppress(Empty):
            while line := waiting.get_nowait():
                answers.put((line, _ask(process, line)))

    for _ in range(count):
        process = Popen(command, env=environment, text=True, stdin=PIPE, stdout=PIPE, stderr=DEVNULL)
        threading.Thread(target=feed, args=(process,), daemon=True).start()
    return answers


def _ask(process: Popen[str], line: str) -> str:
    """Have one kernel compiled; return what was wrong."""
    assert process.stdin is not None and process.stdout is not None
    try:
        process.stdin.write(line + "\n")
        process.stdin.flush()
        answer = process.stdout.readline()
    except OSError as error:
        return str(error)
    return answer.strip() if answer else "the process that compiled it ended"


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def _alone(wait: Callable[[], None]) -> Iterator[None]:
    """Hold the folder's lock, where the system has such; `wait` is called where another holds it."""
    folder = store.written_folder()
    try:
        import fcntl
    except ImportError:  # Windows
        folder = None
    if folder is None:
        yield
        return
    with open(folder.with_suffix(".lock"), "w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            wait()
            fcntl.flock(file, fcntl.LOCK_EX)
        yield
