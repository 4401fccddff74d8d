"""What lights a pixel, and the ways that it came: against estimator, photon map and plain geometry."""

import math

import numpy as np
import pytest
from transport import box_room, lit

import ispm
from ispm.errors import IspmError, SettingsError
from ispm.library.common import lambert
from ispm.library.shapes import polygons
from ispm.photons.grid import PhotonGrid
from ispm.renderer.gather import keep_all_light, series_of
from ispm.renderer.light_paths import receiver_at

SIZE = (64, 36)
SMALL = dict(size=SIZE, photons=4000, antialias=False)
EYE = ispm.Camera.look_at((0.3, 0.1, 0.45), (-0.5, -0.3, -0.5), yfov=1.2)
SETTINGS = {
    "default": {},
    "photons": dict(gather=0),
    "map": dict(emission="map", subsampling=2),
    "rays": dict(emission="rays"),
    "plain": dict(kernel="class"),
    "live": dict(preset="live"),
}


def room():
    """A room with a mirror ball and a sheet of glass, lit by a lamp and a sun through its open side."""
    scene = lit(box_room(albedo=0.7), (0.1, 0.2, -0.1), flux=30.0)
    mirror = ispm.Material((1.0,) * 3, metallic=1.0, roughness=0.0)
    scene.add(ispm.shapes.sphere(0.12), name="ball", material=mirror, translation=(-0.2, -0.38, -0.2))
    return scene


@pytest.fixture(params=SETTINGS)
def renderer(request, gpu):
    settings = ispm.Settings(**{**SMALL, **SETTINGS[request.param]})
    with ispm.Renderer(room(), settings, EYE, threads=2, gpu=gpu) as renderer:
        renderer.render()
        if renderer.settings.live:  # one that goes on, with random numbers of its own
            renderer.scene["ball"].translation = (-0.2, -0.38, -0.25)
            renderer.render()
        yield renderer


def test_paths_are_those_of_photons_of_the_map_and_bring_what_the_estimator_finds(renderer):
    last, photons = renderer._last, renderer.photons()
    made, parts = last.made, last.parts
    smooth = parts.smooth.copy()
    if not made.settings.is_plain:
        keep_all_light(made, parts.keys[: len(smooth)], smooth, series=series_of(made.settings))
    lit_pixels = 0
    for x, y in [(5, 5), (20, 18), (32, 30), (60, 20), (40, 3)]:
        found = renderer.light_paths(x, y, 1000)
        (point,) = receiver_at(last, x, y)[:1]
        receiver = receiver_at(last, x, y)
        np.testing.assert_array_equal(found.position, point["position"])
        exact = PhotonGrid(smooth).estimate(receiver, 1) + parts.caustics.grid().estimate(receiver, 1)
        # float32 sums of some hundred terms
        np.testing.assert_allclose(found.irradiance, exact[0, :3], rtol=2e-5, atol=1e-9)
        lit_pixels += found.photons > 0
        assert len(found.paths) == min(found.photons, 1000)
        brought = np.array([path.irradiance for path in found.paths]).reshape(-1, 3)
        if found.photons <= 1000:
            np.testing.assert_allclose(brought.sum(axis=0), found.irradiance, rtol=2e-5, atol=1e-9)
        luminance = brought @ (0.2126, 0.7152, 0.0722)
        assert (np.diff(luminance) <= 1e-6 * luminance[:1].sum()).all()
        for path in found.paths:
            off = np.abs(photons["position"] - path.positions[-1]).max(axis=1)
            row = off.argmin()
            assert off[row] < 2e-7 and path.bounce == photons["bounce"][row]
            np.testing.assert_allclose(path.flux[-1], photons["flux"][row], rtol=1e-6)
            assert path.events[0] == "light" and path.events[-1] == "stored"
            assert len(path.events) == len(path.positions) == len(path.flux) >= 3
            np.testing.assert_array_equal(path.positions[0], np.float32((0.1, 0.2, -0.1)))
    assert lit_pixels >= 4


