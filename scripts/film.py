"""Film what README's first screen shows: the light of live frames, as a camera orbits and a lamp is dragged.

    python scripts/film.py [OUT.webp] [--scene NAME] [--size WxH] [--fps N] [--sheet PNG]

Frames go on from one another, as in the live view. The camera and the lamp return to where they began, so
that it goes on without a cut. It can be stopped and goes on, as `ispm animate` does.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

import ispm
from ispm.film.animate import Shot

SECONDS = 6.0
QUALITY = 72
BACK = 1.5  # times as far as the scene's camera from the middle, so that all of the room is seen


def orbited(camera: ispm.Camera, middle: np.ndarray, t: float) -> ispm.Camera:
    """The camera at a part of the film, round the middle of the scene."""
    assert camera.pose is not None
    across, up = 0.36 * math.sin(2.0 * math.pi * t), 0.10 * math.sin(4.0 * math.pi * t)
    x, y, z = BACK * (camera.pose[:3, 3] - middle)
    far, turn, rise = math.hypot(x, z), math.atan2(x, z) - across, math.atan2(y, math.hypot(x, z)) + up
    away = math.hypot(far, y)
    flat = away * math.cos(rise)
    eye = middle + np.array([flat * math.sin(turn), away * math.sin(rise), flat * math.cos(turn)])
    return ispm.Camera.look_at(eye, middle, camera.yfov)


def dragged(t: float) -> np.ndarray:
    """Where the lamp is, in parts of the way from its place to the corners of the room: (3,)."""
    far = 0.5 - 0.5 * math.cos(2.0 * math.pi * t)
    return np.array(
        [0.6 * math.sin(4.0 * math.pi * t), -0.62 * far, 0.55 * math.sin(2.0 * math.pi * t) * far]
    )


def marked(picture: Image.Image, camera: ispm.Camera, place: np.ndarray) -> Image.Image:
    """The picture with the mark of a lamp, as the view's page draws it."""
    width, height = picture.size
    seen = np.linalg.inv(camera.extrinsics("opencv"))[:3] @ np.append(place, 1.0)
    x, y = (camera.intrinsics((width, height)) @ seen / seen[2])[:2]
    scale = 4
    layer = Image.new("RGBA", (width * scale, height * scale))
    draw = ImageDraw.Draw(layer)
    for color, wide in (("#000000a0", 4.0), ("#ffd79a", 1.6)):
        ring = [scale * (v + d) for d in (-4.8, 4.8) for v in (x, y)]
        draw.ellipse(ring, outline=color, width=round(wide * scale))
        for k in range(8):
            s, c = math.sin(k * math.pi / 4.0), math.cos(k * math.pi / 4.0)
            ray = [scale * v for v in (x + 7.0 * c, y + 7.0 * s, x + 10.0 * c, y + 10.0 * s)]
            draw.line(ray, fill=color, width=round(wide * scale))
    below = picture.convert("RGBA")
    below.alpha_composite(layer.resize((width, height), Image.Resampling.LANCZOS))
    return below.convert("RGB")


def main() -> None:
    """Make the film, and say how large it is."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", nargs="?", type=Path, default=Path("docs/pictures/live.webp"))
    parser.add_argument("--scene", default="cornell-box")
    parser.add_argument("--size", default="560x420")
    parser.add_argument("--fps", type=float, default=15.0)
    parser.add_argument("--sheet", type=Path)
    args = parser.parse_args()
    settings = ispm.Settings(preset="live", size=args.size)
    scene = ispm.builtin(args.scene)
    camera, middle, lamp = scene.default_camera(settings.size), scene.bounds.mean(axis=0), scene.lights[0]
    home, reach = np.array(lamp.translation), 0.5 * np.ptp(scene.bounds, axis=0)

    def move(renderer: ispm.Renderer, seconds: float) -> None:
        renderer.scene.lights[0].translation = home + dragged(seconds / SECONDS) * reach
        renderer.camera = orbited(camera, middle, seconds / SECONDS)

    film, given = ispm.Film(fps=args.fps, duration=SECONDS), args.out.parent / "film-%04d.png"
    shots: list[Shot] = []
    ispm.animate(
        scene, given, settings, film=film, change=move, contact_sheet=args.sheet, on_frame=shots.append
    )
    first, *others = (
        marked(Image.open(shot.path), orbited(camera, middle, t), home + dragged(t) * reach)
        for shot in shots
        for t in [shot.frame / args.fps / SECONDS]
    )
    duration = round(1000.0 / args.fps)
    first.save(
        args.out, save_all=True, append_images=others, duration=duration, loop=0, quality=QUALITY, method=6
    )
    for shot in shots:
        shot.path.unlink()
    print(f"{args.out}: {len(shots)} pictures of {args.size}, {args.out.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
