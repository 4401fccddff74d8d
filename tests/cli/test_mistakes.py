"""Mistakes on the command line: one line each, that says what, where and how to mend it; and exit codes."""

import os
import warnings

import pytest
from fake import SMALL, FakeRenderer

from ispm.errors import AdapterError, SceneWarning, SettingsError


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("rendr", 'Did you mean "render"'),
        ("render cornell-box --photnos 3", "Did you mean --photons"),
        ("render cornell-box --photons", "--photons requires an argument"),
        ("render cornell-box extra", "ispm: extra: is more than the command takes; see its --help"),
        ("render cornell-box --photons 4x", "--photons: '4x' is not a number"),
        ("render cornell-box --photons -3", "--photons: -3 is outside 0 to 16000000"),
        ("render cornell-box --estimator volums", "did you mean 'volumes'?"),
        ("render cornell-box --size 640", "--size: needs 2 numbers, not 1"),
        ("render cornell-box --size x", "--size: 'x' is not 2 numbers"),
        ("render cornell-box --resume kept.png", "--resume: kept.png would be an .npz"),
        ("render .", ".: this is a folder, not a file"),
        ("render " + "a" * 300 + ".glb -o a.png", "cannot be read: File name too long"),
        ("render cornell-box -o " + "a" * 252 + ".png", "cannot be written: File name too long"),
        ("render cornell-box -o a\udcff.png", "the name is no UTF-8"),
        ("render cornell-box --show ful", "--show: 'ful' is not one of"),
        ("render cornell-box --show depth -o a.exr", "--layers"),
        ("render cornell-box --layers depth", "--layers: a .png holds one picture"),
        ("render cornell-box --layers deph -o a.exr", "did you mean 'depth'?"),
        ("render cornell-box --float", "--float: is for .exr"),
        ("render cornell-box --threads 0", "--threads: 0 is less than 1"),
        ("render cornell-box --threads 2.5", "--threads: '2.5' is not a whole number"),
        ("view cornell-box --web --port 22.5", "--port: '22.5' is not a whole number"),
        ("bench --frames 2.5", "--frames: '2.5' is not a whole number"),
        ("render cornell-box --bits 8.5", "--bits: '8.5' is not a whole number"),
        ("bench --quick -o x.txt", "--output: x.txt would be JSON; name it .json"),
        ("render cornell-box --time nan", "--time: nan"),
        ("render cornell-box --fov 180", "--fov: 180 is not between"),
        ("render cornell-box --look-from 1,2,3", "give both"),
        ("render cornell-box --look-from nan,2,3", "--look-from: 'nan,2,3'"),
        ("render cornell-box --look-from 1,2 --look-at 0,0,0", "--look-from: '1,2' is not X,Y,Z"),
        ("render cornell-box --look-from 1,1,1 --look-at 1,1,1", "are the same"),
        ("render cornell-box --camera 9", "there is no camera '9'"),
        ("render cornell-box --camera 9 --fov 3", "there is no camera '9'"),
        ("render cornell-box --animation walk", "no animation is called 'walk'"),
        ("render cornell-box --max-texture 0", "--max-texture: 0 is outside"),
        ("render cornell-box --config none.toml", "none.toml: cannot be read"),
        ("render cornell-box -o /", "/: is a folder; name a file in it"),
        ("render cornell-box --gather 3", "ispm: --gather: 3 is not a square number"),
        (
            "compare /dev/null a.png",
            "/dev/null: pictures are read from .exr, .npy, .npz, .png; the name has no",
        ),
        ("render cornell-box -o a.tif", "use one of .png"),
        ("render cornell-box -o /dev/null/a.png", "/dev/null/a.png: cannot be written"),
        ("render cornell-box -o a.png --stats a.png", "is to hold two results"),
        ("render cornell-box --environment none.hdr", "none.hdr: there is no such file"),
        ("render cornell-box --environment none.jpg", "none.jpg: environments are read from .hdr .exr"),
        ("render cornell-box --environment-rotation 9", "--environment-rotation: is of --environment"),
        ("render cornell-box --environment a.hdr --environment-rotation nan", "--environment-rotation: nan"),
        ("render cornell-box --environment a.hdr --environment-intensity -1", "-1 is less than 0"),
        ("render cornell-box --enviroment a.hdr", "Did you mean --environment"),
        ("render cornel-box", "did you mean 'cornell-box'?"),
        ("render none.glb", "none.glb: there is no such file"),
        ("render", "no scene was named"),
        ("info", "SCENE"),
        ("compare a.npy", "B"),
        ("compare a.npy b.npy", "a.npy: there is no such file"),
        ("compare a.npy b.npy --max-relmse -1", "--max-relmse: -1.0 is not a bound"),
        (
            "compare a.npy b.npy --reference-error -5",
            "--reference-error: -5.0 is not an error; give 0 or more",
        ),
        ("compare a.npy b.npy --reference-error nan", "--reference-error: nan is not an error"),
    ],
)
def test_a_mistake_is_one_line_and_exit_code_2(ispm_command, place, line, says):
    code, out, err = ispm_command(line)
    last = err.splitlines()[-1]
    assert (code, out) == (2, "")
    assert last.startswith("ispm: ")
    assert says in last
    assert "Traceback" not in err
    assert not FakeRenderer.made
    assert list(place.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("photnos = 3", "s.toml: there is no setting 'photnos'; did you mean 'photons'?"),
        ("photons = 1.5", "s.toml: photons: 1.5 is not a whole number"),
        ("photons = ", "s.toml: is not TOML"),
    ],
)
def test_a_mistake_in_the_file_names_the_file(ispm_command, place, text, says):
    (place / "s.toml").write_text(text)
    code, _, err = ispm_command("render cornell-box --config s.toml")
    assert code == 2
    assert says in err


