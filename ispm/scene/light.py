"""Lights: punctual ones, as in KHR_lights_punctual, and lamps with a surface."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

from ispm.errors import SceneError
from ispm.scene.values import BRIGHTEST, FARTHEST, LEAST, Strict, as_code, require

_FLAT = math.pi / 2.0 + 1e-6  # files round it
_SHARPEST = 1e-6  # difference of the cosines of a spot's cones, in float32


class _Shining(Strict):
    """What the lights share: checked as they are made, shown as the code that makes them."""

    intensity: tuple[float, float, float]
    name: str

    def __post_init__(self) -> None:
        self.check()

    def __repr__(self) -> str:
        return as_code(self)

    def check(self, called: str = "") -> None:
        """Raise SceneError for a value out of range; `called` names this light in the message."""
        called = called or light_called(self)
        require(f"{called}: intensity", self.intensity, 0.0, BRIGHTEST, 3)
        require(f"{called}: range", getattr(self, "range", math.inf), LEAST, math.inf)


class _Soft(_Shining):
    """What lights share that shine from a point, or with a radius from a sphere."""

    range: float
    radius: float

    def check(self, called: str = "") -> None:
        """Raise SceneError for a value out of range; `called` names this light in the message."""
        super().check(called)
        called = called or light_called(self)
        require(f"{called}: radius, in metres,", self.radius, 0.0, FARTHEST)
        if self.radius > 0.0 and not math.isinf(self.range):
            raise SceneError(
                f"{called}: range {self.range:g} cannot be with radius {self.radius:g}; leave it infinite"
            )
        if self.radius > 0.0:
            require(f"{called}: intensity over the area of its radius", self.radiance, 0.0, BRIGHTEST, 3)

    @property
    def radiance(self) -> tuple[float, float, float]:
        """What the sphere of `radius` shines with, (3,) cd/m2: it appears as a disk of that radius."""
        area = max(math.pi * float(self.radius) ** 2, 1e-300)
        r, g, b = (float(v) / area for v in self.intensity)
        return r, g, b


@dataclass(repr=False)
class PointLight(_Soft):
    """Shines alike in all directions from its node's origin.

    intensity  (3,) cd per channel, linear
    range      m, beyond which nothing is lit; infinite by default
    radius     m, of the sphere that shines, for soft shadows, to be given by name; 0, the default, is a
               point. It is a `SphereLight` that gives as much light: the camera and mirrors see it. The scale
               of its node leaves it as it is, and its `range` must be infinite.
    """

    intensity: tuple[float, float, float] = (1.0, 1.0, 1.0)
    range: float = math.inf
    radius: float = field(default=0.0, kw_only=True)
    name: str = field(default="", compare=False)


@dataclass(repr=False)
class SpotLight(_Soft):
    """Shines from its node's origin along its -Z, full within one cone, fading to nothing at another.

    intensity     (3,) cd per channel within the inner cone, linear
    range         m, beyond which nothing is lit; infinite by default
    inner_angle   radians from the axis to the inner cone's edge
    outer_angle   radians from the axis to where the light ends, above `inner_angle`, at most pi / 2
    radius        m, of the sphere that shines, for soft shadows, to be given by name; 0, the default, is a
                  point. From each direction the sphere is as bright as the cones say: dark beside them. The
                  camera and mirrors see it. The scale of its node leaves it as it is, and its `range` must be
                  infinite.
    """

    intensity: tuple[float, float, float] = (1.0, 1.0, 1.0)
    range: float = math.inf
    inner_angle: float = 0.0
    outer_angle: float = math.pi / 4.0
    radius: float = field(default=0.0, kw_only=True)
    name: str = field(default="", compare=False)

    @property
    def falloff(self) -> tuple[float, float]:
        """Scale and offset of the cosine to the axis, which make the share of the intensity in a direction:
        cut to 0 and 1, squared (KHR_lights_punctual, inner and outer cone angles)."""
        inner, outer = math.cos(self.inner_angle), math.cos(self.outer_angle)
        scale = 1.0 / max(inner - outer, _SHARPEST)
        return scale, -outer * scale

    def check(self, called: str = "") -> None:
        """Raise SceneError for a value out of range; `called` names this light in the message."""
        super().check(called)
        called = called or light_called(self)
        for name in ("inner_angle", "outer_angle"):
            require(f"{called}: {name}, in radians,", getattr(self, name), 0.0, _FLAT)
        if not self.inner_angle < self.outer_angle:
            raise SceneError(
                f"{called}: inner_angle {self.inner_angle:g} must be below outer_angle {self.outer_angle:g}"
            )


@dataclass(repr=False)
class DirectionalLight(_Shining):
    """Shines along its node's -Z from infinitely far, like the sun.

    intensity  (3,) lx per channel on a surface that faces it, linear
    """

    intensity: tuple[float, float, float] = (1.0, 1.0, 1.0)
    name: str = field(default="", compare=False)


class _Surface(_Shining):
    """What lamps with a surface share: each point of it is as bright from wherever it is seen (Lambert).

    The surface is seen, casts shadows and reflects nothing. Its node's scale stretches it as it does meshes,
    and its radiance stays.
    """

    SIZES: ClassVar[tuple[str, ...]] = ()  # the fields that say how large it is, m

    def check(self, called: str = "") -> None:
        """Raise SceneError for a value out of range; `called` names this light in the message."""
        super().check(called)
        called = called or light_called(self)
        for name in self.SIZES:
            require(f"{called}: {name}, in metres,", getattr(self, name), LEAST, FARTHEST)
        require(f"{called}: two_sided", getattr(self, "two_sided", False), False, True)

    @property
    def shines_both_ways(self) -> bool:
        """Whether the back shines as well."""
        return bool(getattr(self, "two_sided", False))

    @classmethod
    def from_lumens(cls, lumens: tuple[float, float, float], **others: Any) -> Self:
        """Return the lamp that sends out `lumens` from all of its surface together.

        lumens  (3,) lm per channel; a white lamp of 800 lm has (800, 800, 800)
        others  its other fields, by name; the node must not scale it
        Raises SceneError for a value out of range.
        """
        lamp = cls(**others)
        require(f"{light_called(lamp)}: lumens", lumens, 0.0, math.inf, 3)
        r, g, b = (float(v) / (math.pi * lamp.area) for v in lumens)
        return replace(lamp, intensity=(r, g, b))  # type: ignore[type-var]  # a base of dataclasses alone

    @property
    def stretch(self) -> tuple[float, float, float]:
        """The factors along the node's axes by which the lamp of measures 1 becomes this one."""
        raise NotImplementedError  # each shape has its own

    @property
    def area(self) -> float:
        """The area that shines, m2, both sides where both do; of a node that does not scale."""
        raise NotImplementedError  # each shape has its own

    @property
    def lumens(self) -> tuple[float, float, float]:
        """The flux of the whole lamp, (3,) lm per channel: pi times radiance times `area`."""
        r, g, b = (math.pi * self.area * float(v) for v in self.intensity)
        return r, g, b


