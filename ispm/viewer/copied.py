"""The scene as it is shown, where that is not the one that is edited: at a moment, without what is hidden."""

from __future__ import annotations

from ispm.scene.node import Node
from ispm.scene.scene import Scene
from ispm.scene.skin import Skin
from ispm.scene.values import kept_value

_HELD = ("parts", "instances", "light", "camera")


class Copy:
    """One scene that becomes others, node by node, so that a live renderer knows its nodes again."""

    def __init__(self) -> None:
        self._scene: Scene | None = None
        self._of: list[tuple[int, int]] = []

    def become(self, scene: Scene, original: Scene) -> Scene:
        """Return a scene that is as `scene`: the last one returned, where that has nodes in the same places.

        original  whose nodes, in the same order, tell which are the same
        """
        tree = original.tree()
        of = [(id(node), parent) for node, parent in zip(tree.nodes, tree.parents, strict=True)]
        if self._scene is None or of != self._of:
            self._scene, self._of = scene, of
            return scene
        self._scene.environment = scene.environment
        pairs = list(zip(self._scene.nodes, scene.nodes, strict=True))
        twins = {id(other): mine for mine, other in pairs}
        for mine, other in pairs:
            mine.name = other.name
            mine.stand_as(other)
            for name in _HELD:
                setattr(mine, name, getattr(other, name))
            skin = None if other.skin is None else other.skin.of(twins)
            if not _alike(mine.skin, skin):
                mine.skin = skin
        return self._scene


def _alike(a: Skin | None, b: Skin | None) -> bool:
    """Whether two skins have the same joints and matrices."""
    if a is None or b is None:
        return a is b
    return a.joints == b.joints and kept_value(a.inverse_bind) == kept_value(b.inverse_bind)


def without(scene: Scene, original: Scene, hidden: frozenset[Node]) -> Scene:
    """Return a copy, at some moment, without those of the original's nodes that are hidden and what is below.

    scene  the original, or what its `at` returned, which is changed
    """
    copied = scene.at_rest() if scene is original else scene
    tree = original.tree()
    away: list[bool] = []
    for node, parent, twin in zip(tree.nodes, tree.parents, copied.nodes, strict=True):
        if scene is original:
            twin.stand_as(node)  # which may be a moment of another scene
        away.append(node in hidden or (parent >= 0 and away[parent]))
        if away[-1]:
            twin.parts, twin.light = [], None
    return copied
