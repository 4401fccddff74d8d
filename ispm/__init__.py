"""Dynamic global illumination by image space photon mapping (McGuire and Luebke, 2009).

The public names load on first use, so that `import ispm` is quick and needs no graphics adapter.
"""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False  # typing takes ten times as long to import as this module does
if TYPE_CHECKING:
    from ispm import shapes
    from ispm.bench.metrics import compare
    from ispm.errors import AdapterError, IspmError, OutputError, SceneError, SceneWarning, SettingsError
    from ispm.film.animate import animate
    from ispm.film.path import CameraKey, CameraPath, Turntable
    from ispm.film.settings import Film
    from ispm.gpu.device import list_adapters as adapters
    from ispm.io.about import read_names
    from ispm.io.load import load
    from ispm.io.named import builtin
    from ispm.io.save import save
    from ispm.renderer import Renderer, render
    from ispm.renderer.light_paths import LightPaths, PhotonPath
    from ispm.renderer.picture import Frame
    from ispm.renderer.statistics import Stats
    from ispm.scene.animation import Animation, Channel
    from ispm.scene.camera import Camera
    from ispm.scene.environment import Environment
    from ispm.scene.light import DirectionalLight, DiskLight, PointLight, RectLight, SphereLight, SpotLight
    from ispm.scene.material import AlphaMode, Material, Texture, TextureUse, Wrap
    from ispm.scene.mesh import Mesh, Morph
    from ispm.scene.names import Names
    from ispm.scene.rotation import axis_angle, euler
    from ispm.scene.scene import Node, Part, Scene
    from ispm.scene.skin import Skin
    from ispm.scene.sky import Sky
    from ispm.settings import Settings
    from ispm.viewer.viewer import Viewer, view

__version__ = "0.1.0"

_HOMES = {
    "AdapterError": "ispm.errors",
    "AlphaMode": "ispm.scene.material",
    "Animation": "ispm.scene.animation",
    "Camera": "ispm.scene.camera",
    "CameraKey": "ispm.film.path",
    "CameraPath": "ispm.film.path",
    "Channel": "ispm.scene.animation",
    "DirectionalLight": "ispm.scene.light",
    "DiskLight": "ispm.scene.light",
    "Environment": "ispm.scene.environment",
    "Film": "ispm.film.settings",
    "Frame": "ispm.renderer.picture",
    "IspmError": "ispm.errors",
    "LightPaths": "ispm.renderer.light_paths",
    "Material": "ispm.scene.material",
    "Mesh": "ispm.scene.mesh",
    "Morph": "ispm.scene.mesh",
    "Names": "ispm.scene.names",
    "Node": "ispm.scene.scene",
    "OutputError": "ispm.errors",
    "Part": "ispm.scene.scene",
    "PhotonPath": "ispm.renderer.light_paths",
    "PointLight": "ispm.scene.light",
    "RectLight": "ispm.scene.light",
    "Renderer": "ispm.renderer",
    "Scene": "ispm.scene.scene",
    "SceneError": "ispm.errors",
    "SceneWarning": "ispm.errors",
    "Settings": "ispm.settings",
    "SettingsError": "ispm.errors",
    "Skin": "ispm.scene.skin",
    "Sky": "ispm.scene.sky",
    "SphereLight": "ispm.scene.light",
    "SpotLight": "ispm.scene.light",
    "Stats": "ispm.renderer.statistics",
    "Texture": "ispm.scene.material",
    "TextureUse": "ispm.scene.material",
    "Turntable": "ispm.film.path",
    "Viewer": "ispm.viewer.viewer",
    "Wrap": "ispm.scene.material",
    "adapters": "ispm.gpu.device:list_adapters",
    "animate": "ispm.film.animate",
    "axis_angle": "ispm.scene.rotation",
    "builtin": "ispm.io.named",
    "compare": "ispm.bench.metrics",
    "euler": "ispm.scene.rotation",
    "load": "ispm.io.load",
    "read_names": "ispm.io.about",
    "render": "ispm.renderer",
    "save": "ispm.io.save",
    "shapes": "ispm.shapes",
    "view": "ispm.viewer.viewer",
}

__all__ = [
    "AdapterError",
    "AlphaMode",
    "Animation",
    "Camera",
    "CameraKey",
    "CameraPath",
    "Channel",
    "DirectionalLight",
    "DiskLight",
    "Environment",
    "Film",
    "Frame",
    "IspmError",
    "LightPaths",
    "Material",
    "Mesh",
    "Morph",
    "Names",
    "Node",
    "OutputError",
    "Part",
    "PhotonPath",
    "PointLight",
    "RectLight",
    "Renderer",
    "Scene",
    "SceneError",
    "SceneWarning",
    "Settings",
    "SettingsError",
    "Skin",
    "Sky",
    "SphereLight",
    "SpotLight",
    "Stats",
    "Texture",
    "TextureUse",
    "Turntable",
    "Viewer",
    "Wrap",
    "__version__",
    "adapters",
    "animate",
    "axis_angle",
    "builtin",
    "compare",
    "euler",
    "load",
    "read_names",
    "render",
    "save",
    "shapes",
    "view",
]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'ispm' has no attribute '{name}'")
    home, _, inside = _HOMES[name].partition(":")
    module = import_module(home)
    value = module if home == f"{__name__}.{name}" else getattr(module, inside or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
