"""Small scenes that between them have all that is rendered, and the settings that each is rendered with.

Only what users call is used here, so that what is behind it may move.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

import ispm
from ispm import AlphaMode, Camera, Material, Node, Part, Scene, Texture, TextureUse, Wrap, shapes

Place = tuple[float, float, float]
SIZE = (64, 40)
_LAMP = (30.0, 26.0, 20.0)  # cd
_WHITE, _RED, _BLUE = (0.75, 0.75, 0.75), (0.7, 0.15, 0.1), (0.15, 0.25, 0.65)


@dataclass(frozen=True)
class Case:
    """One scene, looked at in one way.

    name      `scene/variant`
    camera    None: the scene's own
    settings  besides `size` and `photons`
    times     moments that one renderer shows in turn, the last of them kept; None: the scene as it stands
    views     those of the renderer that are kept besides the layers
    steady    whether rounding moves little: False where a few photons bring much of the light
    """

    name: str
    scene: Callable[[], Scene]
    camera: Camera | None = None
    settings: dict[str, Any] = field(default_factory=dict)
    times: tuple[float | None, ...] = (None,)
    views: tuple[str, ...] = ()
    steady: bool = True


def cases() -> list[Case]:
    """Return all cases."""
    return [
        *_case("corner", corner, _EYE, _METHODS),
        *_case("lamps", lamps, _EYE, _LIGHTS),
        *_case("cloth", cloth, _EYE, {"default": {}, "photons": dict(gather=0, subsampling=2)}),
        *_case("metals", metals, _EYE, {"default": {}, "photons": dict(gather=0), "eye": _FULL}),
        *_case("glass", glass, _EYE, {"default": {}, "photons": dict(gather=0), "eye": _FULL}),
        Case("glass/close", glass, Camera.look_at((0.5, 0.7, 2.4), (0.45, 0.45, 0.0), yfov=0.5)),
        *_case("sheets", sheets, _EYE, {"default": {}, "transparent": dict(background="transparent")}),
        *_case("open", outdoors, _EYE, {"sky": dict(background=_SKY), "rays": dict(emission="rays")}),
        Case("open/orthographic", outdoors, Camera(ymag=2.2, pose=_EYE.pose), dict(emission="map")),
        Case("corner/orthographic", corner, Camera(ymag=2.0, pose=_EYE.pose), dict(gather=4)),
        Case(
            "corner/off-axis", corner, Camera(yfov=0.8, aspect=1.4, principal=(0.2, -0.3), pose=_EYE.pose),
            dict(subsampling=3),
        ),
        *_case("panels", panels, _EYE, {"default": {}, "photons": dict(gather=0), "passes": dict(passes=2)}),
        Case("dome/default", partial(dome, SKY), _EYE),
        Case("dome/gradient", partial(dome, GRADIENT), _EYE, dict(passes=2, shadows="rays")),
        *_case("unlit", unlit, _EYE, {name: dict(light=name) for name in ("studio", "sky", "lamp", "none")}),
        Case("coats/default", coats, _EYE),
        Case("velvet/default", velvet, _EYE),
        Case("brushed/default", brushed, _EYE),
        *_case("prisms", prisms, _EYE, {"default": {}, "photons": dict(gather=0)}),
        *_case("lantern", lantern, _EYE, {"default": {}, "photons": dict(gather=0)}),
        Case("lantern/live", lantern, _EYE, dict(preset="live", exposure="auto")),  # else of a case before
        Case("product/ground", product, _EYE, dict(ground=True, background="transparent")),
        Case("crowd/moving", crowd, _EYE, {}, times=(0.0, 0.6)),
        Case("crowd/photons", crowd, _EYE, dict(gather=0, subsampling=2), times=(0.3, 0.3)),
        *(Case(f"{name}/builtin", partial(ispm.builtin, name)) for name in _BUILTINS),
        Case("atrium/builtin", partial(ispm.builtin, "atrium"), steady=False),
        Case("caustic-ring/builtin", _ring, steady=False),
        Case("caustic-ring/passes", _ring, None, dict(passes=2), steady=False),
    ]  # fmt: skip


_EYE = Camera.look_at((0.3, 1.7, 4.2), (0.0, 0.95, 0.0))
_ring = partial(ispm.builtin, "caustic-ring")
_BUILTINS = ("cornell-box", "glass-sphere", "objects-in-box")
_SKY = (0.2, 0.3, 0.5)
SKY = ispm.Sky(0.6)
GRADIENT = ispm.Environment(
    (np.linspace(2.0, 0.1, 8)[:, None, None] * np.linspace(0.5, 1.0, 16)[:, None] * (0.8, 0.9, 1.0)),
    rotation=0.5,
)
_FULL = dict(subsampling=1, gather=4, background=(0.1, 0.2, 0.1))
_METHODS: dict[str, dict[str, Any]] = {
    "default": dict(views=("photons", "overdraw")),
    **{f"gathered-{name}": dict(estimator=name, gather=4) for name in ("volumes", "tiled", "grid")},
    **{name: dict(estimator=name, gather=0, subsampling=2) for name in ("volumes", "tiled", "grid")},
    **{f"all-{name}": dict(estimator=name, gather=0, subsampling=1) for name in ("volumes", "tiled", "grid")},
    **{f"kernel-{name}": dict(kernel=name) for name in ("footprint", "measured", "hint")},
    "kernel-class": dict(kernel="class", photons=20_000),  # fewer have the widest kernels that there are
    **{f"class-{name}": dict(kernel="class", estimator=name) for name in ("tiled", "grid")},
    "measured-photons": dict(kernel="measured", gather=0),
    **{f"preset-{name}": dict(preset=name) for name in ("fast", "best", "live", "talk")},
    "talk-errors": dict(preset="talk", talk_errors=True),
    "emission-map": dict(emission="map", views=("bounce-map",)),
    "emission-rays": dict(emission="rays"),
    "passes": dict(passes=3, gather=4, seed=7),
    "direct-only": dict(bounces=0, tonemap="none"),
    "one-bounce": dict(bounces=1, tonemap="agx", exposure=2.0),
    "smooth": dict(smoothing=2.0, antialias=False, shadow_resolution=96),
}
_LIGHTS: dict[str, dict[str, Any]] = {
    "map": dict(emission="map", views=("bounce-map",)),
    "rays": dict(emission="rays"),
    "rough-shadows": dict(shadow_resolution=64, gather=0, emission="map"),
    "traced-shadows": dict(shadows="rays"),
    "mapped-shadows": dict(shadows="map", passes=2),
    "all-aimed": dict(caustic_photons=1.0),
    "none-aimed": dict(caustic_photons=0.0),
}


def _case(
    name: str, scene: Callable[[], Scene], camera: Camera, variants: dict[str, dict[str, Any]]
) -> list[Case]:
    return [
        Case(f"{name}/{variant}", scene, camera, {k: v for k, v in given.items() if k != "views"},
             views=given.get("views", ()))
        for variant, given in variants.items()
    ]  # fmt: skip


def corner() -> Scene:
    """Walls that color each other, a shelf, a box, a glass and a brass ball."""
    scene = _room("corner")
    _put(scene, shapes.box((0.8, 0.9, 0.8)), Material(_BLUE, roughness=0.9), (-1.0, 0.45, -0.6), turn=0.4)
    _put(scene, shapes.box((1.4, 0.06, 0.5)), Material(_WHITE), (0.9, 1.1, -1.6))
    _put(scene, _ball(0.4), _solid_glass(), (0.9, 0.41, 0.5))
    _put(scene, _ball(0.3), Material((0.9, 0.7, 0.4), metallic=1.0, roughness=0.0), (0.0, 0.31, 1.0))
    _put(scene, _ball(0.25), Material(_RED, metallic=1.0, roughness=0.35), (-0.4, 1.16, -0.6))
    scene.add(ispm.PointLight(_LAMP), translation=(0.4, 2.5, 0.4))
    return scene


def lamps() -> Scene:
    """Every kind of light, with and without range, one of them outside, among a mirror and a lens."""
    scene = _room("lamps", ceiling=False)
    _put(scene, shapes.torus(0.5, 0.15, segments=24, sides=12), Material(_WHITE), (-0.9, 0.2, 0.2))
    _put(scene, _ball(0.35), _solid_glass(), (0.8, 0.5, 0.6))
    _put(scene, shapes.cylinder(0.4, 0.5, segments=24, caps=False), _MIRROR, (0.4, 0.25, -0.8))
    scene.add(ispm.PointLight((9.0, 3.0, 1.0), range=2.5), translation=(-1.4, 1.2, -0.9))
    scene.add(ispm.PointLight((2.0, 5.0, 9.0)), translation=(1.5, 1.8, 1.0))
    spot = scene.add(
        ispm.SpotLight((60.0, 50.0, 40.0), inner_angle=0.2, outer_angle=0.5), translation=(1.2, 3.0, 1.6)
    )
    spot.look_at((0.6, 0.3, 0.2))
    wide = scene.add(
        ispm.SpotLight((5.0, 9.0, 5.0), range=4.0, outer_angle=math.pi / 2.0), translation=(-1.6, 2.4, 1.2)
    )
    wide.look_at((0.0, 0.0, 0.0))
    sun = scene.add(ispm.DirectionalLight((2.5, 2.2, 1.8)), translation=(3.0, 6.0, 2.0))
    sun.look_at((0.0, 0.0, 0.0))
    return scene


def cloth() -> Scene:
    """Every texture: colors, data, normals, glow; wrapped, clamped, mirrored, nearest, moved, of set 1."""
    scene = _room("cloth")
    colors, data, bumps = _pattern(0), _pattern(1), _bumps()
    wrapped = TextureUse(Texture(colors), 0, ((3.0, 0.4, 0.1), (-0.4, 3.0, 0.2)))
    mirrored = TextureUse(
        Texture(colors, wrap_u=Wrap.MIRROR, wrap_v=Wrap.CLAMP, mipmaps=False),
        0,
        ((2.5, 0.0, 0.0), (0.0, 2.5, 0.0)),
    )
    nearest = TextureUse(Texture(colors, linear=False), 1)
    floor = shapes.plane(3.6, 3.6)
    floor.uv1 = floor.uv0[:, ::-1] * 2.0
    materials = [
        Material(base_color_texture=wrapped, normal_texture=Texture(bumps, srgb=False)),
        Material(
            base_color_texture=mirrored, metallic=1.0, metallic_roughness_texture=Texture(data, srgb=False)
        ),
        Material(
            base_color_texture=Texture(colors), normal_texture=Texture(bumps, srgb=False), normal_scale=0.5
        ),
        Material(_WHITE, emission=(2.0, 1.0, 0.5), emission_texture=Texture(colors)),
        Material(_WHITE, transmission=1.0, roughness=0.0, transmission_texture=Texture(data, srgb=False)),
    ]
    _put(scene, floor, Material(base_color_texture=nearest), (0.0, 0.01, 0.0))
    meshes = (
        shapes.box(0.8),
        _ball(0.45),
        _ball(0.4),
        shapes.cone(0.4, 0.8, segments=24),
        shapes.box((0.9, 0.9, 0.1)),
    )
    places = ((-1.2, 0.45, -0.6), (0.1, 0.5, -0.8), (-0.5, 0.45, 0.7), (1.3, 0.41, -0.9), (0.9, 0.5, 0.8))
    for mesh, material, place in zip(meshes, materials, places, strict=True):
        _put(scene, mesh, material, place, turn=0.5)
    painted = shapes.sphere(0.3, segments=16, rings=8)
    painted.colors = np.concatenate(
        [0.5 + painted.positions, np.ones((len(painted.positions), 1))], axis=1
    ).clip(0, 1)
    _put(scene, painted, Material(), (-1.4, 1.5, 0.0))
    scene.add(ispm.PointLight(_LAMP), translation=(0.3, 2.4, 1.2))
    return scene


def metals() -> Scene:
    """Mirrors and metals from smooth to rough, glossy plastics, one mirror that shows another."""
    scene = _room("metals")
    _put(scene, shapes.box((1.6, 1.4, 0.05)), _MIRROR, (-0.6, 1.3, -1.7))
    _put(scene, shapes.box((0.05, 1.4, 1.4)), Material((0.9, 0.85, 0.7), ior=0.0), (1.9, 1.2, -0.3))
    for place, roughness in enumerate((0.0, 0.05, 0.2, 0.45, 0.8)):
        metal = Material((0.95, 0.7, 0.4), metallic=1.0, roughness=roughness)
        _put(scene, _ball(0.3), metal, (0.75 * place - 1.5, 0.31, 0.2))
    for place, (roughness, ior, specular) in enumerate(((0.0, 1.5, 1.0), (0.15, 1.8, 1.0), (0.4, 1.5, 0.3))):
        plastic = Material(
            _RED, roughness=roughness, ior=ior, specular=specular, specular_color=(1.0, 0.8, 0.6)
        )
        _put(scene, _ball(0.25), plastic, (0.8 * place - 0.8, 0.26, 1.2))
    _put(scene, shapes.box(0.5), Material(_BLUE, metallic=0.5, roughness=0.3), (0.3, 0.9, -1.0), turn=0.7)
    spot = scene.add(ispm.SpotLight((120.0, 110.0, 90.0), outer_angle=0.6), translation=(0.5, 2.9, 1.6))
    spot.look_at((0.0, 0.3, 0.3))
    return scene


def glass() -> Scene:
    """Glass, smooth and frosted, solid and thin, clear and colored, one ball within another."""
    scene = _room("glass")
    solid = dict(transmission=1.0, ior=1.5, thickness=0.5)
    tint = dict(attenuation_color=(0.3, 0.8, 0.5), attenuation_distance=0.4)
    for place, material in enumerate(
        (
            Material(roughness=0.0, **solid),
            Material(roughness=0.0, **solid, **tint),
            Material(roughness=0.6, **solid),
            Material((0.9, 0.6, 0.6), roughness=0.0, transmission=0.7, ior=2.2, thickness=0.5),
        )
    ):
        _put(scene, _ball(0.38), material, (0.95 * place - 1.45, 0.4, 0.3))
    _put(
        scene,
        _ball(0.18),
        Material(roughness=0.0, transmission=1.0, ior=1.2, thickness=0.2),
        (-1.45, 0.4, 0.3),
    )
    pane = shapes.box((0.8, 1.0, 0.04))
    for place, material in enumerate(
        (
            Material((0.6, 0.9, 0.7), roughness=0.0, transmission=1.0),
            Material(roughness=0.35, transmission=1.0),
            Material((0.9, 0.8, 0.5), roughness=0.25, transmission=0.6),
        )
    ):
        _put(scene, pane, material, (1.1 * place - 1.1, 0.9, -0.9), turn=0.2)
    spot = scene.add(
        ispm.SpotLight((90.0, 90.0, 90.0), inner_angle=0.3, outer_angle=0.7), translation=(-0.6, 2.9, 1.5)
    )
    spot.look_at((0.0, 0.3, 0.0))
    scene.add(ispm.PointLight((6.0, 5.0, 4.0)), translation=(1.4, 2.2, -1.4))
    return scene


def sheets() -> Scene:
    """Holes, veils, things without a back, things that glow, things that no light changes; open behind."""
    scene = _room("sheets", back=False)
    holes = Texture(_holes(), wrap_u=Wrap.REPEAT)
    upright = dict(lift=True)
    mask = Material(base_color_texture=holes, alpha_mode=AlphaMode.MASK, alpha_cutoff=0.4, double_sided=True)
    veil = Material((0.8, 0.4, 0.3, 0.45), alpha_mode=AlphaMode.BLEND, double_sided=True)
    pattern = Material(base_color_texture=holes, alpha_mode=AlphaMode.BLEND)
    glow = Material(_RED, emission=(3.0, 2.0, 1.0), double_sided=True)
    _put(scene, shapes.plane(1.2, 1.2), mask, (-1.0, 1.0, 0.4), **upright)
    _put(scene, shapes.plane(1.0, 1.4), veil, (0.3, 1.0, 0.8), **upright)
    _put(scene, shapes.plane(0.9, 0.9), pattern, (1.3, 0.9, 0.3), **upright)
    _put(scene, shapes.plane(0.8, 0.8), glow, (1.0, 2.0, -0.9), turn=0.6)
    _put(scene, shapes.plane(0.8, 0.8), Material(_BLUE), (-0.4, 2.0, -0.6), turn=0.6)
    _put(scene, shapes.plane(0.8, 0.8), Material(_BLUE, double_sided=True), (-1.3, 2.2, -0.8))
    _put(scene, _ball(0.3), Material((0.2, 0.6, 0.2), unlit=True), (0.0, 0.31, -0.9))
    scene.add(ispm.PointLight(_LAMP), translation=(0.6, 2.6, 1.4))
    sun = scene.add(ispm.DirectionalLight((1.5, 1.5, 2.0)), translation=(-2.0, 5.0, 4.0))
    sun.look_at((0.0, 0.0, 0.0))
    return scene


def outdoors() -> Scene:
    """A sun on an open field with a gate, a wire, a mirror ball and nothing behind."""
    scene = Scene(name="open")
    _put(scene, shapes.plane(8.0, 8.0), Material((0.4, 0.45, 0.3)), (0.0, 0.0, 0.0))
    for x in (-1.1, 0.5):
        _put(scene, shapes.box((0.3, 1.8, 0.3)), Material(_WHITE), (x, 0.9, -0.4))
    _put(scene, shapes.box((2.4, 0.3, 0.3)), Material(_RED), (-0.3, 1.95, -0.4))
    _put(scene, shapes.cylinder(0.01, 3.0, segments=6), Material(_BLUE), (1.4, 1.5, 0.2))
    _put(scene, _ball(0.4), _MIRROR, (1.0, 0.41, 0.9))
    sun = scene.add(ispm.DirectionalLight((5.0, 4.5, 4.0)), translation=(2.0, 3.0, 2.5))
    sun.look_at((0.0, 0.0, 0.0))
    return scene


def panels() -> Scene:
    """Lamps of every shape, one behind glass, a ball and a pattern that glow, among rough metals."""
    scene = _room("panels")
    _put(scene, shapes.box((0.6, 0.8, 0.6)), Material(_BLUE), (-1.1, 0.4, -0.5), turn=0.4)
    _put(scene, _ball(0.35), Material((0.9, 0.7, 0.4), metallic=1.0, roughness=0.3), (0.0, 0.36, 0.9))
    _put(scene, _ball(0.3), Material((0.8, 0.8, 0.9), metallic=1.0, roughness=0.6), (0.9, 0.31, 0.4))
    _put(scene, _ball(0.2), Material(emission=(4.0, 2.0, 1.0)), (-1.4, 1.3, 0.4))
    glow = Material(emission=(2.0, 2.0, 2.0), emission_texture=Texture(_pattern(0)), double_sided=True)
    _put(scene, shapes.plane(0.8, 0.8), glow, (1.3, 1.2, -1.2), lift=True)
    _put(scene, shapes.box((0.6, 0.6, 0.03)), Material(roughness=0.0, transmission=1.0), (0.9, 1.9, 1.0))
    lamps: list[tuple[ispm.Light, Place]] = [
        (ispm.RectLight((20.0, 18.0, 15.0), width=0.8, height=0.4), (0.0, 2.8, 0.2)),
        (ispm.DiskLight((9.0, 12.0, 18.0), radius=0.2), (1.6, 2.4, 1.4)),
        (ispm.SphereLight((30.0, 24.0, 16.0), radius=0.08), (-0.9, 2.2, 1.0)),
    ]
    for lamp, place in lamps:
        scene.add(lamp, translation=place).look_at((0.0, 0.3, 0.0))
    return scene


def dome(environment: ispm.Environment | ispm.Sky) -> Scene:
    """A field under light from all around, with glass, gloss and a lamp."""
    scene = outdoors()
    for node in list(scene.lights):
        scene.remove(node)
    _put(scene, _ball(0.35), _solid_glass(), (-0.3, 0.36, 0.9))
    _put(scene, _ball(0.3), Material((0.9, 0.6, 0.3), metallic=1.0, roughness=0.3), (-1.3, 0.31, 0.8))
    scene.add(ispm.PointLight((3.0, 2.0, 1.0)), translation=(-0.3, 1.2, 0.2))
    scene.environment = environment
    return scene


def unlit() -> Scene:
    """Things on the ground that bring no light."""
    scene = Scene(name="unlit")
    _put(scene, shapes.plane(5.0, 5.0), Material(_WHITE), (0.0, 0.0, 0.0))
    _put(
        scene, shapes.torus(0.6, 0.2, segments=24, sides=12), Material(_RED, roughness=0.4), (-0.6, 0.2, 0.2)
    )
    _put(scene, _ball(0.4), Material((0.9, 0.8, 0.6), metallic=1.0, roughness=0.3), (0.8, 0.4, 0.4))
    return scene


def coats() -> Scene:
    """Clear coats, smooth and rough, even, patterned and bumpy, over paint and over metal; a soft lamp."""
    scene = _room("coats")
    pattern, bumps = Texture(_pattern(1), srgb=False), Texture(_bumps(), srgb=False)
    materials = [
        Material(_RED, roughness=0.6, clearcoat=1.0),
        Material((0.7, 0.5, 0.3), metallic=1.0, roughness=0.5, clearcoat=0.8, clearcoat_roughness=0.3),
        Material(_BLUE, roughness=0.7, clearcoat=1.0, clearcoat_roughness=0.5, clearcoat_texture=pattern,
                 clearcoat_roughness_texture=pattern, clearcoat_normal_texture=bumps,
                 clearcoat_normal_scale=0.5),
    ]  # fmt: skip
    for place, material in enumerate(materials):
        _put(scene, _ball(0.42), material, (1.1 * place - 1.1, 0.43, 0.5))
    scene.add(ispm.PointLight(_LAMP, radius=0.15), translation=(0.4, 2.5, 0.8))
    return scene


def velvet() -> Scene:
    """Sheen, even and patterned, and specular reflection that textures tell; a lamp with a surface."""
    scene = _room("velvet")
    pattern, colors = Texture(_pattern(1), srgb=False), Texture(_pattern(2))
    materials = [
        Material(_RED, roughness=0.8, sheen_color=(0.9, 0.6, 0.5), sheen_roughness=0.4),
        Material(_BLUE, roughness=0.7, sheen_color=(1.0, 1.0, 1.0), sheen_roughness=0.8,
                 sheen_color_texture=colors, sheen_roughness_texture=pattern),
        Material((0.1, 0.1, 0.1), roughness=0.3, specular_texture=pattern, specular_color_texture=colors),
    ]  # fmt: skip
    for place, material in enumerate(materials):
        _put(scene, _ball(0.42), material, (1.1 * place - 1.1, 0.43, 0.5))
    scene.add(ispm.PointLight(_LAMP, radius=0.15), translation=(0.4, 2.5, 0.8))
    return scene


def brushed() -> Scene:
    """Anisotropic metal and plastic, even, turned, patterned and under a coat; a soft lamp."""
    scene = _room("brushed")
    pattern = Texture(_pattern(1), srgb=False)
    materials = [
        Material((0.9, 0.6, 0.3), metallic=1.0, roughness=0.3, anisotropy=0.8),
        Material((0.8, 0.8, 0.9), metallic=1.0, roughness=0.4, anisotropy=0.7, anisotropy_rotation=0.8,
                 clearcoat=1.0),
        Material(_RED, roughness=0.3, anisotropy=0.9, anisotropy_texture=pattern),
    ]  # fmt: skip
    for place, material in enumerate(materials):
        _put(scene, _ball(0.42), material, (1.1 * place - 1.1, 0.43, 0.5))
    scene.add(ispm.PointLight(_LAMP, radius=0.15), translation=(0.4, 2.5, 0.8))
    return scene


def prisms() -> Scene:
    """Glass that parts light into colors, smooth, frosted and behind a pane, before a mirror."""
    scene = _room("prisms")
    solid = dict(transmission=1.0, ior=1.6, thickness=0.5, dispersion=3.0)
    _put(scene, _ball(0.38), Material(roughness=0.0, **solid), (-1.1, 0.4, 0.3))
    _put(scene, shapes.box(0.6), Material(roughness=0.0, **solid), (0.0, 0.5, 0.3), turn=0.6)
    _put(scene, _ball(0.38), Material((0.6, 0.8, 1.0), roughness=0.4, **solid), (1.1, 0.4, 0.3))
    _put(scene, shapes.box((0.8, 1.0, 0.04)), Material(roughness=0.0, transmission=1.0), (-1.1, 0.9, 1.2))
    _put(scene, shapes.plane(2.4, 1.2), _MIRROR, (0.3, 1.0, -1.2), lift=True)
    spot = scene.add(ispm.SpotLight((90.0, 80.0, 60.0), outer_angle=0.7), translation=(-0.6, 2.9, 1.5))
    spot.look_at((0.0, 0.3, 0.3))
    return scene


def lantern() -> Scene:
    """Paper before lamps and a mirror: even, patterned, blended, glossy, under sheen; a lamp in a shade."""
    scene = _room("lantern")
    pattern, colors = Texture(_holes()), Texture(_pattern(2))
    leaf = dict(double_sided=True, diffuse_transmission_color=(0.8, 0.9, 0.3))
    sheets = [
        Material(_WHITE, diffuse_transmission=0.6, **leaf),
        Material(_BLUE, roughness=0.4, diffuse_transmission=0.9, diffuse_transmission_texture=pattern,
                 diffuse_transmission_color_texture=colors, **leaf),
        Material((*_RED, 0.6), diffuse_transmission=0.5, alpha_mode=AlphaMode.BLEND,
                 sheen_color=(0.4, 0.3, 0.3), sheen_roughness=0.5, **leaf),
    ]  # fmt: skip
    for place, material in enumerate(sheets):
        _put(scene, shapes.plane(0.9, 1.0), material, (1.1 * place - 1.1, 0.7, 0.9), lift=True)
    shade = Material((0.8, 0.75, 0.6), diffuse_transmission=0.5, double_sided=True)
    _put(scene, shapes.cylinder(0.3, 0.5, segments=24), shade, (-0.6, 1.9, -0.4))
    _put(scene, shapes.plane(1.2, 1.2), _MIRROR, (1.0, 1.4, -1.9), lift=True)
    scene.add(ispm.PointLight((9.0, 8.0, 6.0)), translation=(-0.6, 1.9, -0.4))
    lamp = ispm.RectLight((20.0, 20.0, 20.0), width=0.6, height=0.4)
    scene.add(lamp, translation=(0.8, 2.8, -0.6)).look_at((0.3, 0.3, 0.5))
    return scene


def product() -> Scene:
    """One thing alone, without light."""
    scene = Scene(name="product")
    _put(
        scene, shapes.torus(0.7, 0.25, segments=32, sides=16), Material(_RED, roughness=0.4), (0.0, 0.25, 0.0)
    )
    return scene


def crowd() -> Scene:
    """Copies of one mesh, some of them mirrored or scaled, and a node that an animation moves."""
    scene = _room("crowd")
    turns = []
    for k in range(9):
        x, z, angle, size = 0.8 * (k % 3) - 0.8, 0.8 * (k // 3) - 0.8, 0.7 * k, 0.6 + 0.1 * k
        c, s, flip = size * math.cos(angle), size * math.sin(angle), -1.0 if k % 4 == 3 else 1.0
        turns.append([[flip * c, 0, s, x], [0, size, 0, 0.01], [-flip * s, 0, c, z], [0, 0, 0, 1]])
    many = Node("many", parts=[Part(shapes.cone(0.25, 0.6, segments=16), Material(_RED, roughness=0.5))])
    many.instances = np.array(turns, np.float64)
    scene.roots.append(many)
    ball = _put(scene, _ball(0.3), Material((0.9, 0.9, 0.95), metallic=1.0, roughness=0.1), (-1.0, 1.6, 0.2))
    path = np.array([[-1.0, 1.6, 0.2], [1.0, 1.2, 0.6]])
    scene.animations.append(
        ispm.Animation([ispm.Channel(ball, "translation", np.array([0.0, 1.0]), path)], "fly")
    )
    scene.add(ispm.PointLight(_LAMP), translation=(0.3, 2.4, 1.0))
    return scene


_MIRROR = Material((0.9, 0.9, 0.9), metallic=1.0, roughness=0.0)


def _room(name: str, *, ceiling: bool = True, back: bool = True) -> Scene:
    """A box of 4 x 3 x 4 m, open in front, of single walls."""
    scene = Scene(name=name)
    walls = [((4.0, 0.1, 4.0), (0.0, -0.05, 0.0), _WHITE)]
    walls += [((0.1, 3.0, 4.0), (-2.05, 1.5, 0.0), _RED), ((0.1, 3.0, 4.0), (2.05, 1.5, 0.0), _BLUE)]
    walls += [((4.0, 3.0, 0.1), (0.0, 1.5, -2.05), _WHITE)] if back else []
    walls += [((4.0, 0.1, 4.0), (0.0, 3.05, 0.0), _WHITE)] if ceiling else []
    for size, place, color in walls:
        _put(scene, shapes.box(size), Material(color), place)
    return scene


def _put(
    scene: Scene, mesh: ispm.Mesh, material: Material, place: Place, *, turn: float = 0.0, lift: bool = False
) -> Node:
    """Add a mesh; turn: radians about +Y; lift: what lies faces +Z."""
    rotation = (
        ispm.axis_angle((1.0, 0.0, 0.0), math.pi / 2.0) if lift else ispm.axis_angle((0.0, 1.0, 0.0), turn)
    )
    return scene.add(mesh, material=material, translation=place, rotation=rotation)


def _ball(radius: float) -> ispm.Mesh:
    return shapes.sphere(radius, segments=32, rings=16)


def _solid_glass() -> Material:
    return Material(transmission=1.0, roughness=0.0, ior=1.5, thickness=0.5)


def _pattern(kind: int) -> np.ndarray:
    """(32, 48, 4) uint8: numbers that no row or column repeats, all channels unlike."""
    y, x, c = np.mgrid[:32, :48, :3]
    values = (x * (7 + 4 * c) + y * (13 - 3 * c) + 97 * c + 50 * kind + 5 * (x // 6) * (y // 5)) % 256
    return np.concatenate([values, np.full((32, 48, 1), 255)], axis=2).astype(np.uint8)


def _holes() -> np.ndarray:
    """(32, 32, 4) uint8: rings whose opacity rises and falls."""
    y, x = np.mgrid[:32, :32] - 15.5
    opacity = 255 * (0.5 + 0.5 * np.cos(0.9 * np.hypot(x, y)))
    return np.stack([np.full((32, 32), 200), 128 + 4 * x, 128 + 4 * y, opacity], axis=2).astype(np.uint8)


def _bumps() -> np.ndarray:
    """(32, 32, 3) float: normals of waves, as pictures hold them."""
    y, x = np.mgrid[:32, :32] * (2.0 * math.pi / 32.0)
    slopes = np.stack([0.4 * np.cos(2.0 * x), 0.3 * np.sin(3.0 * y), np.ones_like(x)], axis=2)
    return 0.5 + 0.5 * slopes / np.linalg.norm(slopes, axis=2, keepdims=True)
