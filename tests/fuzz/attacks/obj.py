"""OBJ and MTL: lines out of order, and too much of everything."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from fuzz.attacks.files import CORNERS, NINES, TRIANGLE, WORN, Attack, text
from fuzz.attacks.images import chunk, png
from fuzz.seeds import OBJ, encoded


def obj() -> Iterator[Attack]:
    lines = [
        f"s {s}"
        for s in (
            "1e3",
            "-1",
            str(2**31),
            str(2**63 - 1),
            str(2**63),
            str(2**64),
            NINES,
            "0" * 5000,
            "on",
            "",
        )
    ]
    lines += [f"f 1 2 {i}" for i in ("0", "4", "-4", str(2**63), f"-{2**63}", NINES, "-" + NINES, "1.5", "nan", "", "x", "/",
                                     "//", "1/", "1//9", "1/9", "1/1/1/1", "1/-1", "1//-1", "\xb2", "1_0", "+1")]  # fmt: skip
    lines += [
        f"v 0 0 {x}\nf 1 2 4"
        for x in ("nan", "inf", "-1e400", NINES, "0x10", "1_0", "", "x", "1 1 1 nan", "1 1 1 1 1")
    ]
    lines += [f"vn {x}" for x in ("", "1", "nan nan nan")] + [f"vt {x}" for x in ("", "nan", "1e400 1")]
    lines += [f"{k} {'n' * 10**6}" for k in ("o", "g", "usemtl", "#", "call", "mtllib")]
    lines += ["curv 0 1", "p 1", "l 1 2", "call x", "csh rm", "\\", "f", "v", "o", "usemtl", "\0" * 1000]
    for line in lines:
        yield f"OBJ with {line[:40]!r}", text("a.obj", f"{TRIANGLE}{line}\nf 1 2 3\n")
    yield "OBJ in UTF-16", text("a.obj", OBJ.encode("utf-16"))
    yield "OBJ of 20 MB of zeros", text("a.obj", bytes(20 << 20))
    yield "OBJ of 5 M empty lines", text("a.obj", b"\n" * 5_000_000)
    yield "OBJ of continued lines", text("a.obj", b"\\\n" * 2_000_000)
    yield (
        "OBJ of continued lines of words",
        text("a.obj", TRIANGLE.encode() + b"f 1 2 3" + b" \\\n 1" * 500_000),
    )
    yield (
        "OBJ of 30,000 objects",
        text("a.obj", TRIANGLE + "".join(f"o {k}\nf 1 2 3\n" for k in range(30_000))),
    )
    yield (
        "OBJ of 100,000 objects",
        text("a.obj", TRIANGLE + "".join(f"o {k}\nf 1 2 3\n" for k in range(100_000))),
    )
    yield (
        "OBJ of 100,000 materials",
        text("a.obj", TRIANGLE + "".join(f"usemtl {k}\nf 1 2 3\n" for k in range(100_000))),
    )
    yield (
        "OBJ of 100,000 smoothing groups",
        text("a.obj", TRIANGLE + "".join(f"s {k}\nf 1 2 3\n" for k in range(100_000))),
    )
    far = "".join(f"v {k} 0 0\n" for k in range(100_000))
    yield (
        "OBJ of 5,000 objects over 100,000 vertices",
        text("a.obj", far + "".join(f"o {k}\nf 1 {k + 2} 100000\n" for k in range(5000))),
    )
    yield "OBJ of 500 kinds of glass over 100,000 vertices", text(
        "a.obj", "mtllib a.mtl\n" + far + "".join(f"usemtl {k}\nf 1 {k + 2} 100000\n" for k in range(500)),
        **{"a.mtl": "".join(f"newmtl {k}\nillum 7\n" for k in range(500))})  # fmt: skip
    yield "OBJ with a face of a million corners", text("a.obj", TRIANGLE + "f" + " 1 2 3" * 333_333 + "\n")
    star = "".join(
        f"v {x} {y} 0\n"
        for x, y in (((1 + k % 2) * np.cos(k / 20.4), (1 + k % 2) * np.sin(k / 20.4)) for k in range(128))
    )
    comb = "".join(f"v {k} {(k % 2) * 50} 0\n" for k in range(126)) + "v 126 -1 0\nv 0 -1 0\n"
    for about, shape in (("stars", star), ("combs", comb)):
        for count in (300, 3000):
            yield (
                f"OBJ of {count} {about}",
                text("a.obj", shape + ("f " + " ".join(map(str, range(1, 129))) + "\n") * count),
            )
    yield (
        "OBJ of faces of 2,000 sizes",
        text("a.obj", TRIANGLE + "".join("f" + " 1 2 3" * k + "\n" for k in range(1, 1500))),
    )


def mtl() -> Iterator[Attack]:
    said = [f"illum {x}" for x in ("nan", "inf", "-1", "11", "1e400", NINES, "x", "")]
    said += [
        f"{k} {x}"
        for k in ("Kd", "Ks", "Ns", "d", "Tr", "Ni", "Tf", "Ke", "Pr", "Pm")
        for x in ("nan", "-inf 1 2", NINES, "x")
    ]
    said += ["map_Kd", "map_Kd -s", "map_Kd -s nan 1 p", "map_Kd -o 1e400 p", "map_Kd -mm 1", "map_Kd -s 1e30 1e30 1e30 p",
             "map_Kd " + "-s 1 1 " * 300_000 + "p", "map_Kd " + "-mm 0 1 " * 300_000 + "p", "map_Kd " + "-s " * 500_000 + "p",
             "map_Kd " + "p " * 500_000, "map_Kd p\nmap_d p", "map_Pr p\nmap_Pm q", "norm p\nmap_Ke p"]  # fmt: skip
    for line in said:
        yield (
            f"MTL with {line[:40]!r}",
            text("a.obj", "mtllib a.mtl\n" + WORN, **{"a.mtl": f"newmtl m\n{line}\n", "p": encoded("PNG")}),
        )

    def cutouts(count: int, folder: Path) -> Path:
        """Each of many small masks over one large picture."""
        (folder / "big").write_bytes(png(4096, 4096))
        for k in range(count):
            (folder / f"m{k}").write_bytes(png(2, 2, before=chunk(b"tEXt", b"k\0%d" % k)))
        mtl = "".join(f"newmtl {k}\nmap_Kd big\nmap_d m{k}\n" for k in range(count))
        obj = TRIANGLE + CORNERS + "".join(f"usemtl {k}\nf 1/1 2/2 3/3\n" for k in range(count))
        return text("a.obj", "mtllib a.mtl\n" + obj, **{"a.mtl": mtl})(folder)

    def same(count: int, folder: Path) -> Path:
        (folder / "big").write_bytes(png(4096, 4096, kind=6))
        mtl = "".join(f"newmtl {k}\nmap_Kd big\nmap_Pr big\n" for k in range(count))
        obj = TRIANGLE + CORNERS + "".join(f"usemtl {k}\nf 1/1 2/2 3/3\n" for k in range(count))
        return text("a.obj", "mtllib a.mtl\n" + obj, **{"a.mtl": mtl})(folder)

    for count in (60, 1000):
        yield f"{count} cutouts of one picture", partial(cutouts, count)
        yield f"{count} materials of one picture", partial(same, count)
    yield (
        "MTL of 300,000 materials",
        text("a.obj", "mtllib a.mtl\n" + WORN, **{"a.mtl": "".join(f"newmtl {k}\n" for k in range(300_000))}),
    )
