"""A sky saved with its scene: in the extras of the glTF scene, and back."""

import json

import pytest

from ispm.io.load import load
from ispm.io.save import save
from ispm.scene.scene import Scene
from ispm.scene.sky import Sky


@pytest.mark.parametrize("ending", ["glb", "gltf"])
def test_a_sky_loads_back_equal(tmp_path, ending):
    sky = Sky(
        sun_elevation=0.3, sun_azimuth=1.0, turbidity=5.0, intensity=0.5, background=False, sun_radius=0.0
    )
    path = save(Scene(environment=sky), tmp_path / f"a.{ending}")
    loaded = load(path)
    assert loaded.environment == sky and not loaded.warnings


@pytest.mark.parametrize(
    ("record", "told"),
    [
        ({"sun_elevation": 9.0}, "sun_elevation"),
        ({"sun_elevation": "high"}, "float"),
        ({"turbidty": 2.0}, "turbidity"),
        ([1, 2], "object"),
    ],
)
def test_a_sky_that_makes_no_sense_is_passed_over(tmp_path, record, told):
    path = save(Scene(environment=Sky()), tmp_path / "a.gltf")
    text = json.loads(path.read_text())
    text["scenes"][0]["extras"]["ispm_sky"] = record
    path.write_text(json.dumps(text))
    loaded = load(path)
    assert loaded.environment is None
    (line,) = loaded.warnings
    assert "the scene's ispm_sky is passed over" in line and told in line
