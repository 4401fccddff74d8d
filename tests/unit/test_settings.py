"""Settings: one definition, converted and checked alike from Python and text."""

import contextlib
import dataclasses
from dataclasses import fields
from typing import get_args, get_type_hints

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ispm.errors import SettingsError
from ispm.settings import PRESETS, Changes, LoadLimits, Settings, resolve


@pytest.mark.parametrize(
    "text", ["40000", "40_000", "40k", "4e4", "0.04M", 40_000, 40_000.0, np.int64(40_000)]
)
def test_photons_may_be_written_in_many_ways(text):
    assert Settings(photons=text).photons == 40_000
    assert type(Settings(photons=text).photons) is int


@pytest.mark.parametrize(
    ("name", "given_value", "held"),
    [
        ("size", "640x360", (640, 360)),
        ("size", [640, 360], (640, 360)),
        ("background", "black", (0.0, 0.0, 0.0)),
        ("background", "transparent", "transparent"),
        ("background", "0.1, .2,3", (0.1, 0.2, 3.0)),
        ("exposure", "-2.5", -2.5),
        ("exposure", "auto", "auto"),
        ("antialias", "off", False),
        ("smoothing", 2, 2.0),
    ],
)
def test_setting_converts_to_what_the_renderer_uses(name, given_value, held):
    assert getattr(Settings(**{name: given_value}), name) == held


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("photons", -1, "photons: -1 is outside 0 to 16000000"),
        ("photons", 1.5, "1.5 is not a whole number"),
        ("photons", "4x", "'4x' is not a number"),
        ("photons", True, "True is not a number"),
        ("photons", None, "None is not a number"),
        ("photons", float("nan"), "nan is outside"),
        ("photons", float("inf"), "inf is outside"),
        ("photons", "9" * 400, "inf is outside"),
        ("size", (640,), "needs 2 numbers, not 1"),
        ("size", (0, 3), "0 is outside 1 to 16384 pixels"),
        ("estimator", "volums", "did you mean 'volumes'?"),
        ("exposure", "atuo", "is not a number or auto or hold; did you mean 'auto'?"),
        ("background", "balck", "did you mean 'black'?"),
        ("antialias", 3, "3 is not true or false"),
        ("gather", 5, "5 is not a square number; use 4 or 9"),
        ("gather", 4.5, "4.5 is not a whole number"),
        ("gather", "atuo", "did you mean 'auto'?"),
    ],
)
def test_setting_refuses_what_it_cannot_hold_in_one_line(name, value, says):
    with pytest.raises(SettingsError) as caught:
        Settings(**{name: value})
    assert says in str(caught.value)
    assert str(caught.value).startswith(name + ": ")
    assert "\n" not in str(caught.value)


@given(st.text(max_size=12))
def test_any_text_is_a_number_or_a_settings_error(text):
    with contextlib.suppress(SettingsError):
        assert 0 <= Settings(photons=text).photons <= 100_000_000


def test_replace_names_the_nearest_setting():
    with pytest.raises(SettingsError, match="no setting 'photnos'; did you mean 'photons'"):
        Settings().replace(photnos=3)


def test_replace_keeps_the_rest_and_the_original():
    before = Settings(seed=5)
    assert before.replace(photons=7) == dataclasses.replace(Settings(), seed=5, photons=7)
    assert before.photons == Settings().photons


def test_resolve_takes_the_first_layer_that_has_a_value():
    settings = resolve({"photons": 1}, {"photons": 2, "bounces": 2}, {"seed": 3, "bounces": 3})
    assert (settings.photons, settings.bounces, settings.seed) == (1, 2, 3)


def test_resolve_puts_the_preset_under_all_layers(monkeypatch):
    monkeypatch.setitem(PRESETS, "fast", {"photons": 10, "bounces": 1})
    settings = resolve({"photons": 20}, {"preset": "fast"})
    assert (settings.preset, settings.photons, settings.bounces) == ("fast", 20, 1)


def test_preset_stands_below_what_is_given_with_it():
    talk = Settings(preset="talk", bounces=8)
    assert (talk.photons, talk.bounces, talk.kernel) == (20_356, 8, "hint")
    assert Settings().replace(preset="talk", bounces=8) == talk
    assert talk.replace(seed=1).bounces == 8  # what was given once is not undone
    assert Settings((64, 64), 7, preset="talk").photons == 7


def test_the_talks_kernel_belongs_to_volumes():
    with pytest.raises(SettingsError, match=r"estimator: 'tiled' does not have .* use volumes or auto"):
        Settings(preset="talk", estimator="tiled")
    with pytest.raises(SettingsError, match="talk_errors: kernel 'auto' has none of them"):
        Settings(talk_errors=True)
    assert Settings(kernel="hint").estimator == "auto"


def test_gather_rays_are_few_in_large_pictures_and_none_where_there_is_nothing_to_find():
    rays = {size: Settings(size=size).gather_rays for size in ((1280, 720), (640, 360), (160, 90), (8, 8))}
    assert rays == {(1280, 720): 4, (640, 360): 4, (160, 90): 25, (8, 8): 64}
    none = (
        {"kernel": "hint"},
        {"preset": "talk"},
        {"preset": "fast"},
        {"photons": 0},
        {"bounces": 0},
        {"gather": 0},
    )
    assert [Settings(**given).gather_rays for given in none] == [0] * 6
    assert Settings(preset="best").gather_rays == Settings(gather="16").gather_rays == 16
    with pytest.raises(SettingsError, match="gather: kernel 'hint' lights the pixels itself; use 0 or auto"):
        Settings(kernel="hint", gather=4)


def test_every_knob_says_what_it_does():
    for owner in (Settings, LoadLimits):
        for f in dataclasses.fields(owner):
            assert len(f.metadata["help"]) >= 10, f.name


def test_load_limits_are_checked():
    with pytest.raises(SettingsError, match="max_texture: 0 is outside"):
        LoadLimits(max_texture=0)


def test_arguments_by_name_are_typed_as_the_fields_are():
    """One definition: what type checkers read of `replace` and `render` says what Settings says."""
    assert get_type_hints(Changes) == get_type_hints(Settings)


def test_choices_are_those_of_the_types():
    hints = get_type_hints(Settings)
    for f in fields(Settings):
        words = [w for kind in (hints[f.name], *get_args(hints[f.name])) for w in get_args(kind)]
        allowed = {word for word in words if isinstance(word, str)}
        assert allowed == set(f.metadata["choices"]) | set(f.metadata["words"]), f.name
