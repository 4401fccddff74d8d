"""Small renderings that between them call every kernel of a picture, with all types of arguments.

python -m every_kernel            print the lines of ispm/kernels/kernels.txt
python -m every_kernel --write    and write them to that file: `make kernels`
"""

import math
import sys
import tempfile
from base64 import b85decode
from pathlib import Path

import numpy as np
from meshopt_streams import PLAIN, STREAMS
from rgbe import hdr

import ispm
from ispm.io.meshopt import decode
from ispm.io.weld import weld
from ispm.kernels import manifest
from ispm.kernels.jit import KERNELS, kernel_file
from ispm.settings import RENDERER_VIEWS

SMALL = dict(size=(48, 28), photons=1000, subsampling=2)
TEXTURE = np.arange(64, dtype=np.uint8).reshape(4, 4, 4)
VARIANTS = [
    *[dict(kernel=name) for name in ("footprint", "measured", "class", "hint")],
    *[dict(kernel="class", estimator=name) for name in ("volumes", "tiled", "grid")],
    *[dict(gather=0, estimator=name) for name in ("volumes", "tiled", "grid")],
    *[dict(preset=name) for name in ("fast", "best", "talk")],
    *[dict(emission=name) for name in ("map", "rays")],
    dict(shadows="rays"),
    *[dict(tonemap=name) for name in ("agx", "none")],
    dict(subsampling=1),
    dict(antialias=False, background="transparent", exposure=1.0),
    dict(ground=True, background=(1.0, 1.0, 1.0)),
    dict(passes=2, target_error=0.01),
]  # fmt: skip


# So few receivers ask each photon.
TINY = [dict(size=(8, 6)), dict(size=(8, 6), gather=0)]


def everything() -> ispm.Scene:
    """Return a scene of every kind of light and material, one of them with textures, and a moving box."""
    from ispm.library.shapes import box, icosphere
    from ispm.scene.material import AlphaMode

    use, data = ispm.TextureUse(ispm.Texture(TEXTURE)), ispm.Texture(TEXTURE, srgb=False)
    materials = [
        ispm.Material(base_color=(0.8, 0.5, 0.3)),
        ispm.Material(base_color_texture=use, metallic_roughness_texture=data, metallic=0.5, roughness=0.4),
        ispm.Material(metallic=1.0, roughness=0.0),
        ispm.Material(diffuse_transmission=0.5, double_sided=True),
        ispm.Material(transmission=1.0, roughness=0.0, ior=1.5, thickness=0.1, dispersion=1.0),
        ispm.Material(transmission=1.0, roughness=0.4, ior=1.5, thickness=0.1),
        ispm.Material(base_color=(0.8, 0.5, 0.3, 0.5), alpha_mode=AlphaMode.BLEND),
        ispm.Material(
            clearcoat=1.0,
            clearcoat_roughness=0.3,
            sheen_color=(1.0, 0.5, 0.2),
            sheen_roughness=0.4,
            anisotropy=0.5,
        ),
    ]
    scene = ispm.Scene(name="everything")
    scene.add(box((-4, -1, -4), (4, 0, 4)), material=materials[0])
    for place, material in enumerate(materials):
        scene.add(icosphere(0.6, 2), material=material, translation=(1.2 * place - 2.8, 0.7, 0.0))
    scene.add(ispm.PointLight((50.0, 40.0, 30.0)), translation=(0, 3, 2))
    scene.add(ispm.SpotLight((50.0, 40.0, 30.0), outer_angle=0.6), translation=(2, 4, 1))
    scene.add(ispm.DirectionalLight((2.0, 2.0, 1.0)), rotation=(-math.sqrt(0.5), 0, 0, math.sqrt(0.5)))
    return scene


def render_everything() -> None:
    """Call every kernel of a picture, and of reading files, at least once."""
    for name, (mode, filtered, values) in PLAIN.items():
        if filtered == "NONE":
            decode(memoryview(b85decode(STREAMS[name])), mode, filtered, len(values), values[0].nbytes)
    weld(np.zeros((3, 3), np.float32))
    camera = ispm.Camera.look_at((0, 2, 7), (0, 0.5, 0))
    with (
        tempfile.TemporaryDirectory() as folder,
        ispm.Renderer(everything(), ispm.Settings(**SMALL, emission="map"), camera, threads=2) as renderer,
    ):
        renderer.render().save(Path(folder) / "a.png", bits=16)
        for name in RENDERER_VIEWS:
            renderer.view(name)
        assert renderer.light_paths(24, 20).photons
        for variant in VARIANTS:
            renderer.settings = ispm.Settings(**{**SMALL, **variant})
            assert renderer.render().image.size
        sky = Path(folder) / "sky.hdr"
        sky.write_bytes(hdr(TEXTURE.reshape(4, 4, 4)))
        renderer.scene.environment = ispm.Environment(sky)
        glow = ispm.Material(emission=(1.0, 1.0, 1.0), emission_texture=ispm.Texture(TEXTURE[..., :3]))
        renderer.scene.add(ispm.shapes.box(0.5), material=glow, translation=(2.0, 2.0, 0.0))
        renderer.scene.add(ispm.RectLight((5.0, 4.0, 3.0)), translation=(0.0, 3.0, 0.0))
        for emission in ("map", "auto"):
            renderer.settings = ispm.Settings(**SMALL, emission=emission)
            assert renderer.render().image.size
        renderer.settings = ispm.Settings(**SMALL, preset="live")
        for step in (0.0, 0.1, 0.1):  # the last frame rests
            renderer.scene.nodes[1].translation = (-2.8 + step, 0.7, 0.0)
            mesh = renderer.scene.nodes[2].parts[0].mesh
            mesh.positions = mesh.positions * np.float32(1.0 + step)
            assert renderer.render().image.size
        renderer.settings = ispm.Settings(**SMALL)
        for name in ("cornell-box", "caustic-ring", "objects-in-box"):  # the last has large meshes
            renderer.scene, renderer.camera = ispm.builtin(name), None
            assert renderer.render().image.size
        renderer.scene = ispm.builtin("glass-sphere")
        for variant in TINY:
            renderer.settings = ispm.Settings(**variant, photons=1000, subsampling=2)
            assert renderer.render().image.size


def called() -> set[tuple[str, tuple]]:
    """Return the kernels that Python has called in this process: names, and the types of arguments."""
    return {(name, signature) for name, kernel in KERNELS.items() for signature in kernel.signatures}


def lines(calls: set[tuple[str, tuple]]) -> list[str]:
    """Return the manifest's lines of these; AssertionError for one that leads to another kernel."""
    found = []
    for name, signature in calls:
        found.append(manifest.line(KERNELS[name], signature))
        kernel, read = manifest.parse(found[-1])
        assert kernel_file(kernel, read) == kernel_file(KERNELS[name], signature), found[-1]
    return sorted(found)


if __name__ == "__main__":
    render_everything()
    text = "".join(line + "\n" for line in lines(called()))
    if "--write" in sys.argv:
        manifest.FILE.write_text(text, "utf-8")
    else:
        print(text, end="")
