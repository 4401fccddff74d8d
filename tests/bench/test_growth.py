"""Growth of a frame: exponents of made-up times, and points of the curves."""

import itertools
import json
import math
import random
from functools import partial

import numpy as np
import pytest

from ispm.bench import growth
from ispm.bench.growth import (
    Curve,
    Power,
    curve_line,
    fit_power,
    growth_table,
    last_power,
    logarithmic,
    measure_curve,
    series,
)
from ispm.bench.growth_scene import hall
from ispm.bench.suite import moments, spread
from ispm.cli.main import main
from ispm.renderer import Renderer
from ispm.scene.packed import pack
from ispm.settings import Settings

AMOUNTS = [100, 400, 1600, 6400, 25600]


def times(of, scatter=0.0, seed=0, frames=15):
    """Spreads of frames that take `of` an amount, ms."""
    draw = random.Random(seed)
    return [spread([of(n) * draw.gauss(1.0, scatter) for _ in range(frames)]) for n in AMOUNTS]


def test_exponents_of_powers_are_exact():
    for p in (0.0, 0.5, 1.0, 1.5):
        made = times(lambda n, p=p: 3.0 * n**p)
        for power in (fit_power(AMOUNTS, made), last_power(AMOUNTS, made, 15)):
            assert power.exponent == pytest.approx(p, abs=1e-12)
            assert power.uncertainty == pytest.approx(0.0, abs=1e-6)


def test_uncertainty_of_the_line_holds_the_exponent_at_95_per_cent():
    # Lines through points whose logarithms scatter normally: of 400, 0.95 has a standard error of 0.011.
    draw, x = np.random.default_rng(3), np.log(AMOUNTS)
    held = 0
    for _ in range(400):
        y = np.exp(0.7 * x + draw.normal(0.0, 0.1, 5))
        power = fit_power(AMOUNTS, [spread([value]) for value in y])
        held += abs(power.exponent - 0.7) < power.uncertainty
    assert 0.95 - 3.0 * 0.011 < held / 400 < 0.95 + 3.0 * 0.011


def test_last_step_tells_what_a_constant_hides():
    found = series("frame", AMOUNTS, times(lambda n: 1000.0 + 1e-4 * n**1.8), 15, 1.0)
    assert found.power.exponent < 1.0 < found.last.exponent and not found.is_within


def test_what_grows_linearly_is_within_and_what_grows_faster_is_not():
    linear = series("frame", AMOUNTS, times(lambda n: 200.0 + 0.1 * n, 0.02), 15, 1.0)
    assert linear.is_within and linear.power.exponent < 1.0
    assert series("frame", AMOUNTS, times(lambda n: 0.1 * n, 0.02), 15, 1.0).last.exponent == pytest.approx(
        1.0, abs=0.05
    )
    assert not series("frame", AMOUNTS, times(lambda n: 0.1 * n**1.3, 0.02), 15, 1.0).is_within


def test_limit_of_a_logarithm_is_its_exponent():
    made = times(math.log)
    assert fit_power(AMOUNTS, made).exponent == pytest.approx(logarithmic(AMOUNTS), rel=0.05)
    assert series("trace", AMOUNTS, made, 15, logarithmic(AMOUNTS)).power.is_within(logarithmic(AMOUNTS))
    assert not Power(0.5, 0.1).is_within(logarithmic(AMOUNTS))


def test_halls_have_what_they_are_asked_for_and_all_of_it_moves():
    scene = hall(triangles=5_000, instances=10, lights=3)
    first, second = (pack(moment) for moment in moments(scene, 2))
    assert len(first.lights) == 3
    assert len(first.instances) == 10 + 3
    rest = 10 * 44 + 12 + 20 * 12**2
    assert first.triangle_count - rest == 2 * 50**2
    assert np.abs(first.lights["position"] - second.lights["position"]).max() > 1e-2
    still = [(a == b).all() for a, b in zip(first.placed.places, second.placed.places, strict=True)]
    assert sum(still) == 3  # walls, floor and the ball


def test_points_of_the_curves_differ_in_one_thing():
    curves = growth._curves(4)
    assert list(curves) == ["photons", "pixels", "triangles", "lights", "instances"]
    for name, points in curves.items():
        amounts = [point.amount for point in points]
        assert len(amounts) == 5
        steps = {round(b / a, 1) for a, b in itertools.pairwise(amounts)}
        assert steps <= {2.0, 4.0, 4.1}
        assert len({point.settings for point in points}) == (5 if name in ("photons", "pixels") else 1)


def test_a_curve_is_measured():
    tiny = Settings(size=(32, 18), photons=300, shadow_resolution=64)
    points = [growth._Point(n, partial(hall, 200, 2, n), tiny) for n in (1, 2)]
    points = [*points, *points, points[0]]  # five, as a line wants
    with Renderer(hall(), tiny) as renderer:
        curve = measure_curve(renderer, "lights", points, 2)
    assert [each.name for each in curve.series] == ["frame", "trace"]
    for frame, trace in zip(*(each.times for each in curve.series), strict=True):
        assert 0.0 < trace.median <= frame.median


def test_curves_are_kept_one_by_one(monkeypatch, tmp_path, capsys):
    found = [series(name, AMOUNTS, times(lambda n: n**0.5), 15, 1.0) for name in ("frame", "trace")]
    curve = Curve("lights", AMOUNTS, 15, found, "made up")
    assert len({len(row) for row in growth_table([curve])}) == 1
    assert "frame ~ lights^0.50 ± 0.00" in curve_line(curve)

    def measure(quick, frames, tell):
        yield curve
        raise KeyboardInterrupt

    monkeypatch.setattr(growth, "measure_growth", measure)
    path = tmp_path / "growth.json"
    assert main(["bench", "--growth", "-o", str(path)]) == 130
    report = json.loads(path.read_text())
    assert report["kind"] == "growth" and report["machine"]["adapter"] == "made up"
    assert report["curves"][0]["amounts"] == AMOUNTS
