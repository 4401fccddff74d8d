"""What ids stand for: every copy, in pictures and in the files that they are saved to."""

import json

import numpy as np
import OpenEXR
import pytest

import ispm
from ispm.errors import OutputError, SceneError
from ispm.io.about import read_about
from ispm.scene.names import Names, Place, Run
from ispm.scene.packed import pack

TABLE = Names(
    (Run(0, 0, "box", 1, 1), Run(2, 0, "trunk", 0, 3), Run(2, 1, "crown", 2, 3)),
    ("bark", "white", "leaf ☘"),
    (Place("floor", -1), Place("garden", -1), Place("tree", 1)),
)


def row_of_cups():
    """A lamp and a camera first, then cups as copies of two parts, and one more of the same name."""
    scene = ispm.Scene(name="cups")
    scene.add(ispm.PointLight((9, 9, 9)), name="lamp", translation=(0, 3, 2))
    scene.add(ispm.Camera(), translation=(0, 1, 4))
    blue = ispm.Material((0.1, 0.2, 0.7), name="blue")
    cups = scene.add(ispm.shapes.box(0.5), name="cup", material=ispm.Material(name="clay"))
    cups.parts.append(ispm.Part(ispm.shapes.sphere(0.2), blue))
    cups.parts[1].mesh.positions[:, 1] += 0.4
    cups.instances = np.tile(np.eye(4), (3, 1, 1))
    cups.instances[:, 0, 3] = -1.0, 0.0, 1.0
    scene.add(ispm.Mesh(np.zeros((3, 3)), np.zeros((0, 3), int)), name="nothing")
    scene.add(ispm.shapes.box((4, 0.1, 2)), name="cup", material=blue, translation=(0, -0.3, 0))
    return scene


def test_ids_count_nodes_then_parts_then_copies():
    scene = row_of_cups()
    names = pack(scene).names
    assert len(names) == len(list(names)) == 7
    assert [(n.name, n.node, n.part, n.copy) for n in names] == [
        *(("cup", 2, 0, k) for k in range(3)), *(("cup", 2, 1, k) for k in range(3)), ("cup", 4, 0, 0)
    ]  # fmt: skip
    assert names.materials == ("clay", "blue")
    assert [names.materials[n.material] for n in names] == ["clay"] * 3 + ["blue"] * 4
    assert names[4] == list(names)[4] and names[:2] == list(names)[:2] and names[4].mesh == "sphere"
    assert names.find("cup").tolist() == list(range(7)) and names.find("c?p").dtype == np.int32
    assert names.of_node(4).tolist() == [6]
    assert names.find("lamp").tolist() == names.find("nothing").tolist() == []
    assert names.find_materials("b*").tolist() == [1]
    assert "cup" in names and names[3] in names and "lamp" not in names and None not in names
    with pytest.raises(TypeError, match=r"ids are numbers; find\('cup'\) gives those of a name"):
        names["cup"]
    for wrong in (-1, 7):  # -1 is where nothing is: never the last
        with pytest.raises(IndexError, match=f"there is no id {wrong}; they are 0 to 6"):
            names[wrong]


def test_every_pixel_shows_what_its_id_says():
    """Cups stand side by side: the pixels of each copy lie where it is placed, and their material is its."""
    scene = row_of_cups()
    frame = ispm.render(scene, size=(96, 64), photons=100)
    assert set(np.unique(frame.instance)) == {-1, *range(7)}
    k, pose = scene.default_camera((96, 64)), np.linalg.inv(frame.camera["pose"])
    for id, what in enumerate(frame.names):
        seen = frame.instance == id
        assert set(np.unique(frame.material[seen])) == {what.material}
        if what.node == 2:
            column = np.nonzero(seen)[1].mean() + 0.5
            place = pose @ scene.nodes[2].instances[what.copy] @ (0, 0.4 * what.part, 0, 1)
            x, _, z = k.intrinsics((96, 64)) @ (place[:3] * (1, -1, -1))
            assert column == pytest.approx(x / z, abs=4.0)  # copies lie 25 pixels apart
    assert (frame.material[frame.instance < 0] == -1).all()


