"""Edges supersampled: the share of a pixel that each surface covers, and nothing else changed."""

import numpy as np
import pytest
from transport import render

from ispm.errors import SettingsError
from ispm.library.shapes import polygons
from ispm.scene.camera import Camera
from ispm.scene.material import Material
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Scene

SIZE = (64, 36)


def flat(corners, color):
    """A polygon that shines by itself, so that radiance is its color wherever it is seen."""
    return polygons([np.array(corners, float)]), Material(unlit=True, base_color=color, double_sided=True)


def half_plane(slope):
    """White left of a line through the picture's middle, black right of it; seen straight on."""
    top, bottom = slope, -slope
    return flat([(-9, -1, 0), (bottom, -1, 0), (top, 1, 0), (-9, 1, 0)], (1.0, 1.0, 1.0, 1.0))


def picture(gpu, *parts, **settings):
    scene = Scene()
    for mesh, material in parts:
        scene.add(mesh, material=material)
    camera = Camera(ymag=0.5, pose=np.eye(4) + np.array([[0] * 4, [0] * 4, [0, 0, 0, 1], [0] * 4]))
    return render(gpu, scene, camera, size=SIZE, bounces=0, **settings)[0]


@pytest.mark.parametrize("slope", [0.0, 0.1, 0.35, 0.9])
def test_an_edge_is_as_bright_as_the_share_it_covers(gpu, slope):
    frame = picture(gpu, half_plane(slope))
    x = (np.arange(SIZE[0] * 16) + 0.5) / 16 - SIZE[0] / 2
    y = SIZE[1] / 2 - (np.arange(SIZE[1] * 16) + 0.5) / 16
    covered = (x[None] < slope * y[:, None]).reshape(SIZE[1], 16, SIZE[0], 16).mean(axis=(1, 3))
    error = frame.radiance[..., 0] - covered
    # four samples tell shares a quarter apart; a straight edge crosses them evenly
    assert np.abs(error).max() <= 0.25 + 1 / 16
    assert abs(error.sum()) < 0.02 * SIZE[1]
    assert frame["alpha"] == pytest.approx(frame.radiance[..., 0], abs=1e-6)


def test_pixels_within_surfaces_stay_as_they_are(gpu):
    smooth, sharp = (picture(gpu, half_plane(0.35), antialias=on) for on in (True, False))
    x = np.arange(SIZE[0]) + 0.5 - SIZE[0] / 2
    y = SIZE[1] / 2 - np.arange(SIZE[1]) - 0.5
    away = np.abs(x[None] - 0.35 * y[:, None]) > 1.5
    assert (smooth.radiance[away] == sharp.radiance[away]).all()
    assert set(np.unique(sharp.radiance)) == {0.0, 1.0}


def test_materials_that_meet_in_one_plane_mix_at_their_border(gpu):
    left = half_plane(0.35)
    right = flat([(-0.35, -1, 0), (9, -1, 0), (9, 1, 0), (0.35, 1, 0)], (0.0, 0.5, 0.0, 1.0))
    frame = picture(gpu, left, right)
    white = frame.radiance[..., 0]
    assert frame.radiance[..., 1] == pytest.approx(white + 0.5 * (1.0 - white), abs=1e-3)
    assert ((white > 0.0) & (white < 1.0)).sum() > SIZE[1] // 2


@pytest.mark.parametrize("side", [1, -1])
def test_a_face_does_not_cover_the_side_that_leads_away_from_it(gpu, side):
    # one mesh, so that depth alone tells the two; the side is 1.6 pixels wide and 6 m deep
    edge, wide = (2.0 + 0.44) / SIZE[1], 1.6 / SIZE[1]
    corners = [(edge, 0.0), (9.0, 0.0), (edge - wide, -6.0), (edge, 0.0)]
    position = np.array([(side * x, y, z) for x, z in corners for y in (-1, 1)])
    color = np.repeat([(1, 1, 1, 1), (0, 0, 0, 1)], 4, axis=0)
    triangles = np.array([(0, 2, 3), (0, 3, 1), (4, 6, 7), (4, 7, 5)])
    mesh = Mesh(position, triangles, colors=color.astype(np.float32))
    frame = picture(gpu, (mesh, Material(unlit=True, double_sided=True)))
    column = SIZE[0] // 2 + (2 if side > 0 else -3)
    white = frame.radiance[4:-4, column + np.array([-side, 0, side]), 0]
    assert white == pytest.approx(np.tile([0.0, 0.5, 1.0], (len(white), 1)))


def test_a_transparent_background_shows_in_the_picture_s_alpha(gpu):
    frame = picture(gpu, half_plane(0.35), background="transparent")
    assert frame.image.shape == (SIZE[1], SIZE[0], 4)
    assert (frame.image[..., 3] == np.rint(frame["alpha"] * 255)).all()


def test_a_colored_background_fills_what_nothing_covers(gpu):
    frame = picture(gpu, half_plane(0.35), background=(0.0, 0.0, 2.0))
    assert frame.radiance[..., 2] == pytest.approx(frame["alpha"] + 2.0 * (1.0 - frame["alpha"]), abs=1e-6)
    with pytest.raises(SettingsError):
        picture(gpu, half_plane(0.0), background="gren")
