"""Edits and what takes them back."""

import math

import numpy as np
import pytest

import ispm
from ispm.errors import SceneError
from ispm.scene.rotation import rotation_matrix
from ispm.viewer import actions, fields
from ispm.viewer.changes import fingerprint
from ispm.viewer.edits import Assign, Edit, Hidden, History

TURN = ispm.euler(0.3, -0.7, 1.1)


def scene():
    made = ispm.Scene()
    top = made.add(ispm.shapes.box(), name="top", translation=(1, 2, 3), rotation=TURN, scale=(2, 2, 2))
    made.add(ispm.shapes.sphere(), name="ball", translation=(0, 1, 0), parent=top)
    made.add(ispm.PointLight((4.0, 2.0, 1.0)), name="lamp", translation=(0, 3, 0))
    made.add(ispm.SpotLight((5.0, 5.0, 5.0)), name="spot", parent=top)
    placed = made.add(ispm.shapes.plane(), name="matrix")
    placed.matrix = np.diag([2.0, 3.0, 4.0, 1.0])
    return made


def random_edit(world, hidden, dice):
    nodes = world.nodes
    node = nodes[dice.integers(len(nodes))]
    kind = dice.integers(9)
    numbers = tuple(dice.uniform(0.1, 2.0, 3).tolist())
    if kind == 0:
        return actions.move(world, node, np.array(numbers))
    if kind == 1:
        return fields.node_edit(node, "rotation", numbers, None)
    if kind == 2:
        return fields.node_edit(node, "scale", numbers, None)
    if kind == 3 and len(nodes) > 3:
        return actions.delete(world, node)
    if kind == 4:
        return actions.duplicate(world, node, np.ones(3))[0]
    if kind == 5:
        return actions.add_light(world, "spot", np.eye(4), 2.0)[0]
    if kind == 6:
        return actions.hide(hidden, node, bool(dice.integers(2)))
    if kind == 7 and node.light is not None:
        name, value = (("strength", 7.0), ("kind", "rect"), ("color", list(numbers)))[dice.integers(3)]
        value = [min(v, 1.0) for v in value] if name == "color" else value
        return fields.light_edit(node, name, value, 2.0, None)
    if node.parts:
        return fields.material_edit(node.parts[0].material, "roughness", float(dice.uniform()), None)
    return fields.node_edit(node, "name", f"name {dice.integers(9)}", None)


@pytest.mark.parametrize("seed", range(8))
def test_taking_all_edits_back_gives_the_scene_and_making_them_again_the_result(seed):
    world, hidden, history, dice = scene(), Hidden(), History(), np.random.default_rng(seed)
    states = [(fingerprint(world), hidden.nodes)]
    for _ in range(60):
        history.make(random_edit(world, hidden, dice))
        states.append((fingerprint(world), hidden.nodes))
    for state in reversed(states[:-1]):
        assert history.undo()
        assert (fingerprint(world), hidden.nodes) == state
    assert not history.undo()
    for state in states[1:]:
        assert history.redo()
        assert (fingerprint(world), hidden.nodes) == state
    assert not history.redo()


def test_steps_of_one_drag_are_taken_back_at_once():
    world, history = scene(), History()
    lamp = world["lamp"]
    for x in (1.0, 2.0, 3.0):
        history.make(actions.move(world, lamp, np.array([x, 0, 0]), gesture=("client", 7)))
    history.make(actions.move(world, lamp, np.array([9.0, 0, 0]), gesture=("client", 8)))
    assert len(history.undos) == 2
    history.undo()
    np.testing.assert_array_equal(lamp.translation, (3, 0, 0))
    history.undo()
    np.testing.assert_array_equal(lamp.translation, (0, 3, 0))
    history.redo()
    np.testing.assert_array_equal(lamp.translation, (3, 0, 0))


@pytest.mark.parametrize("end", [(0.0, 3.0, 0.0), (1e-9, 3.0 - 1e-7, -1e-9)])
def test_a_drag_that_ends_where_it_began_leaves_nothing(end):
    world, history = scene(), History()
    lamp = world["lamp"]
    history.make(fields.node_edit(lamp, "name", "a", None))
    history.undo()
    for place in ((0.0, 3.1, 0.0), (0.2, 3.1, 0.0), end):
        history.make(actions.move(world, lamp, np.array(place), gesture=("client", 7)))
    assert history.undos == []
    np.testing.assert_array_equal(lamp.translation, (0, 3, 0))  # and not what rounding made of it
    bright = fields.light_fields(lamp.light)[2]["value"]
    for value in (2.0 * bright, bright):
        history.make(fields.light_edit(lamp, "strength", value, 1.0, ("client", 8)))
    assert history.undos == []


