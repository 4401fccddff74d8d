"""Whole films at tiny sizes: what is in them, and that a killed one goes on with the same bytes."""

import hashlib
import os
import random
import shutil
import subprocess
import sys
import time
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import ispm
import ispm.io.atomic
from ispm.errors import IspmError, OutputError, SettingsError
from ispm.film import animate as films
from ispm.film.yuv import to_yuv
from ispm.io.image import read_array

SIZE, COUNT = (64, 36), 6
FILM = ispm.Film(fps=COUNT)
SETTINGS = ispm.Settings(size=SIZE, photons=1000, gather=4, exposure="hold", seed=3)
FLAGS = "--size 64x36 --photons 1000 --gather 4 --seed 3 --fps 6"


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A file in which a lamp and a block move for a second."""
    made = ispm.builtin("cornell-box")
    lamp, block = made.lights[0], made["short block"]
    start, end = np.array(lamp.translation), np.array(lamp.translation) - (1.0, 1.0, 0.0)
    channels = [ispm.Channel(lamp, "translation", [0.0, 1.0], [start, end])]
    place = np.array(block.translation)
    channels.append(ispm.Channel(block, "translation", [0.0, 1.0], [place, place - (0.0, 0.0, 0.5)]))
    made.animations.append(ispm.Animation(channels, "play"))
    return ispm.save(made, tmp_path_factory.mktemp("scene") / "moving.glb")


@pytest.fixture(scope="module")
def pictures(scene, tmp_path_factory):
    """The bytes of all frames, rendered undisturbed, by their names."""
    folder = tmp_path_factory.mktemp("whole")
    sheet, shots = folder / "sheet" / "all.png", []
    given = folder / "%04d.png"
    out = ispm.animate(scene, given, SETTINGS, film=FILM, contact_sheet=sheet, on_frame=shots.append)
    assert out == given
    assert [(s.frame, s.done, s.count, s.left, s.found) for s in shots] == [
        (k, k + 1, COUNT, COUNT - 1 - k, False) for k in range(COUNT)
    ]
    return bytes_in(folder) | {"sheet": sheet.read_bytes()}


def bytes_in(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.is_file()}


def pixels_of(folder_bytes, tmp_path):
    found = []
    for k in range(COUNT):
        path = tmp_path / "one.png"
        path.write_bytes(folder_bytes[f"{k:04d}.png"])
        found.append(np.asarray(Image.open(path)))
    return np.stack(found)


def test_frames_are_pictures_at_their_times_with_the_exposure_of_the_first(scene, pictures, tmp_path):
    assert sorted(pictures) == [*(f"{k:04d}.png" for k in range(COUNT)), "sheet"]
    shown = pixels_of(pictures, tmp_path)
    first = ispm.render(scene, SETTINGS, time=0.0)
    np.testing.assert_array_equal(shown[0], first.image)
    third = ispm.render(scene, SETTINGS.replace(exposure=first.exposure), time=3 / COUNT)
    np.testing.assert_array_equal(shown[3], third.image)
    assert (np.abs(np.diff(shown.astype(int), axis=0)).mean(axis=(1, 2, 3)) > 0.5).all()


def test_the_contact_sheet_shows_frames_small_with_their_numbers(pictures, tmp_path):
    (tmp_path / "sheet.png").write_bytes(pictures["sheet"])
    sheet = np.asarray(Image.open(tmp_path / "sheet.png"))
    assert sheet.shape == (2 * (36 + 14), 3 * 64, 3)
    shown = pixels_of(pictures, tmp_path)
    for k in range(COUNT):
        y, x = k // 3 * 50, k % 3 * 64
        np.testing.assert_array_equal(sheet[y : y + 36, x : x + 64], shown[k])
        assert (sheet[y + 36 : y + 50, x : x + 64] > 200).any()


def test_a_part_is_made_again_and_the_rest_is_left(scene, pictures, tmp_path):
    (tmp_path / "0000.png").write_text("mine")
    ispm.animate(scene, tmp_path / "####.png", SETTINGS, film=FILM, frames="2:4")
    assert bytes_in(tmp_path) == {
        "0000.png": b"mine",
        **{name: pictures[name] for name in ("0002.png", "0003.png")},
    }


def killed_and_resumed(scene, folder, output, note):
    """Run the command, kill it by SIGKILL at random once `note` is there, and run it again.

    Now and then a process is killed while it writes: what it leaves then lies there in any case.
    """
    command = [sys.executable, "-m", "ispm", "animate", str(scene), "-o", output, *FLAGS.split()]
    wait = random.uniform(0.0, 1.0)
    before = set(folder.iterdir())
    while True:
        with subprocess.Popen(
            command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as run:
            end = time.monotonic() + 200.0
            while not (folder / note).exists() and run.poll() is None and time.monotonic() < end:
                time.sleep(0.005)
            time.sleep(wait)
            run.kill()
        if (folder / note).exists():
            break
        wait /= 2.0  # the film was done already: once more
        for path in set(folder.iterdir()) - before:
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    for written in (folder / note, folder / output.replace("%04d", "0003")):
        written.with_name(f".ispm-0123abcd-{written.name}").write_bytes(b"half")
    again = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=280)
    assert again.returncode == 0, again.stderr
    return f"killed {wait:.3f} s after the first frame", again


def test_killed_numbered_pictures_go_on_with_the_same_bytes(scene, pictures, tmp_path):
    told, again = killed_and_resumed(scene, tmp_path, "%04d.png", "%04d.png.frames/000000.small.png")
    assert bytes_in(tmp_path) == {name: pictures[name] for name in pictures if name != "sheet"}, told
    assert not (tmp_path / "%04d.png.frames").exists()
    assert set(again.stdout.split()) <= {f"{k:04d}.png" for k in range(1, COUNT)}, told  # 0 was there


def test_a_killed_video_goes_on_with_the_same_bytes_and_shows_the_pictures(scene, pictures, tmp_path):
    av = pytest.importorskip("av", reason="PyAV is not installed")
    from ispm.film.video import write_video

    told, again = killed_and_resumed(scene, tmp_path, "film.mp4", "film.mp4.frames/000000.small.png")
    assert again.stdout == "film.mp4\n"
    shown = pixels_of(pictures, tmp_path)
    write_video(tmp_path / "whole.mp4", shown, FILM, "h264")
    made = (tmp_path / "film.mp4").read_bytes()
    if made != (tmp_path / "whole.mp4").read_bytes():
        pytest.fail(f"{told}; by frame, the shown codes differ by {apart(tmp_path)}")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["film.mp4", "one.png", "whole.mp4"]
    assert made.index(b"moov") < made.index(b"mdat")  # players need not wait for the end
    with av.open(str(tmp_path / "film.mp4")) as file:
        stream = file.streams.video[0]
        assert (stream.codec_context.name, stream.average_rate) == ("h264", COUNT)
        require_bt709(stream.codec_context)
        decoded = list(file.decode(video=0))
    assert [frame.pts * frame.time_base for frame in decoded] == [Fraction(k, COUNT) for k in range(COUNT)]
    require_like(decoded, shown, "yuv420p")


def apart(folder):
    """The greatest difference of each frame of the film and of the whole one."""
    import av

    films = [av.open(str(folder / name)) for name in ("film.mp4", "whole.mp4")]
    frames = [[frame.to_ndarray().astype(int) for frame in film.decode(video=0)] for film in films]
    return [int(np.abs(a - b).max()) for a, b in zip(*frames, strict=True)]


def require_bt709(owner):
    """Of ITU-T H.273 the numbers of BT.709, and FFmpeg's of the limited range."""
    tags = (owner.color_primaries, owner.color_trc, owner.colorspace, owner.color_range)
    assert [int(tag) for tag in tags] == [1, 1, 1, 1]


