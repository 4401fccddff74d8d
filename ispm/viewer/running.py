"""A session that runs: a thread that draws, a bounded queue of messages, and those who listen."""

from __future__ import annotations

import threading
import time as clock
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from ispm.errors import IspmError, SceneError, SettingsError
from ispm.scene.camera import Camera
from ispm.scene.scene import Scene
from ispm.settings import Settings
from ispm.viewer.changes import fingerprint
from ispm.viewer.drawing import Drawing
from ispm.viewer.fields import granted
from ispm.viewer.messages import Hold, Message, merged
from ispm.viewer.pick import Picked
from ispm.viewer.session import Picture, Session

LEAST_FPS, MOST_FPS = 0.1, 240.0
MOST_QUEUED = 512  # messages; more are refused
_LOOKED_AT = 0.5  # s between looks at a file that is watched, at least
_LOOKING = 0.1  # of a core at most that looking for changes of the scene may take
_REST = 0.15  # s after the last message, until which no time is spent on what stands still
_RESTED = 1.5  # s after the last message, until which it is drawn as large as is quick, not at its full size
_HELD = 0.5  # s, likewise where a drag is about to begin
_FORGET = 1.0  # s after which a pause between pictures is no slow picture

_Result = TypeVar("_Result")
Listener = Callable[[Picture, Session], None]
Told = Callable[[Session], None]


class Running:
    """A session in a thread of its own, which draws while anyone listens.

    make   makes the session, in that thread
    watch  a file that is loaded again when it changes
    fps    how often a second the scene is looked at for changes, at most
    on_pick  called in that thread with what a click shows
    """

    def __init__(self, make: Callable[[], Session], *, watch: Path | None = None, fps: float = 15.0) -> None:
        self._make, self._watched, self._fps = make, watch, fps
        self._wake = threading.Condition()
        self._queue: deque[tuple[Message, object]] = deque()
        self._jobs: deque[tuple[Callable[[Session], Any], Future[Any]]] = deque()
        self._listeners: dict[object, tuple[Listener, Told]] = {}
        self._closing, self._editors = False, 0
        self._moved = 0.0  # when the last message came
        self._quiet = 0.0  # when pictures of what stands still may be drawn better again
        self._editing = threading.RLock()
        self._opened: Future[Session] = Future()
        self._thread = threading.Thread(target=self._run, name="ispm-view", daemon=True)
        self._on_close: list[Callable[[], None]] = []
        self.on_pick: Callable[[Picked], None] | None = None

    def start(self) -> Running:
        """Begin to draw. Raises IspmError where the scene cannot be drawn, or no adapter serves."""
        self._thread.start()
        self._opened.result()
        return self

    @property
    def session(self) -> Session:
        """What runs. Other threads read it, and change it by `ask` and `editing` alone."""
        return self._opened.result()

    @contextmanager
    def editing(self) -> Iterator[Scene]:
        """Hold pictures back while the scene is changed, and have the next one show it."""
        session = self._opened.result()
        with self._wake:
            self._editors += 1  # or the thread that draws would always have the lock first
        try:
            with self._editing:
                yield session.scene
                session.touch()
        finally:
            with self._wake:
                self._editors -= 1
                self._wake.notify_all()

    @property
    def listened(self) -> bool:
        """Whether anyone listens."""
        return bool(self._listeners)

    @property
    def closed(self) -> bool:
        """Whether it has ended, or is about to."""
        return self._closing

    def wait(self, asked: Callable[[], bool] = lambda: False) -> None:
        """Wait until Ctrl-C, another thread, or what `asked` says, ends it."""
        try:
            while self._thread.is_alive() and not asked():
                self._thread.join(0.2)
        except KeyboardInterrupt:
            pass
        self.close()

    def close(self) -> None:
        """Stop drawing, and serving; free the adapter. Closing twice does no harm."""
        with self._wake:
            self._closing = True
            self._wake.notify_all()
        for each in self._on_close:
            each()
        self._on_close.clear()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join()

    # -- for canvases ----------------------------------------------------------------------------------------

    def post(self, message: Message, sender: object = None) -> bool:
        """Queue a message, merged with the last one where both are one; False where the queue is full."""
        with self._wake:
            self._moved = clock.monotonic()
            self._quiet = max(self._quiet, self._moved + (_HELD if type(message) is Hold else _REST))
            if type(message) is Hold:
                return not self._closing
            if self._queue and self._queue[-1][1] is sender:
                both = merged(self._queue[-1][0], message)
                if both is not None:
                    self._queue[-1] = both, sender
                    return True
            if len(self._queue) >= MOST_QUEUED or self._closing:
                return False
            self._queue.append((message, sender))
            self._wake.notify_all()
            return True

    def ask(self, job: Callable[[Session], _Result]) -> Future[_Result]:
        """Have the drawing thread call `job` between pictures; return what will be its result."""
        answer: Future[_Result] = Future()
        with self._wake:
            if self._closing:
                answer.set_exception(IspmError("this view is closed"))
                return answer
            self._jobs.append((job, answer))
            self._wake.notify_all()
        return answer

    def listen(self, key: object, picture: Listener, told: Told) -> None:
        """Call, in the drawing thread, `picture` with each picture, and `told` where the state alone changed.

        key  by which `leave` ends it. Nothing is drawn while nobody listens.
        """
        with self._wake:
            self._listeners[key] = picture, told
            self._wake.notify_all()

    def leave(self, key: object) -> None:
        """Stop calling a listener."""
        with self._wake:
            self._listeners.pop(key, None)

    def on_closing(self, do: Callable[[], None]) -> None:
        """Call `do` when it closes."""
        self._on_close.append(do)

    # -- the thread ------------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            session = self._make()
        except BaseException as error:  # the thread that waits tells it
            self._opened.set_exception(error)
            return
        session.on_pick = self._picked
        self._opened.set_result(session)
        try:
            self._loop(session)
        finally:
            session.draw.close()
            with self._wake:
                self._closing = True
                left = [answer for _, answer in self._jobs]
            for answer in left:
                answer.set_exception(IspmError("this view is closed"))

    def _loop(self, session: Session) -> None:
        before, looked, print_, stamp = clock.monotonic(), 0.0, 0, _stamp(self._watched)
        pause = 1.0 / self._fps
        while True:
            with self._wake:
                if not self._waiting(session):
                    rest = self._quiet - clock.monotonic()
                    self._wake.wait(min(pause, rest) if rest > 0.0 else pause)
                self._wake.wait_for(lambda: not self._editors)
                if self._closing:
                    return
                posted, self._queue = list(self._queue), deque()
                jobs, self._jobs = list(self._jobs), deque()
            now = clock.monotonic()
            with self._editing:
                changed = self._handled(session, posted, jobs)
                session.pass_time(min(now - before, _FORGET) if self._listeners else 0.0)
                before = now
                if now - looked > pause:
                    found = fingerprint(session.scene)
                    if found != print_:
                        print_ = found
                        session.touch()
                    looked = clock.monotonic()
                    pause = max(1.0 / self._fps, (looked - now) / _LOOKING)
                    stamp, reloaded = self._reloaded(session, stamp)
                    changed |= reloaded
                wanted = self._wanted(session)
                # a picture brings the state with it, but the first one may take long
                if changed and not (wanted and session.picture is not None):
                    self._tell(session)
                if wanted:
                    self._draw(session)

    def _waiting(self, session: Session) -> bool:
        """Whether there is something to do."""
        return bool(self._closing or self._queue or self._jobs or self._wanted(session))

    def _wanted(self, session: Session) -> bool:
        """Whether to draw now: a better picture of what stands still waits for who is about to move it."""
        if not self._listeners or not session.wants_picture:
            return False
        return session.moves or clock.monotonic() >= self._quiet

    def _handled(self, session: Session, posted: list[Any], jobs: list[Any]) -> bool:
        """Do what was asked for; whether anything was."""
        for message, sender in posted:
            try:
                session.handle(message, sender)
            except IspmError as error:
                session.line = str(error)
        for job, answer in jobs:
            if not answer.set_running_or_notify_cancel():
                continue
            try:
                answer.set_result(job(session))
            except Exception as error:  # who asked is told
                answer.set_exception(error)
        return bool(posted or jobs)

    def _draw(self, session: Session) -> None:
        try:
            picture = session.next_picture(rested=clock.monotonic() - self._moved > _RESTED)
        except Exception as error:  # a scene half changed, or one that cannot be drawn
            session.line = str(error) if isinstance(error, IspmError) else f"{type(error).__name__}: {error}"
            session.fail()
            self._tell(session)
            clock.sleep(0.05)
            return
        if picture is None:
            return
        for listener, _ in list(self._listeners.values()):
            listener(picture, session)

    def _tell(self, session: Session) -> None:
        for _, told in list(self._listeners.values()):
            told(session)

    def _picked(self, found: Picked) -> None:
        if self.on_pick is not None:
            self.on_pick(found)

    def _reloaded(self, session: Session, stamp: object) -> tuple[object, bool]:
        """Open the watched file again where it changed and stands still since; its stamp, and whether."""
        if self._watched is None:
            return None, False
        now = _stamp(self._watched)
        if now == stamp or now is None or clock.time() - self._watched.stat().st_mtime < _LOOKED_AT:
            return stamp, False
        from ispm.io.load import load

        try:
            found = load(self._watched, **session.loading)
            found.environment = session.scene.environment  # which no scene file has
            session.open(found, session.source, keep_camera=True)
            session.line = f"{self._watched.name} was loaded again"
        except (SceneError, OSError) as error:
            session.line = str(error)
        return now, True


