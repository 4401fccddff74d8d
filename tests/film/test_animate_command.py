"""`ispm animate`: what it says, and what it hands on."""

import json
import re
import sys

import pytest

import ispm.film.animate
from ispm.cli.animate import as_duration
from ispm.cli.main import main
from ispm.film.animate import Shot


@pytest.fixture
def run(capsys, tmp_path, monkeypatch):
    """Run a command line in a folder of its own; return (exit code, stdout, stderr)."""
    monkeypatch.chdir(tmp_path)

    def ispm_animate(line):
        code = main(["animate", *line.split()])
        out, err = capsys.readouterr()
        return code, out, err

    return ispm_animate


@pytest.fixture
def given(monkeypatch, tmp_path):
    """What the command hands to `ispm.animate`, which tells of three frames instead."""
    taken = {}

    def shoot(scene, output, settings, *, on_frame, **others):
        taken.update(others, scene=scene, output=output, settings=settings)
        for k in range(3):
            on_frame(Shot(k, tmp_path / f"{k}.png", k == 0, k + 1, 3, 2 - k))
        if taken["frames"] == "0:9":
            raise KeyboardInterrupt
        return output

    monkeypatch.setattr(ispm.film.animate, "animate", shoot)
    return taken


def test_without_pyav_a_video_is_one_line_with_the_cure(run, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "av", None)
    code, out, err = run("cornell-box -o a.mp4 --turntable 360/5")
    assert (code, out, list(tmp_path.iterdir())) == (2, "", [])
    assert err == (
        "ispm: a.mp4: videos need PyAV; pip install 'ispm[video]', or name numbered pictures: a-%04d.png\n"
    )


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("--turntable 360/0", "--turntable: frames must be 1 or more, not 0"),
        ("--turntable 360/5 --frames x", "--frames: 'x' is not FIRST:END"),
        ("--turntable 360/5 --codec vp9", "a.mp4: a .mp4 does not hold vp9"),
    ],
)
def test_mistakes_are_told_before_what_renders_is_read(run, monkeypatch, line, says):
    monkeypatch.setitem(sys.modules, "ispm.film.animate", None)
    code, _, err = run(f"cornell-box -o a.mp4 {line}")
    assert code == 2 and says in err


def test_options_reach_the_film(run, given):
    line = (
        "cornell-box -o f-##.png --turntable 180/9 --look-from 1,2,-3 --look-at 2,2,2 --fps 25 --shutter .25 "
        "--passes 4 --frames 2:5 --time 1.5 --show direct --contact-sheet s.png --photons 5k"
    )
    code, out, err = run(line)
    assert code == 0, err
    assert out.split()[-1] == "s.png" and len(out.split()) == 3  # the first was found
    table = given["camera"]
    assert (table.degrees, table.frames, table.center) == (180.0, 9, (2.0, 2.0, 2.0))
    assert tuple(table.camera.pose[:3, 3]) == (1.0, 2.0, -3.0)
    assert (given["film"].fps, given["film"].shutter) == (25.0, 0.25)
    assert (given["settings"].passes, given["settings"].photons) == (4, 5000)
    assert (given["settings"].exposure, given["settings"].live) == ("hold", False)
    assert (given["frames"], given["time"], given["saved"]["show"]) == ("2:5", 1.5, "direct")
    assert "frame 2, 3 of 3" in err and "left" in err


def test_history_is_the_live_view_s_and_an_exposure_that_is_given_stays(run, given):
    assert run("cornell-box -o #.png --duration 1 --history --exposure 2")[0] == 0
    assert (given["settings"].live, given["settings"].exposure) == (True, 2.0)


def test_film_settings_come_from_files_and_the_environment_too(run, given, tmp_path, monkeypatch):
    (tmp_path / "s.toml").write_text("fps = 12\nshutter = 0.5\nduration = 2")
    monkeypatch.setenv("ISPM_FPS", "15")
    assert run("cornell-box -o #.png --config s.toml --shutter .75")[0] == 0
    film = given["film"]
    assert (film.fps, film.shutter, film.duration) == (15.0, 0.75, 2.0)


def test_json_is_one_object(run, given):
    _, out, _ = run("cornell-box -o #.png --duration 1 --json")
    assert json.loads(out) == {"output": "#.png", "frames": 3, "contact_sheet": None}


def test_an_interrupt_is_one_line_that_says_what_is_kept(run, given):
    code, _, err = run("cornell-box -o #.png --duration 1 --frames 0:9 --quiet")
    assert (code, err) == (
        130,
        "ispm: interrupted: 3 frames are finished and kept; the same command goes on after them\n",
    )


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("cornell-box -o a.gif --duration 1", "films cannot be written as '.gif'"),
        ("cornell-box -o #.png", "--duration: nothing moves"),
        ("cornell-box -o #.png --turntable 360", "--turntable: '360' is not DEGREES/FRAMES"),
        ("cornell-box -o #.png --path none.toml", "none.toml: cannot be read"),
        ("cornell-box -o #.png --path a.toml --fov 50", "--path and --fov exclude each other"),
        ("cornell-box -o #.png --path a.toml --turntable 9/9", "--path and --turntable exclude each other"),
        ("cornell-box -o #.png --duration 1 --frames 1-2", "--frames: '1-2' is not FIRST:END"),
        ("cornell-box -o #.png --duration 1 --shutter 2", "--shutter: 2 is outside 0.0 to 1.0"),
        ("cornell-box -o #.png --duration 1 --layers full", "a .png holds one picture"),
        ("cornell-box -o a.mp4 --duration 1 --bits 16", "are for numbered pictures"),
        ("cornell-box -o #.png --duration 1 --history --passes 3", "have one each"),
        ("cornell-boxx -o #.png --duration 1", "did you mean 'cornell-box'"),
    ],
)
def test_mistakes_are_one_line(run, line, says):
    code, out, err = run(line)
    assert (code, out) == (2, "")
    assert re.fullmatch(r"(loading.*\n)*ispm: [^\n]*\n", err) and says in err, err


def test_durations_read_well():
    assert [as_duration(s) for s in (0.4, 89.0, 90.0, 3000.0, 9000.0)] == [
        "0 s",
        "89 s",
        "2 min",
        "50 min",
        "2.5 h",
    ]
