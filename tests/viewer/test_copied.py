"""The one scene that a view moves: what deforms in it follows its own joints, and packs as the same."""

import numpy as np

import ispm
from ispm.scene.packed import pack
from ispm.viewer.copied import Copy


def arm():
    """A post that follows two nodes, one of which turns for a second."""
    scene, post = ispm.Scene(), ispm.shapes.cylinder(0.1, 2.0)
    scene.roots += [ispm.Node("foot"), ispm.Node("head")]
    upper = np.clip(0.5 + post.positions[:, 1], 0, 1)
    post.joints = np.tile([0, 1], (len(upper), 1))
    post.joint_weights = np.stack([1 - upper, upper], axis=1)
    scene.add(post, name="post").skin = ispm.Skin([scene["foot"], scene["head"]])
    keys = np.array([[0, 0, 0, 1], ispm.euler(z=1.0)])
    scene.animations = [ispm.Animation([ispm.Channel(scene["head"], "rotation", np.arange(2.0), keys)])]
    return scene


def test_a_figure_moves_in_the_copy_as_at_its_moments():
    scene, copy, packed = arm(), Copy(), None
    for time in (0.0, 0.4, 1.0):
        shown = copy.become(scene.at(time), scene)
        before, packed = packed, pack(shown, packed)
        np.testing.assert_allclose(shown.bounds, scene.at(time).bounds)
        assert shown["post"].skin.joints == [shown["foot"], shown["head"]]
        if before is not None:
            assert packed.placed.layout is before.placed.layout
            assert packed.geometry.indices is before.geometry.indices
            assert packed.geometry is not before.geometry


def test_another_skin_comes_into_the_copy():
    scene, copy = arm(), Copy()
    copy.become(scene.at(1.0), scene)
    scene["post"].skin = ispm.Skin([scene["foot"], scene["foot"]])
    shown = copy.become(scene.at(1.0), scene)
    assert shown["post"].skin.joints == [shown["foot"]] * 2
    np.testing.assert_allclose(
        shown.bounds, ispm.Scene([ispm.Node(parts=scene["post"].parts)]).bounds, atol=1e-6
    )
    scene["post"].skin = None
    assert copy.become(scene.at(1.0), scene)["post"].skin is None
