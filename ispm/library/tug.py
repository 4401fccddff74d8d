"""A cargo tug that hovers: one moving object of 14,762 triangles; it flies along +x."""

from __future__ import annotations

import numpy as np

from ispm.library.cargo import container
from ispm.library.finishes import Finishes, pieces
from ispm.library.forms import beveled_box, loft, pipe, placed, pose, refined, unwrapped
from ispm.library.pipework import flange
from ispm.library.shapes import box, lathe, merge, tube
from ispm.scene.material import Material
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Part

TRIANGLES = 14_762


def tug(finishes: Finishes) -> list[Part]:
    """Return the parts of a tug about the origin: a hull with a cockpit, four thrusters, a container below.

    7 m long, 4.4 m wide; from 2.1 m below to 1.3 m above.
    """
    collected = pieces()
    collected["orange paint"].append(_hull())
    collected["dark hull"].append(_belly())
    ring, nozzle = _thruster()
    for x in (-1.9, 1.7):
        for s in (-1.0, 1.0):
            place = pose(x, 0.05, s * 1.75)
            collected["white paint"].append(placed(ring, place))
            collected["dark metal"].append(placed(nozzle, place))
            collected["steel"].append(pipe([(x, 0.05, s * 0.6), (x, 0.05, s * 1.3)], 0.13, 14))
            collected["dark metal"].append(placed(flange(0.13, 16), pose(x, 0.05, s * 0.95, pitch=90.0)))
    sheets, frame = container(4.2)
    below = pose(-0.1, -2.12, 0.0) @ np.diag([1.0, 0.55, 0.80, 1.0])
    collected["blue paint"].append(placed(sheets, below))
    collected["yellow paint"].append(placed(frame, below))
    for x in (-1.6, 1.4):
        for s in (-1.0, 1.0):
            collected["steel"].append(
                pipe([(x, -0.1, s * 0.5), (x, -0.45, s * 0.85), (x, -0.85, s * 0.95)], 0.06, 10, 0.08)
            )
            collected["hazard"].append(
                beveled_box((x - 0.13, -0.95, s * 0.95 - 0.10), (x + 0.13, -0.68, s * 0.95 + 0.10), 0.02)
            )
    rail = [(1.9, 0.75, 0.62), (1.2, 1.02, 0.66), (-1.9, 1.02, 0.66), (-2.3, 0.7, 0.6)]
    collected["galvanized"] += [
        pipe([(x, y, s * z) for x, y, z in rail], 0.03, 10, 0.15) for s in (-1.0, 1.0)
    ]
    collected["galvanized"] += [
        pipe([(x, 0.45, s * 0.62), (x, 1.02, s * 0.66)], 0.022, 8)
        for x in (-1.8, -0.9, 0.0, 0.9)
        for s in (-1, 1)
    ]
    parts = finishes.parts(collected, "tug")
    glass = Material((0.03, 0.05, 0.06), roughness=0.25, name="cockpit")
    lamp = Material((0.60, 0.90, 1.0), unlit=True, name="running lamp")
    parts.append(Part(_cockpit(), glass))
    lamps = [box((3.28, -0.05, z - 0.16), (3.34, 0.03, z + 0.16)) for z in (-0.42, 0.42)]
    glow = lathe([(0.0, -0.345), (0.40, -0.345), (0.40, -0.33), (0.0, -0.33)], 24)
    lamps += [placed(glow, pose(x, 0.05, s * 1.75)) for x in (-1.9, 1.7) for s in (-1, 1)]
    parts.append(Part(merge(lamps, "running lamps"), lamp))
    block = beveled_box((-0.9, 0.5, -0.5), (0.3, 0.95, 0.5), 0.06, "power unit")
    rest = TRIANGLES - sum(len(part.mesh.triangles) for part in parts)
    parts.append(Part(unwrapped(refined(block, rest), 2.0), finishes["dark metal"]))
    return parts


def _section(x: np.ndarray, half_y: np.ndarray, half_z: np.ndarray, y: np.ndarray, sides: int) -> np.ndarray:
    """(R, S, 3) rings of rounded rectangles across x, counter-clockwise seen from +x."""
    t = 2.0 * np.pi * (np.arange(sides) + 0.5) / sides
    across, up = (np.sign(v) * np.abs(v) ** 0.5 for v in (np.cos(t), np.sin(t)))
    rings = np.empty((len(x), sides, 3))
    rings[..., 0] = x[:, None]
    rings[..., 1] = y[:, None] + half_y[:, None] * up
    rings[..., 2] = -half_z[:, None] * across
    return rings


def _hull() -> Mesh:
    """The body: blunt in front, cut behind."""
    x = np.concatenate([np.linspace(-2.9, 2.0, 22), np.linspace(2.15, 3.3, 12)])
    taper = np.sqrt(np.clip(1.0 - ((x - 1.0) / 2.6) ** 2, 0.0, 1.0)) * (x > 1.0) + 1.0 * (x <= 1.0)
    back = np.clip((x + 3.3) / 0.8, 0.0, 1.0) ** 0.4
    return loft(
        _section(
            x, 0.52 * taper * back, 0.78 * (0.35 + 0.65 * taper) * back, 0.12 - 0.12 * (1.0 - taper), 36
        ),
        "hull",
    )


def _belly() -> Mesh:
    """The frame below the body that holds cargo."""
    parts = [
        beveled_box((-2.5, -0.52, s * 0.52 - 0.12), (2.3, -0.28, s * 0.52 + 0.12), 0.03) for s in (-1.0, 1.0)
    ]
    parts += [beveled_box((x - 0.15, -0.56, -1.0), (x + 0.15, -0.34, 1.0), 0.03) for x in (-1.6, -0.1, 1.4)]
    parts += [
        beveled_box((x - 0.4, 0.3, s * 0.74 - 0.08), (x + 0.4, 0.42, s * 0.74 + 0.08), 0.03)
        for x in (-1.9, -0.8, 0.4)
        for s in (-1, 1)
    ]
    return merge(parts, "belly")


def _thruster() -> tuple[Mesh, Mesh]:
    """A ducted fan about the y axis: its ring, and what is within."""
    angle = np.linspace(0.0, 2.0 * np.pi, 11)
    profile = [(0.56 + 0.09 * float(np.cos(a)), 0.27 * float(np.sin(a))) for a in angle]
    profile[-1] = profile[0]
    blade = placed(beveled_box((0.08, -0.012, -0.07), (0.50, 0.012, 0.07), 0.006), pose(pitch=28.0))
    inner = [lathe([(0.0, -0.2), (0.1, -0.2), (0.13, 0.0), (0.09, 0.18), (0.0, 0.24)], 20)]
    inner.append(placed(blade, *(pose(yaw=45.0 * k) for k in range(8))))
    around = 2.0 * np.pi * np.arange(20) / 20
    inner.append(
        tube(np.stack([0.53 * np.cos(around), 0 * around - 0.16, -0.53 * np.sin(around)], axis=1), 0.03, 6)
    )
    inner.append(lathe([(0.0, -0.33), (0.42, -0.33), (0.5, -0.22), (0.0, -0.21)], 24))
    return lathe(profile, 28), merge(inner)


def _cockpit() -> Mesh:
    """The cockpit's canopy."""
    x = np.linspace(1.0, 2.62, 14)
    bulge = np.sqrt(np.clip(1.0 - ((x - 1.55) / 1.12) ** 2, 0.02, 1.0))
    return loft(_section(x, 0.44 * bulge, 0.50 * bulge, 0.42 + 0.0 * x, 28), "canopy")
