"""What every record of glTF's JSON is made of."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

Index = Annotated[int, Meta(ge=0)]
Count = Annotated[int, Meta(ge=0)]
Vec2 = tuple[float, float]
Vec3 = tuple[float, float, float]
Vec4 = tuple[float, float, float, float]
Matrix = Annotated[list[float], Meta(min_length=16, max_length=16)]


class Record(msgspec.Struct, rename="camel", frozen=True):
    """A JSON object; members that are not named here are passed over, and absent ones share their default."""
