"""Direct light of skies as metals reflect it: the first pass is as smooth as those that follow."""

import numpy as np

from ispm import Camera, Environment, Material, Renderer, Settings, shapes
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
