"""The state of a live view: a scene, a camera, settings, what is selected, the time line, the edits.

No network and no thread: messages go in, pictures and descriptions come out.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from ispm.errors import SceneError, SettingsError
from ispm.renderer.light_paths import LightPaths
from ispm.renderer.picture import Frame
from ispm.scene.camera import Camera
from ispm.scene.node import Node
from ispm.scene.scene import Scene
from ispm.settings import LOADING, Settings
from ispm.viewer import messages
from ispm.viewer.copied import Copy, without
from ispm.viewer.drawing import Draws
from ispm.viewer.edits import Hidden, History
from ispm.viewer.handling import EDITS, HANDLERS, QUIET, SAME_FRAME
from ispm.viewer.numbering import Numbering
from ispm.viewer.orbit import orbit_of
from ispm.viewer.pace import Pace
from ispm.viewer.pick import Picked, pick
from ispm.viewer.timeline import TimeLine

_Made = TypeVar("_Made")


@dataclass(eq=False)
class Picture:
    """What canvases show.

    number  counts pictures
    image   (h, w, 3) uint8 sRGB
    still   whether none will follow while nothing changes
    frame   that it is a view of
    """

    number: int
    image: np.ndarray
    still: bool
    frame: Frame


@dataclass(eq=False)
class Session:
    """A live view of a scene.

    scene     may be changed between pictures by edits, and by others who say so with `touch`
    draw      draws the pictures
    settings  that it begins with; its size is that of the pictures until a canvas asks for another
    camera    as of `Renderer`
    fps       pictures a second while something moves, for which they become smaller
    source    what the scene was opened by: a file or a name
    loading   what `load` took
    on_pick   called with what was picked
    inspected  the photons that light a place which was asked for, until the scene changes
    """

    scene: Scene
    draw: Draws
    settings: Settings
    camera: Camera | str | int | None = None
    fps: float = 15.0
    source: str = ""
    loading: Mapping[str, Any] = field(
        default_factory=lambda: {k: v for o in LOADING for k, v in asdict(o()).items()}
    )
    on_pick: Callable[[Picked], None] | None = None

    view: str = "full"
    line: str = ""
    selected: Node | None = None
    inspected: LightPaths | None = None
    hidden: Hidden = field(default_factory=Hidden)
    history: History = field(default_factory=History)
    numbering: Numbering = field(default_factory=Numbering)
    picture: Picture | None = None
    version: int = 0  # counts what may have changed the scene
    count: int = 0  # of pictures

    def __post_init__(self) -> None:
        self.begun, self._drawn_version = self.settings, -1
        self._made: dict[str, tuple[object, Any]] = {}
        self._pace = Pace(self.fps)
        self.open(self.scene, self.source)

    def open(self, scene: Scene, source: str, *, keep_camera: bool = False) -> None:
        """Take another scene, or another state of its file. Raises SceneError where it cannot be drawn."""
        camera = self.draw.open(scene, self.settings, self.camera)
        orbit = orbit_of(camera, scene.bounds)
        self.scene, self.source = scene, source
        self.home = orbit
        if not keep_camera:
            self.orbit = orbit
        self.selected, self.hidden, self.picture = None, Hidden(), None
        self.history.clear()
        self.numbering, self._copy = Numbering(), Copy()
        self.timeline, self.timed = TimeLine.of(scene), False
        self.touch()

    def touch(self) -> None:
        """Say that the scene has changed."""
        self.inspected = None
        self.version += 1
        self._changed, self._again, self._failed = True, False, False

    @property
    def moves(self) -> bool:
        """Whether what is seen has changed since the last picture."""
        return (self._changed or self._again or self.picture is None) and not self._failed

    @property
    def wants_picture(self) -> bool:
        """Whether a picture should be drawn: something changed, or it can still become better."""
        still = self.picture is not None and self.picture.still
        return self.moves or not (still or self._failed)

    def pass_time(self, seconds: float) -> None:
        """Let seconds of the clock go by, for what plays."""
        after = self.timeline.after(seconds)
        if after.time != self.timeline.time:
            self.timeline, self._changed, self._failed, self.inspected = after, True, False, None

    def next_picture(self, *, rested: bool = True) -> Picture | None:
        """Draw, and return what canvases should show now; None where nothing is to be drawn.

        rested  whether what stands still is drawn at its full size, though that may take long
        Raises IspmError where the scene or a setting cannot be drawn; the next change is tried again.
        """
        full = self.settings.size
        wanted = full if rested else self._pace.resting(full)
        if self._again and not self._changed and self.picture is not None:
            self._again = False
            return self._next(self.picture.frame, self.picture.still)
        moving, self._changed, self._again = self._changed, False, False
        frame: Frame | None = None
        if moving:
            began = clock.perf_counter()
            frame = self._drawn(self._pace.size(full))
            self._pace.spent(clock.perf_counter() - began)
        elif self.picture is None or self.picture.frame.settings.size not in (wanted, full):
            frame = self._drawn(wanted)
        else:
            frame = self.draw.settle()
            if frame is None and self.picture.frame.settings.size != full:
                frame = self._drawn(full)
        if frame is None:
            assert self.picture is not None
            self.count += 1
            self.picture = replace(self.picture, still=True, number=self.count)
            return self.picture
        return self._next(frame, False)

    def _next(self, frame: Frame, still: bool) -> Picture:
        image = np.ascontiguousarray(self._image(frame)[..., :3])
        self.count += 1
        self.picture = Picture(self.count, image, still, frame)
        return self.picture

    def fail(self) -> None:
        """Say that the last picture could not be drawn: none is tried until something changes."""
        self._failed = True

    def _drawn(self, size: tuple[int, int]) -> Frame:
        frame = self.draw.draw(self.shown(), self.settings.replace(size=size), self.orbit.placed)
        self._drawn_version = self.version
        return frame

    def _image(self, frame: Frame) -> np.ndarray:
        try:
            return self.draw.view(frame, self.view)
        except SettingsError as error:
            self.line, self.view = str(error), "full"
            return self.draw.view(frame, "full")

    def shown(self) -> Scene:
        """Return the scene at the time line's moment, without what is hidden."""
        return self.once("shown", self._shown)

    def _shown(self) -> Scene:
        if not self.timed and not self.hidden.nodes:
            return self.scene
        scene = self.scene.at(self.timeline.time, self.timeline.animation) if self.timed else self.scene
        copied = without(scene, self.scene, self.hidden.nodes)
        return self._copy.become(copied, self.scene)

    def once(self, name: str, make: Callable[[], _Made], *more: object) -> _Made:
        """Return what `make` does, made anew where the scene, its moment or one of `more` changed."""
        moment = (self.timeline.time, self.timeline.animation) if self.timed else None
        key = self.version, moment, more
        if name not in self._made or self._made[name][0] != key:
            self._made[name] = key, make()
        made: _Made = self._made[name][1]
        return made

    def handle(self, message: messages.Message, sender: object = None) -> None:
        """Do what a canvas asks for. Raises IspmError, in one line, where that cannot be done.

        sender  tells the drags of one canvas from those of another
        """
        self.line = ""
        HANDLERS[type(message)](self, message, sender)
        if isinstance(message, EDITS):
            self.touch()
        if isinstance(message, SAME_FRAME):
            self._again, self._failed = True, False
        elif not isinstance(message, QUIET):
            self._changed, self._failed = True, False

    def node(self, number: int | None) -> Node:
        """Return the node of a number. Raises SceneError where none in the scene has it."""
        node = None if number is None else self.numbering.node(number)
        if node is None or node not in self.scene:
            raise SceneError("there is no such node any more")
        return node

    def picked(self, x: float, y: float) -> Picked | None:
        """Return what a place in the last picture shows."""
        return None if self.picture is None else pick(self.picture.frame, x, y)

    def lit_by(self, x: float, y: float) -> LightPaths | None:
        """Return the photons that light a place in the last picture; None: nothing is there.

        Raises SceneError where the scene has changed and is not drawn yet, IspmError as of `Renderer`.
        """
        if self.picture is None or self._drawn_version != self.version:
            raise SceneError("the picture is about to change: ask again when it has")
        return self.draw.light_paths(self.picture.frame, x, y)

    def bounds_of(self, node: Node) -> np.ndarray:
        """Return the (2, 3) bounds of a node, m, world space; without a surface, of a box about its place."""
        try:
            return self.scene.bounds_of(node)
        except SceneError:
            place = self.scene.world_matrix(node)[:3, 3]
            half = 0.1 * self.diagonal()
            return np.stack([place - half, place + half])

    def diagonal(self) -> float:
        """Return m, of the box round the scene; 1 where there is none."""
        try:
            low, high = self.scene.bounds
        except SceneError:
            return 1.0
        return float(np.linalg.norm(high - low)) or 1.0
