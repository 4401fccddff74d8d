"""What tests of surfaces share: records, photons that scatter often, floors, and a ball beside slow paths."""

import math

import numpy as np
from transport import Tracer, render

from ispm.library.common import lambert
from ispm.library.shapes import icosphere, polygons
from ispm.optics.jit import jit
from ispm.optics.rng import random4
from ispm.photons.scatter import scatter
from ispm.reference.paths import path_light
from ispm.scene.camera import Camera
from ispm.scene.light import PointLight, RectLight
from ispm.scene.scene import Scene
from ispm.stages.camera import CameraView

f32, u32 = np.float32, np.uint32
_SEEDS, _PARTS = 6, 8


def made(value):
    """What a kernel returned, numbers, vectors and records of Python's floats, as kernels take it."""
    if not isinstance(value, tuple):
        return f32(value)
    parts = [made(part) for part in value]
    return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)


@jit
def scatter_often(x, wo, weights):
    """Write what a photon of flux 1 that comes from wo is worth after a SurfacePoint, (n, 3), 0: absorbed."""
    one = f32(1), f32(1), f32(1)
    d = -wo[0], -wo[1], -wo[2]
    for k in range(len(weights)):
        u0, u1, u2, _ = random4(u32(k), u32(0), u32(0), u32(5))
        alive, _, flux, _, _ = scatter(x, d, one, u0, u1, u2)
        for c in range(3):
            weights[k, c] = flux[c] if alive else f32(0)


def floor(material, uv=None):
    """A square of 20 m at y = 0; uv: texture coordinates of its corners, or of all."""
    scene = Scene()
    mesh = polygons([np.array([(-10, 0, -10), (-10, 0, 10), (10, 0, 10), (10, 0, -10)], float)], "floor")
    if uv is not None:
        mesh.uv0 = np.broadcast_to(np.asarray(uv, f32), (len(mesh.positions), 2)).copy()
    scene.add(mesh, material=material, name="floor")
    return scene


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def places_seen(eye, size, yfov):
    """Points of the floor that pixels show, (n, 3)."""
    width, height = size
    x, y = np.meshgrid((np.arange(width) + 0.5) / width * 2 - 1, 1 - (np.arange(height) + 0.5) / height * 2)
    tangent, back = math.tan(yfov / 2), unit(np.array(eye))
    right = np.array([1.0, 0.0, 0.0])
    d = (
        (x * width / height * tangent)[..., None] * right
        + (y * tangent)[..., None] * np.cross(back, right)
        - back
    )
    d = d.reshape(-1, 3)
    return np.array(eye) - d * (eye[1] / d[:, 1:2])


def lit_floor(gpu, scene, place):
    """A picture of a floor that a point of 50 cd at `place`, m, lights; of its pixels the places, m, wo and
    wi there, and the irradiance, lx."""
    eye = (0.0, 1.0, 3.0)
    scene.add(PointLight((50.0,) * 3), translation=place)
    camera = Camera.look_at(eye, (0, 0, 0), yfov=0.6)
    frame, _ = render(gpu, scene, camera, size=(64, 36), antialias=False)
    places = places_seen(eye, (64, 36), 0.6)
    to_light = np.array(place) - places
    wo, wi = unit(np.array(eye) - places), unit(to_light)
    return frame, places, wo, wi, wi[:, 1] * 50.0 / (to_light**2).sum(axis=1)


def boxed_ball(material):
    """A ball of a material in an open box under a lamp."""
    scene = Scene()
    for corners, color in (
        ([(-2, 0, -2), (-2, 0, 2), (2, 0, 2), (2, 0, -2)], (0.7,) * 3),
        ([(-2, 0, -2), (2, 0, -2), (2, 3, -2), (-2, 3, -2)], (0.7, 0.4, 0.3)),
        ([(-2, 0, 2), (-2, 0, -2), (-2, 3, -2), (-2, 3, 2)], (0.3, 0.7, 0.4)),
    ):
        scene.add(polygons([np.array(corners, float)], "wall"), material=lambert(color))
    scene.add(icosphere(0.7, 24, "ball"), material=material, translation=(0.0, 0.7, 0.0), name="ball")
    scene.add(RectLight((60.0,) * 3, 1.0, 1.0), translation=(0.5, 2.9, 0.5), rotation=(-0.7071, 0, 0, 0.7071))
    return scene


def assert_as_bright_as_paths(gpu, material, samples):
    """Six pictures: the ball's mean is within 2 % and 3.5 standard errors of that of slow paths.

    samples  paths of each pixel
    """
    scene, size = boxed_ball(material), (64, 48)
    camera = Camera.look_at((0, 1.2, 4.5), (0, 0.7, 0), yfov=0.4)
    frames = [render(gpu, scene, camera, size=size, antialias=False, seed=s)[0] for s in range(_SEEDS)]
    shown = frames[0].instance == np.bincount(frames[0].instance[20:28, 28:36].ravel()).argmax()
    ours, our_error = _mean([frame.radiance[shown].mean(axis=0) for frame in frames])
    tracer, view = Tracer(scene), CameraView(size, camera.pose, camera.yfov, None)
    rays = [np.ascontiguousarray(each[shown]) for each in view.rays()]
    step = samples // _PARTS
    parts = [range(first, first + step) for first in range(0, samples, step)]
    paths = (path_light(tracer.tables, *rays, samples=part, bounces=32, threads=2) for part in parts)
    truth, error = _mean([each.mean(axis=0) for each in paths])
    assert (error < 0.01 * truth).all()
    assert (np.abs(ours - truth) < 0.02 * truth + 3.5 * np.hypot(error, our_error)).all()


def _mean(values):
    """Mean and standard error of RGB values."""
    return np.mean(values, axis=0), np.std(values, axis=0, ddof=1) / math.sqrt(len(values))
