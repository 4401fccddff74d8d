"""Materials of MTL files, converted to glTF's.

Kd is the base color, linear. Ks is the reflectance at normal incidence, F0 (of files that Blender wrote: its
specular level, F0 = 0.08 Ks). Ns is Blinn and Phong's exponent: alpha = sqrt(2 / (Ns + 2)) (Walter et al.
2007). illum 3 and 5 are mirrors: metals of color Ks, smooth where Ns is not given or 1000, its largest value.
illum 4, 6, 7 and 9 are smooth glass of index Ni, tinted by the hue of Tf: solid where its faces are
closed, a thin sheet otherwise. Pr and Pm, roughness and metalness, go before Ns and illum.
Source: Wavefront, "MTL material format", 1995; https://benhouston3d.com/blog/extended-wavefront-obj-mtl-for-pbr
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ispm.errors import SceneError
from ispm.io.budget import WORK_PER_BYTE, Budget
from ispm.io.folder import read_inside
from ispm.io.mtl_picture import Maps, MapUse, parse_map
from ispm.io.notes import Notes
from ispm.scene.material import TEXTURES, AlphaMode, Material, TextureUse
from ispm.scene.mesh import Mesh
from ispm.scene.values import BRIGHTEST

MIRRORS, GLASS = (3, 5), (4, 6, 7, 9)
PLAIN_F0 = 0.04  # of ior 1.5, which specular_color multiplies
PLAIN_SPECULAR: dict[str, Any] = dict(specular=1.0, specular_color=(1.0, 1.0, 1.0))
PHYSICAL = {"pm", "pr", "map_pm", "map_pr"}
SHARPEST = 1000.0
UNREAD = {"map_ks", "map_ns", "map_bump", "bump", "disp", "decal", "refl", "map_ps", "map_refl"}

Statements = dict[str, str]  # of one material: what each key, in lower case, says
Color = tuple[float, float, float]


class Materials:
    """The materials of some MTL files, each made when it is first used."""

    def __init__(self, libraries: list[str], folder: Path, notes: Notes, budget: Budget) -> None:
        self._notes = notes
        self._maps = Maps(folder, notes, budget)
        self._records: dict[str, Statements] = {}
        self._made: dict[tuple[str, bool, bool], Material] = {}
        for library in dict.fromkeys(libraries):
            self._read(library, folder, budget)

    def _read(self, library: str, folder: Path, budget: Budget) -> None:
        """Read the file called `library`, or the several that it names."""
        whole = os.path.isfile(folder / library) or not library.split()
        for name in [library] if whole else dict.fromkeys(library.split()):
            try:
                data = read_inside(name.replace("\\", "/"), folder, budget)
                budget.take(f"materials '{name[:80]}'", work=WORK_PER_BYTE * len(data))
            except (SceneError, OSError) as error:
                self._notes.add(f"materials '{name[:80]}' are left out: {error}")
            else:
                for material, record in parse(bytes(data).decode("utf-8", "replace")).items():
                    self._records.setdefault(material, record)

    def get(self, name: str, mesh: Mesh, solid: Callable[[], bool]) -> Material:
        """Return the material `name` as `mesh` can show it: gray where there is none, plain without uv0.

        solid  tells whether the faces of this material are closed; called for glass alone
        """
        key = name, mesh.uv0 is not None, mesh.colors is not None
        if key not in self._made:
            record = self._records.get(name)
            if record is None and name:
                self._notes.add(f"material '{name[:80]}' is not there; a gray one is used")
            made = plain(mesh, name) if record is None else self._make(name, record, solid)
            self._strip(made, mesh)
            self._made[key] = made
        return self._made[key]

    def _strip(self, material: Material, mesh: Mesh) -> None:
        textured = [slot for slot in TEXTURES if getattr(material, slot) is not None]
        if textured and mesh.uv0 is None:
            self._notes.add(f"{mesh.name}: it lacks the texture coordinates that its material asks for")
            for slot in textured:
                setattr(material, slot, None)

    def _make(self, name: str, statements: Statements, solid: Callable[[], bool]) -> Material:
        record = _Record(statements, f"material '{name}'", self._notes)
        for key in sorted(UNREAD & set(statements)):
            self._notes.add(f"{key} of MTL files is not supported and passed over")
        values = _base(record) | self._textures(record) | _opacity(record)
        if record.glass:
            values |= _glass(record, solid())
        elif record.illum in MIRRORS and not PHYSICAL & set(statements):
            values |= _mirror(record)
        elif PHYSICAL & set(statements):
            values |= _physical(record)
        return Material(**values, double_sided=True, name=name)

    def _textures(self, record: _Record) -> dict[str, Any]:
        result: dict[str, Any] = {
            "normal_texture": self._use(record, "norm", srgb=False),
            "emission_texture": self._use(record, "map_ke", srgb=True),
            "base_color_texture": self._use(record, "map_kd", srgb=True),
        }
        if "map_d" in record.statements:
            result["base_color_texture"] = self._cutout(record) or result["base_color_texture"]
        rough, metal = record.map("map_pr"), record.map("map_pm")
        pixels = [None if m is None else self._maps.pixels(m.name, srgb=False) for m in (rough, metal)]
        if any(p is not None for p in pixels):
            result["metallic_roughness_texture"] = self._maps.use(
                rough or metal or MapUse(""),
                ("roughness", rough.name if rough else "", metal.name if metal else ""),
                lambda: self._maps.stacked([(pixels[0], 0), (pixels[1], 0)], (-1, 0, 1, -1)),
                srgb=False,
            )
        return result

    def _use(self, record: _Record, key: str, *, srgb: bool) -> TextureUse | None:
        what = record.map(key)
        pixels = None if what is None else self._maps.pixels(what.name, srgb=srgb)
        if what is None or pixels is None:
            return None

        def make() -> np.ndarray:
            if srgb and (pixels[..., 3] != 255).any():  # opacity is for map_d to say
                return self._maps.stacked([(pixels, 0), (pixels, 1), (pixels, 2)], (0, 1, 2, -1))
            return pixels

        return self._maps.use(what, (what.name,), make, srgb=srgb)

    def _cutout(self, record: _Record) -> TextureUse | None:
        """The base color with the opacity of map_d: its alpha where it has one, else its red."""
        mask, color = record.map("map_d"), record.map("map_kd")
        opacity = None if mask is None else self._maps.pixels(mask.name, srgb=True)
        if mask is None or opacity is None:
            return None
        base = None if color is None else self._maps.pixels(color.name, srgb=True)

        def make() -> np.ndarray:
            channel = 3 if (opacity[..., 3] != 255).any() else 0
            return self._maps.stacked([(base, 0), (base, 1), (base, 2), (opacity, channel)], (0, 1, 2, 3))

        return self._maps.use(color or mask, ("cutout", (color or mask).name, mask.name), make, srgb=True)


def plain(mesh: Mesh, name: str = "") -> Material:
    """Return the material of a mesh that brings none: gray, or white where it has colors of its own."""
    return Material((0.8 if mesh.colors is None else 1.0,) * 3, double_sided=True, name=name)


class _Record:
    """The statements of one material, with their values checked."""

    def __init__(self, statements: Statements, where: str, notes: Notes) -> None:
        self.statements, self.where, self.notes = statements, where, notes
        self.illum = int(self.number("illum", 2.0, 0.0, 10.0))

    @property
    def glass(self) -> bool:
        """Whether light goes through, bent: as illum says; without it, as Tf with an index does."""
        if "illum" in self.statements:
            return self.illum in GLASS
        return self.number("ni", 1.0, 0.0, 100.0) > 1.0 and max(self.color("tf", 0.0)) > 0.0

    def color(self, key: str, default: float, most: float = 1.0) -> Color:
        """Three numbers, or one for all, within 0..most."""
        words = self.statements.get(key, "").split()
        try:
            given = [float(word) for word in words[:3]] if words else [default]
        except ValueError:
            self.notes.add(
                f"{self.where}: '{key} {self.statements[key][:40]}' cannot be read; {default:g} is used"
            )
            given = [default]
        r, g, b = given if len(given) == 3 else given[:1] * 3
        return self._within(key, r, most), self._within(key, g, most), self._within(key, b, most)

    def number(self, key: str, default: float, low: float = 0.0, most: float = 1.0) -> float:
        """A number within low..most; a word before it, as in `d -halo 0.5`, is passed over."""
        words = self.statements.get(key, "").split()
        try:
            return max(self._within(key, float(words[-1]) if words else default, most), low)
        except ValueError:
            self.notes.add(
                f"{self.where}: '{key} {self.statements[key][:40]}' cannot be read; {default:g} is used"
            )
            return default

    def _within(self, key: str, value: float, most: float) -> float:
        if 0.0 <= value <= most:
            return value
        self.notes.add(f"{self.where}: {key} {value:g} is clamped to 0..{most:g}")
        return most if value > most else 0.0  # 0 where it is not a number

    def map(self, key: str) -> MapUse | None:
        """What a map statement names."""
        what = parse_map(self.statements.get(key, ""))
        return what if what.name else None


def parse(text: str) -> dict[str, Statements]:
    """Return the statements of each material in an MTL file; of two of one name, the first."""
    found: dict[str, Statements] = {}
    blender = "blender" in text[:200].lower()
    current: Statements = {}
    for line in text.splitlines():
        key, _, rest = line.strip().replace("\t", " ").partition(" ")
        key, rest = key.lower(), rest.strip()
        if key == "newmtl":
            current = {"blender": ""} if blender else {}
            found.setdefault(" ".join(rest.split()), current)
        elif key and not key.startswith("#"):
            named = key.startswith("map_") or key == "norm"  # names of pictures may hold a #
            current[key] = rest if named else rest.partition("#")[0].strip()
    return found


def _base(record: _Record) -> dict[str, Any]:
    color, glow = record.color("kd", 0.8), record.color("ke", 0.0, BRIGHTEST)
    if "map_kd" in record.statements and max(color) == 0.0:
        color = (1.0, 1.0, 1.0)
    if "map_ke" in record.statements and max(glow) == 0.0:
        glow = (1.0, 1.0, 1.0)
    mirror = record.color("ks", 0.0)
    level = 0.08 if "blender" in record.statements else 1.0
    return dict(
        base_color=color,
        specular=1.0 if max(mirror) > 0.0 else 0.0,
        specular_color=tuple(level * k / PLAIN_F0 for k in mirror) if max(mirror) > 0.0 else (1.0, 1.0, 1.0),
        roughness=_roughness(record),
        emission=glow,
    )


def _roughness(record: _Record) -> float:
    """The square root of alpha, 0 to 1."""
    exponent = record.number("ns", 0.0, 0.0, 1e6)
    return float((2.0 / (exponent + 2.0)) ** 0.25)


def _physical(record: _Record) -> dict[str, Any]:
    metallic = record.number("pm", 1.0 if "map_pm" in record.statements else 0.0)
    return dict(metallic=metallic, roughness=record.number("pr", 1.0), **PLAIN_SPECULAR)


def _mirror(record: _Record) -> dict[str, Any]:
    given = "kd" if "blender" in record.statements or max(record.color("ks", 0.0)) == 0.0 else "ks"
    smooth = record.number("ns", SHARPEST, 0.0, 1e6) >= SHARPEST
    return dict(
        base_color=record.color(given, 0.8),
        metallic=1.0,
        roughness=record.number("pr", 0.0 if smooth else _roughness(record)),
        **PLAIN_SPECULAR,
    )


def _glass(record: _Record, solid: bool) -> dict[str, Any]:
    filtered = record.color("tf", 1.0)
    brightest = max(filtered)
    return dict(
        base_color=tuple(f / brightest for f in filtered) if brightest > 0.0 else (1.0, 1.0, 1.0),
        metallic=0.0,
        roughness=record.number("pr", 0.0),
        **PLAIN_SPECULAR,
        ior=max(record.number("ni", 1.5, 0.0, 100.0), 1.0),
        transmission=1.0,
        thickness=1.0 if solid else 0.0,
        alpha_mode=AlphaMode.OPAQUE,
    )


def _opacity(record: _Record) -> dict[str, Any]:
    if record.glass:
        return {}
    if "map_d" in record.statements:
        return dict(alpha_mode=AlphaMode.MASK)
    opacity = record.number("d", 1.0) if "d" in record.statements else 1.0 - record.number("tr", 0.0)
    if opacity == 0.0 and "d" not in record.statements:
        record.notes.add(f"{record.where}: Tr 1 is taken for opaque, as some programs mean it")
        return {}
    if opacity == 1.0:
        return {}
    record.notes.count(
        "material with an opacity below 1 is drawn as a stochastic mask",
        "materials with an opacity below 1 are drawn as stochastic masks",
    )
    return dict(alpha_mode=AlphaMode.BLEND, base_color=(*_base(record)["base_color"], opacity))
