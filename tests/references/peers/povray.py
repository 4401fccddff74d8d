"""POV-Ray: radiosity at ever higher quality, and photon maps where there are caustics."""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from references.peers import SIZE, Recorder, work

_NEAR = 0.01  # fade_distance: nearer than that light does not grow with the inverse square
_RADIOSITY = {
    "R1": "count 35 error_bound 1.8 recursion_limit 3",
    "R2": "count 100 error_bound 0.5 recursion_limit 3 pretrace_end 0.01",
    "R3": "count 400 error_bound 0.25 recursion_limit 5 pretrace_end 0.01 nearest_count 10",
}
_SETTINGS = {  # radiosity, photons; from quick to slow
    "A": [("R1", 0), ("R2", 0), ("R3", 0)],
    "B": [("R2", 100_000), ("R2", 500_000), ("R3", 500_000)],
    "C": [("", 200_000), ("", 1_000_000)],
}
_SPENT = re.compile(r"(?:Photon|Radiosity|Trace) Time:.*?\(([\d.]+) seconds\)")


def render(name: str, recorder: Recorder) -> None:
    """Keep a picture of each setting, until one takes too long; each is a process of its own."""
    program = shutil.which("povray")
    if program is None:
        sys.exit("not installed: no povray on the path")
    parts = _parts(recorder.scene())
    for quality, photons in _SETTINGS[name]:
        source = recorder.folder / "scene.pov"
        source.write_text(_head(quality, photons) + parts, "utf-8")
        started = time.perf_counter()
        try:
            told = _run(program, source, timeout=recorder.limit)
        except subprocess.TimeoutExpired:
            return
        seconds = sum(map(float, _SPENT.findall(told)))
        if not recorder.kept:
            version = re.search(r"Version ([\d.]+\d)", told)
            title = f"POV-Ray {version[1] if version else ''}, {'photons' if photons else 'radiosity'}"
            recorder.ready(title, time.perf_counter() - started - seconds)
        recorder.add(seconds, _picture(source.with_suffix(".exr")))


def _run(program: str, source: Path, timeout: float) -> str:
    """Return what it says on the way."""
    options = [f"+I{source}", f"+O{source.with_suffix('.exr')}", f"+W{SIZE[0]}", f"+H{SIZE[1]}"]
    options += ["+FE", f"+WT{os.cpu_count()}", "-D", "-A", "+Q9"]
    done = subprocess.run([program, *options], capture_output=True, text=True, timeout=timeout)
    if done.returncode:
        sys.exit(next((line for line in done.stderr.splitlines() if "rror" in line), "povray failed"))
    return done.stderr


def _picture(path: Path) -> np.ndarray:
    with OpenEXR.File(str(path)) as file:
        channels = file.channels()
        found: np.ndarray = channels[next(iter(channels))].pixels[..., :3]
        return found


def _head(quality: str, photons: int) -> str:
    radiosity = f"radiosity {{ {_RADIOSITY[quality]} }}" if quality else ""
    gather = "" if quality else "gather 10, 40 jitter 0.4"
    caustics = f"photons {{ count {photons} autostop 0 {gather} }}" if photons else ""
    return (
        f"#version 3.7;\nglobal_settings {{ assumed_gamma 1 max_trace_level 16 {radiosity} {caustics} }}\n"
        "#default { finish { ambient 0 emission 0 diffuse 1 } }\n"
    )


def _parts(described: dict[str, Any]) -> str:
    camera, light = described["camera"], described["light"]
    high = 2.0 * math.tan(0.5 * camera["yfov"])
    up, right = high * np.array(camera["up"]), high * SIZE[0] / SIZE[1] * np.array(camera["right"])
    color = np.array(light["intensity"]) / (2.0 * math.pi * _NEAR**2)
    lines = [
        f"camera {{ location {_vector(camera['eye'])} direction {_vector(camera['forward'])}"
        f" right {_vector(right)} up {_vector(up)} }}",
        f"light_source {{ {_vector(light['position'])} color rgb {_vector(color)}"
        f" fade_distance {_NEAR} fade_power 2 photons {{ reflection on refraction on }} }}",
        *(_mesh(part) for part in described["parts"]),
    ]
    return "\n".join(lines)


def _mesh(part: dict[str, Any]) -> str:
    lists = {"vertex_vectors": part["positions"], "normal_vectors": part["normals"]}
    lists["face_indices"] = part["corners"]
    rows = [f"{key} {{ {len(rows)}, {', '.join(map(_vector, rows))} }}" for key, rows in lists.items()]
    return f"mesh2 {{ {' '.join(rows)} {_material(part)} }}"


def _material(part: dict[str, Any]) -> str:
    color = _vector(part["color"])
    if part["kind"] == "lambert":
        return f"pigment {{ color rgb {color} }}"
    if part["kind"] == "mirror":
        return (
            f"pigment {{ color rgb 0 }} finish {{ diffuse 0 reflection {{ color rgb {color} }} }}"
            " photons { target reflection on refraction off }"
        )
    return (
        "pigment { color rgbt 1 } finish { diffuse 0 reflection { 0, 1 fresnel on } conserve_energy }"
        f" interior {{ ior {part['ior']} }} photons {{ target reflection on refraction on }}"
    )


def _vector(values: Iterable[float]) -> str:
    return f"<{', '.join(f'{value:.9g}' for value in values)}>"


if __name__ == "__main__":
    work(render)