def test_an_object_of_several_nodes_is_found_with_all_below_it():
    scene, chair = ispm.Scene(), ispm.Scene(name="chair")
    seat = chair.add(ispm.shapes.box(), name="seat")
    chair.add(ispm.shapes.cylinder(), name="leg", parent=seat)
    scene.add(ispm.shapes.plane(), name="floor")
    for k in range(2):
        scene.merge(chair, name=f"chair {k}")
    assert scene.parents() == [-1, -1, 1, 2, -1, 4, 5]
    names = pack(scene).names
    assert [node.name for node in names.nodes] == [node.name for node in scene]
    assert names.find("chair 1").tolist() == []  # a node without a mesh of its own
    assert names.find("chair 1", below=True).tolist() == [3, 4]
    assert names.find("seat").tolist() == [1, 3]
    assert (
        names.find("seat", below=True).tolist() == names.find("chair *", below=True).tolist() == [1, 2, 3, 4]
    )
    assert names.find("floor", below=True).tolist() == [0]


def test_ids_hold_while_things_move_and_passes_are_summed():
    scene = row_of_cups()
    with ispm.Renderer(scene, ispm.Settings(size=(32, 24), photons=4000)) as renderer:
        first = renderer.render()
        scene.nodes[2].translation = (0.1, 0, 0)
        assert renderer.render().names == first.names
        assert [frame.names for frame in renderer.converge(passes=2)] == [first.names] * 2


@pytest.mark.parametrize("ending", ["exr", "npz"])
def test_files_bring_their_names(tmp_path, ending):
    frame = ispm.render(row_of_cups(), size=(16, 12), photons=100)
    path = frame.save(tmp_path / f"a.{ending}", layers=["full", "instance"])
    assert ispm.read_names(path) == ispm.read_names(str(path)) == frame.names
    assert "names" not in read_about(path).made
    assert not any("names" in channel for channel in read_about(path).channels)
    text = (
        str(np.load(path)["names"]) if ending == "npz"
        else OpenEXR.File(str(path), header_only=True).header()["ispm:names"]
    )  # fmt: skip
    table = json.loads(text)
    assert table["instances"][1] == dict(
        id=3, name="cup", node=2, part=1, mesh="sphere", material=1, copies=3
    )
    assert table["materials"] == ["clay", "blue"]
    assert table["nodes"][2] == {"name": "cup", "parent": -1}


def test_a_million_copies_are_a_line():
    table = Names((Run(0, 0, "blade", 0, 1_000_000),), ("green",), (Place("grass", -1),))
    assert len(table) == 1_000_000 and len(table.to_json()) < 250
    assert table[999_999].copy == 999_999
    assert Names.from_json(table.to_json()) == table


def test_a_table_comes_back():
    assert Names.from_json(TABLE.to_json()) == TABLE
    assert Names.from_json(Names().to_json()) == Names()
    assert repr(TABLE) == "<Names of 7 ids and 3 materials>"
    assert len(Names()) == 0 and Names().find("*").tolist() == []


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{}", '{"instances": [3], "materials": []}', '{"instances": 3, "materials": []}', "[" * 5000,
     TABLE.to_json().replace('"id": 1', '"id": 2'), TABLE.to_json().replace('"copies": 3', '"copies": -3'),
     TABLE.to_json().replace('"copies": 3', '"copies": 1e400'),
     TABLE.to_json().replace('"part": 0', '"part": null'), TABLE.to_json().replace('"node": 2', '"node": 3'),
     TABLE.to_json().replace('"material": 2', '"material": 3'), TABLE.to_json().replace("floor", "roof", 1),
     TABLE.to_json().replace('"parent": 1', '"parent": 2')],
)  # fmt: skip
def test_what_is_no_table_is_refused(text):
    with pytest.raises(SceneError, match="no table of names"):
        Names.from_json(text)


def test_files_without_names_say_so(tmp_path):
    np.savez(tmp_path / "a.npz", full=np.zeros((2, 2)))
    (tmp_path / "b.exr").write_bytes(b"no")
    for name, says in (("a.npz", "holds no names"), ("b.exr", "holds no names"), ("c.npz", "no such file"),
                       ("d.png", "names are kept in .exr and .npz")):  # fmt: skip
        with pytest.raises(OutputError, match=says):
            ispm.read_names(tmp_path / name)
