"""Files made to do harm: a table of what was found, and of what might be tried.

Each is a name and a function that writes files into a folder and returns the path to load, or the path and
options of `ispm.load`. One module for each kind of thing that is spoiled.
"""

from __future__ import annotations

from collections.abc import Iterator

from fuzz.attacks.buffers import accessors
from fuzz.attacks.compressed import streams
from fuzz.attacks.deforming import deforming
from fuzz.attacks.files import Attack
from fuzz.attacks.hdr import environments
from fuzz.attacks.images import pictures
from fuzz.attacks.names import names, places
from fuzz.attacks.normals import smooth
from fuzz.attacks.obj import mtl, obj
from fuzz.attacks.ply import ply
from fuzz.attacks.stl import stl
from fuzz.attacks.structure import nodes, numbers

__all__ = ["Attack", "attacks"]


def attacks() -> Iterator[Attack]:
    """Yield all of them."""
    for source in (
        accessors,
        deforming,
        streams,
        pictures,
        numbers,
        nodes,
        names,
        obj,
        mtl,
        ply,
        stl,
        places,
        smooth,
        environments,
    ):
        yield from source()
