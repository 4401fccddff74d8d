"""Decoding in a process of its own: what it may take, and how it ends."""

import sys
from pathlib import Path

import numpy as np
import pytest

from ispm.errors import SceneError
from ispm.io import decoders
from ispm.io.apart import Apart
from ispm.io.budget import Budget
from ispm.settings import LoadLimits

# Stands for a library: the data say what it does.
MISCHIEF = """
import ctypes, os, sys, time
import numpy as np

class Mesh:
    faces = np.array([[0, 1, 2]], np.uint32)
    attributes = [{"unique_id": 4, "data": np.arange(6, dtype=np.float32).reshape(2, 3)}]

def decode(data):
    print("what libraries print is no answer")
    if data == b"crash":
        ctypes.string_at(0)
    if data == b"sleep":
        time.sleep(60.0)
    if data == b"exit":
        os._exit(0)
    if data == b"fill":
        bytearray(1 << 33)
    if data == b"fault":
        raise RuntimeError("first line\\nsecond line")
    return Mesh()
"""


@pytest.fixture
def decoder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "DracoPy.py").write_text(MISCHIEF)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    made = Apart(Budget(LoadLimits()))
    yield made
    made.close()


def check(decoder: Apart) -> None:
    arrays = decoder.decode("draco", b"well")
    assert arrays["faces"].tolist() == [[0, 1, 2]]
    assert arrays["faces"].dtype == np.uint32
    assert arrays["4"].tolist() == [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]


def test_arrays_come_back_and_the_process_serves_again(decoder: Apart) -> None:
    check(decoder)
    first = decoder._process
    check(decoder)
    assert decoder._process is first
    decoder.close()
    assert first is not None
    assert first.poll() is not None


@pytest.mark.parametrize("end", [b"crash", b"exit"])
def test_a_decoder_that_ends_is_one_line_and_the_next_request_is_served(decoder: Apart, end: bytes) -> None:
    with pytest.raises(SceneError, match="its decoder ended"):
        decoder.decode("draco", end)
    check(decoder)


def test_what_a_decoder_says_is_one_line(decoder: Apart) -> None:
    with pytest.raises(SceneError, match=r"^it cannot be decoded: first line second line$"):
        decoder.decode("draco", b"fault")
    check(decoder)


@pytest.mark.skipif(sys.platform != "linux", reason="memory is limited on Linux alone")
def test_a_decoder_gets_no_more_memory_than_is_left(decoder: Apart) -> None:
    with pytest.raises(SceneError, match="no memory left to decode it"):
        decoder.decode("draco", b"fill")
    check(decoder)


def test_a_decoder_that_does_not_end_is_ended(decoder: Apart) -> None:
    check(decoder)
    decoder._seconds = 0.3
    with pytest.raises(SceneError, match="it takes too long to decode"):
        decoder.decode("draco", b"sleep")
    with pytest.raises(SceneError, match="it takes too long to decode"):
        decoder.decode("draco", b"sleep")  # the time of all is spent


def test_the_program_imports_nothing_of_the_package() -> None:
    text = Path(decoders.__file__).read_text()
    assert "import ispm" not in text
    assert "from ispm" not in text


def test_modules_of_the_working_folder_are_not_imported(
    tmp_path: Path, decoder: Apart, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "scene"
    folder.mkdir()
    (folder / "numpy.py").write_text("raise SystemExit(3)")
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", ["", *sys.path])
    check(decoder)
