"""The ground on which a model stands for its picture: a plane that takes its shadow."""

from __future__ import annotations

import math

import numpy as np

from ispm.framing.camera import NO_POINTS, extent
from ispm.scene.material import Material
from ispm.scene.mesh import Mesh
from ispm.scene.node import Node, Part
from ispm.scene.packed import Packed

_REACH = 2.0  # of the model's diagonal: how far the ground goes from its middle
_BELOW = 1e-4  # of the diagonal, beneath the model: faces of both in one plane would fight
_ALBEDO = 0.5  # what it reflects onto the model
_CORNERS = 64


def ground_node(packed: Packed, passed: np.ndarray = NO_POINTS) -> Node:
    """Return the node that holds the ground beneath a scene: a matt gray disk that faces up.

    passed  (n, 3) m, points that moving things pass
    """
    low, high, diagonal = extent(packed, passed)
    angles = 2.0 * math.pi * np.arange(_CORNERS) / _CORNERS
    rim = np.stack([np.cos(angles), np.zeros(_CORNERS), -np.sin(angles)], axis=1)
    here = np.arange(_CORNERS)
    triangles = np.stack([np.full(_CORNERS, _CORNERS), here, np.roll(here, -1)], axis=1)
    mesh = Mesh(_REACH * diagonal * np.concatenate([rim, np.zeros((1, 3))]), triangles, name="ground")
    middle = (low + high) / 2.0
    place = (float(middle[0]), float(low[1] - _BELOW * diagonal), float(middle[2]))
    material = Material((_ALBEDO,) * 3, specular=0.0, name="ground")
    return Node("ground", translation=place, parts=[Part(mesh, material)])