def test_a_drag_by_nothing_keeps_what_can_be_made_again():
    world, history = scene(), History()
    history.make(fields.node_edit(world["lamp"], "name", "a", None))
    history.undo()
    history.make(actions.move(world, world["lamp"], np.array([0.0, 3.0, 0.0]), gesture=("client", 7)))
    assert history.redo()


def test_a_drag_that_was_taken_back_does_not_go_on():
    world, history = scene(), History()
    for x in (1.0, 2.0):
        history.make(actions.move(world, world["lamp"], np.array([x, 0, 0]), gesture=1))
        history.undo()
        history.redo()
    assert len(history.undos) == 2


def test_a_new_edit_forgets_what_was_taken_back():
    world, history = scene(), History()
    history.make(fields.node_edit(world["lamp"], "name", "a", None))
    history.undo()
    history.make(fields.node_edit(world["lamp"], "name", "b", None))
    assert not history.redo()


def test_an_edit_that_fails_half_way_changes_nothing():
    world = scene()
    before, lamp, history = fingerprint(world), world["lamp"], History()
    steps = Assign(lamp, "name", "moved"), Assign(lamp, "translation", (math.nan, 0, 0))
    with pytest.raises(SceneError, match=r"^move: node 'moved': translation"):
        history.make(Edit("move", steps))
    assert fingerprint(world) == before
    assert not history.undos


@pytest.mark.parametrize("name", ["ball", "spot", "matrix", "lamp"])
def test_a_node_is_moved_to_a_place_in_the_world_wherever_it_hangs(name):
    world = scene()
    node, goal = world[name], np.array([-3.0, 0.5, 7.0])
    turn = world.world_matrix(node)[:3, :3].copy()
    actions.move(world, node, goal).apply()
    np.testing.assert_allclose(world.world_matrix(node)[:3, 3], goal, atol=1e-12)
    np.testing.assert_allclose(world.world_matrix(node)[:3, :3], turn, atol=1e-12)


def test_angles_are_those_that_a_node_is_turned_to():
    world, dice = scene(), np.random.default_rng(3)
    for angles in [*dice.uniform(-180, 180, (200, 3)), (30, 90, 0), (0, -90, 0), (0, 0, 0)]:
        actions.turn(world["lamp"], tuple(map(float, angles))).apply()
        turn = rotation_matrix(np.array(world["lamp"].rotation))
        actions.turn(world["lamp"], actions.angles_of(world["lamp"])).apply()
        np.testing.assert_allclose(rotation_matrix(np.array(world["lamp"].rotation)), turn, atol=1e-7)


