"""The `ispm render` command that makes the picture of a session again."""

from __future__ import annotations

import math

from ispm.renderer.command_line import command_line
from ispm.scene.environment import Environment
from ispm.viewer.session import Session


def command_of(session: Session) -> str:
    """Return the command, without the edits: these are in the scene that can be saved."""
    orbit = session.orbit
    eye, target = (",".join(f"{v:.5g}" for v in point) for point in (orbit.eye, orbit.pivot))
    options: dict[str, object] = {"look_from": eye, "look_at": target}
    if orbit.camera.ymag is None:
        options["fov"] = f"{math.degrees(orbit.camera.yfov):.5g}"
    if session.timed:
        options["animation"], options["time"] = session.timeline.animation, round(session.timeline.time, 4)
    around = session.scene.environment
    if isinstance(around, Environment) and around.file:
        options["environment"] = around.file
        options["environment_rotation"] = f"{math.degrees(around.rotation):.5g}" if around.rotation else None
        options["environment_intensity"] = f"{around.intensity:.5g}" if around.intensity != 1.0 else None
    options["show"] = session.view
    settings = session.settings
    if settings.exposure == "hold" and session.picture is not None:
        settings = settings.replace(exposure=round(session.picture.frame.exposure, 3))
    return command_line(
        session.source or "SCENE.glb", options, settings, session.loading, output="picture.png"
    )