def require_like(decoded, shown, kind):
    """What a video shows is its pictures in BT.709 (test_yuv.py), but for what encoders drop.

    The quantizer of H.264 has steps of 2^((q - 4) / 6) codes, half of which may go wrong; q is 16 in key
    frames and 5 more between two others: 3.6 codes. Others are set to lose about as little. In the mean less
    than a code is lost.
    """
    assert len(decoded) == len(shown) and {frame.format.name for frame in decoded} == {kind}
    deep = "10le" in kind
    for frame, pixels in zip(decoded, shown, strict=True):
        require_bt709(frame)
        for plane, wanted in zip(frame.planes, to_yuv(pixels, 8, not deep), strict=True):
            error = codes(plane, deep) - wanted
            assert np.sqrt((error**2).mean()) < 3.6
            assert abs(error.mean()) < 1.0


def codes(plane, deep):
    """(h, w) samples of a plane, in codes of 8 bits."""
    rows = np.frombuffer(plane, np.uint8).reshape(plane.height, plane.line_size)
    samples = rows[:, : 2 * plane.width].view("<u2") / 4.0 if deep else rows[:, : plane.width]
    return samples.astype(float)


@pytest.mark.parametrize(
    ("name", "codec", "kind"),
    [
        ("a.mp4", "av1", "yuv420p"),
        ("a.mkv", "auto", "yuv420p"),
        ("a.webm", "auto", "yuv420p"),
        ("a.mov", "auto", "yuv422p10le"),
    ],
)
def test_every_codec_shows_the_pictures_and_gives_the_same_bytes_twice(pictures, tmp_path, name, codec, kind):
    av = pytest.importorskip("av", reason="PyAV is not installed")
    from ispm.film.video import bits_of, codec_of, write_video

    shown = pixels_of(pictures, tmp_path)
    film = ispm.Film(fps=23.976, codec=codec)
    codec = codec_of(Path(name), film)
    given = shown if bits_of(codec) == 8 else shown.astype(np.uint16) * 257
    digests = set()
    for _ in range(2):
        write_video(tmp_path / name, given, film, codec)
        digests.add(hashlib.sha256((tmp_path / name).read_bytes()).hexdigest())
    assert len(digests) == 1
    with av.open(str(tmp_path / name)) as file:
        rate = file.streams.video[0].average_rate
        assert abs(float(rate) - 24000 / 1001) < 0.01
        require_like(list(file.decode(video=0)), shown, kind)


