"""The options that `render` and `view` share: what is looked at, from where, on which machine's parts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from cyclopts import Parameter

from ispm.cli.options import WHOLE
from ispm.errors import SettingsError
from ispm.settings import VIEWS, nearest

_Point = Parameter(metavar="X,Y,Z", allow_leading_hyphen=True)


@dataclass(frozen=True)
class Viewpoint:
    """How a scene is looked at."""

    camera: Annotated[
        str | None, Parameter(help="one of the scene's; default: its first", metavar="NAME or INDEX")
    ] = None
    look_from: Annotated[str | None, _Point, Parameter(help="where the camera stands, metres")] = None
    look_at: Annotated[str | None, _Point, Parameter(help="what it looks at, metres")] = None
    fov: Annotated[float | None, Parameter(help="vertical angle of view", metavar="DEGREES")] = None
    time: Annotated[
        float | None, Parameter(help="animation time; default: as the file stands", metavar="SECONDS")
    ] = None
    animation: Annotated[str | None, Parameter(help="the one to play; default: all", metavar="NAME")] = None
    show: Annotated[str, Parameter(help=f"what to show ({', '.join(VIEWS)})", metavar="VIEW")] = "full"
    environment: Annotated[
        str | None, Parameter(help="an .hdr or .exr that lights and is reflected", metavar="FILE")
    ] = None
    environment_rotation: Annotated[
        float | None, Parameter(help="turned so far, counterclockwise seen from above", metavar="DEGREES")
    ] = None
    environment_intensity: Annotated[float | None, Parameter(help="factor of its radiance", metavar="X")] = (
        None
    )
    adapter: Annotated[
        str | None, Parameter(help="part of a graphics adapter's name; default: the best", metavar="NAME")
    ] = None
    threads: Annotated[int | None, WHOLE, Parameter(help="CPU threads; default: all cores", metavar="N")] = (
        None
    )
    config: Annotated[str | None, Parameter(help="settings as TOML", metavar="FILE.toml")] = None

    def check(self) -> None:
        """Raise SettingsError for what makes no sense, before any work."""
        if self.threads is not None and self.threads < 1:
            raise SettingsError(f"--threads: {self.threads} is less than 1")
        if self.time is not None and not math.isfinite(self.time):
            raise SettingsError(f"--time: {self.time} is not a time")
        for name, value in (
            ("rotation", self.environment_rotation),
            ("intensity", self.environment_intensity),
        ):
            if value is not None and self.environment is None:
                raise SettingsError(f"--environment-{name}: is of --environment; give that too")
            if value is not None and not math.isfinite(value):
                raise SettingsError(f"--environment-{name}: {value} is not a number")
        if (self.environment_intensity or 0.0) < 0.0:
            raise SettingsError(f"--environment-intensity: {self.environment_intensity:g} is less than 0")
        if self.show not in VIEWS:
            raise SettingsError(
                f"--show: '{self.show}' is not one of {', '.join(VIEWS)}{nearest(self.show, VIEWS)}"
            )
