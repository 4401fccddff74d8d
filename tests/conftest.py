"""What all tests share: one device for the whole session."""

from collections.abc import Iterator

import pytest

from ispm.gpu import Gpu, open_gpu


@pytest.fixture(scope="session")
def gpu() -> Iterator[Gpu]:
    """The preferred adapter's device; software adapters serve."""
    device = open_gpu()
    yield device
    device.close()
