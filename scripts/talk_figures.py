"""Print the figures of docs/talk.md: what the talk of 2009 claims, measured with this program.

python scripts/talk_figures.py          # some minutes on two cores
python scripts/talk_figures.py --quick  # rows of the table at a quarter of their pixels
"""

from __future__ import annotations

import math
import statistics
import sys

import numpy as np

import ispm
from ispm.estimators.volumes import Volumes
from ispm.gpu import Target, open_gpu
from ispm.optics.records import PHOTON, RECEIVER

# row of the talk's table: built-in scene, resolution, subsampling, emitted, bounces; stored, fps direct, full
ROWS = {
    9: ("glass-sphere", (512, 512), 6, 26_640, 2, 10_941, 199.0, 38.8),
    10: ("glass-sphere", (512, 512), 3, 137_780, 3, 66_447, 199.0, 10.3),
    11: ("glass-sphere", (1920, 1080), 6, 18_000, 2, 7_319, 163.0, 34.1),
    12: ("objects-in-box", (1920, 1080), 8, 27_620, 3, 37_433, 177.6, 11.8),
    13: ("objects-in-box", (1920, 1080), 10, 27_620, 2, 30_515, 177.6, 15.8),
    15: ("atrium", (1920, 1080), 4, 6_240, 1, 5_136, 195.2, 22.4),
    18: ("caustic-ring", (512, 384), 1, 101_124, 1, 5_020, 200.0, 28.0),
    19: ("caustic-ring", (512, 384), 1, 324_900, 1, 16_030, 200.0, 10.9),
    20: ("caustic-ring", (1920, 1080), 1, 101_124, 1, 5_020, 197.5, 24.3),
}
FRAMES = 5
SPHERE = dict(radius=2.0, albedo=0.6, flux=100.0)


def sphere() -> None:
    """Indirect light in an integrating sphere, over the exact answer."""
    bounces, radius, albedo, flux = 8, *SPHERE.values()
    exact = flux / (4 * math.pi**2 * radius**2) * sum(albedo ** (b + 1) for b in range(1, bounces + 1))
    for name, knobs in (
        ("ours", {}),
        ("talk", {"preset": "talk"}),
        ("talk, its slide's errors", {"preset": "talk", "talk_errors": True}),
    ):
        found = []
        for seed in range(6):
            settings = ispm.Settings(**knobs, size=(320, 180), bounces=bounces, seed=seed)
            frame = ispm.render(ispm.builtin("integrating-sphere", **SPHERE), settings)
            found.append(float(frame.indirect.mean(dtype=float)) / exact)
        error = statistics.stdev(found) / math.sqrt(len(found))
        print(f"  {name:26} {statistics.mean(found):.3f} +- {error:.3f}")


def bound() -> None:
    """What is left of a photon's flux where the volume is an icosahedron with its corners on the kernel."""
    gpu = open_gpu()
    side, half = 256, 1.25
    receivers = np.zeros(side * side, RECEIVER)
    place = ((np.arange(side) + 0.5) / side * 2 - 1) * half
    receivers["position"][:, 0] = np.tile(place, side)
    receivers["position"][:, 1] = np.repeat(-place, side)
    for name in ("n", "ng", "wo"):
        receivers[name] = (0, 0, 1)
    receivers["valid"] = 1
    clip = np.diag([1 / half, 1 / half, 0.1, 1.0])
    clip[2, 3] = 0.5
    photon = np.zeros(1, PHOTON)
    photon["flux"], photon["radius"], photon["height"] = 1.0, 1.0, 0.25
    for talk in (False, True):
        kept = []
        for scale in (1.25840857, 1.0):
            volumes = Volumes(gpu, talk)
            volumes._diffuse = gpu.raster(
                "estimators/volumes.wgsl", [Target("rgba32float", blend="add")], depth=None, cull="front",
                fragment="fs_diffuse", BOUND_SCALE=scale, TALK=talk,
            )  # fmt: skip
            for tilt in np.linspace(0.0, 0.1, 5):  # which corners lie in the plane depends on the frame
                photon["normal"] = photon["wi"] = (math.sin(tilt), 0.0, math.cos(tilt))
                found = volumes(receivers, photon, clip, (side, side))[:, 3]
                kept.append(float(found.sum()) * (2 * half / side) ** 2)
        whole, cut = np.array(kept).reshape(2, 5)
        left = cut / whole
        print(f"  {'cut Gaussian' if talk else 'biweight':13} {left.min():.4f} to {left.max():.4f}")
    gpu.close()


def rows(quick: bool) -> None:
    """Rows of the table: photons, kernels per pixel, and the cost of all light over direct light."""
    print("  row scene            stored (talk)    overdraw: ours, hint   full / direct: ours (talk)")
    for row, (name, size, subsampling, photons, bounces, stored, direct, full) in ROWS.items():
        size = (size[0] // 2, size[1] // 2) if quick else size
        scene = ispm.builtin(name)
        knobs = dict(size=size, subsampling=subsampling, photons=photons, bounces=bounces)
        found = []
        with ispm.Renderer(scene, ispm.Settings(**knobs)) as renderer:
            for k in range(FRAMES + 2):
                renderer.scene = scene.at(0.11 * k)
                found.append(renderer.render().stats)
            renderer.settings = ispm.Settings(**knobs, kernel="hint")
            hint = renderer.render().stats
        ratio = statistics.median(s.total_ms / s.direct_only_ms for s in found[2:])
        last = found[-1]
        print(
            f"  {row:3} {name:15} {last.stored_photons:8,} ({stored:6,})    {last.overdraw:8.1f} "
            f"{hint.overdraw:8.1f}      {ratio:8.2f} ({direct / full:.2f})",
            flush=True,
        )


if __name__ == "__main__":
    print("Integrating sphere, indirect radiance over the exact one:")
    sphere()
    print("Flux that an unscaled icosahedron keeps:")
    bound()
    print("The talk's table:")
    rows("--quick" in sys.argv[1:])
