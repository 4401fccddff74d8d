"""Progressive passes: their mean, its error, its end, and going on with it."""

import contextlib
import dataclasses
import io
import json
import math
import tracemalloc
import zipfile

import numpy as np
import pytest

from ispm.errors import IspmError, OutputError, SceneError, SettingsError
from ispm.io.named import builtin
from ispm.renderer import Renderer
from ispm.renderer.converge import place_in_pixel, shrunk
from ispm.renderer.progress import Progress
from ispm.settings import Settings

SETTINGS = Settings(size=(160, 90), photons=4000)


@pytest.fixture(scope="module")
def scene():
    return builtin("cornell-box")


def renderer(gpu, scene, **changes):
    return Renderer(scene, SETTINGS.replace(**changes), gpu=gpu)


def test_kernels_shrink_as_knaus_and_zwicker_say():
    areas = np.array([shrunk(k) for k in range(200)]) ** 2
    assert areas[0] == 1.0
    k = np.arange(1, 200)
    np.testing.assert_allclose(areas[1:] / areas[:-1], (k + 2 / 3) / (k + 1), rtol=1e-12)


def test_samples_cover_the_pixel_evenly():
    places = np.array([place_in_pixel(k) for k in range(256)])
    assert (places[0] == 0.0).all() and (np.abs(places) <= 0.5).all()
    # each of 8 x 8 parts holds 4 of 256, by a lattice of discrepancy of order log(n) / n: none is empty
    counts = np.histogram2d(*places.T, bins=8, range=[[-0.5, 0.5]] * 2)[0]
    assert counts.min() >= 2 and counts.max() <= 6


def test_samples_and_the_narrowest_kernels_blur_as_a_pixel_does():
    k = np.arange(1, 4097)
    places = np.array([place_in_pixel(int(i)) for i in k])
    # variances: of a square of side 1, and of the biweight of radius sqrt(2 / 3) that shrinks with the passes
    wanted = (1.0 - 1.0 / (k + 1)) / 12.0
    found = np.square(places).cumsum(axis=0)
    np.testing.assert_allclose(found[-1], wanted.sum(), rtol=0.01)


def test_samples_of_few_passes_lie_round_the_centre():
    # opposite ones cancel but for their spread, which grows from 0.7 to 1: what is left is half a pixel at
    # most, and 0.3 of it
    places = np.array([place_in_pixel(k) for k in range(64)])
    assert np.abs(places.cumsum(axis=0)).max() < 0.5 * 1.3


def test_the_mean_of_passes_nears_the_truth(gpu, scene):
    """Noise falls with the passes: of 16, what is left is under half of one pass's, and errors are told."""
    with renderer(gpu, scene, size=(64, 36)) as one:
        frames = [(frame.stats.passes, frame.radiance, frame.stats.error) for frame in one.converge(16)]
    with renderer(gpu, scene, size=(64, 36), seed=9) as other:
        *_, truth = other.converge(64)
    passes, pictures, errors = zip(*frames, strict=True)
    assert passes == tuple(range(1, 17)) and math.isnan(errors[0])
    floor = 1e-3 * truth.radiance.mean() ** 2
    left = [((p - truth.radiance) ** 2 / (truth.radiance**2 + floor)).mean() for p in pictures]
    assert left[15] < 0.25 * left[0]
    # 16 passes against 64 others: their noise adds, 1 + 1/4; kernels' bias and the estimate itself: a half
    assert 0.5 < errors[15] / math.sqrt(left[15] / 1.25) < 1.5


def test_passes_without_noise_are_as_many_as_were_asked_for(gpu, scene):
    with renderer(gpu, scene, size=(16, 9), bounces=0) as direct:
        errors = [frame.stats.error for frame in direct.converge(6)]
    assert errors[1:] == [0.0] * 5


def test_passes_repeat_and_continue_to_the_bit(gpu, scene, tmp_path):
    kept = tmp_path / "passes.npz"
    with renderer(gpu, scene) as whole:
        *_, expected = whole.converge(5)
    with renderer(gpu, scene) as first:
        for _ in first.converge(2):
            pass
        assert first.save_progress(kept) == kept
    with renderer(gpu, scene, passes=5, exposure=1.0) as second:
        *_, got = second.converge(resume=kept)
    assert got.stats.passes == 5
    for layer in expected.layers:
        np.testing.assert_array_equal(got[layer], expected[layer], err_msg=layer)
    with renderer(gpu, scene) as third:  # at its end already
        (frame,) = third.converge(2, resume=kept)
        assert frame.stats.passes == 2 and frame.stats.stored_photons > 0
        *_, fifth = third.converge(5, resume=kept)
        third.save_progress(kept)
        (frame,) = third.converge(9, target_error=1.01 * fifth.stats.error, resume=kept)
        assert frame.stats.passes == 5


