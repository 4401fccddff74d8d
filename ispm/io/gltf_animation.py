"""Animations of a glTF file: channels that move nodes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ispm.errors import SceneError
from ispm.io import gltf_schema as schema
from ispm.io.gltf_file import GltfFile, item, label
from ispm.scene.animation import WIDTHS, Animation, Channel
from ispm.scene.scene import Node


def read_animations(file: GltfFile, nodes: Sequence[Node]) -> list[Animation]:
    """Return the animations; channels that cannot be played are left out, with a note.

    nodes  as the file numbers them
    """
    animations = []
    for index, record in enumerate(file.gltf.animations):
        where = label("animation", index, record.name)
        channels = [_channel(file, record, channel, nodes, where) for channel in record.channels]
        playable = [channel for channel in channels if channel is not None]
        if playable:
            animations.append(Animation(playable, record.name))
    return animations


def _channel(
    file: GltfFile, record: schema.Animation, channel: schema.Channel, nodes: Sequence[Node], where: str
) -> Channel | None:
    target = channel.target
    if target.path == "pointer":
        file.notes.count(
            "animation channel moves what KHR_animation_pointer names, which is not supported",
            "animation channels move what KHR_animation_pointer names, which is not supported",
        )
        return None
    if target.node is None:
        return None  # glTF 2.0, 3.11: such a channel is to be ignored
    try:
        node = item(nodes, target.node, "node")
        sampler = item(record.samplers, channel.sampler, "sampler")
        return _keyed(file, node, target.path, sampler)
    except SceneError as error:
        file.notes.add(f"{where}: a channel is left out: {error}")
        return None


def _keyed(file: GltfFile, node: Node, path: str, sampler: schema.AnimationSampler) -> Channel:
    """A channel with its keyframes, shaped as `Channel` says. Raises SceneError where they make no sense."""
    if path not in WIDTHS:
        raise SceneError(f"it moves '{path}', which is unknown")
    width, kind = WIDTHS[path], f"VEC{WIDTHS[path]}"
    if width is None:
        width, kind = max((len(part.mesh.morphs) for part in node.parts), default=0), "SCALAR"
        if not width:
            raise SceneError(f"node '{node.name}' has no morph targets whose weights it could move")
    elif node.matrix is not None:
        raise SceneError(f"node '{node.name}' is placed by a matrix, which cannot be animated")
    times = file.floats(sampler.input, ("SCALAR",))
    values = file.floats(sampler.output, (kind,))
    if times is None or values is None:
        raise SceneError("its times or values are of the wrong type")
    spline = sampler.interpolation == "CUBICSPLINE"
    if values.size != len(times) * width * (3 if spline else 1):
        each = f" for {width} morph targets" if path == "weights" else ""
        raise SceneError(f"it has {len(times)} times and {len(values)} values{each}")
    shaped = values.reshape(len(times), 3, width) if spline else values.reshape(len(times), width)
    if path == "weights" and node.weights is None:
        node.weights = np.zeros(width)
    return Channel(node, path, times[:, 0].copy(), shaped, sampler.interpolation)
