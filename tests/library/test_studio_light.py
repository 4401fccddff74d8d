"""The studio that lights what has no light."""

import math

import numpy as np
import pytest

from ispm.library.studio_light import FRONT, studio_radiance

HEIGHT = 128


def irradiance(image, normal):
    """lx on a surface with a normal, of any length."""
    theta = math.pi * (np.arange(HEIGHT) + 0.5) / HEIGHT
    phi = math.pi * ((np.arange(2 * HEIGHT) + 0.5) / HEIGHT - 1.0)
    sine = np.sin(theta)
    x, z = np.outer(sine, np.sin(phi)), -np.outer(sine, np.cos(phi))
    y = np.broadcast_to(np.cos(theta)[:, None], x.shape)
    cosine = np.maximum(np.stack([x, y, z], axis=-1) @ (np.asarray(normal) / np.linalg.norm(normal)), 0.0)
    return float((image[..., 0] * cosine * sine[:, None]).sum() * (math.pi / HEIGHT) ** 2)


def test_the_studio_is_neutral_and_of_plausible_light():
    image = studio_radiance()
    assert image.shape == (HEIGHT, 2 * HEIGHT, 3) and image.dtype == np.float32
    assert (image == image[..., :1]).all() and np.isfinite(image).all()
    assert image.min() > 50.0 and image.max() < 5_000.0
    assert irradiance(image, (0.0, 1.0, 0.0)) == pytest.approx(3_000.0, rel=0.02)


def test_key_fill_and_floor_make_form_readable():
    """Ratios in stops that portrait and product photographers use: key to fill one to two, no side black."""
    image = studio_radiance()
    front = np.array([math.sin(FRONT), 0.0, -math.cos(FRONT)])
    right = np.array([math.sin(FRONT - math.pi / 2), 0.0, -math.cos(FRONT - math.pi / 2)])
    up = np.array([0.0, 1.0, 0.0])
    key, fill = irradiance(image, front - right + up), irradiance(image, front + right)
    assert 1.0 < math.log2(key / fill) < 2.0
    assert irradiance(image, front - right) > 1.2 * irradiance(image, front + right)
    least = min(irradiance(image, side) for side in (front, right, -right, -front))
    assert least > 0.25 * key and 0.05 * key < irradiance(image, -up) < 0.2 * key


def test_its_edges_are_soft_and_it_has_no_seam():
    luminance = studio_radiance()[..., 0]
    across = np.abs(np.diff(np.concatenate([luminance, luminance[:, :1]], axis=1), axis=1))
    down = np.abs(np.diff(luminance, axis=0))
    assert down.max() < 0.6 * luminance.max()
    # near the zenith pixels are narrow, so that columns there differ least
    assert across.max() < 0.6 * luminance.max()
    assert across[:, -1].max() <= across.max()
    assert luminance[0].max() < 1.02 * luminance[0].min() and luminance[-1].max() < 1.02 * luminance[-1].min()


def test_the_front_is_where_the_default_camera_stands():
    from ispm.framing.camera import _FROM

    assert math.sin(FRONT) * _FROM[2] == pytest.approx(-math.cos(FRONT) * _FROM[0])
