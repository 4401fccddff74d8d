"""Variants of a scene: looks that its parts can have, by name."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ispm.errors import SceneError
from ispm.scene.values import Strict

if TYPE_CHECKING:
    from ispm.scene.node import Node


@dataclass(eq=False, kw_only=True)
class Varied(Strict):
    """What has nodes whose parts wear other materials in each variant."""

    variants: list[str] = field(default_factory=list)
    _variant: str | None = field(default=None, init=False, repr=False)

    @property
    def nodes(self) -> list[Node]:
        """All nodes."""
        raise NotImplementedError

    @property
    def variant(self) -> str | None:
        """Which of `variants` the parts wear; None: what they wear without.

        To set it gives nodes new parts. Raises SceneError for what is none of them.
        """
        return self._variant

    @variant.setter
    def variant(self, name: str | None) -> None:
        if name is not None and name not in self.variants:
            names = ", ".join(repr(known) for known in self.variants) or "none"
            raise SceneError(f"there is no variant {name!r}; the scene has {names}")
        for node in {id(node): node for node in self.nodes}.values():
            if any(part.variants for part in node.parts):
                node.parts = [part.wearing(name) if part.variants else part for part in node.parts]
        self._variant = name
