"""Animations of nodes: keyframes of translation, rotation, scale and morph weights."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ispm.errors import SceneError
from ispm.scene.values import Strict, array_of

if TYPE_CHECKING:
    from ispm.scene.scene import Node

WIDTHS = {"translation": 3, "rotation": 4, "scale": 3, "weights": None}  # None: one for each morph target
INTERPOLATIONS = ("LINEAR", "STEP", "CUBICSPLINE")
_SHORTEST = 1e-3  # norm of a quaternion, below which its rotation is undefined


@dataclass(eq=False)
class Channel(Strict):
    """Keyframes of one property of one node.

    node           the node that moves
    path           "translation", "rotation", "scale" or "weights", of morph targets
    times          (K,) float32 seconds, increasing
    values         (K, n) float32, n = 3, 4, 3 or one for each target; CUBICSPLINE: (K, 3, n) in-tangent,
                   value, out-tangent
    interpolation  "LINEAR", "STEP" or "CUBICSPLINE", as glTF 2.0, appendix C
    Raises SceneError where these make no sense.
    """

    node: Node
    path: str
    times: np.ndarray
    values: np.ndarray
    interpolation: str = "LINEAR"

    def __post_init__(self) -> None:
        from ispm.scene.node import Node  # which needs this module

        node: object = self.node
        if not isinstance(node, Node):
            hint = f"; scene[{node!r}] is one" if isinstance(node, str) else ""
            raise SceneError(f"a channel moves a Node, not a {type(node).__name__}{hint}")
        where = f"channel of node '{self.node.name}'"
        if self.path not in tuple(WIDTHS):
            raise SceneError(f"{where}: path '{self.path}' is not one of {', '.join(WIDTHS)}")
        if self.interpolation not in INTERPOLATIONS:
            raise SceneError(f"{where}: interpolation '{self.interpolation}' is unknown")
        self.times = array_of(f"{where}: times", self.times, (None,))
        if not len(self.times):
            raise SceneError(f"{where}: there are no keys")
        if (np.diff(self.times) <= 0.0).any():
            raise SceneError(f"{where}: times must increase")
        spline, width = self.interpolation == "CUBICSPLINE", WIDTHS[self.path]
        shape = (len(self.times), 3, width) if spline else (len(self.times), width)
        self.values = array_of(f"{where}: values", self.values, shape)
        keys = self.values[:, 1] if spline else self.values
        if self.path == "rotation" and np.linalg.norm(keys, axis=1).min() < _SHORTEST:
            raise SceneError(f"{where}: a rotation is zero")

    def __repr__(self) -> str:
        return f"<Channel {self.path} of '{self.node.name}': {len(self.times)} keys>"

    def at(self, time: float) -> np.ndarray:
        """Return the value at `time` in seconds, held before the first and after the last key."""
        times: np.ndarray = self.times
        last = len(times) - 1
        k = int(np.clip(np.searchsorted(times, time, side="right") - 1, 0, last))
        if self.interpolation == "CUBICSPLINE":
            value = self._spline(time, k, last)
        elif self.interpolation == "STEP" or k == last or time <= times[0]:
            value = self.values[k]
        else:
            s = (time - times[k]) / (times[k + 1] - times[k])
            a, b = self.values[k], self.values[k + 1]
            value = _slerp(a, b, s) if self.path == "rotation" else (1.0 - s) * a + s * b
        if self.path == "rotation":
            value = value / np.linalg.norm(value)
        return np.asarray(value, np.float64)

    def _spline(self, time: float, k: int, last: int) -> np.ndarray:
        times: np.ndarray = self.times
        if k == last or time <= times[0]:
            return np.asarray(self.values[k, 1])
        step = times[k + 1] - times[k]
        s = (time - times[k]) / step
        value = (2 * s**3 - 3 * s**2 + 1) * self.values[k, 1]
        value = value + step * (s**3 - 2 * s**2 + s) * self.values[k, 2]
        value = value + (-2 * s**3 + 3 * s**2) * self.values[k + 1, 1]
        return np.asarray(value + step * (s**3 - s**2) * self.values[k + 1, 0])


@dataclass(eq=False)
class Animation(Strict):
    """A named set of channels that play together."""

    channels: list[Channel] = field(default_factory=list)
    name: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.channels, list) or not all(isinstance(c, Channel) for c in self.channels):
            raise SceneError(f"animation '{self.name}': channels must be a list of Channel")

    def __repr__(self) -> str:
        count = len(self.channels)
        return f"<Animation '{self.name}': {count} channel{'s' * (count != 1)}, {self.duration:g} s>"

    @property
    def duration(self) -> float:
        """The time of the last keyframe in seconds."""
        return max((float(c.times[-1]) for c in self.channels), default=0.0)

    def of(self, nodes: Mapping[int, Node]) -> Animation:
        """Return this animation of other nodes.

        nodes  by the ids of those that they stand for; channels of others are left out
        """
        result = copy.copy(self)
        result.channels = [copy.copy(c) for c in self.channels if id(c.node) in nodes]
        for channel in result.channels:
            channel.node = nodes[id(channel.node)]
        return result


def _slerp(a: np.ndarray, b: np.ndarray, s: float) -> np.ndarray:
    """Interpolate unit quaternions along the shorter arc."""
    cosine = float(np.dot(a, b))
    if cosine < 0.0:
        b, cosine = -b, -cosine
    if cosine > 0.9995:
        return np.asarray((1.0 - s) * a + s * b)
    angle = np.arccos(cosine)
    return np.asarray((np.sin((1.0 - s) * angle) * a + np.sin(s * angle) * b) / np.sin(angle))
