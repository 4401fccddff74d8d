"""Names of films and of numbered pictures, and ranges of frames."""

import re

import pytest

from ispm.errors import OutputError, SettingsError
from ispm.film.output import Output
from ispm.film.settings import frame_range


@pytest.mark.parametrize(
    ("name", "picture"),
    [
        ("frames/%04d.exr", "frames/0007.exr"),
        ("frame_####.exr", "frame_0007.exr"),
        ("####", "0007.png"),
        ("a-#.PNG", "a-7.PNG"),
        ("%d.png", "7.png"),
        ("%3d.jpg", "007.jpg"),
        ("take#2/##.png", "take#2/07.png"),
    ],
)
def test_numbered_pictures(name, picture):
    output = Output.of(name)
    assert not output.is_film and str(output.picture(7)) == picture
    assert output.picture(123456).name != output.picture(12345).name


def test_films_and_what_is_neither():
    assert Output.of("a/film.MP4").is_film
    assert str(Output.of("a/film.mp4").beside) == "a/film.mp4.frames"
    for name, says in (
        ("a.png", "number them, as a-%04d.png"),
        ("film.gif", "films cannot be written as '.gif'; use one of .mp4, .mkv, .webm, .mov"),
        ("film", "the name has no ending"),
        ("%04d-##.png", "twice"),
        ("f/%d/%d.png", "a folder cannot be numbered"),
        ("%04d.bmp", "pictures cannot be written as '.bmp'"),
    ):
        with pytest.raises(OutputError, match=re.escape(says)):
            Output.of(name)
    with pytest.raises(OutputError, match="int is not the path"):
        Output.of(3)


@pytest.mark.parametrize(
    "text", [":", "2:5", ":3", "4:", "-3:", ":-2", "-4:-1", "3", "-1", "0:99", " 2 : 4 "]
)
def test_ranges_are_half_open_as_slices(text):
    if ":" in text:
        first, end = (int(word) if word.strip() else None for word in text.split(":"))
        assert list(frame_range(text, 6)) == list(range(6))[first:end]
    else:
        assert list(frame_range(text, 6)) == [range(6)[int(text)]]


def test_one_frame_is_named_by_its_number_too():
    assert list(frame_range(5, 6)) == list(frame_range(-1, 6)) == [5]


@pytest.mark.parametrize(
    "text", [6, 1.5, None, "", "a", "1:2:3", "1-2", "2:2", "6:", "6", "-7", "5:1", "1.5:3"]
)
def test_other_ranges_are_refused(text):
    with pytest.raises(SettingsError, match=r"^frames: "):
        frame_range(text, 6)
