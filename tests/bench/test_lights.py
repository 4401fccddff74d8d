"""What lights cost: the scenes that are measured, and the table."""

import json
import math

import pytest

from ispm.bench import lights
from ispm.bench.lights import LIGHTS, POINT, LightCost, lights_table
from ispm.bench.suite import spread
from ispm.cli.main import main
from ispm.scene.packed import pack
from ispm.settings import Settings


def made(name, ratios, limit):
    return LightCost(name, len(ratios), spread([2.0 * r for r in ratios]), spread(ratios), limit, 7)


def test_each_scene_has_the_light_that_it_is_named_after():
    packed = [pack(make().at(0.0)) for make, _ in LIGHTS.values()]
    assert [len(each.lights) for each in packed] == [1, 0, 1, 1, 0]
    assert [len(each.environment.rows) > 0 for each in packed] == [False, False, False, True, False]
    assert [each.triangle_count - packed[0].triangle_count for each in packed] == [0, 2, 0, 0, 1000]


def test_the_table_tells_which_light_costs_too_much():
    costs = [made(POINT, [1.0, 1.0], math.inf), made("a", [1.2, 1.4], 1.2), made("b", [1.2, 1.4], 1.3)]
    heading, *rows = lights_table(costs)
    assert {len(row) for row in rows} == {len(heading)}
    assert [row[-2] for row in rows] == ["", "more", ""]
    assert rows[1][1] == pytest.approx(2600.0) and rows[1][4] == pytest.approx(1.3)


def test_lights_are_measured_beside_the_point(monkeypatch, tmp_path):
    monkeypatch.setattr(lights, "Settings", lambda: Settings(size=(64, 36), photons=300))
    monkeypatch.setattr(lights, "LIGHTS", {name: LIGHTS[name] for name in (POINT, "rectangle")})
    path = tmp_path / "lights.json"
    assert main(["bench", "--lights", "--quick", "--frames", "1", "-o", str(path)]) == 0
    report = json.loads(path.read_text())
    point, rectangle = report["lights"]
    assert report["kind"] == "lights" and point["ratio"]["median"] == 1.0
    assert (
        rectangle["stored"] > 0 and rectangle["seconds"]["median"] > 0.0 and rectangle["light"] == "rectangle"
    )


def test_lights_are_measured_alone(capsys):
    assert main(["bench", "--lights", "--talk"]) == 2
    assert "--lights: is measured alone" in capsys.readouterr().err
