"""What is more than memory can hold is one line with the cure; what nobody uses any more is removed."""

import os
import time

import pytest

from ispm.errors import SettingsError
from ispm.gpu import Gpu, within_memory
from ispm.kernels.store import _forget_old
from ispm.library.builtin import builtin
from ispm.renderer.renderer import Renderer
from ispm.settings import Settings


def test_a_buffer_larger_than_the_adapter_has_is_told_with_the_cure(gpu: Gpu):
    largest = gpu.device.limits["max-buffer-size"]
    told = pytest.raises(SettingsError, match=r"a heap of photons needs more memory .* fewer photons")
    with told, within_memory("a heap of photons"):
        gpu.buffer("photons").sized(largest + 1024)


def test_a_binding_larger_than_the_adapter_has_is_told_with_the_cure():
    line = "Buffer binding 0 range 268435456 exceeds `max_*_buffer_binding_size` limit 134217728"
    with pytest.raises(SettingsError, match="a picture needs more memory"), within_memory("a picture"):
        raise RuntimeError(line)


@pytest.mark.parametrize(
    "error", [RuntimeError("the shader is wrong"), ValueError("out of memory"), KeyError(1)]
)
def test_other_errors_stay_what_they_are(error):
    with pytest.raises(type(error)), within_memory("a picture"):
        raise error


def test_a_renderer_without_memory_names_size_and_photons(gpu: Gpu, monkeypatch):
    def fail(self, index):
        raise MemoryError("Unable to allocate 9 TiB")

    monkeypatch.setattr(Renderer, "_draw", fail)
    renderer = Renderer(builtin("cornell-box"), Settings(size=(640, 48), photons=12_000), gpu=gpu)
    with pytest.raises(
        SettingsError, match="a picture of 640x48 pixels and 12,000 photons needs more memory"
    ):
        renderer.render()
    assert repr(renderer).startswith(
        "<Renderer of <Scene 'cornell-box': 30 triangles, 1 light, 1 camera> at 640x48"
    )
    renderer.close()
    assert repr(renderer) == "<Renderer, closed>"


def test_kernels_of_old_versions_are_removed(tmp_path):
    kept = tmp_path / "kernels"
    for name, days in (("kernels-new", 1), ("kernels-old", 31), ("other-old", 31)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "a.nbc").write_bytes(b"machine code")
        _age(tmp_path / name, days)
    kept.mkdir()
    for name, days in (("a.kernel", 29), ("b.kernel", 31)):
        (kept / name).write_bytes(b"machine code")
        _age(kept / name, days)
    _forget_old(tmp_path, kept)
    assert sorted(f.name for f in tmp_path.iterdir()) == ["kernels", "kernels-new", "other-old"]
    assert [f.name for f in kept.iterdir()] == ["a.kernel"]


def _age(path, days):
    past = time.time() - days * 86400
    os.utime(path, (past, past))
