"""The sky as a scene's environment: its dome, its sun, and what it refuses."""

import math
import re

import numpy as np
import pytest
from numba import typeof

import ispm
from ispm.errors import SceneError
from ispm.library.shapes import box
from ispm.optics import records
from ispm.optics.atmosphere import sun_direction, sun_irradiance
from ispm.optics.environment import NO_ENVIRONMENT, environment_radiance, seen_radiance
from ispm.optics.vector import LUMINANCE
from ispm.scene.packed import pack
from ispm.scene.scene import Scene
from ispm.scene.sky import Sky
from ispm.scene.sun import turned


def under(sky):
    scene = Scene()
    scene.add(box((0, 0, 0), (1, 1, 1)))
    scene.environment = sky
    return scene


def seen(packed, direction):
    light = environment_radiance(packed.environment, tuple(np.asarray(direction, np.float32)))
    return float(np.dot(light, LUMINANCE))


@pytest.mark.parametrize("azimuth", [0.0, 0.4, 0.5 * math.pi, 3.0, -1.3])
def test_sun_and_sky_are_bright_on_the_same_side(azimuth):
    packed = pack(under(Sky(0.3, azimuth)))
    towards = sun_direction(0.3, azimuth)
    (sun,) = packed.lights
    assert sun["kind"] == records.LIGHT_DIRECTIONAL
    assert sun["direction"] == pytest.approx(-towards, abs=1e-6)
    assert sun["intensity"] == pytest.approx(sun_irradiance(0.3, 3.0), rel=1e-6)
    around = [
        seen(packed, sun_direction(0.3, azimuth + step)) for step in np.linspace(0.0, 2 * math.pi, 25)[:-1]
    ]
    assert int(np.argmax(around)) == 0
    assert around[1:] == pytest.approx(around[:0:-1], rel=0.05)  # alike on both sides, but for pixels


def test_a_sun_at_the_zenith_shines_straight_down():
    (sun,) = pack(under(Sky(math.pi / 2))).lights
    assert sun["direction"] == pytest.approx((0.0, -1.0, 0.0), abs=1e-6)


def test_there_is_no_sun_below_the_horizon_but_twilight():
    packed = pack(under(Sky(-0.05)))
    assert len(packed.lights) == 0
    assert 1.0 < seen(packed, (0.0, 1.0, 0.0)) < 100.0


def test_the_disc_is_as_bright_as_the_sun_lights():
    for sky in (Sky(0.6), Sky(0.6, sun_radius=0.08, intensity=2.0)):
        surround = pack(under(sky)).surround
        (sun,) = pack(under(sky)).lights
        solid = math.pi * math.sin(surround.disc.radius) ** 2  # times the cosine, over the disc
        assert np.array(surround.disc.radiance) * solid == pytest.approx(sun["intensity"], rel=1e-5)
        assert surround.table.disc[:3] == pytest.approx(sun_direction(0.6, sky.sun_azimuth), abs=1e-6)
    for sky in (Sky(0.6, sun_radius=0.0), Sky(-0.05), Sky(intensity=0.0)):
        surround = pack(under(sky)).surround
        assert surround.disc is None and not len(surround.table.disc)


def test_the_disc_ends_at_its_rim_and_at_the_horizon():
    table = pack(under(Sky(0.01, sun_azimuth=0.0, sun_radius=0.05))).environment

    def shown(up, right):
        d = np.array(
            [math.sin(right), math.sin(0.01 + up), -math.cos(right) * math.cos(0.01 + up)], np.float32
        )
        return seen_radiance(table, tuple(d), True) != seen_radiance(table, tuple(d), False)

    assert shown(0.0, 0.0) and shown(0.0499, 0.0) and shown(0.0, -0.0499) and shown(-0.0099, 0.0)
    assert not (shown(0.0501, 0.0) or shown(0.0, 0.0501) or shown(0.0, -0.0501) or shown(-0.0101, 0.0))


