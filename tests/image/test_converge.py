"""Progressive passes: their mean, its error, its end, and going on with it."""

import dataclasses
import math

import numpy as np
import pytest

from ispm import Camera, Material, RectLight, Scene, Sky, shapes
from ispm.errors import OutputError, SceneError
from ispm.io.named import builtin
from ispm.optics.vector import LUMINANCE
from ispm.renderer import Renderer
from ispm.renderer.converge import place_in_pixel, shrunk
from ispm.renderer.progress import _half
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


@pytest.mark.parametrize("light", ["sky", "panel"])
def test_the_error_tells_of_drawn_direct_light_too(gpu, light):
    """16 passes, whose direct light is most of their noise, against 64 others as above."""
    scene = builtin("cornell-box")
    if light == "sky":
        scene.environment = Sky(sun_elevation=0.5)
    else:
        lamp = RectLight((30.0, 30.0, 30.0), width=1.0, height=1.0)
        scene.add(lamp, translation=(2.8, 4.5, 2.8)).look_at((2.8, 0.0, 2.8))
    with renderer(gpu, scene) as one:
        *_, mean = one.converge(16)
    with renderer(gpu, scene, seed=9) as other:
        *_, truth = other.converge(64)
    light, true = (each.radiance @ np.array(LUMINANCE) for each in (mean, truth))
    left = ((light - true) ** 2 / (true**2 + 1e-3 * true.mean() ** 2)).mean()
    assert 0.5 < mean.stats.error / math.sqrt(left / 1.25) < 1.5


def test_passes_without_noise_are_as_many_as_were_asked_for(gpu):
    wall = Scene()
    wall.add(shapes.plane(9.0, 9.0), material=Material((0.0,) * 3, specular=0.0, emission=(1.0, 2.0, 3.0)))
    camera = Camera.look_at((0.0, 1.0, 0.0), (0.0, 0.0, 0.1))
    with Renderer(wall, Settings(size=(16, 9), bounces=0), camera, gpu=gpu) as even:
        errors = [frame.stats.error for frame in even.converge(6)]
    assert errors[1:] == [0.0] * 5


def test_halves_of_passes_are_even():
    """What grows by the same amounts, or by the squares of the passes' numbers, has equal halves of 8."""
    halves = [[k for k in range(8) if _half(k) == half] for half in (0, 1)]
    for power in (0, 1, 2):
        one, other = (sum(k**power for k in half) for half in halves)
        assert one == other
    assert all({_half(k), _half(k + 1)} == {0, 1} for k in range(0, 64, 2))


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
