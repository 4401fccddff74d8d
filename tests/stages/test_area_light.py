"""Direct light of skies as metals reflect it: the first pass is as smooth as those that follow."""

import numpy as np
import pytest

from ispm import Camera, Environment, Material, RectLight, Renderer, Settings, Texture, shapes
from ispm.scene.scene import Scene


def test_the_first_pass_of_metal_is_filtered_as_others_are(gpu):
    """Metal has no Lambert lobe whose light without shadows would be known: passes 1 and 2 are means of draws
    over the same squares, with errors alike against the mean of 64 more passes. 1,500 pixels are some 60
    squares of 5 x 5, by which each root mean square is known to 1 / sqrt(2 * 60) = 9 %; the bound lies four
    standard deviations of their ratio above 1. A pixel's own draw had four times the error."""
    scene = Scene(environment=Environment(np.random.default_rng(2).random((8, 16, 3)) ** 4))
    scene.add(shapes.plane(20.0, 20.0), material=Material(metallic=1.0, roughness=1.0))
    camera = Camera.look_at((0.0, 3.0, 0.0), (0.0, 0.0, -0.1), yfov=0.6)
    settings = Settings(size=(48, 32), bounces=0, antialias=False)
    with Renderer(scene, settings, camera, gpu=gpu) as renderer:
        means = [frame.direct.astype(float) for frame in renderer.converge(66)]
    first, second = means[0], 2.0 * means[1] - means[0]
    truth = (66.0 * means[65] - 2.0 * means[1]) / 64.0
    errors = [np.sqrt(((each - truth) ** 2).mean()) for each in (first, second)]
    assert errors[0] < 1.5 * errors[1]


STRIPES = np.array([[1.0, 1.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


@pytest.mark.parametrize("roughness", [1.0, 0.6])
@pytest.mark.parametrize("lit_by", ["lamp", "sky"])
def test_white_beside_saturated_colors_stays_white(gpu, lit_by, roughness):
    """Stripes of white, red and black, each five pixels wide, that nothing shades: white is as on a white
    floor, whose draws are the same. What passes is a ratio of means over neighbors, of which those that
    reflect nothing in a channel tell as much as others; the rest are roundings of textures, 1 / 255."""
    camera = Camera.look_at((0.0, 4.0, 0.0), (0.0, 0.0, -1e-3), yfov=0.5)
    settings, shown = Settings(size=(60, 40), bounces=0, antialias=False), []
    for colors in (STRIPES, np.ones((3, 3))):
        scene = Scene(environment=Environment(np.ones((4, 8, 3)))) if lit_by == "sky" else Scene()
        if lit_by == "lamp":
            scene.add(RectLight((10.0,) * 3, width=2.0, height=2.0), translation=(0.0, 6.0, 0.0)).look_at(
                (0, 0, 0)
            )
        image = Texture(np.repeat(colors, 4, axis=0)[None].repeat(4, axis=0), linear=False, mipmaps=False)
        for x in range(-2, 3):
            material = Material(base_color_texture=image, roughness=roughness)
            scene.add(shapes.plane(0.75, 3.0), material=material, translation=(0.75 * x, 0.0, 0.0))
        with Renderer(scene, settings, camera, gpu=gpu) as renderer:
            shown.append(renderer.render().direct.astype(float))
    striped, white = shown
    is_white = (striped > 0.5 * white).all(axis=2)
    assert 0.25 < is_white.mean() < 0.4
    assert striped[is_white] == pytest.approx(white[is_white], rel=0.02)