def _stamp(path: Path | None) -> object:
    """What tells one state of a file from another; None: it is not there."""
    try:
        return None if path is None else (path.stat().st_mtime_ns, path.stat().st_size)
    except OSError:
        return None


def live(
    scene: Scene,
    settings: Settings,
    camera: Camera | str | int | None = None,
    *,
    source: str = "",
    loading: Mapping[str, Any] | None = None,
    fps: float = 15.0,
    adapter: str | None = None,
    threads: int | None = None,
    watch: Path | None = None,
    prepare: Callable[[Session], None] = lambda session: None,
) -> Running:
    """Return a viewer that has begun to draw for whoever listens. Arguments as of `Session`.

    prepare  called with the session before its first picture
    Raises SettingsError for settings, or pictures a second, that a viewer does not grant.
    """
    if not LEAST_FPS <= fps <= MOST_FPS:  # not a number is neither
        raise SettingsError(f"fps: {fps:g} is not within {LEAST_FPS:g} to {MOST_FPS:g}")
    granted(settings)
    if settings.exposure == "auto":  # which would flicker
        settings = settings.replace(exposure="hold")

    def make() -> Session:
        drawing = Drawing(adapter, threads)
        try:
            session = Session(scene, drawing, settings, camera, fps, source)
            session.loading = session.loading if loading is None else loading
            prepare(session)
        except BaseException:
            drawing.close()
            raise
        return session

    return Running(make, watch=watch, fps=fps).start()
