"""What holds for every scene: no light from nowhere, none lost, and no unit of length."""

from dataclasses import replace

import numpy as np
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from ispm.library.shapes import box, icosphere, polygons
from ispm.renderer import Renderer
from ispm.scene.camera import Camera
from ispm.scene.light import DirectionalLight, PointLight, SpotLight
from ispm.scene.material import Material
from ispm.scene.scene import Node, Scene
from ispm.settings import Settings

SETTINGS = Settings(size=(48, 27), photons=600)
TRIANGLE = np.array([(-1, 0, 1), (1, 0, 1), (0, 0, -1)], float)
SHAPES = [box((-1, -1, -1), (1, 1, 1)), icosphere(1.0, 3), polygons([TRIANGLE])]
NEVER_SLOW = settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))

share = st.floats(0, 1, width=32)
place = st.tuples(*[st.floats(-2, 2, width=32)] * 3)
turn = st.tuples(*[st.floats(-1, 1, width=32)] * 4).map(
    lambda q: tuple(np.array(q) / np.linalg.norm(q)) if np.linalg.norm(q) > 0.1 else (0, 0, 0, 1)
)
material = st.builds(
    Material, base_color=st.tuples(share, share, share), metallic=share, roughness=share,
    transmission=st.sampled_from([0.0, 0.0, 1.0]), thickness=st.sampled_from([0.0, 0.1]),
    ior=st.floats(1, 2.5, width=32),
)  # fmt: skip
light = st.one_of(
    st.just(PointLight((5.0, 4.0, 3.0))),
    st.builds(SpotLight, st.just((5.0, 4.0, 3.0)), outer_angle=st.floats(0.05, 1.5)),
    st.just(DirectionalLight((1.0, 2.0, 3.0))),
)
things = st.lists(st.tuples(st.sampled_from(SHAPES), place, turn, st.floats(0.05, 2), material), max_size=4)
lamps = st.lists(st.tuples(light, place, turn), min_size=1, max_size=3)


def picture(gpu, things, lamps, scale=1.0):
    """A floor with things and lights, `scale` times as large and lit so that it looks the same."""
    whole = Node("scaled", scale=(scale,) * 3)
    scene = Scene([whole])
    scene.add(SHAPES[0], translation=(0, -4, 0), scale=(3, 1, 3), parent=whole)
    for shape, at, turned, size, material in things:
        scene.add(shape, material=material, translation=at, rotation=turned, scale=(size,) * 3, parent=whole)
    for lamp, at, turned in lamps:
        if not isinstance(lamp, DirectionalLight):  # what comes to a surface falls with the distance
            lamp = replace(lamp, intensity=tuple(scale * scale * v for v in lamp.intensity))
        scene.add(lamp, translation=at, rotation=turned, parent=whole)
    eye = Camera.look_at((scale * 3.0, scale * 2.0, scale * 7.0), (0.0, -scale, 0.0))
    with Renderer(scene, SETTINGS, eye, gpu=gpu) as renderer:
        return renderer.render()


@NEVER_SLOW
@given(things, lamps)
def test_light_is_finite_and_balanced(gpu, things, lamps):
    frame = picture(gpu, things, lamps)
    for layer in ("full", "direct", "indirect", "emission", "irradiance"):
        assert np.isfinite(frame[layer]).all() and (frame[layer] >= 0.0).all(), layer
    stats = frame.stats
    spent = stats.flux_absorbed + stats.flux_escaped + stats.flux_dropped
    # float64 sums of float32 flux
    assert abs(stats.flux_emitted - spent) <= 1e-5 * max(stats.flux_emitted, 1e-30)


HERE = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))  # where a thing or a lamp stands, and how it is turned
BLACK = Material(base_color=(0.0, 0.0, 0.0), ior=1.0)
LAMP_WITHIN = (
    (0.0, 0.0, 0.0),
    (-0.6362198406966095, -0.7223767609257714, 0.2709172005952589, 0.0),
)  # a lamp turned so that a photon flees


TURNED = (0.12216573258555158, -0.6164367679874755, -0.37294466430275736, 0.6826371819810979)
CLEAR = Material(base_color=(0.0, 0.0, 0.0), roughness=0.0, ior=1.0)
BALL = (SHAPES[1], (0.2344522, 0.3290670, 0.5150606), (0.0, 0.7831772606120806, 0.0, 0.6217985031022165))
LAMPS = [(DirectionalLight((1.0, 2.0, 3.0)), *HERE), (PointLight((5.0, 4.0, 3.0)), *HERE)]


@NEVER_SLOW
@example(
    [(SHAPES[0], (0.0, -2.0, 0.0), TURNED, 0.6249092949385463, CLEAR), (SHAPES[0], *HERE, 1.27, CLEAR)],
    LAMPS,
    2.0**7,
)
@example([(*BALL, 1.2724130973973986, CLEAR)], LAMPS, 2.0**7)
@example([(SHAPES[0], *HERE, 1.0, BLACK)], [(PointLight((5.0, 4.0, 3.0)), *LAMP_WITHIN)], 2.0**-3)
@given(things, lamps, st.sampled_from([2.0**-10, 2.0**-3, 2.0**7]))
def test_size_makes_no_difference(gpu, things, lamps, scale):
    """A power of 2 leaves every mantissa as it is, so that pictures differ by what is not a share of the
    scene's size; there is nothing such but guards against division by zero."""
    small, large = picture(gpu, things, lamps), picture(gpu, things, lamps, scale)
    assert small.stats.stored_photons == large.stats.stored_photons
    np.testing.assert_allclose(large.radiance, small.radiance, rtol=1e-4, atol=1e-5)
