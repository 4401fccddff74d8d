"""Anisotropic reflection in pictures: the formula under a lamp, quadrature under a sky, and slow paths."""

import math

import numpy as np
import pytest
from layered import assert_as_bright_as_paths, floor, lit_floor, unit
from transport import render

from ispm.scene.camera import Camera
from ispm.scene.environment import Environment
from ispm.scene.material import Material, Texture

f32 = np.float32
CORNERS = [(0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0)]  # of the floor's: u goes along +X, v along +Z


def lobe(widths, wo, wi):
    """D V of the extension's appendix, float64: directions (n, 3) of frames (tangent, bitangent, normal)."""
    at, ab = widths
    h = unit(wo + wi)
    a2 = at * ab
    w2 = a2 / ((np.array([ab, at, a2]) * h) ** 2).sum(axis=-1)
    scaled = np.array([at, ab, 1.0])
    masked = wi[..., 2] * np.linalg.norm(scaled * wo, axis=-1)
    shadowed = wo[..., 2] * np.linalg.norm(scaled * wi, axis=-1)
    return a2 * w2 * w2 / math.pi * 0.5 / (masked + shadowed)


def in_frame(d, angle):
    """World directions above the floor, (n, 3), in the frame whose tangent is turned from +X by an angle
    counterclockwise, as seen from above."""
    c, s = math.cos(angle), math.sin(angle)
    along, across = np.array([c, 0.0, -s]), np.array([-s, 0.0, -c])
    return np.stack([d @ along, d @ across, d[..., 1]], axis=-1)


@pytest.mark.parametrize("mapped", [False, True])
@pytest.mark.parametrize("angle", [0.0, 0.7, math.pi / 2])
def test_a_picture_of_a_brushed_floor_is_the_formula(gpu, angle, mapped):
    """Direct light of metal, by factors or by a texture that stands for them; 1 % of the brightest, which
    pixels' halves and normals round."""
    roughness, strength, color = 0.4, 0.7, np.array([0.9, 0.7, 0.5])
    alpha = roughness**2
    widths = alpha + (1.0 - alpha) * strength**2, alpha
    look = dict(anisotropy=strength, anisotropy_rotation=angle)
    if mapped:  # a quarter turn and the rest; a texel's middle is 0.5 / 255 off, and so the turn by 0.004
        texel = Texture(np.full((1, 1, 3), (128, 255, 179), np.uint8), srgb=False)
        look = dict(anisotropy=1.0, anisotropy_rotation=angle - math.pi / 2, anisotropy_texture=texel)
    scene = floor(Material(tuple(color), metallic=1.0, roughness=roughness, **look), CORNERS)
    frame, places, wo, wi, irradiance = lit_floor(gpu, scene, (0.5, 1.0, -0.5))
    fc = (1.0 - (wo * unit(wo + wi)).sum(axis=1)) ** 5
    reflectance = color + (1.0 - color) * fc[:, None]
    f = lobe(widths, in_frame(wo, angle), in_frame(wi, angle))
    expected = reflectance * (f * irradiance)[:, None]
    near = np.abs(places).max(axis=1) < 9.0  # on the floor
    found = frame.direct.reshape(-1, 3)[near]
    np.testing.assert_allclose(found, expected[near], rtol=2e-3, atol=1e-2 * expected.max())
    other = lobe(widths[::-1], in_frame(wo, angle), in_frame(wi, angle)) * irradiance
    assert np.abs(other[near] - (f * irradiance)[near]).max() > 0.2 * expected.max()


@pytest.mark.parametrize("angle", [0.0, math.pi / 2])
def test_brushed_metal_under_an_even_sky_shows_its_albedo(gpu, angle):
    """White metal, seen from afar at 25 degrees above it: by quadrature of the formula; 4 standard errors,
    and 1 % for the average over pixels, of whose paths some lead below the surface."""
    widths, height = (0.8, 0.16), math.radians(25.0)
    strength = math.sqrt((widths[0] - widths[1]) / (1.0 - widths[1]))
    look = dict(metallic=1.0, roughness=0.4, anisotropy=strength, anisotropy_rotation=angle)
    scene = floor(Material((1.0,) * 3, **look), CORNERS)
    scene.environment = Environment(np.ones((4, 8, 3), f32))
    wo = np.array([0.0, math.sin(height), math.cos(height)])
    camera = Camera.look_at(tuple(200.0 * wo), (0, 0, 0), yfov=0.02)
    frame, _ = render(gpu, scene, camera, size=(48, 48), antialias=False)
    assert np.isfinite(frame.depth).all()
    rows, columns = 800, 1600
    z, phi = np.meshgrid(
        (np.arange(rows) + 0.5) / rows, 2 * math.pi * (np.arange(columns) + 0.5) / columns, indexing="ij"
    )
    r = np.sqrt(1.0 - z * z)
    wi = np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)
    albedo = (lobe(widths, in_frame(wo, angle), wi) * z).mean() * 2 * math.pi
    blocks = frame.radiance[..., 0].reshape(6, 8, 6, 8).mean(axis=(1, 3), dtype=float)  # pixels share paths
    error = blocks.std(ddof=1) / 6.0
    assert blocks.mean() == pytest.approx(albedo, abs=4.0 * error + 0.01 * albedo)
    assert error < 0.01


@pytest.mark.parametrize(
    "look",
    [
        dict(base_color=(0.9, 0.6, 0.3), metallic=1.0, roughness=0.3, anisotropy=0.8),
        dict(base_color=(0.3, 0.1, 0.1), roughness=0.4, anisotropy=0.7, anisotropy_rotation=1.2),
        dict(base_color=(0.8,) * 3, metallic=1.0, roughness=0.6, anisotropy=0.6, clearcoat=1.0),
    ],
    ids=["metal", "plastic", "coated"],
)
def test_an_anisotropic_ball_is_as_bright_as_paths_find_it(gpu, look):
    assert_as_bright_as_paths(gpu, Material(**look), samples=512)