def test_passes_of_something_else_are_not_continued(gpu, scene, tmp_path):
    kept = tmp_path / "passes.npz"
    with renderer(gpu, scene) as first:
        with pytest.raises(IspmError, match="no passes"):
            first.save_progress(kept)
        next(first.converge(2))
        first.save_progress(kept)
    for passes in (1, 2):  # at its end already, or not
        with (
            renderer(gpu, scene, seed=1) as other,
            pytest.raises(SettingsError, match=r"passes.npz: holds 1 passes of another scene"),
        ):
            next(other.converge(passes, resume=kept))
    moved = builtin("cornell-box")
    moved.lights[0].translation = (0.1, 0.1, 0.1)
    with renderer(gpu, moved) as other, pytest.raises(SettingsError, match="another scene"):
        next(other.converge(2, resume=kept))
    (tmp_path / "broken.npz").write_bytes(kept.read_bytes()[:1000])
    with renderer(gpu, scene) as other, pytest.raises(OutputError, match="broken"):
        next(other.converge(2, resume=tmp_path / "broken.npz"))


def squeeze(mesh):
    mesh.positions *= np.float32(0.9)
    mesh.touch()


@pytest.mark.parametrize(
    "change",
    [
        lambda r: setattr(r.scene["room"].parts[0].material, "base_color", (0.1, 0.2, 0.3)),
        lambda r: squeeze(r.scene["room"].parts[0].mesh),
        lambda r: setattr(r.scene.lights[0], "translation", (0.1, 0.1, 0.1)),
        lambda r: setattr(r.scene.cameras[0].camera, "yfov", 0.5),
        lambda r: setattr(r, "settings", r.settings.replace(size=(80, 45))),
        lambda r: setattr(r, "settings", r.settings.replace(photons=3000)),
    ],
)
def test_a_scene_that_changes_between_passes_ends_them(gpu, change, tmp_path):
    with renderer(gpu, builtin("cornell-box"), size=(32, 18)) as other:
        passes = other.converge(9)
        first = next(passes)
        change(other)
        with pytest.raises(SceneError, match="changed after pass 1"):
            next(passes)
        assert other.progress.passes == 1
        np.testing.assert_array_equal(other.progress.sums["direct"], first.direct)
        assert other.save_progress(tmp_path / "kept.npz").exists()
        assert next(other.converge(9)).stats.passes == 1


def test_tones_may_change_between_passes(gpu, scene):
    with renderer(gpu, scene, size=(32, 18)) as other:
        passes = other.converge(2)
        next(passes)
        other.settings = other.settings.replace(exposure=2.0, tonemap="agx")
        assert next(passes).stats.passes == 2


def test_passes_are_kept_in_an_npz(gpu, scene, tmp_path):
    with renderer(gpu, scene, size=(32, 18)) as other:
        next(other.converge(1))
        with pytest.raises(OutputError, match="passes are kept in an"):
            other.save_progress(tmp_path / "a.png")


@pytest.mark.parametrize(
    ("name", "spoil"),
    [
        ("sum.direct", lambda a: a * np.nan),
        ("moments", lambda a: a[:1]),
        ("moments", lambda a: a * np.inf),
        ("sum.direct", lambda a: a[:-1]),
        ("passes", lambda n: 0),
        ("passes", lambda n: 2.5),
    ],
)
def test_a_file_of_spoiled_passes_is_refused(gpu, scene, tmp_path, name, spoil):
    with renderer(gpu, scene) as other:
        next(other.converge(2))
        kept = other.save_progress(tmp_path / "kept.npz")
    progress = Progress.load(kept)
    if name == "passes":
        progress.passes = spoil(progress.passes)
    elif name == "moments":
        progress.moments = spoil(progress.moments)
    else:
        progress.sums["direct"] = spoil(progress.sums["direct"])
    progress.save(kept)
    with pytest.raises(OutputError, match="does not hold passes"):
        Progress.load(kept)


def npy(array):
    out = io.BytesIO()
    np.save(out, array, allow_pickle=True)
    return out.getvalue()


def zipped(parts, method=zipfile.ZIP_STORED):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", method) as archive:
        for name, data in parts.items():
            archive.writestr(name, data)
    return out.getvalue()


def about_with(**changes):
    """The JSON of kept passes with parts of it changed; None: left out."""

    def spoil(parts):
        array = np.load(io.BytesIO(parts["__about__.npy"]))
        about = json.loads(json.loads(str(array))["ispm:progress"])
        for name, value in changes.items():
            about[name] = {**about["stats"], **value} if name == "stats" and value else value
        about = {name: value for name, value in about.items() if value is not None}
        parts["__about__.npy"] = npy(np.array(json.dumps({"ispm:progress": json.dumps(about)})))

    return spoil


def array_with(name, change):
    def spoil(parts):
        parts[f"{name}.npy"] = npy(change(np.load(io.BytesIO(parts[f"{name}.npy"]))))

    return spoil


def header_of_a_terabyte(parts):
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        head, {"shape": (1 << 20, 1 << 20, 3), "fortran_order": False, "descr": "<f4"}
    )
    parts["sum.direct.npy"] = head.getvalue() + b"0" * 100


