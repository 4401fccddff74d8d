"""Compile all kernels of a picture that are not kept yet, so that no picture waits for them.

python -m ispm.kernels
"""

import sys

from ispm.kernels import background, store
from ispm.kernels.workers import WORK, work


def main() -> int:
    """Return 1 where a kernel could not be compiled or kept."""
    if WORK in sys.argv:
        work()
        return 0
    if store.written_folder() is None:
        background.say("there is no folder to keep compiled kernels in; set ISPM_CACHE")
        return 1
    background.start()
    background.finish()
    for line in background.progress.failures:
        background.say(line)
    return 1 if background.progress.failures else 0


if __name__ == "__main__":
    sys.exit(main())
