"""What a renderer keeps from frame to frame changes no picture: after any change it renders as a new one."""

import numpy as np
import pytest

from ispm import (
    AlphaMode,
    Camera,
    DirectionalLight,
    Material,
    Morph,
    Node,
    PointLight,
    RectLight,
    Renderer,
    Scene,
    Settings,
    Skin,
    Sky,
    SphereLight,
    SpotLight,
    Texture,
    Wrap,
    shapes,
)
from ispm.stages.antialias import Antialias
from ispm.stages.bounce import BounceStage
from ispm.stages.gbuffer import GBufferStage
from ispm.stages.shadow import ShadowStage

SETTINGS = Settings(
    size=(48, 27), preset="fast", photons=400, emission="map", shadows="map", shadow_resolution=64
)
RNG = np.random.default_rng(1)
PICTURE = RNG.integers(0, 255, (8, 8, 4), np.uint8)


def room() -> Scene:
    """Boxes over a floor: one with holes, one of thin glass, one a mirror; three kinds of light."""
    scene = Scene()
    scene.add(shapes.box((4.0, 0.2, 4.0)), material=Material((0.8, 0.7, 0.6)), name="floor")
    leaf = Material(base_color_texture=Texture(PICTURE.copy()), alpha_mode=AlphaMode.MASK, name="leaf")
    scene.add(shapes.box((1.0, 0.05, 1.0)), material=leaf, name="leaf", translation=(-0.8, 1.0, 0.0))
    pane = Material((0.5, 0.9, 0.5), transmission=1.0, roughness=0.0)
    scene.add(shapes.box((0.8, 0.6, 0.8)), material=pane, name="pane", translation=(0.8, 0.5, 0.0))
    mirror = Material((0.9, 0.9, 0.9), metallic=1.0, roughness=0.0)
    scene.add(shapes.box(0.6), material=mirror, name="mirror", translation=(0.0, 0.4, -1.0))
    scene.add(shapes.sphere(0.3), material=Material(roughness=0.4), name="ball", translation=(0.0, 0.4, 1.0))
    scene.add(PointLight((9.0, 9.0, 9.0)), name="lamp", translation=(0.0, 3.0, 0.0))
    scene.add(SpotLight((20.0, 9.0, 9.0)), name="spot", translation=(2.0, 3.0, 1.0)).look_at((0.0, 0.0, 0.0))
    scene.add(DirectionalLight(), name="sun", translation=(1.0, 3.0, 1.0)).look_at((0.0, 0.0, 0.0))
    panel = RectLight((4.0, 4.0, 6.0), width=0.8, height=0.4)
    scene.add(panel, name="panel", translation=(-1.2, 1.2, -0.8)).look_at((0.0, 0.3, 4.0))
    sail = shapes.box((0.6, 0.6, 0.05))
    sail.morphs = [Morph(0.5 * sail.positions)]
    glow = Material(emission=(2.0, 1.0, 0.5), double_sided=True)
    scene.add(sail, material=glow, name="sail", translation=(1.4, 0.6, 1.0)).weights = [0.2]
    pole = shapes.cylinder(0.1, 1.0)
    pole.joints = np.tile([0, 1], (len(pole.positions), 1))
    pole.joint_weights = np.stack([0.5 - pole.positions[:, 1], 0.5 + pole.positions[:, 1]], axis=1)
    scene.roots += [Node("foot", (-1.4, 0.6, 1.0)), Node("head", (-1.4, 0.6, 1.0))]
    scene.add(pole, name="pole").skin = Skin([scene["foot"], scene["head"]])
    scene.add(Camera(), name="camera", translation=(0.5, 2.0, 5.0)).look_at((0.0, 0.3, 0.0))
    return scene


def content(renderer: Renderer) -> dict[str, bytes]:
    """All layers of the next frame, its photons and the bounce maps."""
    frame = renderer.render()
    found = {name: np.ascontiguousarray(frame[name]).tobytes() for name in frame}
    if renderer._last.traced.texels:  # not where nothing shines but what is all around
        found["maps"] = renderer.view("bounce-map").tobytes()
    return found | {"photons": renderer.photons().tobytes()}


def material_of(renderer: Renderer, name: str) -> Material:
    return renderer.scene[name].parts[0].material