def test_prores_gets_pictures_of_16_bits(scene, tmp_path):
    av = pytest.importorskip("av", reason="PyAV is not installed")
    sizes = []
    ispm.animate(
        scene,
        tmp_path / "a.mov",
        SETTINGS,
        film=FILM,
        frames="1:2",
        on_frame=lambda shot: sizes.append(shot.path.read_bytes()[24]),
    )
    assert sizes == [16]
    with av.open(str(tmp_path / "a.mov")) as file:
        (frame,) = file.decode(video=0)
    assert len(np.unique(np.asarray(frame.planes[0]).view("<u2"))) > 220  # more than 8 bits' limited range


class StopError(Exception):
    pass


def stop_at(count):
    def tell(shot):
        if shot.done == count:
            raise StopError

    return tell


def test_with_history_it_goes_on_with_the_same_bytes_whatever_part_is_asked_for(scene, tmp_path, monkeypatch):
    monkeypatch.setattr(films, "BLOCK", 3)
    monkeypatch.setattr(films, "WARM_UP", 2)
    settings = SETTINGS.replace(live=True)

    def film(folder, **given):
        ispm.animate(scene, tmp_path / folder / "#.png", settings, film=FILM, **given)

    film("whole")
    whole = bytes_in(tmp_path / "whole")
    assert len(whole) == COUNT
    with pytest.raises(StopError):
        film("killed", on_frame=stop_at(5))
    film("killed")
    assert bytes_in(tmp_path / "killed") == whole
    film("part", frames="4:5")
    assert bytes_in(tmp_path / "part") == {"4.png": whole["4.png"]}


def test_other_settings_or_another_scene_do_not_mix(scene, tmp_path):
    fixed = SETTINGS.replace(exposure=1.0)

    def film(**given):
        ispm.animate(
            given.pop("scene", scene),
            tmp_path / "#.png",
            **{"settings": fixed, "film": FILM, **given},
        )

    with pytest.raises(StopError):
        film(on_frame=stop_at(1))
    before = bytes_in(tmp_path)
    with pytest.raises(
        SettingsError, match=r"holds 1 frame of another film, with fps 6 \(here 12\); give the"
    ):
        film(film=ispm.Film(fps=12))
    with pytest.raises(SettingsError, match=r"photons 1000 \(here 2000\), seed 3 \(here 4\)"):
        film(settings=fixed.replace(photons=2000, seed=4))
    other = ispm.load(scene)
    other["short block"].parts[0].material.base_color = (1.0, 0.0, 0.0)
    with pytest.raises(SettingsError, match="other materials in frame 0"):
        film(scene=other, settings=fixed)
    assert bytes_in(tmp_path) == before
    films_frames = []
    film(frames="0:1", on_frame=films_frames.append)  # a part of what is there: nothing is rendered
    assert [shot.found for shot in films_frames] == [True]


