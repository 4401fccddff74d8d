"""Animation channels: their keys as stored, and what they evaluate to between the keys."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_builder import GltfBuilder, quad

from ispm.scene.animation import Channel
from ispm.scene.scene import Scene

TIMES = np.array([0.0, 1.0, 3.0], np.float32)
MOVES = np.array([[0, 0, 0], [1, 2, 3], [5, 2, -1]], np.float32)


def animated(
    times: np.ndarray, values: np.ndarray, path: str = "translation", how: str = "LINEAR", **accessor: Any
) -> GltfBuilder:
    """A quad that one channel moves."""
    builder = quad()
    sampler = {"input": builder.accessor(times), "output": builder.accessor(values, **accessor)}
    channel = {"sampler": 0, "target": {"node": 0, "path": path}}
    samplers = [sampler | {"interpolation": how}]
    builder.put("animations", {"name": "move", "channels": [channel], "samplers": samplers})
    return builder


def only_channel(scene: Scene) -> Channel:
    assert scene.warnings == []
    ((channel,),) = [animation.channels for animation in scene.animations]
    return channel


def test_linear_keys_are_interpolated_and_held(tmp_path: Path) -> None:
    scene = animated(TIMES, MOVES).load(tmp_path)
    channel = only_channel(scene)
    assert (channel.times == TIMES).all()
    assert (channel.values == MOVES).all()
    assert channel.node is scene["quad"]
    assert scene.animations[0].duration == 3.0
    for time, expected in [(-1, [0, 0, 0]), (0.25, [0.25, 0.5, 0.75]), (2, [3, 2, 1]), (9, [5, 2, -1])]:
        assert channel.at(time).tolist() == expected
    assert scene.at(2.0)["quad"].local_matrix()[:3, 3].tolist() == [3, 2, 1]


def test_step_keys_are_held(tmp_path: Path) -> None:
    channel = only_channel(animated(TIMES, MOVES, "scale", "STEP").load(tmp_path))
    assert channel.at(0.99).tolist() == [0, 0, 0]
    assert channel.at(1.0).tolist() == [1, 2, 3]


def test_cubic_splines_follow_a_cubic(tmp_path: Path) -> None:
    """Tangents are derivatives by time, so a cubic polynomial comes back exactly (glTF 2.0, appendix C)."""
    t = TIMES.astype(np.float64)
    polynomials = [np.polynomial.Polynomial(c) for c in ([1, -2, 0, 1], [0, 3, 1, -0.5], [2, 0, 0, 0.25])]
    value = np.stack([p(t) for p in polynomials], axis=1)
    slope = np.stack([p.deriv()(t) for p in polynomials], axis=1)
    keys = np.stack([slope, value, slope], axis=1).reshape(-1, 3).astype(np.float32)
    channel = only_channel(animated(TIMES, keys, how="CUBICSPLINE").load(tmp_path))
    assert channel.values.shape == (3, 3, 3)
    for time in (0.0, 0.3, 1.0, 1.7, 2.9):
        np.testing.assert_allclose(channel.at(time), [p(time) for p in polynomials], atol=1e-5)


@pytest.mark.parametrize("kind", [np.float32, np.int16, np.int8])
def test_rotations_take_the_shorter_arc(tmp_path: Path, kind: type) -> None:
    """Half way from no turn to a quarter turn about Y, stored with the other sign: an eighth of a turn."""
    half = math.sqrt(0.5)
    keys = np.array([[0, 0, 0, 1], [0, -half, 0, -half]])
    steps = 1 if kind is np.float32 else np.iinfo(kind).max
    stored = (keys * steps if steps == 1 else np.rint(keys * steps)).astype(kind)
    builder = animated(TIMES[:2], stored, "rotation", normalized=steps > 1)
    turned = only_channel(builder.load(tmp_path)).at(0.5)
    expected = [0, math.sin(math.pi / 8), 0, math.cos(math.pi / 8)]
    np.testing.assert_allclose(turned, expected, atol=0.5 / steps + 1e-6)  # half a step of the storage


@pytest.mark.parametrize(
    ("builder", "reason"),
    [
        (animated(TIMES[::-1], MOVES), "increase"),
        (animated(np.array([0, 1, 1], np.float32), MOVES), "increase"),
        (animated(np.array([0, np.nan, 1], np.float32), MOVES), "finite"),
        (animated(TIMES, MOVES[:2]), "3 times and 2 values"),
        (animated(TIMES, MOVES, how="CUBICSPLINE"), "3 times and 3 values"),
        (animated(TIMES[:0], MOVES[:0]), "no keys"),
        (animated(TIMES, MOVES, how="WOBBLE"), "WOBBLE"),
        (animated(TIMES, MOVES, "colour"), "colour"),
        (animated(TIMES, MOVES, "rotation"), "wrong type"),
        (animated(TIMES, np.zeros((3, 4), np.float32), "rotation"), "zero"),
        (animated(TIMES, np.full((3, 3), np.inf, np.float32)), "finite"),
        (animated(TIMES, MOVES, bufferView=77), "buffer view 77"),
    ],
)
def test_channels_that_make_no_sense_are_left_out(tmp_path: Path, builder: GltfBuilder, reason: str) -> None:
    scene = builder.load(tmp_path)
    assert scene.animations == []
    assert scene.triangle_count == 2
    (message,) = scene.warnings
    assert message.startswith("animation 'move': a channel is left out: ")
    assert reason in message


def test_channels_of_unknown_targets_are_left_out(tmp_path: Path) -> None:
    for target, warnings in [({"node": 9}, 1), ({}, 0), ({"node": 0, "path": "weights"}, 1)]:
        builder = animated(TIMES, MOVES)
        builder.json["animations"][0]["channels"][0]["target"] = {"path": "translation"} | target
        scene = builder.load(tmp_path)
        assert (scene.animations, len(scene.warnings)) == ([], warnings)


def test_pointers_are_named_and_the_other_channels_play(tmp_path: Path) -> None:
    builder = animated(TIMES, MOVES)
    pointer = {"KHR_animation_pointer": {"pointer": "/materials/0/emissiveFactor"}}
    channels = builder.json["animations"][0]["channels"]
    channels += 2 * [{"sampler": 0, "target": {"path": "pointer", "extensions": pointer}}]
    builder.json["extensionsUsed"] = ["KHR_animation_pointer"]
    scene = builder.load(tmp_path)
    assert [channel.path for channel in scene.animations[0].channels] == ["translation"]
    assert len(scene.warnings) == 2
    assert scene.warnings[0] == (
        "2 animation channels move what KHR_animation_pointer names, which is not supported"
    )
    assert "KHR_animation_pointer (its channels are left out)" in scene.warnings[1]


def test_nodes_placed_by_a_matrix_are_not_animated(tmp_path: Path) -> None:
    builder = animated(TIMES, MOVES)
    builder.json["nodes"][0]["matrix"] = np.diag([2.0, 2, 2, 1]).ravel().tolist()
    scene = builder.load(tmp_path)
    assert scene.animations == []
    assert "matrix" in scene.warnings[0]
