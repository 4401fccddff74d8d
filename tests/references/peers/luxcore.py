"""LuxCore: paths from the eye, and for caustics from the light too (hybrid)."""

from __future__ import annotations

import math
import os
import time
from typing import Any

import numpy as np
import pyluxcore

from references.peers import SIZE, Recorder, work

_LOOK = 0.05  # seconds between looks at the clock

Values = dict[str, Any]


def render(name: str, recorder: Recorder) -> None:
    """Keep pictures of one rendering at ever later times, by its own clock."""
    described = recorder.scene()
    pyluxcore.Init()
    scene = pyluxcore.Scene()
    for k, part in enumerate(described["parts"]):
        triangles = [part[key] for key in ("positions", "corners", "normals")]
        scene.DefineMesh(f"mesh_{k}", *[[tuple(row) for row in rows] for rows in triangles], None, None, None)
    scene.Parse(_properties(_scene(described)))
    hybrid = any(part["kind"] != "lambert" for part in described["parts"])
    session = pyluxcore.RenderSession(pyluxcore.RenderConfig(_properties(_settings(hybrid)), scene))
    session.Start()
    recorder.ready(f"LuxCore {pyluxcore.Version()}, {'hybrid' if hybrid else 'path'}")
    seconds = 0.0
    while seconds < recorder.limit:
        time.sleep(_LOOK)
        session.UpdateStats()
        seconds = session.GetStats().Get("stats.renderengine.time").GetFloat()
        if recorder.due(seconds):
            recorder.add(seconds, _picture(session))
    session.Stop()


def _properties(values: Values) -> Any:
    properties = pyluxcore.Properties()
    for key, value in values.items():
        properties.Set(pyluxcore.Property(key, value))
    return properties


def _scene(described: dict[str, Any]) -> Values:
    camera, light = described["camera"], described["light"]
    half_width = math.tan(0.5 * camera["yfov"]) * SIZE[0] / SIZE[1]
    high, pixel = SIZE[1] / SIZE[0], 2.0 / SIZE[0]  # in half widths
    values: Values = {
        "scene.camera.type": "perspective",
        "scene.camera.lookat.orig": camera["eye"],
        "scene.camera.lookat.target": (np.array(camera["eye"]) + camera["forward"]).tolist(),
        "scene.camera.up": camera["up"],
        "scene.camera.fieldofview": math.degrees(2.0 * math.atan(half_width)),
        "scene.camera.screenwindow": [-1.0, 1.0, -high - pixel, high - pixel],  # its rows are one too low
        "scene.lights.point.type": "point",
        "scene.lights.point.position": light["position"],
        "scene.lights.point.color": [1.0, 1.0, 1.0],
        "scene.lights.point.gain": [4.0 * math.pi * cd for cd in light["intensity"]],  # takes flux
    }
    for k, part in enumerate(described["parts"]):
        material = f"scene.materials.material_{k}"
        values |= {f"{material}.{key}": value for key, value in _material(part).items()}
        values[f"scene.objects.object_{k}.shape"] = f"mesh_{k}"
        values[f"scene.objects.object_{k}.material"] = f"material_{k}"
    return values


def _material(part: dict[str, Any]) -> Values:
    if part["kind"] == "lambert":
        return {"type": "matte", "kd": part["color"]}
    if part["kind"] == "mirror":
        return {"type": "mirror", "kr": part["color"]}
    white = [1.0, 1.0, 1.0]
    return {"type": "glass", "kr": white, "kt": white, "interiorior": part["ior"], "exteriorior": 1.0}


def _settings(hybrid: bool) -> Values:
    return {
        "renderengine.type": "PATHCPU", "sampler.type": "SOBOL", "native.threads.count": os.cpu_count(),
        "path.pathdepth.total": 16, "path.pathdepth.diffuse": 12, "path.pathdepth.glossy": 16,
        "path.pathdepth.specular": 16, "path.clamping.variance.maxvalue": 0.0,
        "path.hybridbackforward.enable": hybrid, "path.hybridbackforward.partition": 0.5,
        "path.hybridbackforward.glossinessthreshold": 0.05,
        "film.width": SIZE[0], "film.height": SIZE[1], "film.filter.type": "BOX", "film.filter.width": 0.5,
        "film.opencl.enable": False, "film.imagepipelines.0.0.type": "NOP",
    }  # fmt: skip


def _picture(session: Any) -> np.ndarray:
    """(h, w, 3): theirs has its first row below."""
    buffer = np.zeros((*SIZE[::-1], 3), np.float32)
    session.GetFilm().GetOutputFloat(pyluxcore.FilmOutputType.RGB_IMAGEPIPELINE, buffer, 0)
    return buffer[::-1]


if __name__ == "__main__":
    work(render)
