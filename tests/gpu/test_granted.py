"""Nothing is used that was not asked for: pictures on a device that grants no more than WebGPU promises."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from drivers.pipelines import all_pipelines
from transport import render

from ispm.errors import AdapterError
from ispm.gpu import Gpu
from ispm.gpu.device import _BASELINE, _GENEROUS, _adapters
from ispm.library.builtin import builtin

SIZE = (64, 36)
# WebGPU specification, section 3.6.2, of what `Gpu` else asks as much of as there is.
LEAST = {
    "max-texture-dimension-2d": 8192,
    "max-storage-buffer-binding-size": 128 << 20,
    "max-buffer-size": 256 << 20,
    "max-compute-workgroups-per-dimension": 65535,
}


class Modest:
    """An adapter that has nothing beyond the baseline."""

    def __init__(self) -> None:
        self._adapter = _adapters()[0]
        self.info, self.features = self._adapter.info, frozenset[str]()
        self.limits = {**self._adapter.limits, **_BASELINE, **LEAST}

    def request_device_sync(self, **wanted: Any) -> Any:
        """Return the adapter's own device, which grants what is asked for and no more."""
        return self._adapter.request_device_sync(**wanted)


@pytest.fixture(scope="module")
def modest() -> Iterator[Gpu]:
    device = Gpu(Modest())
    yield device
    device.close()


def test_the_baseline_is_all_that_is_granted(modest: Gpu):
    assert LEAST.keys() == set(_GENEROUS)
    granted = modest.device.limits
    assert {name: granted[name] for name in _BASELINE | LEAST} == _BASELINE | LEAST
    assert not set(modest.device.features)


@pytest.mark.parametrize("estimator", ["tiled", "grid"])
@pytest.mark.parametrize("emission", ["map", "rays"])
def test_a_picture_needs_no_more(gpu: Gpu, modest: Gpu, estimator: str, emission: str):
    knobs = dict(size=SIZE, photons=2000, estimator=estimator, emission=emission)
    expected, _ = render(gpu, builtin("cornell-box"), **knobs)
    found, _ = render(modest, builtin("cornell-box"), **knobs)
    for layer in expected.layers:
        np.testing.assert_array_equal(found[layer], expected[layer], layer)


@pytest.mark.parametrize("name", ["glass-sphere", "caustic-ring"])
def test_caustics_need_no_more(gpu: Gpu, modest: Gpu, name: str):
    """Without blending of 32-bit floats they are sums of 16-bit ones, of 11 significant bits each."""
    expected, _ = render(gpu, builtin(name), size=SIZE, photons=2000)
    found, _ = render(modest, builtin(name), size=SIZE, photons=2000)
    assert found.indirect.mean() == pytest.approx(expected.indirect.mean(), rel=0.01)


def test_volumes_say_what_they_lack(modest: Gpu):
    with pytest.raises(AdapterError, match="cannot blend 32-bit floats"):
        render(modest, builtin("cornell-box"), size=SIZE, estimator="volumes")


def test_no_pipeline_needs_more(modest: Gpu):
    for pipeline in all_pipelines(Modest()):
        pipeline.make(modest)
