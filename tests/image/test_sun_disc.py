"""The sun of a sky as it is seen, and the edges of its shadows, beside closed forms."""

import math

import numpy as np
import pytest

from ispm import Camera, Material, Renderer, Scene, Settings, Sky, shapes
from ispm.library.common import lambert
from ispm.library.shapes import box
from ispm.stages.camera import CameraView

SIZE = 160, 120


def shown(scene, camera, gpu, passes, **settings):
    """Radiance, (h, w, 3), of so many passes."""
    with Renderer(scene, Settings(size=SIZE, antialias=False, **settings), camera, gpu=gpu) as renderer:
        *_, frame = renderer.converge(passes)
    return frame.radiance.astype(float)


@pytest.mark.parametrize("by", ["itself", "mirror", "coat", "rough"])
def test_all_of_the_sun_is_seen_where_it_is_once(gpu, by):
    """A view of 1.7 degrees of the disc itself, or in a plane. Summed over pixels it brings its irradiance,
    times what the surface reflects: all, Fresnel's share by Schlick, or of roughness .2 what of the
    highlight is in the view, without a disc on top. At its rim are 120 pixels of 1,084, which leave .3 %
    of it to chance in one pass."""
    sky = Sky(sun_elevation=0.8, sun_azimuth=0.0)
    sun = np.array(sky.disc().direction)
    mirrored = sun * (1.0, -1.0, 1.0)
    materials = {
        "mirror": Material((1.0,) * 3, metallic=1.0, roughness=0.0),
        "coat": Material((0.0,) * 3, specular=0.0, clearcoat=1.0, clearcoat_roughness=0.0),
        "rough": Material((1.0,) * 3, metallic=1.0, roughness=0.2),
    }
    scene = Scene(environment=sky)
    camera = Camera.look_at((0.0, 1.0, 0.0), (sun[0], sun[1] + 1.0, sun[2]), yfov=0.03)
    below = shapes.plane(4.0, 4.0)
    if by in materials:
        camera = Camera.look_at(tuple(-3.0 * mirrored), (0.0, 0.0, 0.0), yfov=0.03)
    scene.add(below, material=materials.get(by, lambert((0.5,) * 3)))
    light = shown(scene, camera, gpu, 8, bounces=0)
    above = light - np.median(light, axis=(0, 1))
    solid = above.sum(axis=(0, 1)) * (0.03 / SIZE[1]) ** 2
    cosine = math.sin(0.8)
    expected = {"itself": 1.0, "mirror": 1.0, "coat": 0.04 + 0.96 * (1.0 - cosine) ** 5}
    irradiance = np.array(sky.disc().radiance) * math.pi * math.sin(sky.disc().radius) ** 2
    if by == "rough":
        assert light.max() < 0.5 * max(sky.disc().radiance) and (solid < 0.5 * irradiance).all()
    else:
        assert solid / irradiance == pytest.approx(np.full(3, expected[by]), rel=0.005)


def test_a_shadows_edge_is_the_share_of_the_disc_that_is_seen(gpu):
    """2 m below a blade's edge, the sun at the zenith and 11.5 degrees wide. Pass 0 has the shadow of a
    point; of 64 passes parts of the disc have their share to 3, as their sequence fills discs."""
    sky = Sky(sun_elevation=math.pi / 2.0, sun_radius=0.1)
    camera = Camera.look_at((0.0, 1.0, 0.0), (0.0, 0.0, 1e-4), yfov=0.6)

    def lit(environment, passes):
        scene = Scene(environment=environment)
        scene.add(shapes.plane(20.0, 20.0), material=lambert((0.5,) * 3))
        scene.add(box((-9.0, 2.0, -9.0), (0.0, 2.01, 9.0)), material=lambert((0.0,) * 3))
        return shown(scene, camera, gpu, passes, bounces=0)[..., 1]

    view = CameraView(SIZE, camera.pose, camera.yfov)
    y, x = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
    origins, directions = view.rays_through(x.ravel(), y.ravel())
    at = (origins - directions * (origins[:, 1:2] / directions[:, 1:2]))[:, 0].reshape(SIZE[1], SIZE[0])
    across = np.clip(at / (2.0 * math.tan(0.1)), -1.0, 1.0)
    expected = 0.5 + (np.arcsin(across) + across * np.sqrt(1.0 - across**2)) / math.pi
    dome = lit(sky.dome(), 32)
    irradiance = sky.disc().radiance[1] * math.pi * math.sin(0.1) ** 2
    sharp, soft = ((lit(sky, n) - dome) / (0.5 / math.pi * irradiance) for n in (1, 64))
    near = np.abs(across) < 0.98
    assert near.mean() > 0.2 and (np.abs(across) > 0.99).mean() > 0.2
    away = np.abs(at) > 0.02
    assert np.abs(sharp - (at > 0.0))[away].max() < 0.1
    assert np.abs(soft - expected).max() < 0.06
    assert np.abs(soft - expected)[near].mean() < 0.02