def _edit_mesh(renderer: Renderer) -> None:
    mesh = renderer.scene["ball"].parts[0].mesh
    mesh.positions[:, 1] *= 1.5
    mesh.touch()


def _deform(renderer: Renderer) -> None:
    mesh = renderer.scene["ball"].parts[0].mesh
    mesh.positions = mesh.positions * np.array([1.0, 1.0 + 0.5 * np.sin(1.0), 0.8])
    mesh.normals = mesh.smooth_normals()


def _draw_on_texture(renderer: Renderer) -> None:
    texture = material_of(renderer, "leaf").base_color_texture
    texture.pixels[:4, :, 3] = 0
    texture.touch()


def _disperse(renderer: Renderer) -> None:
    material = material_of(renderer, "pane")
    material.thickness, material.dispersion = 0.5, 2.0


def _move(name: str, *by: float):
    def change(renderer: Renderer) -> None:
        node = renderer.scene[name]
        node.translation = tuple(a + b for a, b in zip(node.translation, by, strict=True))

    return change


def _light(name: str, field: str, value: object):
    return lambda renderer: setattr(renderer.scene[name].light, field, value)


def _material(name: str, field: str, value: object):
    return lambda renderer: setattr(material_of(renderer, name), field, value)


def _set(**values: object):
    return lambda renderer: setattr(renderer, "settings", renderer.settings.replace(**values))


def _replace_scene(renderer: Renderer) -> None:
    renderer.scene = room()
    renderer.scene["lamp"].translation = (1.0, 2.0, 1.0)


def _leave_a_frame_unfinished(renderer: Renderer) -> None:
    """Frames of other places that fail when this and that was recorded, some of it without being sent."""
    nodes = [renderer.scene[name] for name in ("lamp", "mirror", "camera")]
    places = [node.translation for node in nodes]
    for number, name in enumerate(("downsample", "bounce", "direct", "upsample", "antialias")):
        for node, (x, y, z) in zip(nodes, places, strict=True):
            node.translation = (x, y + 0.1 + 0.02 * number, z)
        stage = getattr(renderer._stages, name)
        setattr(renderer._stages, name, None)
        with pytest.raises((TypeError, AttributeError)):
            renderer.render()
        setattr(renderer._stages, name, stage)
    for node, place in zip(nodes, places, strict=True):
        node.translation = place


def _darken(renderer: Renderer) -> None:
    for name in LIGHTS:
        renderer.scene.remove(name)


def _light_by(kind: str):
    def change(renderer: Renderer) -> None:
        _darken(renderer)
        renderer.settings = renderer.settings.replace(light=kind)

    return change


def _sky(**values: object):
    def change(renderer: Renderer) -> None:
        if renderer.scene.environment is None:
            renderer.scene.environment = Sky(0.5)
            content(renderer)
        for name, value in values.items():
            setattr(renderer.scene.environment, name, value)

    return change


