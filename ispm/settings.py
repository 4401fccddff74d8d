"""Every knob of the renderer, once: type, range, unit and what more and less of it costs.

Flags, environment variables, TOML files and the documentation are made from this one definition.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Mapping
from dataclasses import Field, dataclass, fields
from typing import Any, Literal, TypedDict, Unpack, get_args

from ispm.errors import SettingsError
from ispm.knobs import convert as convert
from ispm.knobs import knob
from ispm.knobs import nearest as nearest

Preset = Literal["default", "fast", "best", "talk", "live"]
Kernel = Literal["auto", "footprint", "measured", "class", "hint"]
Estimator = Literal["auto", "volumes", "tiled", "grid"]
Emission = Literal["auto", "map", "rays"]
Shadows = Literal["auto", "map", "rays"]
Tonemap = Literal["neutral", "agx", "none"]
Unlit = Literal["auto", "none", "studio", "sky", "lamp"]

RENDERER_VIEWS = ("photons", "bounce-map", "overdraw")
"""Those of VIEWS that only a renderer can make: they show its photons."""

_SURFACES = ("albedo", "normal", "depth", "emission", "instance", "material")
VIEWS = ("full", "direct", "indirect", "ambient", *RENDERER_VIEWS, "irradiance", *_SURFACES, "split")

LAYERS = (
    *("full", "direct", "indirect", "emission", "irradiance"),
    *("depth", "normal", "albedo", "instance", "material", "alpha"),
)

_RAYS = 20_000  # gather rays of a picture: as smooth as larger pictures need small ones more of each pixel
_SIDE_LEAST, _SIDE_MOST = 2, 8  # their square roots


@dataclass(frozen=True)
class Checked:
    """A frozen dataclass of knobs whose values are converted and checked as it is made."""

    def __post_init__(self) -> None:
        for f in fields(self):
            object.__setattr__(self, f.name, convert(f, getattr(self, f.name)))


@dataclass(frozen=True)
class Settings(Checked):
    """The settings of a picture. Raises SettingsError for a value out of range."""

    size: tuple[int, int] = knob(
        (1280, 720), "width and height of the picture", within=(1, 16384), unit="pixels", metavar="WxH"
    )
    photons: int = knob(
        40_000,
        "photons emitted per pass, all lights together; noise falls and time grows with it",
        within=(0, 16_000_000),
        metavar="N",
    )
    bounces: int = knob(
        32,
        "non-specular scatters of a photon at most, the one at its first hit included; "
        "0: direct light only, 1: one indirect bounce",
        within=(0, 100),
        metavar="N",
    )
    passes: int = knob(
        1,
        "pictures whose mean is taken, each with its own photons and smaller kernels; more: closer to the "
        "truth, and as many times slower; 1, with time_limit or target_error: as many as these want",
        within=(1, 1_000_000),
        metavar="N",
    )
    time_limit: float = knob(
        0.0,
        "passes stop before this time, but one is always made; 0: no limit",
        within=(0.0, 1e9),
        unit="seconds",
        metavar="SECONDS",
    )
    target_error: float = knob(
        0.0,
        "passes stop where the relative error that noise leaves is estimated to be less",
        within=(0.0, 1e3),
        metavar="E",
    )
    caustic_photons: float = knob(
        0.5,
        "share of the photons aimed at mirrors and glass where there are any; unbiased for any",
        within=(0.0, 1.0),
        metavar="F",
    )
    preset: Preset = knob(
        "default",
        "a group of settings to start from; fast: no gather rays; best: 16 of them; "
        "talk: as near to the talk of 2009 as can be, for comparison; live: for pictures that move",
        choices=get_args(Preset),
    )
    gather: int | Literal["auto"] = knob(
        "auto",
        "rays from each low-resolution pixel that look for the light around it, a square number; more: less "
        "noise and finer contact shadows, slower; 0: photons light the pixels themselves; "
        "auto: 4, in small pictures up to 64, with kernel class or hint 0",
        within=(0, 1024),
        words={"auto": "auto"},
        metavar="N",
        whole=True,
    )
    talk_errors: bool = knob(
        False, "with kernel hint: the minus in the distance and the second cosine of the talk's slide"
    )
    smoothing: float = knob(
        1.0,
        "factor on every kernel radius and on the filter's; more: smoother and blurrier",
        within=(0.01, 100.0),
        metavar="S",
    )
    kernel: Kernel = knob(
        "auto",
        "how a photon's kernel is sized; footprint (auto): in caustics by the beam that it stands for; "
        "measured: by the photons around it; for comparison, without gather rays and filter: class: by its "
        "bounce, hint: as in the talk of 2009",
        choices=get_args(Kernel),
    )
    subsampling: int = knob(
        4,
        "incident light is estimated on one pixel in K x K and upsampled; more: faster, coarser",
        within=(1, 16),
        metavar="K",
    )
    estimator: Estimator = knob(
        "auto",
        "how photons become light: raster volumes (the paper's), screen tiles, or a grid in world space",
        choices=get_args(Estimator),
    )
    emission: Emission = knob(
        "auto",
        "how photons leave the lights: rasterised bounce maps, or rays; auto: maps, but rays from lamps with "
        "a surface, and where a software adapter has much to draw; an environment always sends rays",
        choices=get_args(Emission),
    )
    shadows: Shadows = knob(
        "auto",
        "how lights without a surface cast shadows: maps, or rays, where there are many to few of them at a "
        "time; auto: maps, but rays where a software adapter has much to draw",
        choices=get_args(Shadows),
    )
    shadow_resolution: int = knob(
        1024,
        "texels of a shadow map's side; shared out where there are many lights",
        within=(16, 8192),
        metavar="N",
    )
    exposure: float | Literal["auto", "hold"] = knob(
        "auto",
        "exposure in stops; auto: found for each picture; hold: for a renderer's first, and kept",
        within=(-50.0, 50.0),
        words={"auto": "auto", "hold": "hold"},
        metavar="EV",
    )
    tonemap: Tonemap = knob(
        "neutral",
        "neutral: Khronos PBR Neutral, true colors; agx: AgX, softer, as film; none: clipped",
        choices=get_args(Tonemap),
    )
    background: tuple[float, float, float] | Literal["black", "transparent"] = knob(
        (0.0, 0.0, 0.0),
        "seen where nothing is and through glass: linear r,g,b of the screen, black, or transparent; of an "
        "environment, which glass shows, it takes the place unless it is black",
        within=(0.0, 1e6),
        words={"black": (0.0, 0.0, 0.0), "transparent": "transparent"},
        metavar="C",
    )
    light: Unlit = knob(
        "auto",
        "what lights a scene without lights; studio: softboxes all around; sky: a clear sky with its sun; "
        "lamp: one near the camera in a room, else far away; auto: a lamp in a room, else the studio",
        choices=get_args(Unlit),
    )
    ground: bool = knob(
        False,
        "stand the scene on ground that takes its shadow, for pictures of a single model; on black it is "
        "gray and fades out, else it shows what is behind it, darker where it is shaded",
    )
    antialias: bool = knob(True, "supersample the pixels on edges")
    live: bool = knob(
        False,
        "a renderer's frames go on from the ones before: of the photons it emits what stores some 24,000, a "
        "quarter of the pixels gathers, and at rest they converge",
    )
    seed: int = knob(
        0,
        "same seed, same settings, same machine: the same picture, bit for bit",
        within=(0, 2**32 - 1),
        metavar="N",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.gather, int) and math.isqrt(self.gather) ** 2 != self.gather:
            side = math.isqrt(self.gather)
            raise SettingsError(
                f"gather: {self.gather} is not a square number; use {side**2} or {(side + 1) ** 2}"
            )
        if self.is_plain and self.gather not in ("auto", 0):
            raise SettingsError(f"gather: kernel '{self.kernel}' lights the pixels itself; use 0 or auto")
        if self.kernel == "hint" and self.estimator not in ("auto", "volumes"):
            raise SettingsError(
                f"estimator: '{self.estimator}' does not have the talk's kernel, which kernel 'hint' is; "
                "use volumes or auto"
            )
        if self.live and self.is_plain:
            raise SettingsError(f"live: kernel '{self.kernel}' is for comparison; use footprint or auto")
        if self.talk_errors and self.kernel != "hint":
            raise SettingsError(
                f"talk_errors: kernel '{self.kernel}' has none of them; use kernel 'hint' or preset 'talk'"
            )

    @property
    def most_passes(self) -> float:
        """Passes at most: a limit of time or error stands for itself where passes were not asked for."""
        return math.inf if self.passes == 1 and (self.time_limit or self.target_error) else self.passes

    @property
    def is_plain(self) -> bool:
        """Whether photons alone light the pixels, by wide kernels, without a filter."""
        return self.kernel in ("class", "hint")

    @property
    def gather_rays(self) -> int:
        """How many rays each low-resolution pixel sends out, 0 where there is nothing to find."""
        if self.is_plain or not self.photons or not self.bounces:
            return 0
        if self.gather != "auto":
            return int(self.gather)
        pixels = math.prod(-(-side // self.subsampling) for side in self.size)
        return min(max(math.ceil(math.sqrt(_RAYS / pixels)), _SIDE_LEAST), _SIDE_MOST) ** 2

    def replace(self, **changes: Unpack[Changes]) -> Settings:
        """Return these settings with some changed; a preset changes what it holds and is not given here.

        Raises SettingsError for an unknown name.
        """
        for name in changes:
            knob_of(Settings, name)
        return dataclasses.replace(self, **_with_preset(changes))


class Changes(TypedDict, total=False):
    """The fields of Settings as arguments by name, for type checkers; a test holds the two together."""

    size: tuple[int, int]
    photons: int
    bounces: int
    passes: int
    time_limit: float
    target_error: float
    caustic_photons: float
    preset: Preset
    gather: int | Literal["auto"]
    talk_errors: bool
    smoothing: float
    kernel: Kernel
    subsampling: int
    estimator: Estimator
    emission: Emission
    shadows: Shadows
    shadow_resolution: int
    exposure: float | Literal["auto", "hold"]
    tonemap: Tonemap
    background: tuple[float, float, float] | Literal["black", "transparent"]
    light: Unlit
    ground: bool
    antialias: bool
    live: bool
    seed: int


def _preset_first(owner: type[Settings]) -> None:
    """Let what a preset holds stand in for what is not given where settings are made."""
    plain, names = owner.__init__, [f.name for f in fields(owner)]

    @functools.wraps(plain)
    def init(self: Settings, *placed: Any, **named: Any) -> None:
        given = dict(zip(names, placed, strict=False)) | named
        for name in named:
            knob_of(Settings, name)
        plain(self, **_with_preset(given))

    owner.__init__ = init  # type: ignore[method-assign]  # dataclasses have no hook between call and fields


def _with_preset(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return what was given, above what the preset among it holds."""
    preset = convert(knob_of(Settings, "preset"), given.get("preset", "default"))
    return {**PRESETS[preset], **given}


