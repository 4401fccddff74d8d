"""How large moving pictures are: small until they are timed, then as large as the rate allows."""

import pytest

from ispm.viewer.pace import Pace

FULL = (800, 600)


def run(pace, cost, count=60):
    """The sizes of pictures whose seconds are `cost` of their pixels."""
    sizes = []
    for _ in range(count):
        width, height = pace.size(FULL)
        sizes.append(width)
        pace.spent(cost(width * height))
    return sizes


def test_large_pictures_begin_small_and_small_ones_as_they_are():
    assert Pace(15.0).size((1600, 1200)) == (400, 300)
    assert Pace(15.0).size((64, 36)) == (64, 36)
    assert Pace(15.0).size((2048, 16)) == (2048, 16)


@pytest.mark.parametrize("speed", [0.5e6, 2e6, 8e6, 60e6])
def test_pictures_grow_to_what_the_rate_allows_and_stay_there(speed):
    sizes = run(Pace(15.0), lambda pixels: 0.01 + pixels / speed)
    assert sizes == sorted(sizes)
    assert len(set(sizes[20:])) == 1
    width = sizes[-1]
    assert width == 200 or 0.01 + width * width * 0.75 / speed <= 1.0 / 15.0
    if width < 800:  # all of it as much dearer as a step more has pixels would be too slow
        assert (0.01 + width * width * 0.75 / speed) * 1.43**2 > 0.8 * 0.8 / 15.0


def test_one_slow_picture_changes_nothing_and_two_do():
    pace = Pace(15.0)
    run(pace, lambda _: 0.001)
    assert pace.size(FULL) == FULL
    pace.spent(1.0)
    pace.spent(0.04)
    pace.spent(1.0)
    assert pace.size(FULL) == FULL
    pace.spent(1.0)
    assert pace.size(FULL) == (400, 300)  # two steps at once, as it took more than twice the time
