"""What hands scenes to Mitsuba still does, where Mitsuba is installed (the extra `references`)."""

import numpy as np
import pytest
from references import SMALL, stored
from references.scenes import SCENES, TRACED

from ispm.bench.metrics import compare
from ispm.library.common import add_camera
from ispm.library.shapes import box
from ispm.optics.bsdf import Dielectric, eval_bsdf, surface_bsdf
from ispm.optics.environment import environment_radiance
from ispm.scene.material import Material
from ispm.scene.packed import pack
from ispm.scene.scene import Scene

mi = pytest.importorskip("mitsuba", reason="the extra `references` is not installed")


@pytest.fixture(scope="module")
def to_mitsuba():
    mi.set_variant("scalar_rgb")
    from references.to_mitsuba import to_mitsuba

    return to_mitsuba


@pytest.mark.parametrize("name", ["cornell-box", "mirror-ring"])
def test_direct_light_is_that_of_the_stored_picture(to_mitsuba, name):
    """16 paths a pixel, which differ only in where they meet it."""
    reference = stored(f"{name}-direct")
    scene = to_mitsuba(SCENES[name](), SMALL, {"type": "path", "max_depth": 2})
    picture = np.array(mi.render(scene, spp=16, seed=1))
    assert compare(picture, reference.radiance, reference.masks["whole"]).relmse < 1e-4


def directions(count, seed):
    """Unit, (count, 3) float32."""
    d = np.random.default_rng(seed).normal(size=(count, 3))
    return (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)


@pytest.mark.parametrize("name", ["sky-colonnade", "studio-metals"])
def test_environments_shine_from_where_ours_do(to_mitsuba, name):
    """Both interpolate the same pixels: apart by places in float32, 1e-5 of a row or so, and its slope."""
    scene = TRACED[name]()
    table, shown = pack(scene).environment, to_mitsuba(scene, SMALL, {"type": "path"}).environment()
    for d in directions(300, 4):
        seen = mi.SurfaceInteraction3f()
        seen.wi = -mi.Vector3f(*d.tolist())
        np.testing.assert_allclose(shown.eval(seen), environment_radiance(table, tuple(d)), rtol=1e-3)


@pytest.mark.parametrize(("metallic", "roughness"), [(1.0, 0.2), (1.0, 0.9), (0.0, 0.3), (0.0, 1.0)])
def test_gloss_reflects_as_ours_does(to_mitsuba, metallic, roughness):
    """The same formula in another order: float32 leaves 1e-4 of it at narrow peaks."""
    scene = Scene()
    color = 0.8, 0.4, 0.2
    scene.add(box((0, 0, 0), (1, 1, 1)), material=Material(color, metallic=metallic, roughness=roughness))
    add_camera(scene, (2.0, 2.0, 2.0), (0.0, 0.0, 0.0))
    gloss = to_mitsuba(scene, SMALL, {"type": "path"}).shapes()[0].bsdf()
    f32 = np.float32
    white = Dielectric(f32(0.04), (f32(1), f32(1), f32(1)), f32(1), f32(1.5), False)
    base = tuple(map(f32, color))
    ours = surface_bsdf(base, f32(metallic), f32(roughness), f32(0), white, True)
    up = f32(0), f32(0), f32(1)
    at, context = mi.SurfaceInteraction3f(), mi.BSDFContext()
    for wo, wi in zip(directions(200, 5), directions(200, 6), strict=True):
        wo[2], wi[2] = abs(wo[2]), abs(wi[2])
        at.wi = mi.Vector3f(*wo.tolist())
        expected = np.array(eval_bsdf(ours, up, up, tuple(wo), tuple(wi))) * wi[2]
        np.testing.assert_allclose(gloss.eval(context, at, mi.Vector3f(*wi.tolist())), expected, rtol=2e-4)


def test_what_mitsuba_shows_otherwise_is_refused(to_mitsuba):
    scene = Scene()
    scene.add(box((0, 0, 0), (1, 1, 1)), material=Material((0.5, 0.5, 0.5), roughness=0.0, name="glaze"))
    add_camera(scene, (2.0, 2.0, 2.0), (0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="glaze"):
        to_mitsuba(scene, SMALL, {"type": "path"})