def test_points_are_those_that_the_picture_shows(renderer):
    """Walls of the room at +-1/2, whose planes are met exactly; normals inwards."""
    frame = renderer.render()
    walls = [frame.names.find(side) for side in ("-x", "+x", "-y", "+y", "-z", "+z")]
    seen = 0
    for y in range(1, SIZE[1], 7):
        for x in range(1, SIZE[0], 7):
            for k, ids in enumerate(walls):
                if frame.instance[y, x] in ids:
                    found, side = renderer.light_paths(x, y, 0), -0.5 if k % 2 == 0 else 0.5
                    assert found.position[k // 2] == pytest.approx(side, abs=1e-6)
                    normal = np.zeros(3)
                    normal[k // 2] = -np.sign(side)
                    np.testing.assert_allclose(found.normal, normal, atol=1e-4)  # of 16 bits
                    seen += 1
    assert seen > 20


def test_the_sun_shines_from_far_and_a_mirror_of_it_lights_the_floor_by_one_bounce(gpu):
    """A mirror at 45 degrees turns the light from above to the wall: the positions are known."""
    scene = ispm.Scene()
    floor = np.array([(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)], float)
    scene.add(polygons([floor]), material=lambert((0.0,) * 3))
    wall = np.array([(1, 0, -1), (1, 0, 1), (1, 1, 1), (1, 1, -1)], float)
    scene.add(polygons([wall]), material=lambert((0.5,) * 3), name="wall")
    slope = np.array([(-0.5, 0.7, -0.3), (-0.5, 0.7, 0.3), (0.0, 0.2, 0.3), (0.0, 0.2, -0.3)], float)
    mirror = ispm.Material((1.0,) * 3, metallic=1.0, roughness=0.0, double_sided=True)
    scene.add(polygons([slope[::-1]]), material=mirror)
    sun = ispm.DirectionalLight((10.0,) * 3)
    scene.add(sun, rotation=(-math.sqrt(0.5), 0, 0, math.sqrt(0.5)))  # straight down
    eye = ispm.Camera.look_at((-2.0, 2.2, 0.0), (1.0, 0.45, 0.0), yfov=0.6)
    settings = ispm.Settings(size=SIZE, photons=20_000, antialias=False)
    with ispm.Renderer(scene, settings, eye, gpu=gpu) as renderer:
        frame = renderer.render()
        shown = frame.irradiance[..., 0] * np.isin(frame.instance, frame.names.find("wall"))
        row, column = np.unravel_index(shown.argmax(), shown.shape)
        found = renderer.light_paths(column, row)
        diagonal = renderer._last.made.packed.diagonal
    assert found.photons > 5
    for path in found.paths:
        assert path.events == ("light", "mirror", "stored") and path.bounce == 0
        above, met, stored = path.positions.astype(float)
        assert met[0] == pytest.approx(0.2 - met[1], abs=1e-5)  # on the slope
        np.testing.assert_allclose(above, met + np.array((0, diagonal, 0)), atol=1e-5)
        assert met[1] == pytest.approx(stored[1], abs=1e-5) and met[2] == pytest.approx(stored[2], abs=1e-5)
        assert stored[0] == pytest.approx(1.0, abs=1e-6)
        assert (path.flux == path.flux[0]).all()


def test_what_cannot_be_asked_for(gpu):
    with ispm.Renderer(room(), ispm.Settings(**SMALL), EYE, gpu=gpu) as renderer:
        with pytest.raises(IspmError, match="render first"):
            renderer.light_paths(1, 1)
        renderer.render()
        for x, y in [(-1, 0), (0, -0.5), (64, 0), (0, 36), (math.nan, 1)]:
            with pytest.raises(SettingsError, match="not in the picture of 64x36"):
                renderer.light_paths(x, y)
        for count in (-1, 1001):
            with pytest.raises(SettingsError, match="count"):
                renderer.light_paths(1, 1, count)
        renderer.scene["ball"].translation = (0.2, -0.3, 0.0)
        assert renderer.light_paths(20, 30).paths  # of the last frame
        renderer.made_of()  # which packs the scene as it is now
        with pytest.raises(IspmError, match="render it first"):
            for x in range(0, 64, 4):
                renderer.light_paths(x, 30, 1000)


def test_nothing_is_lit_where_nothing_is_seen_or_nothing_scatters(gpu):
    scene = lit(ispm.Scene(), (0.0, 3.0, 3.0))
    scene.add(ispm.shapes.sphere(0.5), material=ispm.Material(metallic=1.0, roughness=0.0))
    eye = ispm.Camera.look_at((0, 0, 4), (0, 0, 0), yfov=0.6)
    with ispm.Renderer(scene, ispm.Settings(**SMALL), eye, gpu=gpu) as renderer:
        renderer.render()
        assert renderer.light_paths(0, 0) is None
        middle = renderer.light_paths(32, 18)
        assert not middle.photons and not middle.paths and not middle.irradiance.any()
        assert middle.position[2] == pytest.approx(0.5, abs=0.01)