SPOILED = {
    **{f"without {name}": (lambda parts, n=name: parts.pop(f"{n}.npy")) for name in (
        "__about__", "indirect_moments", "sum.direct", "first.depth", "camera.pose",
    )},
    **{f"about {k} {v}": about_with(**{k: v}) for k, v in (
        ("passes", None), ("passes", -1), ("passes", True), ("passes", "2"), ("passes", 10**30),
        ("passes", 1.5), ("scene", 3), ("made_of", None), ("made_of", 1), ("stats", None),
        ("stats", {"nothing": 1}), ("stats", {"width": "wide"}), ("stats", {"total_ms": []}),
    )},
    **{f"{name} {i}": array_with(name, change) for name in (
        "sum.direct", "indirect_moments", "first.normal", "first.instance", "camera.pose"
    ) for i, change in enumerate((
        lambda a: a[..., :-1], lambda a: a[None], lambda a: a.astype(np.float16), lambda a: a.astype(object),
        lambda a: a.astype("U3"), lambda a: np.float32(0.0), lambda a: a.astype(np.complex128),
    ))},
    "negative": array_with("indirect_moments", lambda a: a - 1e9),
    "nan depth": array_with("first.depth", lambda a: a * np.float32(np.nan)),
    "infinite": array_with("sum.direct", lambda a: np.full_like(a, np.inf)),
    "terabyte": header_of_a_terabyte,
    "no array": lambda parts: parts.update({"sum.direct.npy": b"\x93NUMPY"}),
    "json": lambda parts: parts.update({"__about__.npy": npy(np.array("[" * 100_000))}),
    "empty": lambda parts: parts.clear(),
}  # fmt: skip


@pytest.fixture(scope="module")
def kept(gpu, scene, tmp_path_factory):
    """The parts of a file of passes."""
    path = tmp_path_factory.mktemp("kept") / "kept.npz"
    with renderer(gpu, scene, size=(16, 9)) as other:
        next(other.converge(2))
        other.save_progress(path)
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.mark.parametrize("how", SPOILED)
def test_every_spoiled_file_of_passes_is_refused_alike(kept, tmp_path, how):
    path, parts = tmp_path / "spoiled.npz", dict(kept)
    SPOILED[how](parts)
    path.write_bytes(zipped(parts))
    with pytest.raises(OutputError, match=r"spoiled.npz: does not hold passes to continue"):
        Progress.load(path)


@pytest.mark.parametrize("seed", range(40))
def test_damaged_files_of_passes_are_refused_or_whole(kept, tmp_path, seed):
    """Bits that are turned and bytes that are lost, anywhere."""
    rng, path, data = np.random.default_rng(seed), tmp_path / "damaged.npz", bytearray(zipped(kept))
    path.write_bytes(data)
    Progress.load(path)
    for _ in range(rng.integers(1, 4)):
        data[rng.integers(len(data))] ^= 1 << rng.integers(8)
    path.write_bytes(data[: rng.integers(len(data))] if seed % 4 == 0 else data)
    with contextlib.suppress(OutputError):
        Progress.load(path)


def test_bombs_are_not_expanded(kept, tmp_path):
    path = tmp_path / "bomb.npz"
    bomb = dict(kept) | {"sum.direct.npy": npy(np.zeros((4000, 4000, 3), np.float32))}
    path.write_bytes(zipped(bomb, zipfile.ZIP_DEFLATED))
    tracemalloc.start()
    with pytest.raises(OutputError, match="does not hold passes"):
        Progress.load(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert path.stat().st_size < 1e6 and peak < 4e6


def test_passes_of_another_size_are_not_continued_whatever_they_say(gpu, scene, kept, tmp_path):
    path = tmp_path / "kept.npz"
    path.write_bytes(zipped(kept))
    with renderer(gpu, scene, size=(32, 18)) as other:
        progress = Progress.load(path)
        progress.made_of = other.fingerprint()
        progress.save(path)
        with pytest.raises(SettingsError, match="holds 1 passes of another scene"):
            next(other.converge(2, resume=path))


def test_limits_end_the_passes(gpu, scene):
    with renderer(gpu, scene, target_error=0.5) as coarse:
        frame = coarse.render()
        assert frame.stats.error <= 0.5 and 2 <= frame.stats.passes < 64
    with renderer(gpu, scene, target_error=1e3) as coarsest:  # the first pass that can be judged
        assert coarsest.render().stats.passes == 2
    with renderer(gpu, scene, time_limit=1e-6) as hasty:
        assert hasty.render().stats.passes == 1


def test_frames_of_passes_add_up_and_keep_their_settings(gpu, scene):
    with renderer(gpu, scene, passes=3) as some:
        frame = some.render()
    assert frame.settings == SETTINGS.replace(passes=3)
    np.testing.assert_array_equal(frame.radiance, (frame.direct + frame.indirect) + frame.emission)
    with renderer(gpu, scene) as one:
        single = one.render()
    for layer in ("depth", "normal", "instance", "material"):
        np.testing.assert_array_equal(frame[layer], single[layer])
    assert dataclasses.asdict(frame.stats)["passes"] == 3