def test_a_full_disk_loses_nothing(scene, pictures, tmp_path, monkeypatch):
    flush = ispm.io.atomic._flush

    def full(path):
        if path.name.endswith("0003.png"):
            raise OSError(28, os.strerror(28))
        flush(path)

    monkeypatch.setattr(ispm.io.atomic, "_flush", full)
    with pytest.raises(OutputError, match=r"0003\.png: cannot be written: No space left on device"):
        ispm.animate(scene, tmp_path / "%04d.png", SETTINGS, film=FILM)
    assert sorted(bytes_in(tmp_path)) == ["0000.png", "0001.png", "0002.png"]
    monkeypatch.undo()
    (tmp_path / "0001.png").write_bytes(b"spoiled")
    shots = []
    ispm.animate(scene, tmp_path / "%04d.png", SETTINGS, film=FILM, on_frame=shots.append, frames=":4")
    assert [shot.found for shot in shots] == [True, False, True, False]
    assert bytes_in(tmp_path) == {f"{k:04d}.png": pictures[f"{k:04d}.png"] for k in range(4)}


def ball_scene():
    """A glowing ball that goes 2 m to the right in a second, seen by a camera without perspective."""
    scene = ispm.Scene()
    glow = ispm.Material((0.0, 0.0, 0.0), emission=(10.0, 10.0, 10.0), roughness=1.0)
    ball = scene.add(ispm.shapes.sphere(0.3), material=glow, name="ball", translation=(-1.0, 0.0, 0.0))
    scene.add(ispm.Camera(ymag=0.75), translation=(0.0, 0.0, 3.0))
    scene.animations.append(
        ispm.Animation([ispm.Channel(ball, "translation", [0.0, 1.0], [(-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)])])
    )
    return scene


def test_motion_blur_is_the_mean_of_many_instants(tmp_path):
    """By column: the mean of the passes is as far from that of instants at random as chance has it.

    The variance of a pass at a place drawn evenly is that of an instant's; passes spread over the shutter
    have less. 4 standard errors of 12 sums: chance exceeds them for one seed in 1,300.
    """
    passes, instants, shutter = 24, 48, 0.5
    scene = ball_scene()
    settings = ispm.Settings(size=(48, 12), photons=0, exposure=0.0)
    film = ispm.Film(fps=1, duration=1.0, shutter=shutter)
    ispm.animate(scene, tmp_path / "#.npy", settings.replace(passes=passes), film=film)
    blurred = bands(read_array(tmp_path / "0.npy"))
    found = []
    random_times = np.random.default_rng(5).uniform(0.0, shutter, instants)
    with ispm.Renderer(scene, settings) as renderer:
        for k, t in enumerate(random_times):
            renderer.scene = scene.at(float(t))
            found.append(bands(renderer.render_pass(1 + k).radiance))
    mean, variance = np.mean(found, axis=0), np.var(found, axis=0, ddof=1)
    error = np.sqrt(variance * (1.0 / instants + 1.0 / passes)) + 1e-3 * mean.max()
    assert (np.abs(blurred - mean) < 4.0 * error).all()
    assert (np.abs(found[0] - mean) > 4.0 * error).any()  # one instant is not
    # the passes themselves lie evenly: the blur's middle is the shutter's, to a pass's share of it
    middle = (blurred * (np.arange(len(blurred)) + 0.5)).sum() / blurred.sum() / len(blurred) * 6.0 - 3.0
    assert abs(middle - (-1.0 + 2.0 * shutter / 2.0)) < 2.0 * shutter / passes + 0.02


def bands(radiance):
    """Twelve sums over columns of a picture."""
    return radiance[..., 0].astype(float).reshape(12, 12, 4).sum(axis=(0, 2))


