"""Cameras that move: exact cases of the spline, turns, and files of key frames."""

import math

import numpy as np
import pytest

from ispm.errors import SettingsError
from ispm.film.path import CameraKey, CameraPath, Turntable
from ispm.scene.camera import Camera

TIMES = np.array([0.0, 0.5, 2.0, 3.0, 3.25, 5.0])


def eyes(path, times):
    return np.array([path.at(t).pose[:3, 3] for t in times])


def path_of(values, times=TIMES):
    return CameraPath(
        [CameraKey(float(t), tuple(v), (0.0, 0.0, -100.0)) for t, v in zip(times, values, strict=True)]
    )


def test_it_goes_through_its_keys_and_is_held_before_and_after():
    values = np.random.default_rng(1).uniform(-3, 3, (len(TIMES), 3))
    path = path_of(values)
    np.testing.assert_allclose(eyes(path, TIMES), values, atol=1e-12)
    np.testing.assert_array_equal(eyes(path, [-9.0, 99.0]), eyes(path, TIMES[[0, -1]]))


def test_parabolas_are_followed_exactly_between_inner_keys():
    def parabola(t):
        return np.stack([1 + 2 * t - 0.3 * t**2, 0.5 * t**2, -t], axis=-1)

    times = np.linspace(TIMES[1], TIMES[-2], 50)
    np.testing.assert_allclose(eyes(path_of(parabola(TIMES)), times), parabola(times), atol=1e-12)


def test_velocity_is_continuous_and_0_at_the_ends():
    values = np.random.default_rng(2).uniform(-3, 3, (len(TIMES), 3))
    path, step = path_of(values), 1e-6
    for k, t in enumerate(TIMES):
        before, here, after = eyes(path, [t - step, t, t + step])
        if k in (0, len(TIMES) - 1):
            assert np.abs(after - before).max() / step < 1e-4  # second derivatives are below 100
        else:
            np.testing.assert_allclose((here - before) / step, (after - here) / step, atol=1e-4)


def test_what_stands_still_between_keys_does_not_sway():
    values = [(0, 0, 0), (1, 0, 0), (1, 0, 0), (1, 0, 0), (4, 2, 0), (5, 5, 5)]
    np.testing.assert_allclose(eyes(path_of(values), np.linspace(0.5, 3.0, 20)) - (1, 0, 0), 0.0, atol=1e-15)


def test_a_closed_path_does_not_stop_where_it_closes():
    angles = np.arange(9) * math.pi / 4.0
    circle = np.stack([np.cos(angles), np.zeros(9), np.sin(angles)], axis=1)
    circle[-1] = circle[0]
    path = path_of(circle, np.arange(9.0))
    h = 1e-6
    start, end = (eyes(path, [h]) - eyes(path, [0.0])) / h, (eyes(path, [8.0]) - eyes(path, [8.0 - h])) / h
    np.testing.assert_allclose(start, end, atol=1e-4)
    np.testing.assert_allclose(
        np.linalg.norm(start), math.sin(math.pi / 4.0), atol=1e-4
    )  # of the chord of two
    # halfway a Hermite cubic is at the chord's middle and an eighth of the velocities' difference
    radius = np.linalg.norm(eyes(path, np.arange(8) + 0.5), axis=1)
    exact = math.cos(math.pi / 8.0) + 0.25 * math.sin(math.pi / 4.0) * math.sin(math.pi / 8.0)
    np.testing.assert_allclose(radius, exact, atol=1e-12)


def test_times_must_increase_and_keys_make_sense():
    key = CameraKey(1.0, (0, 0, 1), (0, 0, 0))
    for keys, says in (
        ([key], "two or more"),
        ([key, key], "key 2 is at 1 s, not after 1 s"),
        ([1, key], "int"),
    ):
        with pytest.raises(SettingsError, match=says):
            CameraPath(keys)
    with pytest.raises(SettingsError, match="target: is where the eye is"):
        CameraKey(0.0, (1, 2, 3), (1, 2, 3))
    with pytest.raises(SettingsError, match="eye must be 3 numbers"):
        CameraKey(0.0, (1, 2), (1, 2, 3))


