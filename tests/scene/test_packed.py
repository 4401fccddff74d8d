"""What is packed again after an edit is what would be packed anew, and what did not change is kept."""

import copy

import numpy as np
import pytest

from ispm import (
    DiskLight,
    Environment,
    Material,
    Mesh,
    Node,
    Part,
    PointLight,
    RectLight,
    Scene,
    SphereLight,
    SpotLight,
    Texture,
    shapes,
)
from ispm.scene.packed import Packed, pack


def furnished() -> Scene:
    """A scene with a tree of nodes, copies, mirrored ones, textures and lights."""
    scene = Scene()
    wood = Material(
        (0.6, 0.4, 0.2), name="wood", base_color_texture=Texture(np.full((4, 4, 3), 90, np.uint8))
    )
    table = scene.add(shapes.box((2.0, 0.1, 1.0)), material=wood, name="table", rotation=(0.1, 0.2, 0.3, 0.9))
    box = shapes.box((0.1, 0.2, 0.3))
    for k in range(4):
        scene.add(box, material=wood, name=f"leg {k}", translation=(k, -0.5, 0.0), parent=table)
    cup = scene.add(shapes.sphere(0.1), material=Material(roughness=0.3), name="cup", scale=(1.0, -1.0, 1.0))
    cup.instances = np.tile(np.eye(4), (3, 1, 1))
    cup.instances[:, 0, 3] = 0.0, 1.0, 2.0
    scene.add(PointLight((9.0, 9.0, 9.0)), name="lamp", translation=np.array([0.0, 3.0, 0.0]))
    scene.add(SpotLight(outer_angle=0.5), name="spot", translation=(1.0, 3.0, 0.0))
    scene.add(RectLight(width=0.5), name="panel", translation=(2.0, 3.0, 0.0), parent=table)
    scene.add(SphereLight(), name="globe", translation=(-2.0, 3.0, 0.0))
    scene.environment = Environment(np.full((2, 4, 3), 0.5))
    return scene


def content(packed: Packed) -> dict[str, object]:
    """All that can be told of it, as bytes and values."""
    arrays = ("instances", "materials", "lights", "bounds", "widths", "boxes", "ids")
    found: dict[str, object] = {name: getattr(packed, name).tobytes() for name in arrays}
    found |= {"vertices": packed.geometry.digest, "diagonal": packed.diagonal, "names": packed.names}
    found["environment"] = packed.surround.digest
    found |= {"draws": packed.draws, "textures": [texture.state for texture in packed.textures]}
    return found


def _paint_environment(scene: Scene) -> None:
    scene.environment.image[0, 0] = 3.0
    scene.environment.touch()


def _move_in_place(scene: Scene) -> None:
    scene["lamp"].translation[1] = 2.5


def _edit_mesh(scene: Scene) -> None:
    mesh = scene["table"].parts[0].mesh
    mesh.positions[0, 0] -= 0.5
    mesh.touch()


def _draw_on_texture(scene: Scene) -> None:
    texture = scene["table"].parts[0].material.base_color_texture
    texture.pixels[0, 0] = 7
    texture.touch()


def _swap_twins(scene: Scene) -> None:
    """A material that equals the one before, and is another."""
    leg = scene["leg 2"].parts[0]
    leg.material = copy.copy(leg.material)