def test_one_pass_has_no_motion_blur_and_it_is_said(tmp_path):
    film = ispm.Film(fps=1, duration=1.0, shutter=0.5)
    settings = ispm.Settings(size=(48, 12), photons=0, exposure=0.0)
    with pytest.warns(ispm.SceneWarning, match="one pass has no motion blur"):
        ispm.animate(ball_scene(), tmp_path / "#.npy", settings, film=film)
    sharp = ispm.render(ball_scene().at(0.0), settings).radiance
    np.testing.assert_array_equal(read_array(tmp_path / "0.npy"), sharp)


def test_a_turn_ends_with_the_picture_that_it_began_with(tmp_path):
    table, film, scene = (
        ispm.Turntable(360, 3, center=(-1, 0, 0)),
        ispm.Film(fps=1, duration=4.0),
        ball_scene(),
    )
    scene.animations.clear()
    ispm.animate(scene, tmp_path / "#.png", film=film, camera=table, size=(32, 18), photons=0)
    found = bytes_in(tmp_path)
    assert found["0.png"] == found["3.png"] != found["1.png"]


def test_a_function_of_the_time_may_change_anything(tmp_path):
    seen = []

    def change(renderer, seconds):
        seen.append(seconds)
        renderer.scene["ball"].translation = (0.0, 0.0, 0.0)
        renderer.scene["ball"].scale = (1.0 + seconds,) * 3
        renderer.settings = renderer.settings.replace(tonemap="none" if seconds else "agx")

    scene = ball_scene()
    scene.animations.clear()
    film = ispm.Film(fps=2, duration=1.0)
    ispm.animate(scene, tmp_path / "#.npy", film=film, change=change, size=(48, 12), photons=0, exposure=0.0)
    small, large = (np.count_nonzero(read_array(tmp_path / f"{k}.npy")) for k in range(2))
    assert large > 1.5 * small and set(seen) == {0.0, 0.5}
    assert tuple(scene["ball"].scale) == (1.0, 1.0, 1.0)


def test_what_cannot_become_a_film_is_told_before_anything_is_rendered(scene, tmp_path, monkeypatch):
    monkeypatch.setattr(ispm.Renderer, "_draw", None)
    (tmp_path / "file").write_text("")
    still = ispm.builtin("cornell-box")
    for given, says in (
        (dict(scene=still), "nothing moves"),
        (dict(time=5.0), "all that moves ends at 1 s"),
        (dict(animation="plaz"), "no animation is called 'plaz'"),
        (dict(frames="9:"), "none of the film's 6"),
        (dict(output="file/#.png"), "cannot be written"),
        (dict(live=True, passes=4), "have one each"),
        (dict(live=True, film=ispm.Film(shutter=0.5)), "no motion blur"),
        (dict(saved={"show": "bounce-map"}), "a size of its own"),
        (dict(contact_sheet=tmp_path / "a.jpg"), "a contact sheet is a .png"),
    ):
        words = {"scene": scene, "output": "#.png", "settings": SETTINGS, "film": FILM, **given}
        words["output"] = tmp_path / words["output"]
        with pytest.raises(IspmError, match=says):
            ispm.animate(words.pop("scene"), words.pop("output"), **words)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file"]


def test_what_a_video_cannot_hold_is_told_before_anything_is_rendered(tmp_path, monkeypatch):
    pytest.importorskip("av", reason="PyAV is not installed")
    monkeypatch.setattr(ispm.Renderer, "_draw", None)
    for output, film, changes, says in (
        ("a.mp4", {}, {"size": (33, 18)}, "use 34x18"),
        ("a.mov", {}, {"size": (32, 19), "background": "transparent"}, "no transparency"),
        ("a.webm", {"codec": "h264"}, {}, "does not hold h264; name it .mp4 or .mkv"),
        ("a.mp4", {}, {"size": (16384, 16384)}, "takes no pictures of 16384x16384"),
    ):
        with pytest.raises(IspmError, match=says):
            ispm.animate("cornell-box", tmp_path / output, film=ispm.Film(duration=1, **film), **changes)
    assert list(tmp_path.iterdir()) == []
