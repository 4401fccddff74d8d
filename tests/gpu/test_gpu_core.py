"""The GPU layer: bindings by name, uniforms, readback, errors and times."""

import numpy as np
import pytest

from ispm import wgsl
from ispm.errors import AdapterError, IspmError, SettingsError
from ispm.gpu import FLAT, Gpu, Target, list_adapters, open_gpu, readback

SHADER = """
struct Params {
    scale: f32,
    offset: u32,
}
override BIAS: f32 = 0.0;
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> source: array<f32>;
@group(0) @binding(2) var<storage, read_write> result: array<f32>;
@group(0) @binding(3) var unused_by_main: texture_2d<f32>;
@group(0) @binding(4) var image: texture_storage_2d<rgba32float, write>;

fn value(i: u32) -> f32 { return source[i] * params.scale + f32(params.offset) + BIAS; }

@compute @workgroup_size(8) fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x < arrayLength(&source)) { result[id.x] = value(id.x); }
}
@compute @workgroup_size(4, 4) fn paint(@builtin(global_invocation_id) id: vec3u) {
    textureStore(image, id.xy, vec4f(vec2f(id.xy), params.scale, 1.0));
}
@vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    let corner = vec2f(f32(i & 1u), f32(i >> 1u)) * 4.0 - 1.0;
    return vec4f(corner, 0.5, 1.0);
}
@fragment fn fs() -> @location(0) vec4f { return vec4f(params.scale, BIAS, 0.0, 1.0); }
"""
PARAMS = np.dtype([("scale", "<f4"), ("offset", "<u4")])


@pytest.fixture
def shader(monkeypatch: pytest.MonkeyPatch) -> str:
    """A shader file that exists for one test only."""

    def load(path: str) -> wgsl.Source:
        text = SHADER if path == "x.wgsl" else SHADER.replace("return source[i]", "return sauce[i]")
        return wgsl.Source(text, tuple((path, i + 1) for i in range(text.count("\n"))))

    monkeypatch.setattr(wgsl, "load", load)
    return "x.wgsl"


def params(scale: float, offset: int = 0) -> np.ndarray:
    return np.array((scale, offset), PARAMS)


def test_compute_uses_named_resources_and_constants(gpu: Gpu, shader: str) -> None:
    run = gpu.compute(shader, BIAS=0.5)
    source = gpu.buffer("source").write(np.arange(21, dtype=np.float32))
    results = [gpu.buffer(f"result {i}").sized(source.nbytes) for i in range(300)]
    with gpu.frame() as frame:  # more uniforms than fit into one chunk, each with its own value
        for i, result in enumerate(results):
            run(frame, over=21, params=params(2.0, i), source=source, result=result)
    for i in (0, 255, 299):
        assert (gpu.read_buffer(results[i], np.float32, 21) == np.arange(21) * 2.0 + i + 0.5).all()


def test_compute_rejects_missing_and_unknown_names(gpu: Gpu, shader: str) -> None:
    run = gpu.compute(shader)
    message = r"x\.wgsl main.*missing \['result', 'source'\], unknown \['sorce'\]"
    with pytest.raises(TypeError, match=message), gpu.frame() as frame:
        run(frame, over=1, params=params(1.0), sorce=gpu.buffer("b"))


def test_compute_rejects_a_record_of_the_wrong_size(gpu: Gpu, shader: str) -> None:
    run, b = gpu.compute(shader), gpu.buffer("b")
    with pytest.raises(TypeError, match="'params' takes 8 bytes of Params, not 4"), gpu.frame() as frame:
        run(frame, over=1, params=np.float32([1.0]), source=b, result=b)


def test_compute_rejects_unknown_entries_and_constants(gpu: Gpu, shader: str) -> None:
    with pytest.raises(TypeError, match="no entry point"):
        gpu.compute(shader, "mian")
    with pytest.raises(TypeError, match=r"no override \['BAIS'\]"):
        gpu.compute(shader, BAIS=1.0)


def test_shader_error_names_file_and_line(gpu: Gpu, shader: str) -> None:
    line = next(i for i, text in enumerate(SHADER.splitlines(), 1) if "fn value" in text)
    with pytest.raises(IspmError, match=rf"^broken\.wgsl:{line}:\d+: .*sauce") as caught:
        gpu.compute("broken.wgsl")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("size", [(1, 1), (5, 3), (64, 2), (257, 129)])
def test_read_texture_unpads_rows(gpu: Gpu, shader: str, size: tuple[int, int]) -> None:
    image = gpu.texture("image", "rgba32float", usage=["storage"]).sized(size)
    with gpu.frame() as frame:
        gpu.compute(shader, "paint")(frame, over=size, params=params(7.0), image=image)
    pixels = gpu.read_texture(image, np.float32, 4)
    y, x = np.mgrid[: size[1], : size[0]]
    assert pixels.shape == (size[1], size[0], 4)
    assert (pixels == np.stack([x, y, 0 * x + 7, 0 * x + 1], -1)).all()


