"""Views of how a frame came about: what they are made of, and that they can be asked for."""

import math

import numpy as np
import pytest

from ispm.errors import SettingsError
from ispm.library.builtin import builtin
from ispm.optics.records import PHOTON, RECEIVER
from ispm.photons.first_hits import first_hits
from ispm.photons.grid import PhotonGrid
from ispm.renderer.charts import overdraw_chart
from ispm.renderer.last import LastFrame, texels_as_photons
from ispm.renderer.renderer import Renderer
from ispm.renderer.views import _ambient
from ispm.settings import RENDERER_VIEWS, VIEWS, Settings

SIZE = (160, 90)


@pytest.fixture(scope="module")
def sphere(gpu):
    scene = builtin("integrating-sphere", radius=2.0, albedo=0.6, flux=100.0)
    with Renderer(scene, Settings(size=SIZE, photons=5000, bounces=2, emission="map"), gpu=gpu) as renderer:
        renderer.render()
        yield renderer


def test_renderer_makes_every_view(sphere):
    for name in VIEWS:
        picture = sphere.view(name)
        assert picture.dtype == np.uint8 and picture.shape[2] == 3
        if name != "bounce-map":
            assert picture.shape[:2] == (SIZE[1], SIZE[0]), name


def test_frame_says_which_views_need_the_renderer(sphere):
    frame = sphere.render()
    for name in RENDERER_VIEWS:
        with pytest.raises(SettingsError, match=rf"ask renderer\.view\('{name}'\)"):
            frame.view(name)


def test_ambient_term_has_the_mean_of_the_indirect_light():
    random = np.random.default_rng(0)
    layers = {k: random.random((7, 9, 3), np.float32) for k in ("direct", "indirect", "albedo", "emission")}
    term = _ambient(layers) - layers["direct"] - layers["emission"]
    assert term.mean(axis=(0, 1)) == pytest.approx(layers["indirect"].mean(axis=(0, 1)), rel=1e-5)
    ratio = term / layers["albedo"]  # one number per channel
    assert np.ptp(ratio, axis=(0, 1)).max() < 1e-3


def test_bounce_maps_hold_what_leaves_the_first_hits(sphere):
    """In the integrating sphere: points at its radius, normals inwards, albedo times the light's flux."""
    last = sphere._last
    assert isinstance(last, LastFrame)
    (emitted,) = texels_as_photons(last.traced)
    assert emitted["flux"].sum(axis=0, dtype=float) == pytest.approx([100.0] * 3, rel=1e-5)
    found = first_hits(last.made.packed, last.made.surfaces, emitted, seed=0, pass_index=0).astype(float)
    position, n, flux, wi = (found[:, k : k + 3] for k in (0, 3, 6, 9))
    # 32 cuts along an icosahedron's edge: chords sag by less than 0.1 % of the radius
    assert np.linalg.norm(position, axis=1) == pytest.approx(2.0, rel=1e-3)
    assert np.einsum("ij,ij->i", n, position) == pytest.approx(-2.0, rel=1e-3)
    # of Lambert every photon goes on; interpolated normals change each by the angle they are off, < 1 degree
    assert flux.sum(axis=0) == pytest.approx([60.0] * 3, rel=2e-3)
    assert np.linalg.norm(wi, axis=1) == pytest.approx(1.0, abs=1e-5)
    cosines = np.einsum("ij,ij->i", wi, n)
    assert cosines.min() > 0.0
    # by the cosine law their mean is 2/3, each with a deviation of sqrt(1/18)
    assert cosines.mean() == pytest.approx(2 / 3, abs=4 * math.sqrt(1 / 18 / len(cosines)))


@pytest.mark.parametrize(
    ("change", "why"), [({"emission": "rays"}, "as rays"), ({"bounces": 0}, "bounces is 0")]
)
def test_bounce_map_says_why_there_is_none(gpu, change, why):
    settings = Settings(size=(32, 18), photons=100, **change)
    with (
        Renderer(builtin("cornell-box"), settings, gpu=gpu) as renderer,
        pytest.raises(SettingsError, match=why),
    ):
        renderer.view("bounce-map")


def test_kernels_are_counted_as_brute_force_counts_them():
    random = np.random.default_rng(1)
    photons, points = np.zeros(300, PHOTON), np.zeros(200, RECEIVER)
    photons["position"], points["position"] = random.random((300, 3)), random.random((200, 3))
    normal = random.normal(size=(300, 3))
    photons["normal"] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    photons["radius"] = random.uniform(0.05, 0.4, 300)
    photons["height"] = 0.25 * photons["radius"]
    points["valid"] = random.random(200) < 0.9
    offset = points["position"][:, None] - photons["position"]
    z = np.einsum("nmi,mi->nm", offset, photons["normal"])
    across = (offset**2).sum(axis=2) - z**2
    inside = across / photons["radius"] ** 2 + z**2 / photons["height"] ** 2 < 1
    expected = (inside & (points["valid"] > 0)[:, None]).sum(axis=1)
    assert expected.max() > 5
    for threads in (1, 3):
        assert np.abs(PhotonGrid(photons).count(points, threads) - expected).sum() <= 1  # rounding at a rim


def test_statistics_tell_the_overdraw(gpu):
    settings = Settings(size=SIZE, photons=5000, bounces=3)
    with Renderer(builtin("cornell-box"), settings, gpu=gpu) as renderer:
        told = renderer.render().stats.overdraw
        last = renderer._last
        assert last is not None
        counted = PhotonGrid(last.photons).count(last.receivers.points, 2).mean()
    # the statistic counts hidden kernels too, and discs whole that the picture's edge cuts
    assert 0.5 * counted < told < 2.5 * counted


def test_overdraw_chart_is_brightest_where_kernels_are_most():
    counts = np.zeros((20, 40), int)
    counts[:, 20:] = 80
    picture = overdraw_chart(counts, (160, 80)).astype(int).sum(axis=2)
    assert picture.shape == (80, 160)
    assert (picture[:30, 80:] > 400).all() and (picture[:30, :80] < 20).all()
