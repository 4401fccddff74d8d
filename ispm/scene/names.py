"""What the ids in a frame's `instance` and `material` stand for."""

from __future__ import annotations

import json
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, overload

import numpy as np

from ispm.errors import SceneError
from ispm.scene.values import matches


class Run(NamedTuple):
    """The copies of one part, whose ids follow each other; fields as of `Copy`."""

    name: str
    node: int
    part: int
    mesh: str
    material: int
    copies: int


class Copy(NamedTuple):
    """What one id of `instance` stands for: a part of a node, at one of the places where it is shown.

    name      of the node
    node      its place in `scene.nodes`, which tells nodes of the same name apart
    part      its place in `node.parts`
    copy      which of `node.instances`; 0 where there is one
    mesh      the mesh's name
    material  the material's id: an index of `Names.materials`
    """

    name: str
    node: int
    part: int
    copy: int
    mesh: str
    material: int


@dataclass(frozen=True)
class Names(Sequence[Copy]):
    """What ids stand for: `names[id]` of `instance`, `names.materials[id]`, a name, of `material`.

    materials  names of the materials, by their ids
    runs       the table as it is kept: a row for the copies of one part
    Ids count from 0 in the order of the scene's nodes, their parts, and the copies of these; what has no
    triangles has none. They stay the same from frame to frame while nothing comes or goes.
    """

    runs: tuple[Run, ...] = ()
    materials: tuple[str, ...] = ()

    @cached_property
    def _ends(self) -> list[int]:
        """The id behind the last of each run."""
        return np.cumsum([run.copies for run in self.runs], dtype=np.int64).tolist() if self.runs else []

    def __repr__(self) -> str:
        return f"<Names of {len(self):,} ids and {len(self.materials):,} materials>"

    def __len__(self) -> int:
        return self._ends[-1] if self._ends else 0

    @overload
    def __getitem__(self, id: int) -> Copy: ...

    @overload
    def __getitem__(self, id: slice) -> list[Copy]: ...

    def __getitem__(self, id: int | slice) -> Copy | list[Copy]:
        """Return what an id stands for. IndexError for one that there is not, as -1, where nothing is."""
        given: object = id
        if isinstance(given, str):
            raise TypeError(f"ids are numbers; find({given!r}) gives those of a name")
        if isinstance(id, slice):
            return [self[k] for k in range(*id.indices(len(self)))]
        if not 0 <= id < len(self):
            raise IndexError(f"there is no id {id}; they are 0 to {len(self) - 1}, and -1 where nothing is")
        row = bisect_right(self._ends, id)
        run = self.runs[row]
        first = self._ends[row] - run.copies
        return Copy(run.name, run.node, run.part, int(id) - first, run.mesh, run.material)

    def __iter__(self) -> Iterator[Copy]:
        for run in self.runs:
            for copy in range(run.copies):
                yield Copy(run.name, run.node, run.part, copy, run.mesh, run.material)

    def __contains__(self, wanted: object) -> bool:
        """Whether a node of this name, or a `Copy`, has an id."""
        return any(run.name == wanted for run in self.runs) or any(copy == wanted for copy in self)

    def find(self, pattern: str) -> np.ndarray:
        """Return the ids, (n,) int32, of the nodes whose name is `pattern` or matches it, as `Scene.find`.

        `np.isin(frame.instance, frame.names.find("ball *"))` is where these are in the picture.
        """
        return self._ids([matches(run.name, pattern) for run in self.runs])

    def of_node(self, node: int) -> np.ndarray:
        """Return the ids, (n,) int32, of one node, by its place in `scene.nodes`."""
        return self._ids([run.node == node for run in self.runs])

    def find_materials(self, pattern: str) -> np.ndarray:
        """Return the ids, (n,) int32, of the materials whose name is `pattern` or matches it."""
        return np.flatnonzero([matches(name, pattern) for name in self.materials]).astype(np.int32)

    def _ids(self, wanted: list[bool]) -> np.ndarray:
        """The ids of the runs that are wanted."""
        return np.flatnonzero(np.repeat(wanted, [run.copies for run in self.runs])).astype(np.int32)

    def to_json(self) -> str:
        """Return the table as JSON, as EXR and NPZ hold it.

        {"instances": [{"id": 0, "name": "floor", "node": 2, "part": 0, "mesh": "floor", "material": 1,
        "copies": 1}, ...], "materials": ["white", ...]}; the copies of one part have the ids from `id` on.
        """
        firsts = [end - run.copies for end, run in zip(self._ends, self.runs, strict=True)]
        rows = [{"id": first, **run._asdict()} for first, run in zip(firsts, self.runs, strict=True)]
        return json.dumps({"instances": rows, "materials": self.materials}, ensure_ascii=False)

    @classmethod
    def from_json(cls, text: str) -> Names:
        """Return the table that `to_json` wrote. Raises SceneError for another text."""
        try:
            table = json.loads(text)
            runs = tuple(_run(row) for row in table["instances"])
            names = cls(runs, tuple(str(name) for name in table["materials"]))
            if [row["id"] for row in table["instances"]] != [0, *names._ends][: len(runs)]:
                raise ValueError
        except (ValueError, TypeError, KeyError, RecursionError):
            raise SceneError("this is no table of names") from None
        return names


def _run(row: dict[str, Any]) -> Run:
    texts, counts = ("name", "mesh"), ("node", "part", "material", "copies")
    if not all(isinstance(row[k], str) for k in texts):
        raise TypeError
    if not all(type(row[k]) is int and 0 <= row[k] < 1 << 40 for k in counts):
        raise TypeError
    return Run(**{k: row[k] for k in Run._fields})
