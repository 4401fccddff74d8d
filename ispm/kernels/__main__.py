"""Compile all kernels of a picture that are not kept yet, so that no picture waits for them.

python -m ispm.kernels
python -m ispm.kernels --copy FOLDER    and copy them there, for a wheel
"""

import shutil
import sys
from pathlib import Path

from ispm.kernels import background, store
from ispm.kernels.workers import WORK, work

COPY = "--copy"


def main(arguments: list[str]) -> int:
    """Return 1 where a kernel could not be compiled, kept or copied."""
    if arguments == [WORK]:
        work()
        return 0
    if store.written_folder() is None:
        background.say("there is no folder to keep compiled kernels in; set ISPM_CACHE")
        return 1
    background.start()
    background.finish()
    for line in background.progress.failures:
        background.say(line)
    if arguments[:1] == [COPY] and not background.progress.failures:
        return _copy(Path(arguments[1]))
    return 1 if background.progress.failures else 0


def _copy(folder: Path) -> int:
    from ispm.kernels.jit import kernel_file
    from ispm.kernels.library import BASELINE, cpu
    from ispm.kernels.manifest import lines, parse

    if cpu()[0] != BASELINE:
        background.say(f"kernels for {cpu()[0]} run nowhere else; build the wheel on a CPU with AVX2 and FMA")
        return 1
    folder.mkdir(parents=True, exist_ok=True)
    for line in lines():
        found = store.find(kernel_file(*parse(line)))
        assert found is not None, line
        shutil.copy(found, folder)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
