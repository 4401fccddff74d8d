"""What all tests share: one device for the whole session, and that pictures call listed kernels alone."""

from collections.abc import Iterator
from functools import wraps

import pytest

from ispm.gpu import Gpu, open_gpu
from ispm.kernels import manifest
from ispm.renderer import Renderer


@pytest.fixture(scope="session")
def gpu() -> Iterator[Gpu]:
    """The preferred adapter's device; software adapters serve."""
    device = open_gpu()
    yield device
    device.close()


@pytest.fixture(scope="session", autouse=True)
def _kernels_are_listed() -> Iterator[None]:
    """Fail a picture that calls a kernel which the manifest lacks: users would wait for the compiler."""
    from every_kernel import called, lines

    listed, draw = set(manifest.lines()), Renderer._draw

    @wraps(draw)
    def watched(self, *given):
        before = called()
        frame = draw(self, *given)
        unlisted = set(lines(called() - before)) - listed
        assert not unlisted, f"kernels.txt lacks these; {manifest.MEND}\n" + "\n".join(sorted(unlisted))
        return frame

    Renderer._draw = watched
    yield
    Renderer._draw = draw