def test_read_many_returns_each_in_order(gpu: Gpu) -> None:
    rng = np.random.default_rng(1)
    pixels = rng.integers(0, 256, (5, 7, 4), np.uint8)
    image = gpu.texture("image", "rgba8unorm").sized((7, 5)).write(pixels)
    numbers = rng.integers(0, 99, 11, np.uint8)
    buffer = gpu.buffer("odd").write(numbers)
    odd, whole = gpu.read_many([(buffer, np.uint8, 11), (image, np.uint8, 4)])
    assert (whole == pixels).all() and (odd == numbers).all()


def test_raster_draws_and_blends(gpu: Gpu, shader: str) -> None:
    raster = gpu.raster(shader, [Target("rgba16float", "add")], FLAT, BIAS=2.0)
    image = gpu.texture("image", "rgba16float").sized((9, 4))
    with gpu.frame() as frame, frame.draw_into(image) as canvas:
        canvas.use(raster, raster.bind(0, frame, params=params(0.5)))
        canvas.viewport(0, 0, 5, 4)
        canvas.draw(3)
        canvas.draw(3)
    pixels = gpu.read_texture(image, np.float16, 4)
    assert (pixels[:, :5] == [1.0, 4.0, 0.0, 2.0]).all() and (pixels[:, 5:] == 0.0).all()


def test_texture_is_remade_only_when_its_size_changes(gpu: Gpu) -> None:
    texture = gpu.texture("t", "rgba8unorm").sized((4, 4))
    handle, view = texture.handle, texture.view
    assert texture.sized((4, 4)).handle is handle and texture.view is view
    assert texture.sized((4, 5)).handle is not handle and texture.view is not view


def test_buffer_grows_and_keeps_what_is_written_last(gpu: Gpu) -> None:
    buffer = gpu.buffer("b")
    for count in (0, 3, 1000, 7):
        values = np.arange(count, dtype=np.uint32)
        assert (gpu.read_buffer(buffer.write(values), np.uint32, count) == values).all()


@pytest.mark.parametrize("timed", [False, True])
def test_frame_times_name_the_stages(gpu: Gpu, shader: str, timed: bool) -> None:
    image = gpu.texture("image", "rgba32float", usage=["storage"]).sized((256, 256))
    paint = gpu.compute(shader, "paint")
    with gpu.frame(timed=timed) as frame:
        for stage in ("first", "second", "first"):
            frame.stage(stage)
            paint(frame, over=image.size, params=params(1.0), image=image)
    times = frame.milliseconds()
    assert frame.timing in ("timestamps", "fenced", "off")
    if frame.timing != "off":
        assert times.keys() == {"first", "second"} and min(times.values()) > 0.0
        assert frame.milliseconds() == times


def test_frame_without_clock_is_fenced(gpu: Gpu, shader: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gpu, "_timer", None)
    test_frame_times_name_the_stages(gpu, shader, True)
    with gpu.frame() as frame:
        pass
    assert frame.timing == "off" and frame.milliseconds() == {}


def test_a_failed_frame_leaves_the_device_usable(gpu: Gpu, shader: str) -> None:
    with pytest.raises(ZeroDivisionError), gpu.frame():
        raise ZeroDivisionError
    test_read_texture_unpads_rows(gpu, shader, (3, 3))


def test_open_gpu_names_the_adapters_there_are() -> None:
    names = [adapter.name for adapter in list_adapters()]
    with pytest.raises(AdapterError, match="no graphics adapter is called 'nonesuch'") as caught:
        open_gpu("nonesuch")
    assert names[0] in str(caught.value)


def test_what_is_no_name_of_an_adapter_is_refused() -> None:
    with pytest.raises(SettingsError, match=r"^adapter: must be part of an adapter's name, or None, not 5$"):
        open_gpu(5)  # type: ignore[arg-type]


def test_open_gpu_without_adapters_says_the_cure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wgpu.gpu.enumerate_adapters_sync", list)
    with pytest.raises(AdapterError, match="mesa-vulkan-drivers"):
        open_gpu()


def test_open_gpu_heeds_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ISPM_ADAPTER", "nonesuch")
    with pytest.raises(AdapterError, match="nonesuch"):
        open_gpu()


def test_pieces_of_read_memory_are_used_again_up_to_a_limit(monkeypatch):
    monkeypatch.setattr(readback._Room, "_MOST", 5 << 20)
    room = readback._Room()
    places = [[each.ctypes.data for each in [room.take(2 << 20) for _ in range(3)]] for _ in range(2)]
    assert places[1][:2] == places[0][:2]
    assert sum(piece.nbytes for piece in room._pieces) == 4 << 20
