"""What a closed renderer leaves on the device, counted by wgpu, without the help of the cycle collector."""

import gc
from collections.abc import Iterator

import pytest
import wgpu.backends.wgpu_native  # which counts

from ispm import Renderer, Settings
from ispm.gpu import Gpu
from ispm.library.builtin import builtin

# Of one block size, shadow size and estimator, and of others: the stages that these settings make anew.
SMALL = Settings(size=(48, 27), photons=200)
OTHER = SMALL.replace(subsampling=2, shadow_resolution=64, estimator="volumes")


def held() -> dict[str, int]:
    """How many objects of each kind wgpu holds for this process."""
    counts = wgpu.diagnostics.get_dict()["wgpu_native_counts"]
    return {kind: counts[kind]["count"] for kind in counts if kind not in ("Adapter", "Surface")}


@pytest.fixture
def _no_collector() -> Iterator[None]:
    gc.collect()
    gc.disable()
    yield
    gc.enable()


def render(gpu: Gpu) -> Renderer:
    """A renderer whose stages have been made anew, and which was not closed."""
    renderer = Renderer(builtin("caustic-ring"), SMALL, gpu=gpu)
    counts = []
    for settings in (SMALL, OTHER, SMALL, OTHER, SMALL):
        renderer.settings = settings
        renderer.render()
        counts.append(held())
    assert counts[4] == counts[2]  # pipelines of the first two are the device's, which keeps them
    return renderer


@pytest.mark.usefixtures("_no_collector")
def test_stages_are_freed_when_replaced_and_when_the_renderer_closes(gpu: Gpu, monkeypatch) -> None:
    monkeypatch.setattr("ispm.renderer.renderer.gc.collect", lambda: 0)
    render(gpu).close()  # the device's own memory for uniforms and reading has grown
    before = held()
    renderer = render(gpu)
    assert held()["Texture"] > before["Texture"] + 15
    renderer.close()
    assert held() == before


def test_a_renderer_frees_its_own_device() -> None:
    gc.collect()
    before = held()
    renderer = Renderer(builtin("cornell-box"), SMALL)
    renderer.render()
    assert held()["Device"] == before["Device"] + 1
    renderer.close()
    assert held() == before and repr(renderer) == "<Renderer, closed>"