def test_passes_have_the_sun_evenly_all_over_its_disc():
    packed = pack(under(Sky(0.6, sun_radius=0.1)))
    lit, disc = packed.lit, packed.surround.disc
    assert turned(lit, disc, 0) is lit and turned(lit, None, 5) is lit
    suns = np.array([-turned(lit, disc, index).rows[-1]["direction"].astype(float) for index in range(256)])
    assert np.linalg.norm(suns, axis=1) == pytest.approx(1.0, abs=1e-6)
    away = np.linalg.norm(np.cross(suns, disc.direction), axis=1) / math.sin(0.1)
    assert away[0] < 1e-5 and away.max() < 1.0 + 1e-6
    # shares of the disc within circles, of a sequence whose discrepancy is below log(n) / n
    for radius in (0.25, 0.5, 0.75):
        assert (away < radius).mean() == pytest.approx(radius**2, abs=math.log(256) / 256)
    middle = suns.mean(axis=0)
    assert np.cross(middle, disc.direction) == pytest.approx(np.zeros(3), abs=0.1 * math.log(256) / 256)
    assert (lit.still == lit.rows).all() and (turned(lit, disc, 7).still == lit.rows).all()


def test_the_sun_joins_the_scenes_own_lights_and_leaves_the_scene_alone():
    scene = under(Sky())
    scene.add(ispm.PointLight((1.0, 2.0, 3.0)))
    assert len(pack(scene).lights) == 2 and len(scene.lights) == 1
    scene.environment = None
    assert len(pack(scene).lights) == 1


def test_intensity_scales_sun_and_sky():
    one, ten = pack(under(Sky())), pack(under(Sky(intensity=10.0)))
    assert ten.lights["intensity"] == pytest.approx(10.0 * one.lights["intensity"], rel=1e-6)
    assert ten.environment.radiance == pytest.approx(10.0 * one.environment.radiance, rel=1e-6)
    dark = pack(under(Sky(intensity=0.0)))
    assert len(dark.lights) == 0 and not dark.environment.radiance.any()


def test_what_stays_is_kept_and_what_changes_is_packed_anew():
    scene = under(Sky())
    before = pack(scene)
    assert pack(scene, before) is before
    scene.environment = Sky()
    assert pack(scene, before) is before  # another sky, but the same
    for name, value in (("sun_elevation", 0.2), ("sun_azimuth", 1.0), ("turbidity", 5.0), ("intensity", 2.0)):
        setattr(scene.environment, name, value)
        after = pack(scene, before)
        assert after.lights.tobytes() != before.lights.tobytes(), name
        assert after.surround.digest != before.surround.digest, name
        assert after.placed.geometry is before.placed.geometry
        before = after
    scene.environment.ground_albedo = 0.9
    assert seen(pack(scene, before), (0.0, -1.0, 0.0)) == pytest.approx(
        3.0 * seen(before, (0.0, -1.0, 0.0)), rel=0.15
    )
    scene.environment.background = False
    assert not pack(scene, before).surround.background


def test_skies_are_shown_as_the_code_that_makes_them():
    assert repr(Sky(turbidity=4.0)) == "Sky(turbidity=4.0)"
    assert Sky(0.5) == Sky(0.5) != Sky(0.6)
    assert ispm.Sky is Sky


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        (
            "sun_elevation",
            45.0,
            "sky: sun_elevation, in radians, must be a number of -0.10472 to 1.5708, not 45.0",
        ),
        ("sun_azimuth", math.nan, "sky: sun_azimuth, in radians, must be a number"),
        ("turbidity", 0.5, "sky: turbidity must be a number of 1 to 10, not 0.5"),
        ("turbidity", "clear", "sky: turbidity must be a number of 1 to 10, not 'clear'"),
        ("ground_albedo", 1.1, "sky: ground_albedo must be a number of 0 to 1, not 1.1"),
        ("sun_radius", 0.2, "sky: sun_radius, in radians, must be a number of 0 to 0.1, not 0.2"),
        ("intensity", -1.0, "sky: intensity must be a number of 0 to 1e+06, not -1.0"),
    ],
)
def test_what_no_sky_has_is_refused_in_a_line(name, value, says):
    with pytest.raises(SceneError, match="^" + re.escape(says)):
        Sky(**{name: value})
    sky = Sky()
    setattr(sky, name, value)
    with pytest.raises(SceneError, match="^" + re.escape(says)):
        pack(under(sky))


def test_misspelt_names_and_other_things_are_refused():
    with pytest.raises(TypeError, match="a Sky has no 'elevation'; did you mean 'sun_elevation'"):
        Sky(elevation=0.3)
    with pytest.raises(
        SceneError, match=r"environment must be an ispm.Environment, an ispm.Sky or None, not a str"
    ):
        pack(under("sunny"))


def test_kernels_take_a_sky_as_they_take_no_environment():
    """A type of its own would be compiled while users wait: an array that cannot be written is one."""
    table = pack(under(Sky())).environment
    assert typeof(table) == typeof(NO_ENVIRONMENT)
