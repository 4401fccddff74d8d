"""Every change to a scene as a value that knows its inverse, and the history of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ispm.errors import SceneError

_MOST = 1000  # edits that can be taken back
_NOTHING = 1e-6  # of a value: a drag that ends as near to where it began has changed nothing


@dataclass(frozen=True, eq=False)
class Assign:
    """Give a field of something in the scene a value: all that an edit ever does.

    owner  a node, light, material, the scene (`roots`), or Hidden
    """

    owner: Any
    field: str
    value: Any

    def apply(self) -> Assign:
        """Do it, and return what takes it back."""
        before = Assign(self.owner, self.field, getattr(self.owner, self.field))
        setattr(self.owner, self.field, self.value)
        return before


@dataclass(frozen=True, eq=False)
class Edit:
    """What is done, and taken back, at once.

    label    as the history names it
    gesture  of a drag: steps with the same one are one edit; None: it stands for itself
    """

    label: str
    steps: tuple[Assign, ...]
    gesture: object = None

    def apply(self) -> Edit:
        """Do all steps, or none; return the edit that takes them back.

        Raises SceneError where one of them gives something a value that it cannot have.
        """
        undone: list[Assign] = []
        try:
            for step in self.steps:
                undone.append(step.apply())
                _check(step.owner)
        except (SceneError, AttributeError, TypeError, ValueError) as error:
            for before in reversed(undone):
                before.apply()
            raise SceneError(f"{self.label}: {error}") from None
        return Edit(self.label, tuple(reversed(undone)), self.gesture)


@dataclass(eq=False)
class Hidden:
    """The nodes that are not shown, nor what stands below them."""

    nodes: frozenset[Any] = frozenset()


@dataclass(eq=False)
class History:
    """The edits that can be taken back, and those that can be made again; the last one at the end."""

    undos: list[Edit] = field(default_factory=list)
    redos: list[Edit] = field(default_factory=list)

    def make(self, edit: Edit) -> None:
        """Apply an edit and remember it, unless it ends a drag where that began.

        Raises SceneError as `Edit.apply`; nothing is changed then.
        """
        before = edit.apply()
        last = self.undos[-1] if self.undos else None
        if last is not None and edit.gesture is not None and last.gesture == edit.gesture:
            before = Edit(last.label, _earliest([*before.steps, *last.steps]), edit.gesture)
            self.undos.pop()
        if edit.gesture is not None and all(_same(getattr(s.owner, s.field), s.value) for s in before.steps):
            before.apply()
            return
        self.redos.clear()
        self.undos.append(before)
        del self.undos[:-_MOST]

    def undo(self) -> bool:
        """Take the last edit back; False where there is none."""
        return _moved(self.undos, self.redos)

    def redo(self) -> bool:
        """Make the edit again that was taken back last; False where there is none."""
        return _moved(self.redos, self.undos)

    def clear(self) -> None:
        """Forget all."""
        self.undos.clear()
        self.redos.clear()


def _moved(source: list[Edit], target: list[Edit]) -> bool:
    """Apply the last of one list; what takes it back joins the other, closed to further steps."""
    if not source:
        return False
    edit = source.pop()
    back = edit.apply()
    target.append(Edit(back.label, back.steps))
    return True


def _earliest(steps: Sequence[Assign]) -> tuple[Assign, ...]:
    """Of steps that are applied in a row, the last to each field alone."""
    kept = {(id(step.owner), step.field): step for step in steps}
    return tuple(kept.values())


def _same(first: Any, second: Any) -> bool:
    """Whether two values of a field are one, numbers but for what rounding does."""
    try:
        a, b = np.asarray(first, np.float64), np.asarray(second, np.float64)
    except (TypeError, ValueError):
        return bool(first == second)
    if first is None or a.shape != b.shape:
        return first is second
    return bool(np.all(np.abs(a - b) <= _NOTHING * max(float(np.abs(a).max()), float(np.abs(b).max()))))


def _check(owner: Any) -> None:
    """Raise SceneError where something was given a value that it cannot have."""
    if hasattr(owner, "check"):
        owner.check()
    if hasattr(owner, "local_matrix"):
        owner.local_matrix()
        if owner.light is not None:
            owner.light.check()
