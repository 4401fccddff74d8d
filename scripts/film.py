"""Record the film on the README's first screen: the live view, its camera orbited and its lamp dragged.

    python scripts/film.py [OUT.webp] [--scene NAME] [--size WxH] [--fps N] [--strip PNG]

Each picture is one frame of the preset `live`, as the view would draw it at that rate. What it keeps of the
frames before is what one sees. The session is moved by the messages that the page sends. The camera
and the lamp return to where they began, so that it goes on without a cut. --strip keeps six pictures in one,
to be looked at.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

import ispm
from ispm.settings import Settings
from ispm.viewer import messages as m
from ispm.viewer.drawing import PRESET, Drawing
from ispm.viewer.running import LEAST_FPS
from ispm.viewer.session import Picture, Session

SECONDS = 6.0
QUALITY = 72
ZOOM = -0.45  # so that all of the room is seen


def turned(t: float) -> tuple[float, float]:
    """Radians that the camera has orbited to the right and down, at a part of the film."""
    return 0.36 * math.sin(2.0 * math.pi * t), 0.10 * math.sin(4.0 * math.pi * t)


def dragged(t: float) -> np.ndarray:
    """Where the lamp is, in parts of the way from its place to the corners of the room: (3,)."""
    far = 0.5 - 0.5 * math.cos(2.0 * math.pi * t)
    return np.array(
        [0.6 * math.sin(4.0 * math.pi * t), -0.62 * far, 0.55 * math.sin(2.0 * math.pi * t) * far]
    )


def marked(picture: Picture, place: np.ndarray) -> Image.Image:
    """The picture with the mark of a lamp, as the page draws it."""
    height, width = picture.image.shape[:2]
    clip = picture.frame.camera["clip_from_world"] @ np.append(place, 1.0)
    x, y = (0.5 + 0.5 * clip[0] / clip[3]) * width, (0.5 - 0.5 * clip[1] / clip[3]) * height
    scale = 4
    layer = Image.new("RGBA", (width * scale, height * scale))
    draw = ImageDraw.Draw(layer)
    for color, wide in (("#000000a0", 4.0), ("#ffd79a", 1.6)):
        stroke = {"fill": color, "width": round(wide * scale)}
        ring = [scale * (v + d) for d in (-4.8, 4.8) for v in (x, y)]
        draw.ellipse(ring, outline=color, width=round(wide * scale))
        for k in range(8):
            s, c = math.sin(k * math.pi / 4.0), math.cos(k * math.pi / 4.0)
            draw.line([scale * v for v in (x + 7.0 * c, y + 7.0 * s, x + 10.0 * c, y + 10.0 * s)], **stroke)
    below = Image.fromarray(picture.image).convert("RGBA")
    below.alpha_composite(layer.resize((width, height), Image.Resampling.LANCZOS))
    return below.convert("RGB")


def main() -> None:
    """Draw the film, and say how large it is."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", nargs="?", type=Path, default=Path("docs/pictures/live.webp"))
    parser.add_argument("--scene", default="cornell-box")
    parser.add_argument("--size", default="560x420")
    parser.add_argument("--fps", type=float, default=15.0)
    parser.add_argument("--strip", type=Path)
    args = parser.parse_args()
    width, height = map(int, args.size.split("x"))
    scene = ispm.builtin(args.scene)
    settings = Settings(preset=PRESET, size=(width, height), exposure="hold")
    drawing = Drawing()
    session = Session(scene, drawing, settings, fps=LEAST_FPS)  # at which no picture becomes smaller
    node = next(each for each in scene.nodes if each.light is not None)
    lamp, home = session.numbering.of(node), scene.world_matrix(node)[:3, 3].copy()
    reach = 0.5 * (scene.bounds[1] - scene.bounds[0])
    count = round(SECONDS * args.fps)
    session.handle(m.Zoom(ZOOM))
    session.handle(m.Pan(0.0, -0.1))
    before = np.array(turned(0.0))
    pictures: list[Image.Image] = []
    for k in range(-4, count):  # what is before the film lets light of earlier frames gather
        t = (k % count) / count
        now = np.array(turned(t))
        place = home + dragged(t) * reach
        session.handle(m.Look(*(float(v) for v in now - before)))
        session.handle(m.Change("node", lamp, "place", [float(v) for v in place], gesture=1))
        before = now
        picture = session.next_picture()
        assert picture is not None
        if k >= 0:
            pictures.append(marked(picture, place))
    drawing.close()
    args.out.parent.mkdir(parents=True, exist_ok=True)
    first, *others = pictures
    first.save(
        args.out,
        save_all=True,
        append_images=others,
        duration=round(1000.0 / args.fps),
        loop=0,
        quality=QUALITY,
        method=6,
    )
    if args.strip:
        kept = pictures[:: max(count // 6, 1)][:6]
        strip = Image.new("RGB", (3 * width, 2 * height))
        for k, each in enumerate(kept):
            strip.paste(each, (k % 3 * width, k // 3 * height))
        strip.save(args.strip)
    print(f"{args.out}: {count} pictures of {width}x{height}, {args.out.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
