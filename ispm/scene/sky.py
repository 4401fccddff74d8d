"""The clear sky as an environment, and its sun as a light."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ispm.errors import SceneError
from ispm.optics.atmosphere import SUN_RADIUS, sky_radiance, sun_direction, sun_irradiance
from ispm.scene.camera import look_at_pose
from ispm.scene.environment import Environment
from ispm.scene.light import DirectionalLight
from ispm.scene.node import Node
from ispm.scene.placing import Tree
from ispm.scene.sun import SunDisc, sun_disc
from ispm.scene.values import Strict, as_code, require

_DUSK = -math.radians(6.0)  # where civil twilight ends; no darker sky is computed
_BRIGHTER = 1e6  # times the sky's own light
_WIDEST = 0.1  # radians, of the sun


@dataclass(repr=False)
class Sky(Strict):
    """The clear sky over a ground without end, and its sun: `scene.environment = Sky(...)`.

    sun_elevation  radians above the horizon, from -0.104 (dusk) to pi / 2
    sun_azimuth    radians from -Z, to +X: clockwise seen from above
    turbidity      1 pure air, 2 very clear, 3 clear, 6 hazy, 10 mist
    ground_albedo  of the ground, which is seen below the horizon and lights the sky
    intensity      factor of all its light, which is else that of the real one: some 100,000 lx at noon
    background     whether it is seen behind the scene; in mirrors and through glass it always is
    sun_radius     radians that the sun's disc is across by half, to 0.1; 0: a point, which is not seen
    The sun is seen as the sky is, but rough mirrors and glass show their highlight of it in its place. One
    pass has sharp shadows of it, more have penumbrae.
    Raises SceneError for a value out of range.
    """

    sun_elevation: float = math.pi / 4.0
    sun_azimuth: float = -0.75 * math.pi
    turbidity: float = 3.0
    ground_albedo: float = 0.3
    intensity: float = 1.0
    background: bool = True
    sun_radius: float = SUN_RADIUS

    def __post_init__(self) -> None:
        self.check()

    def __repr__(self) -> str:
        return as_code(self)

    def check(self) -> None:
        """Raise SceneError for a value out of range."""
        require("sky: sun_elevation, in radians,", self.sun_elevation, _DUSK, math.pi / 2.0)
        require("sky: sun_azimuth, in radians,", self.sun_azimuth)
        require("sky: turbidity", self.turbidity, 1.0, 10.0)
        require("sky: ground_albedo", self.ground_albedo, 0.0, 1.0)
        require("sky: intensity", self.intensity, 0.0, _BRIGHTER)
        require("sky: sun_radius, in radians,", self.sun_radius, 0.0, _WIDEST)

    def dome(self) -> Environment:
        """Return its light without the sun's: the same object while nothing changes, not to be edited."""
        self.check()
        return _dome(
            float(self.sun_elevation),
            float(self.sun_azimuth),
            float(self.turbidity),
            float(self.ground_albedo),
            float(self.intensity),
            bool(self.background),
        )

    def sun(self) -> Node | None:
        """Return a node that holds the sun's light; None where it is below the horizon. Likewise."""
        self.check()
        values = self.sun_elevation, self.sun_azimuth, self.turbidity, self.intensity
        return _sun(*map(float, values))

    def disc(self) -> SunDisc | None:
        """Return how the sun is seen; None where it is a point or below the horizon."""
        self.check()
        direction = sun_direction(float(self.sun_elevation), float(self.sun_azimuth))
        return sun_disc(direction, float(self.sun_radius), self._irradiance())

    def _irradiance(self) -> np.ndarray:
        """The sun's, (3,) lx on a surface that faces it."""
        return np.asarray(self.intensity * sun_irradiance(float(self.sun_elevation), float(self.turbidity)))


@lru_cache(maxsize=8)
def _dome(
    elevation: float, azimuth: float, turbidity: float, albedo: float, intensity: float, background: bool
) -> Environment:
    image = sky_radiance(elevation, 0.0, turbidity, albedo)
    return Environment(image, -azimuth, intensity, background, "sky")


@lru_cache(maxsize=8)
def _sun(elevation: float, azimuth: float, turbidity: float, intensity: float) -> Node | None:
    irradiance = intensity * sun_irradiance(elevation, turbidity)
    if not irradiance.any():
        return None
    red, green, blue = irradiance.tolist()
    pose = look_at_pose(sun_direction(elevation, azimuth), np.zeros(3))
    return Node("sun", light=DirectionalLight((red, green, blue)), matrix=pose)


def disc_of(environment: Environment | Sky | None) -> SunDisc | None:
    """Return the disc of a sky's sun, None where there is none."""
    return environment.disc() if isinstance(environment, Sky) else None


def require_environment(value: object) -> None:
    """Raise SceneError where `value` is not what a scene may have as its environment."""
    if value is not None and not isinstance(value, Environment | Sky):
        raise SceneError(
            f"environment must be an ispm.Environment, an ispm.Sky or None, not a {type(value).__name__}"
        )


def dome_of(environment: Environment | Sky | None) -> Environment | None:
    """Return what a scene's environment is without a sun: itself, or a sky's dome."""
    return environment.dome() if isinstance(environment, Sky) else environment


def with_sun(tree: Tree, environment: Environment | Sky | None) -> Tree:
    """Return a scene's tree, with the sun where its environment has one."""
    sun = environment.sun() if isinstance(environment, Sky) else None
    return tree if sun is None else Tree([*tree.nodes, sun], [*tree.parents, -1])
