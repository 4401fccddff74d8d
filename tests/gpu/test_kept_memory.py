"""What is kept on the device between frames: bind groups, lists with their counts, times, what was drawn."""

import numpy as np
import pytest

from ispm import wgsl
from ispm.gpu import Counted, Gpu, Kept, Recording

SHADER = """
@group(0) @binding(0) var<storage, read_write> count: array<atomic<u32>>;
@group(0) @binding(1) var<storage, read_write> rows: array<u32>;
@group(0) @binding(2) var<uniform> most: vec4u;

@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= most.x) { return; }
    let slot = atomicAdd(&count[0], 1u);
    if (slot < arrayLength(&rows)) { rows[slot] = id.x; }
}
@group(0) @binding(3) var drawn: texture_2d<f32>;
@vertex fn vs() -> @builtin(position) vec4f { return vec4f(0.0); }
@fragment fn fs() -> @location(0) vec4f { return textureLoad(drawn, vec2u(0u), 0); }
"""


@pytest.fixture
def shader(monkeypatch: pytest.MonkeyPatch) -> str:
    """A shader file that exists for one test only."""
    source = wgsl.Source(SHADER, tuple(("x.wgsl", i + 1) for i in range(SHADER.count("\n"))))
    monkeypatch.setattr(wgsl, "load", lambda path: source)
    return "x.wgsl"


def test_a_list_is_read_whole_whatever_was_expected(gpu: Gpu, shader: str) -> None:
    run, counted = gpu.compute(shader), Counted(gpu)
    count, rows = gpu.buffer("count"), gpu.buffer("rows").sized(4 * 500)
    dtype = np.dtype(np.uint32)
    for wanted in (0, 3, 400, 5, 0, 500, 800, 2):
        count.write(np.zeros(4, np.uint32))
        with gpu.frame() as frame:
            run(frame, over=1024, count=count, rows=rows, most=_uniform(frame, wanted))
        total, (found,) = counted.read(count, 500, (rows, dtype))
        assert total == wanted and len(found) == min(wanted, 500)
        if wanted <= 500:
            assert sorted(found.tolist()) == list(range(wanted))


def _uniform(frame: Recording, value: int) -> dict[str, object]:
    return frame.uniform(np.full(4, value, np.uint32))


def test_bind_groups_are_kept_until_memory_is_allocated(gpu: Gpu, shader: str) -> None:
    raster = gpu.raster(shader, ["rgba32float"])
    first, second = (gpu.texture(name, "rgba32float").sized((4, 4)) for name in ("first", "second"))
    group = raster.bind(0, drawn=first)
    assert raster.bind(0, drawn=first) is group
    other = raster.bind(0, drawn=second)
    assert other is not group and raster.bind(0, drawn=second) is other
    assert raster.bind(0, drawn=first.sized((4, 4))) is group
    changed = raster.bind(0, drawn=first.sized((8, 8)))
    assert changed is not group and raster.bind(0, drawn=first) is changed
    gpu.buffer("any")
    assert raster.bind(0, drawn=first) is not changed


def test_what_was_recorded_is_kept_once_it_is_sent(gpu: Gpu) -> None:
    kept = Kept()
    with pytest.raises(ZeroDivisionError), gpu.frame() as frame:
        assert kept.lacks(frame, 1, "a")
        raise ZeroDivisionError
    for made_of, lacks in (((1, "a"), True), ((1, "a"), False), ((1, "b"), True), ((1, "a"), True)):
        with gpu.frame() as frame:
            assert kept.lacks(frame, *made_of) == lacks
    with pytest.raises(ZeroDivisionError), gpu.frame() as frame:
        assert kept.lacks(frame, 2)  # what was there may be overwritten in part
        raise ZeroDivisionError
    with gpu.frame() as frame:
        assert kept.lacks(frame, 1, "a")


def test_times_of_many_recordings_are_read_at_once(gpu: Gpu, shader: str) -> None:
    run = gpu.compute(shader)
    count, rows = gpu.buffer("count"), gpu.buffer("rows").sized(4 * 4096)
    recordings = []
    for stages in (1, 3, 0, 20):
        with gpu.frame() as frame:
            for number in range(stages):
                frame.stage(f"stage {number}")
                run(frame, over=4096, count=count, rows=rows, most=_uniform(frame, 4096))
        recordings.append(frame)
    Recording.read_times(recordings)
    for stages, frame in zip((1, 3, 0, 20), recordings, strict=True):
        if frame.timing != "off":
            times = frame.milliseconds()
            assert len(times) == stages and all(0.0 < each < 1e4 for each in times.values())


def test_a_pipeline_is_compiled_once_and_each_user_has_bind_groups_of_its_own(gpu: Gpu, shader: str) -> None:
    one, two, other = (gpu.raster(shader, [format]) for format in ("rgba32float", "rgba32float", "r8unorm"))
    assert one.pipeline is two.pipeline and other.pipeline is not one.pipeline
    texture = gpu.texture("drawn", "rgba32float").sized((4, 4))
    assert one.bind(0, drawn=texture) is one.bind(0, drawn=texture) is not two.bind(0, drawn=texture)


def test_a_file_that_reads_otherwise_is_compiled_anew(gpu: Gpu, shader: str, monkeypatch) -> None:
    first = gpu.raster(shader, ["rgba32float"])
    source = wgsl.Source(SHADER + "// more\n", (("x.wgsl", 1),) * (SHADER.count("\n") + 1))
    monkeypatch.setattr(wgsl, "load", lambda path: source)
    assert gpu.raster(shader, ["rgba32float"]).pipeline is not first.pipeline