def test_a_node_placed_by_a_matrix_is_turned_and_scaled_by_parts_that_are_the_same():
    world = scene()
    node = world["matrix"]
    history = History()
    history.make(actions.scale(node, (2.0, 3.0, 8.0)))
    np.testing.assert_allclose(node.local_matrix(), np.diag([2.0, 3.0, 8.0, 1.0]), atol=1e-12)
    history.undo()
    assert node.matrix is not None
    node.matrix = np.array([[1.0, 1.0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    with pytest.raises(SceneError, match="shears"):
        actions.turn(node, (1.0, 2.0, 3.0))


def test_a_light_of_another_kind_stays_as_bright_at_a_distance():
    world = scene()
    lamp = world["lamp"]
    actions.as_kind(lamp, "directional", 2.0).apply()
    assert lamp.light == ispm.DirectionalLight((1.0, 0.5, 0.25))
    actions.as_kind(lamp, "spot", 2.0).apply()
    assert isinstance(lamp.light, ispm.SpotLight)
    assert lamp.light.intensity == (4.0, 2.0, 1.0)


@pytest.mark.parametrize("kind, seen", [("rect", 0.25), ("disk", math.pi / 64), ("sphere", math.pi / 64)])
def test_a_point_becomes_a_lamp_as_bright_before_it(kind, seen):
    """A quarter of the distance across, so many m2 as seen from there; and back."""
    world = scene()
    lamp = world["lamp"]
    actions.as_kind(lamp, kind, 2.0 if kind == "rect" else 1.0).apply()
    assert lamp.light.intensity == pytest.approx([v / seen for v in (4.0, 2.0, 1.0)])
    actions.as_kind(lamp, "point", 2.0).apply()
    assert lamp.light.intensity == pytest.approx((4.0, 2.0, 1.0))


@pytest.mark.parametrize("kind", ["rect", "disk", "sphere"])
def test_lamps_are_added_shown_and_changed_field_by_field(kind):
    world = scene()
    edit, node = actions.add_light(world, kind, np.eye(4), 2.0)
    edit.apply()
    shown = {f["name"]: f for f in fields.light_fields(node.light)}
    sizes = {"rect": ("width", "height")}.get(kind, ("radius",))
    assert shown["kind"]["value"] == kind and shown["strength"]["unit"] == "cd/m²" and "range" not in shown
    for name in sizes:
        assert (shown[name]["value"], shown[name]["unit"]) == (0.5 if kind == "rect" else 0.25, "m")
        fields.light_edit(node, name, 0.75, 1.0, None).apply()
        assert getattr(node.light, name) == 0.75
        with pytest.raises(SceneError, match=name):
            fields.light_edit(node, name, 0.0, 1.0, None)
    assert ("two_sided" in shown) == (kind != "sphere")
    if "two_sided" in shown:
        fields.light_edit(node, "two_sided", True, 1.0, None).apply()
        assert node.light.two_sided
    with pytest.raises(SceneError, match=f"a {kind} light has no field 'range'"):
        fields.light_edit(node, "range", 3.0, 1.0, None)
    assert "scale" in [f["name"] for f in fields.node_fields(node, False)]
    before = fingerprint(world)
    node.light.intensity = (9.0, 9.0, 9.0)
    assert fingerprint(world) != before


def test_color_and_intensity_of_a_light_are_its_parts():
    world = scene()
    lamp = world["lamp"]
    shown = {f["name"]: f["value"] for f in fields.light_fields(lamp.light)}
    assert (shown["color"], shown["strength"], shown["range"]) == ([1.0, 0.5, 0.25], 4.0, None)
    fields.light_edit(lamp, "strength", 8.0, 1.0, None).apply()
    assert lamp.light.intensity == (8.0, 4.0, 2.0)
    fields.light_edit(lamp, "color", [0.5, 1.0, 0.0], 1.0, None).apply()
    assert lamp.light.intensity == (4.0, 8.0, 0.0)


def test_a_copy_has_lights_and_materials_of_its_own():
    world = scene()
    edit, twin = actions.duplicate(world, world["top"], np.array([1.0, 0.0, 0.0]))
    edit.apply()
    assert twin.name == "top 2"
    twin.parts[0].material.roughness = 0.125
    twin["spot"].light.intensity = (9.0, 9.0, 9.0)
    assert world["top"].parts[0].material.roughness == 1.0
    assert world["top"]["spot"].light.intensity == (5.0, 5.0, 5.0)
    np.testing.assert_allclose(world.world_matrix(twin)[:3, 3], (2, 2, 3), atol=1e-12)


def test_a_copy_below_a_turned_parent_stands_beside_it_in_the_world():
    world = scene()
    edit, twin = actions.duplicate(world, world["ball"], np.array([1.0, -2.0, 0.5]))
    edit.apply()
    step = world.world_matrix(twin)[:3, 3] - world.world_matrix("ball")[:3, 3]
    np.testing.assert_allclose(step, (1.0, -2.0, 0.5), atol=1e-12)


def test_every_field_of_a_material_takes_the_value_that_it_shows():
    material = ispm.Material(
        (0.2, 0.4, 0.6, 0.5), metallic=0.3, emission=(1.0, 2.0, 3.0), alpha_mode=ispm.AlphaMode.BLEND
    )
    before = repr(material)
    for field in fields.material_fields(material):
        value = "" if field["value"] is None else field["value"]
        fields.material_edit(material, field["name"], value, None).apply()
    assert repr(material) == before


@pytest.mark.parametrize(
    ("field", "value", "line"),
    [
        ("roughness", 2.0, "roughness must be a number of 0 to 1"),
        ("roughness", "rough", "roughness: must be a number"),
        ("base_color", [1.0, 2.0, 0.0], "base_color: must be three numbers of 0 to 1"),
        ("emission", [1.0], "emission: must be three numbers"),
        ("alpha_mode", "glass", "'glass' is not one of"),
        ("name", "x", "no field 'name'"),
    ],
)
def test_values_that_a_material_cannot_have_are_refused(field, value, line):
    material = ispm.Material()
    with pytest.raises(SceneError, match=line):
        History().make(fields.material_edit(material, field, value, None))
    assert material == ispm.Material()
