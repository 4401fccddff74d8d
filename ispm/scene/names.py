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

_MAX_COPIES = 1 << 40  # copies; more are no scene


class Run(NamedTuple):
    """The copies of one part, whose ids follow each other; fields as of `Copy`."""

    node: int
    part: int
    mesh: str
    material: int
    copies: int


class Place(NamedTuple):
    """A node's name, and its parent's place in `scene.nodes`; -1: it has none."""

    name: str
    parent: int


class Copy(NamedTuple):
    """What one id of `instance` stands for: a part of a node, at one of the places where it is shown.

    name      of the node
    node      its place in `scene.nodes`, which tells nodes of the same name apart
    part      its place in `node.parts`; the node's lamp comes behind these
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
    nodes      of each node its name and its parent's place among them, in the order of `scene.nodes`
    runs       the table as it is kept: a row for the copies of one part
    Ids count from 0 in the order of the scene's nodes, their parts, and the copies of these; what has no
    triangles has none. They stay the same from frame to frame while nothing comes or goes.
    """

    runs: tuple[Run, ...] = ()
    materials: tuple[str, ...] = ()
    nodes: tuple[Place, ...] = ()

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
        return self._copy(run, int(id) - first)

    def __iter__(self) -> Iterator[Copy]:
        for run in self.runs:
            for copy in range(run.copies):
                yield self._copy(run, copy)

    def _copy(self, run: Run, copy: int) -> Copy:
        return Copy(self.nodes[run.node].name, run.node, run.part, copy, run.mesh, run.material)

    def __contains__(self, wanted: object) -> bool:
        """Whether a node of this name, or a `Copy`, has an id."""
        return any(self.nodes[run.node].name == wanted for run in self.runs) or any(
            copy == wanted for copy in self
        )

    def find(self, pattern: str, *, below: bool = False) -> np.ndarray:
        """Return the ids, (n,) int32, of the nodes whose name is `pattern` or matches it, as `Scene.find`.

        below  whether those of the nodes below them count as well, as of an object made of several
        `np.isin(frame.instance, frame.names.find("ball *"))` is where these are in the picture.
        """
        wanted: list[bool] = []
        for name, parent in self.nodes:  # parents come first
            wanted.append(matches(name, pattern) or (below and parent >= 0 and wanted[parent]))
        return self._ids([wanted[run.node] for run in self.runs])

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
        "copies": 1}, ...], "materials": ["white", ...], "nodes": [{"name": "room", "parent": -1}, ...]}; the
        copies of one part have the ids from `id` on.
        """
        rows = [
            {"id": end - run.copies, "name": self.nodes[run.node].name, **run._asdict()}
            for end, run in zip(self._ends, self.runs, strict=True)
        ]
        nodes = [place._asdict() for place in self.nodes]
        table = {"instances": rows, "materials": self.materials, "nodes": nodes}
        return json.dumps(table, ensure_ascii=False)

    @classmethod
    def from_json(cls, text: str) -> Names:
        """Return the table that `to_json` wrote. Raises SceneError for another text."""
        try:
            table = json.loads(text)
            rows, materials = table["instances"], tuple(str(name) for name in table["materials"])
            nodes = tuple(_place(node, k) for k, node in enumerate(table["nodes"]))
            names = cls(tuple(_run(row, len(nodes), len(materials)) for row in rows), materials, nodes)
            if json.loads(names.to_json())["instances"] != rows:
                raise ValueError
        except (ValueError, TypeError, KeyError, RecursionError):
            raise SceneError("this is no table of names") from None
        return names


def _place(row: dict[str, Any], index: int) -> Place:
    """The node at `index`, whose parent comes before it."""
    if not isinstance(row["name"], str) or not _is_count(row["parent"] + 1, index):
        raise ValueError
    return Place(row["name"], row["parent"])


def _run(row: dict[str, Any], nodes: int, materials: int) -> Run:
    """A row of the table; there are so many nodes and materials."""
    most = {"node": nodes - 1, "part": _MAX_COPIES, "material": materials - 1, "copies": _MAX_COPIES}
    if not isinstance(row["mesh"], str) or not all(_is_count(row[k], n) for k, n in most.items()):
        raise ValueError
    return Run(**{k: row[k] for k in Run._fields})


def _is_count(value: object, most: int) -> bool:
    return type(value) is int and 0 <= value <= most