def test_a_turn_ends_where_it_began_bit_for_bit_and_keeps_its_distance():
    camera, center = Camera.look_at((3.0, 2.0, 1.0), (0.5, 0.5, 0.5)), np.array([0.25, 0.5, -1.0])
    table = Turntable(360, 7)
    np.testing.assert_array_equal(table.turned(camera, 7, center).pose, camera.pose)
    again, before = (table.turned(camera, k, center).pose for k in (9, 2))
    np.testing.assert_allclose(again, before, atol=1e-12)
    quarter = Turntable(90, 5).turned(camera, 5, center).pose  # from +Z to +X: counterclockwise from above
    away = camera.pose[:3, 3] - center
    np.testing.assert_allclose(quarter[:3, 3] - center, (away[2], away[1], -away[0]), atol=1e-12)
    for text in ("360", "a/5", "360/0", "360/2.5", "nan/5"):
        with pytest.raises(SettingsError, match="turntable"):
            Turntable.parse(text)


GOOD = """\
# a walk
[[key]]
time = 0
eye = [0, 1.7, 5]
target = [0, 1.5, 0]

[[key]]
time = 2.5
eye = [1, 1.7, 2]
target = [0, 1.5, 0]
fov = 40
"""


def test_a_file_of_keys_is_read(tmp_path):
    file = tmp_path / "walk.toml"
    file.write_text(GOOD)
    path = CameraPath.load(file)
    assert [key.time for key in path.keys] == [0.0, 2.5]
    assert [math.degrees(key.yfov) for key in path.keys] == pytest.approx([50.0, 40.0])
    np.testing.assert_allclose(path.at(2.5).pose[:3, 3], (1, 1.7, 2))
    np.testing.assert_allclose(path.at(1.25).yfov, math.radians(45.0))


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ("time = 2.5", "time = = 2.5", 8, "is not TOML"),
        ("fov = 40", "fov = [", 11, "is not TOML"),
        ("time = 2.5", "time = 0", 8, "key 2 is at 0 s, not after 0 s"),
        ("fov = 40", "fov = 180", 11, "fov must be between 0 and 180 degrees, not 180"),
        ("fov = 40", "fovv = 40", 11, "a key has no 'fovv'; did you mean 'fov'"),
        ("eye = [1, 1.7, 2]", "eye = [1, 2]", 9, "eye must be 3 numbers"),
        ("eye = [1, 1.7, 2]", 'eye = "here"', 9, "eye must be 3 numbers"),
        ("target = [0, 1.5, 0]\nfov", "fov", 7, "key 2 lacks its target"),
        ("target = [0, 1.5, 0]\nfov", "target = [1, 1.7, 2]\nfov", 10, "target: is where the eye is"),
        ("time = 0\n", 'time = "now"\n', 3, "time must be a number"),
        ("# a walk", "speed = 2", 1, "there is no 'speed' in a camera path"),
        ("[[key]]\ntime = 0\n", "[key]\ntime = 0\n", 7, "is not TOML"),
    ],
)
def test_faults_of_a_file_are_told_with_their_line(tmp_path, old, new, line, says):
    file = tmp_path / "walk.toml"
    assert GOOD.count(old) >= 1
    head, _, tail = GOOD.rpartition(old)
    file.write_text(head + new + tail)
    with pytest.raises(SettingsError) as told:
        CameraPath.load(file)
    assert str(told.value).startswith(f"{file}:{line}: ")
    assert says in str(told.value) and "\n" not in str(told.value)


def test_a_file_without_keys_or_none_at_all(tmp_path):
    file = tmp_path / "walk.toml"
    for text, says in (("", "two or more"), ("[[key]]\ntime=0\neye=[0,0,1]\ntarget=[0,0,0]", "two or more")):
        file.write_text(text)
        with pytest.raises(SettingsError, match=rf"walk\.toml:1: .*{says}"):
            CameraPath.load(file)
    with pytest.raises(SettingsError, match="No such file"):
        CameraPath.load(tmp_path / "none.toml")