def test_a_mistake_in_the_environment_names_the_variable(ispm_command, monkeypatch):
    monkeypatch.setenv("ISPM_PHOTONS", "many")
    assert ispm_command("render cornell-box")[2] == "ispm: ISPM_PHOTONS: 'many' is not a number\n"


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (SettingsError("size: too large"), 2, "ispm: size: too large\n"),
        (AdapterError("no graphics adapter"), 3, "ispm: no graphics adapter\n"),
        (KeyboardInterrupt(), 130, "ispm: interrupted\n"),
        (
            ZeroDivisionError("by\nzero"),
            2,
            "ispm: unexpected ZeroDivisionError: by zero; run again with --debug",
        ),
    ],
)
def test_errors_become_exit_codes(ispm_command, monkeypatch, error, code, line, place):
    monkeypatch.setattr(FakeRenderer, "error", error)
    result, out, err = ispm_command(SMALL + "--quiet")
    assert (result, out) == (code, "")
    assert err.startswith(line)
    assert err.count("\n") == 1
    assert list(place.iterdir()) == []


def test_debug_adds_the_traceback(ispm_command, monkeypatch):
    monkeypatch.setattr(FakeRenderer, "error", SettingsError("size: too large"))
    code, _, err = ispm_command(SMALL + "--debug")
    assert code == 2
    assert "Traceback" in err
    assert err.endswith("ispm: size: too large\n")


def test_warnings_are_a_line_each_and_said_once(ispm_command, monkeypatch):
    def render(self):
        for _ in range(2):
            warnings.warn("no light;\none was added", SceneWarning, stacklevel=1)
            warnings.warn("of a library", RuntimeWarning, stacklevel=1)
        return original(self)

    original = FakeRenderer.render
    monkeypatch.setattr(FakeRenderer, "render", render)
    _, _, err = ispm_command(SMALL)
    assert err.count("ispm: warning: no light; one was added\n") == 1
    assert "library" not in err


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("render cornell-box --bits 12", "--bits: 12 is not possible; give 8 or 16"),
        ("render cornell-box --bits 16 -o a.exr", "--bits: 16 is for .png"),
        ("render cornell-box --bits 16 --show photons", "--bits: the view 'photons' has 8"),
        ("info none.png", "none.png: there is no such file"),
    ],
)
def test_mistakes_about_pictures_are_one_line(ispm_command, line, says):
    code, _, err = ispm_command(line)
    assert code == 2 and says in err.splitlines()[-1]


def test_a_mistyped_variable_is_told_once_with_the_nearest(ispm_command, monkeypatch):
    monkeypatch.setenv("ISPM_PHOTNS", "3")
    monkeypatch.setenv("ISPM_CACHE", os.environ.get("ISPM_CACHE", ""))
    _, _, err = ispm_command(SMALL)
    line = "ispm: warning: the environment has ISPM_PHOTNS, which means nothing; did you mean 'ISPM_PHOTONS'?"
    assert err.splitlines().count(line) == 1
    assert "ISPM_CACHE" not in err


def test_limits_have_one_name_in_options_and_messages(ispm_command, place):
    from ispm.io.save import save
    from ispm.library.builtin import builtin

    save(builtin("cornell-box"), place / "a.glb")
    code, _, err = ispm_command("info a.glb --max-triangles 3")
    assert code == 2 and "max_triangles=3" in err