EDITS = {
    "node moved": lambda s: setattr(s["leg 1"], "translation", (1.0, -0.6, 0.0)),
    "node moved in place": _move_in_place,
    "parent moved": lambda s: setattr(s["table"], "scale", (1.0, 1.0, -1.0)),
    "many moved": lambda s: s.set_transforms([s["leg 0"], s["leg 3"]], np.stack([np.eye(4)] * 2)),
    "copies moved in place": lambda s: s["cup"].instances.__setitem__((1, 1, 3), 0.25),
    "copies gone": lambda s: setattr(s["cup"], "instances", None),
    "mesh edited": _edit_mesh,
    "mesh emptied": lambda s: setattr(s["cup"].parts[0].mesh, "triangles", np.zeros((0, 3), np.uint32)),
    "mesh replaced": lambda s: setattr(s["table"].parts[0], "mesh", shapes.box((1.0, 1.0, 1.0))),
    "material's number": lambda s: setattr(s["cup"].parts[0].material, "roughness", 0.4),
    "material's color as a list": lambda s: setattr(s["cup"].parts[0].material, "emission", [1.0, 2.0, 3.0]),
    "material's texture": lambda s: setattr(s["table"].parts[0].material, "base_color_texture", None),
    "material's twin": _swap_twins,
    "texture drawn on": _draw_on_texture,
    "texture wrapped": lambda s: setattr(s["table"].parts[0].material.base_color_texture, "wrap_u", 1),
    "light's number": lambda s: setattr(s["lamp"].light, "intensity", (1.0, 2.0, 3.0)),
    "light's kind": lambda s: setattr(s["lamp"], "light", SpotLight()),
    "light gone": lambda s: s.remove("spot"),
    "lamp's number": lambda s: setattr(s["panel"].light, "intensity", (1.0, 2.0, 3.0)),
    "lamp's size": lambda s: setattr(s["panel"].light, "height", 0.3),
    "lamp's back": lambda s: setattr(s["panel"].light, "two_sided", True),
    "lamp's kind": lambda s: setattr(s["panel"], "light", DiskLight()),
    "lamp's twin": lambda s: setattr(s["panel"], "light", RectLight(width=0.5)),
    "lamp without a surface": lambda s: setattr(s["globe"], "light", PointLight()),
    "light with a surface": lambda s: setattr(s["lamp"], "light", SphereLight()),
    "lamp gone": lambda s: s.remove("globe"),
    "lamp and copies": lambda s: setattr(s["cup"], "light", DiskLight(radius=0.2)),
    "environment gone": lambda s: setattr(s, "environment", None),
    "environment's number": lambda s: setattr(s.environment, "intensity", 2.0),
    "environment turned": lambda s: setattr(s.environment, "rotation", 1.0),
    "environment hidden": lambda s: setattr(s.environment, "background", False),
    "environment's image": lambda s: setattr(s.environment, "image", np.ones((2, 4, 3))),
    "environment painted": _paint_environment,
    "environment's twin": lambda s: setattr(s, "environment", Environment(np.full((4, 8, 3), 0.5))),
    "node renamed": lambda s: setattr(s["leg 0"], "name", "foot"),
    "node added": lambda s: s.add(shapes.box(), name="new"),
    "node removed": lambda s: s.remove("leg 1"),
    "part added": lambda s: s["cup"].parts.append(Part(shapes.box(), Material())),
    "order": lambda s: s["table"].children.reverse(),
    "moved to another parent": lambda s: s.roots.append(s.remove("leg 1")),
}


@pytest.mark.parametrize("edit", EDITS)
def test_after_an_edit_a_scene_is_packed_as_if_anew(edit):
    scene = furnished()
    before = pack(scene)
    old = content(before)
    EDITS[edit](scene)
    again = pack(scene, before)
    assert again is not before
    assert content(again) == content(pack(scene))
    assert {**content(before), "textures": None} == {**old, "textures": None}  # frames may still hold it


def test_what_did_not_change_is_kept():
    scene = furnished()
    before = pack(scene)
    assert pack(scene, before) is before
    assert pack(scene.at_rest(), before) is not before  # other nodes, even if they stand alike
    scene["leg 1"].translation = (0.0, 5.0, 0.0)
    moved = pack(scene, before)
    assert (moved.geometry, moved.looks, moved.lit) == (before.geometry, before.looks, before.lit)
    assert moved.names is before.names and moved.instances is not before.instances
    scene["cup"].parts[0].material.roughness = 0.9
    painted = pack(scene, moved)
    assert painted.placed is moved.placed and painted.looks is not moved.looks
    scene["lamp"].light.intensity = (2.0, 2.0, 2.0)
    lit = pack(scene, painted)
    assert (lit.placed, lit.looks) == (painted.placed, painted.looks) and lit.lit is not painted.lit
    assert lit.surround is before.surround
    scene.environment.rotation = 0.5
    turned = pack(scene, lit)
    assert (turned.placed, turned.looks, turned.lit) == (lit.placed, lit.looks, lit.lit)
    assert turned.environment.columns is lit.environment.columns  # made of the image alone


def test_a_value_that_goes_bad_is_refused_though_the_one_before_was_packed():
    scene = furnished()
    before = pack(scene)
    for owner, name, bad in (
        (scene["cup"].parts[0].material, "roughness", 2.0),
        (scene["lamp"].light, "intensity", (np.nan, 1.0, 1.0)),
        (scene["leg 0"], "translation", (np.inf, 0.0, 0.0)),
        (scene["leg 0"], "parts", [None]),
        (scene["leg 0"], "light", 3),
        (scene, "environment", "sky.hdr"),
        (scene.environment, "rotation", np.nan),
        (scene.environment, "intensity", -1.0),
        (scene.environment, "image", np.ones((2, 4))),
        (scene["leg 0"], "children", None),
    ):
        good = getattr(owner, name)
        setattr(owner, name, bad)
        with pytest.raises(ValueError):
            pack(scene, before)
        setattr(owner, name, good)
    assert pack(scene, before) is before


def test_a_mesh_of_a_class_of_ones_own_is_packed_too():
    class Own(Mesh):
        pass

    plain = shapes.box()
    own = Own(plain.positions, plain.triangles, plain.normals, plain.tangents, plain.uv0)
    first, second = (pack(Scene([Node(parts=[Part(mesh, Material())])])) for mesh in (plain, own))
    assert first.instances.tobytes() == second.instances.tobytes()