PRESETS: dict[str, dict[str, Any]] = {
    "default": {},
    "fast": {"gather": 0},
    "best": {"gather": 16},
    "live": {"live": True, "gather": 4, "exposure": "hold"},
    # The table's row 5, NS2 (Cargo Bay): 20,356 photons, 3 bounces, one sample in 6 x 6 pixels.
    "talk": {
        "photons": 20_356,
        "bounces": 3,
        "subsampling": 6,
        "estimator": "volumes",
        "kernel": "hint",
        "caustic_photons": 0.0,
        "gather": 0,
    },
}
_preset_first(Settings)


@dataclass(frozen=True)
class LoadOptions(Checked):
    """How a scene file is taken. Raises SettingsError for a value out of range."""

    up: str = knob("y", "the axis of an OBJ, PLY or STL that points up; glTF's is y", choices=("y", "z"))
    smooth_normals: bool = knob(False, "give smooth normals to meshes that bring none")
    crease_degrees: float = knob(
        30.0,
        "with smooth_normals: faces at a larger angle keep their edge",
        within=(0.0, 180.0),
        unit="degrees",
        metavar="DEGREES",
    )
    variant: str = knob("", "which of a glTF file's material variants is shown", name=True, metavar="NAME")


@dataclass(frozen=True)
class LoadLimits(Checked):
    """What a scene file may ask for at most. Raises SettingsError for a value out of range.

    `max_file_bytes`, `max_memory`, `max_work`, `max_nodes` and `max_triangles` are of a scene with all its
    files, the others of single items.
    """

    max_file_bytes: int = knob(
        4 << 30, "most bytes of a scene's files together", within=(1, 1 << 50), unit="bytes", metavar="N"
    )
    max_memory: int = knob(
        640 << 20,
        "most memory for arrays and pictures together, and 16 bytes more for each byte of the files; "
        "pictures that take much of what is left are halved",
        within=(1, 1 << 50),
        unit="bytes",
        metavar="N",
    )
    max_work: int = knob(
        1_000_000_000,
        "most steps of loading, of some ten nanoseconds, and 100 more for each byte of the files",
        within=(1, 1 << 50),
        metavar="N",
    )
    max_elements: int = knob(200_000_000, "most elements of one accessor", within=(1, 1 << 40), metavar="N")
    max_nodes: int = knob(1_000_000, "most nodes", within=(1, 1 << 40), metavar="N")
    max_triangles: int = knob(100_000_000, "most triangles, as placed", within=(1, 1 << 40), metavar="N")
    max_image_pixels: int = knob(
        64_000_000, "most pixels of one texture, before it is decoded", within=(1, 1 << 40), metavar="N"
    )
    max_texture: int = knob(
        4096, "larger textures are halved until they fit", within=(1, 1 << 20), unit="pixels", metavar="N"
    )


LOADING = LoadOptions, LoadLimits
"""What `load` takes the fields of."""


def resolve(*layers: Mapping[str, Any]) -> Settings:
    """Return the settings that `layers` make, the first above the next, all above preset and defaults."""
    return Settings().replace(**{k: value for layer in reversed(layers) for k, value in layer.items()})


def knob_of(owner: type, name: str) -> Field[Any]:
    """Return the field `name` of `owner`. Raises SettingsError where there is none."""
    known = {f.name: f for f in fields(owner)}
    if name not in known:
        raise SettingsError(f"there is no setting '{name}'{nearest(name, known)}")
    return known[name]
