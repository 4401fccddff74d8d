"""Dynamic global illumination by image space photon mapping (McGuire and Luebke, 2009).

The public names load on first use, so that `import ispm` is quick and needs no graphics adapter.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ispm.bench.metrics import compare
    from ispm.errors import AdapterError, IspmError, OutputError, SceneError, SettingsError
    from ispm.gpu.device import list_adapters as adapters
    from ispm.io.load import load
    from ispm.io.named import builtin
    from ispm.io.save import save
    from ispm.renderer import Renderer, render
    from ispm.renderer.picture import Frame
    from ispm.scene.animation import Animation
    from ispm.scene.camera import Camera
    from ispm.scene.light import DirectionalLight, PointLight, SpotLight
    from ispm.scene.material import Material, Texture, TextureUse
    from ispm.scene.mesh import Mesh
    from ispm.scene.scene import Node, Scene
    from ispm.settings import Settings

__version__ = "0.1.0"

_HOMES = {
    "AdapterError": "ispm.errors",
    "Animation": "ispm.scene.animation",
    "Camera": "ispm.scene.camera",
    "DirectionalLight": "ispm.scene.light",
    "Frame": "ispm.renderer.picture",
    "IspmError": "ispm.errors",
    "Material": "ispm.scene.material",
    "Mesh": "ispm.scene.mesh",
    "Node": "ispm.scene.scene",
    "OutputError": "ispm.errors",
    "PointLight": "ispm.scene.light",
    "Renderer": "ispm.renderer",
    "Scene": "ispm.scene.scene",
    "SceneError": "ispm.errors",
    "Settings": "ispm.settings",
    "SettingsError": "ispm.errors",
    "SpotLight": "ispm.scene.light",
    "Texture": "ispm.scene.material",
    "TextureUse": "ispm.scene.material",
    "adapters": "ispm.gpu.device:list_adapters",
    "builtin": "ispm.io.named",
    "compare": "ispm.bench.metrics",
    "load": "ispm.io.load",
    "render": "ispm.renderer",
    "save": "ispm.io.save",
}

__all__ = [
    "AdapterError",
    "Animation",
    "Camera",
    "DirectionalLight",
    "Frame",
    "IspmError",
    "Material",
    "Mesh",
    "Node",
    "OutputError",
    "PointLight",
    "Renderer",
    "Scene",
    "SceneError",
    "Settings",
    "SettingsError",
    "SpotLight",
    "Texture",
    "TextureUse",
    "__version__",
    "adapters",
    "builtin",
    "compare",
    "load",
    "render",
    "save",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'ispm' has no attribute '{name}'")
    module, _, inside = _HOMES[name].partition(":")
    value = getattr(import_module(module), inside or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