LIGHTS = ("spot", "lamp", "sun", "panel")
CHANGES = {
    "nothing": lambda renderer: None,
    "mesh edited in place": _edit_mesh,
    "mesh deformed": _deform,
    "mesh that glows morphed": lambda renderer: setattr(renderer.scene["sail"], "weights", [0.8]),
    "mesh without a weight": lambda renderer: setattr(renderer.scene["sail"], "weights", None),
    "joint moved": _move("head", 0.3, 0.1, 0.2),
    "node moved": _move("mirror", 0.3, 0.0, 0.2),
    "node with holes moved": _move("leaf", 0.3, 0.0, 0.2),
    "pane moved": _move("pane", 0.0, 0.3, 0.0),
    "lamp moved": _move("lamp", 0.4, 0.0, 0.0),
    "lamp raised by a hair": _move("lamp", 0.0, 1e-6, 0.0),
    "lamp's intensity": _light("lamp", "intensity", (1.0, 2.0, 3.0)),
    "lamp's range": _light("lamp", "range", 2.5),
    "spot's angle": _light("spot", "outer_angle", 0.3),
    "panel moved": _move("panel", 0.3, 0.1, 0.0),
    "panel's intensity": _light("panel", "intensity", (1.0, 2.0, 3.0)),
    "panel's size": _light("panel", "width", 0.5),
    "panel's kind": lambda renderer: setattr(renderer.scene["panel"], "light", SphereLight(radius=0.2)),
    "light gone": lambda renderer: renderer.scene.remove("spot"),
    "all lights gone": _darken,
    "a lamp in their place": _light_by("lamp"),
    "a sky in their place": _light_by("sky"),
    "nothing in their place": _light_by("none"),
    "a sky": _sky(),
    "a sky's sun moved": _sky(sun_azimuth=1.0),
    "a sky's sun set": _sky(sun_elevation=-0.05),
    "a sky of more light": _sky(intensity=2.0),
    "node gone": lambda renderer: renderer.scene.remove("mirror"),
    "node added": lambda renderer: renderer.scene.add(shapes.box(0.3), translation=(0.0, 1.2, 0.0)),
    "color": _material("floor", "base_color", (0.2, 0.9, 0.2)),
    "roughness": _material("ball", "roughness", 0.9),
    "diffuse transmission": _material("ball", "diffuse_transmission", 0.5),
    "solid glass": _material("pane", "thickness", 0.5),
    "dispersion": _disperse,
    "holes filled": _material("leaf", "alpha_mode", AlphaMode.OPAQUE),
    "holes cut otherwise": _material("leaf", "alpha_cutoff", 0.2),
    "leaf blended": _material("leaf", "alpha_mode", AlphaMode.BLEND),
    "pane tinted": _material("pane", "base_color", (0.9, 0.2, 0.2)),
    "pane opaque": _material("pane", "transmission", 0.0),
    "texture drawn on": _draw_on_texture,
    "texture wrapped": lambda r: setattr(material_of(r, "leaf").base_color_texture, "wrap_u", Wrap.MIRROR),
    "camera moved": _move("camera", 0.5, 0.1, -0.4),
    "size": _set(size=(64, 40)),
    "photons": _set(photons=700),
    "bounces": _set(bounces=2),
    "subsampling": _set(subsampling=2),
    "shadow maps": _set(shadow_resolution=32),
    "seed": _set(seed=5),
    "rays": _set(emission="rays"),
    "scene replaced": _replace_scene,
    "an unfinished frame": _leave_a_frame_unfinished,
}


@pytest.fixture(scope="module")
def used(gpu):
    """A renderer that the tests share, so that it has rendered other things before."""
    with Renderer(room(), SETTINGS, threads=2, gpu=gpu) as renderer:
        yield renderer


@pytest.mark.filterwarnings("ignore::ispm.SceneWarning")
@pytest.mark.parametrize("change", CHANGES)
def test_after_a_change_a_renderer_renders_as_a_new_one(gpu, used, change):
    used.scene, used.settings, used.camera = room(), SETTINGS, None
    first = content(used)
    CHANGES[change](used)
    found = content(used)
    assert (found == first) == (change in ("nothing", "an unfinished frame"))
    with Renderer(used.scene, used.settings, threads=2, gpu=gpu) as fresh:
        wanted = content(fresh)
    assert [name for name in wanted if found[name] != wanted[name]] == []


@pytest.mark.filterwarnings("ignore::ispm.SceneWarning")
def test_changes_and_back(used):
    scene = used.scene = room()
    used.settings, first = SETTINGS, content(used)
    for change in (_replace_scene, _set(size=(64, 40)), _leave_a_frame_unfinished, _set(emission="rays")):
        change(used)
        content(used)
        used.scene, used.settings = scene, SETTINGS
        assert content(used) == first


@pytest.mark.filterwarnings("ignore::ispm.SceneWarning")
def test_what_rests_is_not_drawn_again(gpu, monkeypatch):
    drawn = []
    stages = {ShadowStage, BounceStage, GBufferStage, Antialias}
    for stage in stages:
        monkeypatch.setattr(
            stage, "_draw", lambda self, *_, draw=stage._draw: (drawn.append(type(self)), draw(self, *_))[1]
        )

    def of_a_frame() -> set[type]:
        drawn.clear()
        renderer.render()
        return set(drawn)

    with Renderer(room(), SETTINGS, threads=2, gpu=gpu) as renderer:
        assert of_a_frame() == stages
        assert of_a_frame() == set()
        _move("lamp", 0.3, 0.0, 0.0)(renderer)
        assert of_a_frame() == {ShadowStage, BounceStage}
        _move("camera", 0.3, 0.0, 0.0)(renderer)
        assert of_a_frame() >= {GBufferStage, Antialias}
        _move("mirror", 0.3, 0.0, 0.0)(renderer)
        assert of_a_frame() == stages
