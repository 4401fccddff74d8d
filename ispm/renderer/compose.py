"""The last step of a frame: from what the GPU gave to arrays and a picture."""

from __future__ import annotations

import numpy as np

from ispm.frame import LitFrame
from ispm.gpu import Gpu
from ispm.renderer import layers as make
from ispm.renderer.backdrop import (
    ENVIRONMENT,
    LAYER,
    background_color,
    environment_behind,
    shows_environment,
)
from ispm.renderer.one_pass import Pass
from ispm.renderer.picture import Frame
from ispm.renderer.statistics import Stats
from ispm.scene.camera import Camera


def compose(gpu: Gpu, this: Pass, lit: LitFrame) -> Frame:
    """Read a picture's parts back and add them; its statistics are still empty."""
    f2, f4, u4 = np.float16, np.float32, np.uint32
    packed, view, gbuffer = this.packed, this.view, lit.gbuffer
    color = background_color(this.settings)
    glass = [(lit.through, f4, 4)] if color is not None or this.settings.ground else []
    shines = packed.glows or len(packed.environment.rows) > 0  # mirrors show it
    glow = [(lit.emission, f4, 4)] if shines else []
    light = [(texture, f4, 4) for texture in (lit.direct, lit.indirect, lit.irradiance)]
    surfaces = [(gbuffer.base, f2, 4), (gbuffer.normals, u4, 2), (gbuffer.ids, u4, 2), (gbuffer.depth, f4)]
    d, i, irr, base, normals, ids, depth, *rest = gpu.read_many([*light, *surfaces, *glass, *glow])
    e = rest[-1] if glow else np.zeros(d.shape, f4)  # untouched pages: zeros_like would write them
    alpha, more = i[..., 3], {}
    through = rest[0][..., :3] if glass and rest[0].shape == d.shape else np.zeros((1, 1, 3), f4)
    if color is not None:
        behind = (1.0 - alpha[..., None] + through) * color
        e[..., :3] += behind
        more = {LAYER: lambda: behind}
    elif shows_environment(this):
        if through.any():
            behind = environment_behind(this, np.zeros_like(alpha)) * (1.0 - alpha[..., None] + through)
        else:
            behind = environment_behind(this, alpha)
        e[..., :3] += behind
        more = {ENVIRONMENT: lambda: behind}
    elif through.any():  # a transparent background: ground is there as far as it is shaded
        alpha = np.clip(alpha - through.mean(axis=-1), 0.0, 1.0)
    copies, materials = (
        np.append(np.int32(-1), rows.astype(np.int32)) for rows in (packed.ids, packed.instances["material"])
    )
    full = make.sum_layers(d, i, e, this.threads)
    layers = make.Layers(
        {
            "full": lambda: full,
            "direct": lambda: make.rgb(d),
            "indirect": lambda: make.rgb(i),
            "emission": lambda: make.rgb(e),
            "alpha": lambda: np.ascontiguousarray(alpha),
            "irradiance": lambda: make.rgb(irr),
            "depth": lambda: make.linear_depth(depth, view),
            "normal": lambda: make.decode_normals(normals, depth),
            "albedo": lambda: base[..., :3].astype(f4),
            "instance": lambda: copies[ids[..., 0]],
            "material": lambda: materials[ids[..., 0]],
            **more,
        }
    )
    camera = {"pose": view.pose, "clip_from_world": view.clip_from_world}
    if view.ymag is None:
        eye = Camera(yfov=view.yfov, aspect=view.aspect, principal=view.principal)
        camera["intrinsics"] = eye.intrinsics(view.size)
    return Frame(layers, Stats(), this.settings, camera, names=packed.names)
