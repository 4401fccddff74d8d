"""Small valid files of every kind, to be damaged: by name, the file to load and all that belongs to it."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import numpy as np
from gltf_builder import QUAD, QUAD_INDICES, QUAD_UV, GltfBuilder
from PIL import Image
from rgbe import hdr

from ispm.io.image import write_exr

Files = dict[str, bytes]
LARGEST = 1 << 21  # bytes of an asset that is damaged

TEXT = (
    "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nv 0 1 0 1 1 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n"
)
OBJ = f"""mtllib a.mtl
{TEXT}o floor
usemtl wood
s 1
f 1/1 2/2 3/3 4/4
o wall
usemtl glass
f 1/1/1 2/2/1 3/3/1
f -4//-1 -3//-1 \\
 -2//-1
s off
f 1 2 3
"""
MTL = """newmtl wood
Kd .8 .5 .2
Ks .1 .1 .1
Ns 50
map_Kd -s 2 2 -clamp on a.png
map_d b.jpg
newmtl glass
illum 7
Ni 1.5
Tf .9 1 .9
"""


def pixels(seed: int = 1) -> Image.Image:
    return Image.fromarray(np.random.default_rng(seed).integers(0, 255, (12, 9, 3), dtype=np.uint8))


def encoded(kind: str, **options: object) -> bytes:
    stream = io.BytesIO()
    pixels().save(stream, kind, **options)
    return stream.getvalue()


def furnished() -> GltfBuilder:
    """A glTF file with a bit of everything."""
    builder = GltfBuilder()
    builder.picture(np.arange(108, dtype=np.uint8).reshape(6, 6, 3))
    builder.picture(np.arange(108, dtype=np.uint8).reshape(6, 6, 3), "JPEG")
    slot = {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2, 2], "rotation": 0.5}}}
    material = {"pbrMetallicRoughness": {"baseColorTexture": slot}, "normalTexture": {"index": 1},
                "alphaMode": "MASK", "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1},
                "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 2}}}  # fmt: skip
    more = {"material": builder.put("materials", material)}
    more["targets"] = [{"POSITION": builder.accessor(QUAD)}]
    follow = {"JOINTS_0": np.zeros((4, 4), np.uint8), "WEIGHTS_0": np.ones((4, 4), np.float32)}
    shape = {"POSITION": QUAD, "TEXCOORD_0": QUAD_UV, "NORMAL": QUAD, **follow, "COLOR_0": QUAD}
    mesh = builder.mesh(QUAD_INDICES, more=more, **shape)
    bind = builder.accessor(np.eye(4, dtype=np.float32).reshape(1, 16))
    builder.put("skins", {"joints": [1], "inverseBindMatrices": bind})
    sparse = {"count": 1, "indices": {"bufferView": builder.view(b"\1"), "componentType": 5121},
              "values": {"bufferView": builder.view(QUAD[:1].tobytes())}}  # fmt: skip
    builder.json["accessors"][0]["sparse"] = sparse
    builder.mesh(None, more={"mode": 5}, POSITION=QUAD)
    builder.json["cameras"] = [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]
    spot = {"type": "spot", "intensity": 10, "spot": {"outerConeAngle": 0.5}}
    builder.json["extensions"] = {"KHR_lights_punctual": {"lights": [spot]}}
    builder.json["extensionsUsed"] = ["KHR_lights_punctual", "EXT_unknown"]
    instancing = {"attributes": {"TRANSLATION": builder.accessor(QUAD)}}
    builder.node(mesh=mesh, name="a", extensions={"EXT_mesh_gpu_instancing": instancing})
    builder.json["nodes"][0] |= {"skin": 0, "weights": [0.5]}
    builder.node(mesh=1, children=[2], rotation=[0, 0.6, 0, 0.8], scale=[1, 2, 3])
    builder.node(camera=0, translation=[0, 1, 5], extensions={"KHR_lights_punctual": {"light": 0}})
    keys = {"input": builder.accessor(np.arange(4, dtype=np.float32)), "output": builder.accessor(QUAD)}
    channel = {"sampler": 0, "target": {"node": 1, "path": "translation"}}
    builder.put("animations", {"channels": [channel], "samplers": [keys]})
    builder.json["scenes"] = [{"nodes": [0, 1]}]
    return builder


def ply(form: str) -> bytes:
    head = (f"ply\nformat {form} 1.0\ncomment TextureFile a.png\nelement vertex 4\nproperty float x\n"
            "property float y\nproperty float z\nproperty float s\nproperty float t\nproperty uchar red\n"
            "property uchar green\nproperty uchar blue\nelement face 2\n"
            "property list uchar int vertex_indices\nend_header\n").encode()  # fmt: skip
    if form == "ascii":
        rows = "0 0 0 0 0 255 0 0", "1 0 0 1 0 0 255 0", "1 1 0 1 1 0 0 255", "0 1 0 0 1 9 9 9", "4 0 1 2 3"
        return head + "\n".join([*rows, "3 0 1 2", ""]).encode()
    order = "<" if "little" in form else ">"
    body = b"".join(
        struct.pack(order + "5f3B", *p, *uv, 200, 9, 7) for p, uv in zip(QUAD, QUAD_UV, strict=True)
    )
    return head + body + struct.pack(order + "B4iB3i", 4, 0, 1, 2, 3, 3, 0, 1, 2)


def stl_bytes() -> bytes:
    triangles = b"".join(struct.pack("<12fH", *[0.0] * 3, *QUAD[[0, k, k + 1]].ravel(), 0) for k in (1, 2))
    return bytes(80) + struct.pack("<I", 2) + triangles


def stl_text() -> bytes:
    faces = "".join(
        "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
        for _ in range(2)
    )
    return f"solid a\n{faces}endsolid a\nsolid b\n{faces}endsolid b\n".encode()


def small(folder: Path) -> list[tuple[str, Files]]:
    """The files made here; `folder` is for those that are made by way of the disk."""
    whole = furnished()
    parts = furnished()
    parts.json["buffers"] = [{"byteLength": len(parts.data), "uri": "a.bin"}]
    parts.json["images"] = [{"uri": "a.png"}, {"uri": "b.jpg"}]
    pictures = {"a.png": encoded("PNG"), "b.jpg": encoded("JPEG", progressive=True)}
    made = [("a.glb", {"a.glb": whole.save_glb(folder / "a.glb").read_bytes()}),
            ("a.gltf", {"a.gltf": whole.save(folder / "a.gltf").read_bytes()}),
            ("a.gltf", {"a.gltf": parts.save(folder / "a.gltf").read_bytes(), "a.bin": parts.data,
                        **pictures}),
            ("a.obj", {"a.obj": OBJ.encode(), "a.mtl": MTL.encode(), **pictures}),
            ("a.stl", {"a.stl": stl_bytes()}), ("a.stl", {"a.stl": stl_text()})]  # fmt: skip
    made += [("a.ply", {"a.ply": ply(form), "a.png": pictures["a.png"]})
             for form in ("ascii", "binary_little_endian", "binary_big_endian")]  # fmt: skip
    texels = np.repeat(np.random.default_rng(3).integers(9, 140, (6, 8, 4), dtype=np.uint8), 3, axis=1)
    made += [("a.hdr", {"a.hdr": hdr(texels, form)}) for form in ("flat", "old", "new")]
    write_exr(folder / "a.exr", {"full": texels[..., :3].astype(np.float32)})
    made.append(("a.exr", {"a.exr": (folder / "a.exr").read_bytes()}))
    for kind in ("PNG", "JPEG", "WEBP", "BMP", "TGA", "GIF", "TIFF"):
        text = f"{TEXT}usemtl m\nf 1/1 2/2 3/3\n".encode()
        mtl = f"newmtl m\nmap_Kd a.{kind.lower()}\n".encode()
        files = {"a.obj": b"mtllib a.mtl\n" + text, "a.mtl": mtl, f"a.{kind.lower()}": encoded(kind)}
        made.append(("a.obj", files))
    return made


def among(assets: Path) -> list[tuple[str, Files]]:
    """Those of a folder of assets that are small, with what lies beside them where it is small too."""
    found = []
    for path in sorted(assets.rglob("*")):
        if path.suffix.lower() not in (".glb", ".gltf", ".obj", ".ply", ".stl") or "negative" in path.parts:
            continue
        beside = [path] if path.suffix in (".glb", ".ply", ".stl") else sorted(path.parent.iterdir())
        needed = (".bin", ".mtl", ".png", ".jpg")
        files = [p for p in beside if p == path or (p.is_file() and p.suffix.lower() in needed)]
        if sum(p.stat().st_size for p in files) < LARGEST:
            found.append((path.name, {p.name: p.read_bytes() for p in files}))
    return found
