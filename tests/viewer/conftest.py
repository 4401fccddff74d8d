"""What the tests of the live view share: a session that draws without a device."""

import pytest
from painting import CAMERA, Painting, boxes

from ispm.settings import Settings
from ispm.viewer.session import Session


@pytest.fixture
def painting():
    return Painting()


@pytest.fixture
def session(painting):
    return Session(boxes(), painting, Settings(size=(64, 32), preset="fast"), CAMERA)


@pytest.fixture
def site():
    for name in ("websockets", "uvicorn"):
        pytest.importorskip(name, reason="needs the extra web")
    from serving import Site

    made = Site()
    yield made
    made.running.close()
    assert made.painting.closed
