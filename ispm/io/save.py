"""Scenes written as glTF 2.0."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from ispm.errors import OutputError, SceneError, warn_caller
from ispm.io.atomic import as_path, require_writable, write_whole
from ispm.io.gltf_camera import camera_record
from ispm.io.gltf_instances import instance_attributes
from ispm.io.gltf_lamp import lamp_extras, lamp_part
from ispm.io.gltf_light import RADIUS
from ispm.io.gltf_mesh import ATTRIBUTES
from ispm.io.gltf_sky import sky_extras
from ispm.io.gltf_write import Document
from ispm.io.gltf_write_material import MaterialWriter, given, numbers, split
from ispm.io.gltf_write_skin import (
    complete_targets,
    write_skins,
    written_joints,
    written_targets,
    written_weights,
)
from ispm.io.png import encode_png
from ispm.scene.animation import Animation, Channel
from ispm.scene.compact import compact
from ispm.scene.environment import Environment
from ispm.scene.light import DirectionalLight, PointLight, PunctualLight, SpotLight, SurfaceLight
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Node, Part, Scene
from ispm.scene.sky import Sky
from ispm.scene.values import frozen

ENDINGS = (".glb", ".gltf")
_Worn = tuple[int, tuple[tuple[int, tuple[int, ...]], ...]]  # a material; others, and variants that show them


def save(scene: Scene, path: str | os.PathLike[str]) -> Path:
    """Write `scene` as glTF 2.0 and return the path; what `load` reads back is equal.

    path  .glb: one file; .gltf: with a buffer `NAME.bin` and pictures `NAME-textures/0.png` beside it
    Left out are vertices and parts without triangles, channels of nodes outside the scene, names of a node's
    meshes but for the first, and what has no effect, such as the normal scale of a material without a normal
    map. A texture whose encoding is not the one glTF has for its place is rounded to that, and an Environment
    is left out, with a SceneWarning. Parts are written as they are without a variant, and with what they wear
    in each. A camera's pose, aspect and principal point stand in `extras`, where only this program reads
    them; so do a Sky, and a lamp with a surface, which others see as a mesh that emits.
    Raises SceneError for what glTF cannot hold, OutputError where the file cannot be written.
    """
    if not isinstance(scene, Scene):
        raise SceneError(f"save takes a Scene first, not a {type(scene).__name__}")
    target = as_path(path)
    ending = target.suffix.lower()
    if ending not in ENDINGS:
        problem = f"scenes cannot be written as '{ending}'" if ending else "the name has no ending"
        raise OutputError(f"{target}: {problem}; use one of {', '.join(ENDINGS)}")
    require_writable(target)
    if isinstance(scene.environment, Environment):
        warn_caller(
            f"{target.name}: the environment is not in it: glTF has none; keep its own file beside it"
        )
    try:
        document = _Writer(scene).document
        if ending == ".glb":
            write_whole(target, document.glb())
        else:
            _write_gltf(target, document)
    except SceneError as error:
        raise SceneError(f"{target.name}: {error}") from None
    return target


def _write_gltf(target: Path, document: Document) -> None:
    """The buffer and the pictures, then the text that names them."""
    folder = f"{target.stem}-textures"
    names = [f"{folder}/{i}.png" for i in range(document.picture_count)]
    text, chunks, pictures = document.gltf(quote(target.stem), [quote(name) for name in names])
    for name, pixels in zip(names, pictures, strict=True):
        write_whole(target.parent / name, [encode_png(pixels)])
    if chunks:
        write_whole(target.with_suffix(".bin"), chunks)
    write_whole(target, [text])


class _Writer:
    """Fills a document with a scene."""

    def __init__(self, scene: Scene) -> None:
        self.document = Document()
        self._materials = MaterialWriter(self.document)
        self._primitives: dict[int, dict[str, Any]] = {}
        self._meshes: dict[tuple[tuple[int, _Worn], ...], int] = {}
        self._lamps: dict[tuple[object, ...], Part] = {}
        self._numbers: dict[int, list[int]] = {}  # of each node, one for each of its parents
        self._bent: list[tuple[Node, dict[str, Any]]] = []  # nodes with skins, and their records
        self._variants = {name: i for i, name in enumerate(scene.variants)}
        self._scene(scene)
        write_skins(self.document, self._bent, self._numbers)
        for name in self._variants:
            self.document.use("KHR_materials_variants")
            self.document.put("variants", {"name": name})
        for animation in scene.animations:
            self._animation(animation)

    def _scene(self, scene: Scene) -> None:
        for node, _ in scene.placed():  # which finds nodes without a place, and circles
            node.check()
        record: dict[str, Any] = {"name": scene.name} if scene.name else {}
        stack: list[tuple[Node, dict[str, Any], str]] = [(n, record, "nodes") for n in reversed(scene.roots)]
        while stack:
            node, parent, place = stack.pop()
            made = self._node(node)
            number = self.document.put("nodes", made)
            self._numbers.setdefault(id(node), []).append(number)
            if node.skin is not None and any(part.mesh.joints is not None for part in node.parts):
                self._bent.append((node, made))
            parent.setdefault(place, []).append(number)
            stack.extend((child, made, "children") for child in reversed(node.children))
        if isinstance(scene.environment, Sky):
            record["extras"] = sky_extras(scene.environment)
        self.document.put("scenes", record)

    def _node(self, node: Node) -> dict[str, Any]:
        parts = [part for part in node.parts if len(part.mesh.triangles)]
        extensions = self._light(node.light) if isinstance(node.light, PunctualLight) else {}
        extras = {}
        if isinstance(node.light, SurfaceLight):
            if parts and node.instances is not None:
                raise SceneError(
                    f"node '{node.name}' holds a lamp and instances of meshes, which glTF cannot hold; "
                    "put the lamp on a node of its own"
                )
            extras = lamp_extras(node.light)
            parts.append(self._lamp(node.light))
        elif parts and node.instances is not None:
            extensions |= self._instances(node.instances)
        camera = None if node.camera is None else self.document.put("cameras", camera_record(node.camera))
        return given(
            {
                "name": node.name,
                **_place(node),
                "mesh": self._mesh(parts) if parts else None,
                "weights": written_weights(node, parts),
                "camera": camera,
                "extensions": extensions,
                "extras": extras,
            },
            {
                "name": "",
                "translation": [0.0] * 3,
                "rotation": [0.0, 0.0, 0.0, 1.0],
                "scale": [1.0] * 3,
                "extensions": {},
                "extras": {},
            },
        )

    def _mesh(self, parts: list[Part]) -> int:
        key = tuple((id(part.mesh), self._worn(part)) for part in parts)
        if key not in self._meshes:
            primitives = [
                {**self._primitive(part.mesh), **self._wearing(worn)}
                for part, (_, worn) in zip(parts, key, strict=True)
            ]
            record = {
                "name": parts[0].mesh.name,
                "primitives": primitives,
                **complete_targets(self.document, primitives, parts),
            }
            self._meshes[key] = self.document.put("meshes", given(record, {"name": ""}))
        return self._meshes[key]

    def _worn(self, part: Part) -> _Worn:
        """The number of a part's material, and those of its variants with theirs."""
        worn = part.wearing(None)
        mappings: dict[int, list[int]] = {}
        for name, material in worn.variants.items():
            if name is not None and name in self._variants:
                mappings.setdefault(self._materials.number(material), []).append(self._variants[name])
        return self._materials.number(worn.material), tuple((m, tuple(v)) for m, v in mappings.items())

    def _wearing(self, worn: _Worn) -> dict[str, Any]:
        """What a primitive says of its material."""
        material, mappings = worn
        if not mappings:
            return {"material": material}
        records = [{"material": number, "variants": list(variants)} for number, variants in mappings]
        extension = self.document.use("KHR_materials_variants")
        return {"material": material, "extensions": {extension: {"mappings": records}}}

    def _primitive(self, mesh: Mesh) -> dict[str, Any]:
        """Accessors of a mesh; the loader shares meshes by them."""
        key = id(mesh)
        if key not in self._primitives:
            mesh.check()
            triangles, rows = compact(mesh.triangles)
            some = slice(None) if len(rows) == len(mesh.positions) else rows
            attributes = {"POSITION": self.document.floats(mesh.positions[some], bounds=True, vertices=True)}
            for field, (name, _) in ATTRIBUTES.items():
                values = getattr(mesh, field)
                if values is not None:
                    attributes[name] = self.document.floats(values[some], vertices=True)
            attributes |= written_joints(self.document, mesh, rows)
            indices = self.document.indices(triangles, len(rows))
            targets = written_targets(self.document, mesh, rows)
            self._primitives[key] = {"attributes": attributes, "indices": indices, **targets}
        return self._primitives[key]

    def _instances(self, matrices: np.ndarray) -> dict[str, Any]:
        attributes = {name: self.document.floats(v) for name, v in instance_attributes(matrices).items()}
        return {self.document.use("EXT_mesh_gpu_instancing"): {"attributes": attributes}}

    def _lamp(self, lamp: SurfaceLight) -> Part:
        """What shows a lamp to other programs, the same for equal ones."""
        key = type(lamp), *frozen(replace(lamp, name=""))
        if key not in self._lamps:
            self._lamps[key] = lamp_part(lamp)
        return self._lamps[key]

    def _light(self, light: PunctualLight) -> dict[str, Any]:
        """A node's extensions that hold a light of its own, as the loader makes them."""
        light.check()
        color, intensity = split(light.intensity)
        record = given(
            {"name": light.name, "color": color, "intensity": intensity}, {"name": "", "color": [1.0] * 3}
        )
        if isinstance(light, DirectionalLight):
            record["type"] = "directional"
        else:
            record["type"] = "spot" if isinstance(light, SpotLight) else "point"
            if not math.isinf(light.range):
                record["range"] = float(light.range)
        if isinstance(light, PointLight | SpotLight) and light.radius > 0.0:
            record["extras"] = {RADIUS: float(light.radius)}
        if isinstance(light, SpotLight):
            record["spot"] = {
                "innerConeAngle": float(light.inner_angle),
                "outerConeAngle": float(light.outer_angle),
            }
        return {self.document.use("KHR_lights_punctual"): {"light": self.document.put("lights", record)}}

    def _animation(self, animation: Animation) -> None:
        samplers: list[dict[str, Any]] = []
        channels: list[dict[str, Any]] = []
        for channel in animation.channels:
            numbers_ = self._numbers.get(id(channel.node), [])
            if numbers_:
                samplers.append(self._sampler(channel))
            channels += [
                {"sampler": len(samplers) - 1, "target": {"node": number, "path": channel.path}}
                for number in numbers_
            ]
        if channels:
            record = {"channels": channels, "samplers": samplers}
            name = {"name": animation.name} if animation.name else {}
            self.document.put("animations", {**name, **record})

    def _sampler(self, channel: Channel) -> dict[str, Any]:
        if channel.node.matrix is not None and channel.path != "weights":
            raise SceneError(
                f"node '{channel.node.name}' is placed by a matrix and animated, which glTF cannot hold; "
                "give it a translation, a rotation and a scale"
            )
        width = 1 if channel.path == "weights" else channel.values.shape[-1]
        return {
            "input": self.document.floats(channel.times, bounds=True),
            "output": self.document.floats(np.asarray(channel.values).reshape(-1, width)),
            "interpolation": channel.interpolation,
        }


def _place(node: Node) -> dict[str, Any]:
    if node.matrix is not None:
        return {"matrix": numbers(np.asarray(node.matrix, float).T.ravel())}
    return {
        "translation": numbers(node.translation),
        "rotation": numbers(node.rotation),
        "scale": numbers(node.scale),
    }