@dataclass(repr=False)
class RectLight(_Surface):
    """A rectangle in its node's XY plane, about its origin, that shines along -Z.

    intensity  (3,) cd/m2 per channel, linear: the radiance of the surface; in the trade its luminance, in
               nits. `from_lumens` takes the flux of the whole lamp instead.
    width, height   m, along X and Y
    two_sided  whether it shines along +Z as well; else the back is not drawn
    """

    SIZES: ClassVar[tuple[str, ...]] = ("width", "height")

    intensity: tuple[float, float, float] = (1.0, 1.0, 1.0)
    width: float = 1.0
    height: float = 1.0
    two_sided: bool = False
    name: str = field(default="", compare=False)

    @property
    def stretch(self) -> tuple[float, float, float]:
        """The factors along the node's axes by which a square of 1 m becomes this."""
        return float(self.width), float(self.height), 1.0

    @property
    def area(self) -> float:
        """The area that shines, m2, both sides where both do; of a node that does not scale."""
        return float(self.width) * float(self.height) * (2.0 if self.two_sided else 1.0)


@dataclass(repr=False)
class DiskLight(_Surface):
    """A disk in its node's XY plane, about its origin, that shines along -Z.

    intensity  (3,) cd/m2 per channel, linear: the radiance of the surface; in the trade its luminance, in
               nits. `from_lumens` takes the flux of the whole lamp instead.
    radius     m
    two_sided  whether it shines along +Z as well; else the back is not drawn
    It is drawn as a polygon of 64 corners and the disk's area.
    """

    SIZES: ClassVar[tuple[str, ...]] = ("radius",)

    intensity: tuple[float, float, float] = (1.0, 1.0, 1.0)
    radius: float = 0.5
    two_sided: bool = False
    name: str = field(default="", compare=False)

    @property
    def stretch(self) -> tuple[float, float, float]:
        """The factors along the node's axes by which a disk of radius 1 m becomes this."""
        return float(self.radius), float(self.radius), 1.0

    @property
    def area(self) -> float:
        """The area that shines, m2, both sides where both do; of a node that does not scale."""
        return math.pi * float(self.radius) ** 2 * (2.0 if self.two_sided else 1.0)


@dataclass(repr=False)
class SphereLight(_Surface):
    """A sphere about its node's origin that shines outwards.

    intensity  (3,) cd/m2 per channel, linear: the radiance of the surface; in the trade its luminance, in
               nits. `from_lumens` takes the flux of the whole lamp instead.
    radius     m
    It is drawn as a mesh of 1,280 triangles and the sphere's area, which is as large from all sides together
    (Cauchy: the mean shadow of a convex body is a quarter of its surface).
    """

    SIZES: ClassVar[tuple[str, ...]] = ("radius",)

    intensity: tuple[float, float, float] = (1.0, 1.0, 1.0)
    radius: float = 0.5
    name: str = field(default="", compare=False)

    @property
    def stretch(self) -> tuple[float, float, float]:
        """The factors along the node's axes by which a sphere of radius 1 m becomes this."""
        return float(self.radius), float(self.radius), float(self.radius)

    @property
    def area(self) -> float:
        """The area that shines, m2; of a node that does not scale."""
        return 4.0 * math.pi * float(self.radius) ** 2


PunctualLight = PointLight | SpotLight | DirectionalLight
SurfaceLight = RectLight | DiskLight | SphereLight
Light = PointLight | SpotLight | DirectionalLight | RectLight | DiskLight | SphereLight


def has_surface(light: Light | None) -> bool:
    """Return whether a light is a lamp with a surface."""
    return isinstance(light, SurfaceLight) or (isinstance(light, _Soft) and light.radius != 0.0)


def as_lamp(light: Light, called: str = "") -> SurfaceLight:
    """Return the lamp that a light with a surface is: itself, or the sphere of a point or spot with a radius.

    called  in messages
    Raises SceneError for a value out of range.
    """
    light.check(called)
    if isinstance(light, PointLight | SpotLight):
        return SphereLight(light.radiance, light.radius, name=light.name)
    assert isinstance(light, SurfaceLight)
    return light


def light_called(light: _Shining, node: str = "", index: int | None = None) -> str:
    """Return what messages call a light: by its name or its node's, else by its kind and number."""
    name = light.name or node
    number = "" if index is None else f" {index}"
    return f"light '{name}'" if name else f"{type(light).__name__}{number} without a name"
