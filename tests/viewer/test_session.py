"""The state of a live view, without network, thread or device."""

import numpy as np
import pytest

import ispm
from ispm.errors import IspmError, SceneError
from ispm.io.load import load
from ispm.io.save import save
from ispm.scene.animation import Animation, Channel
from ispm.viewer import messages as m
from ispm.viewer.describe import describe, header
from ispm.viewer.pace import Pace


def settle(session):
    """Draw until nothing more comes; return the pictures."""
    pictures = []
    while session.wants_picture:
        pictures.append(session.next_picture())
        assert len(pictures) < 50
    return pictures


def number(session, name):
    return session.numbering.of(session.scene[name])


def test_pictures_come_until_one_is_still_and_then_none(session):
    pictures = settle(session)
    assert [p.still for p in pictures] == [False] * (len(pictures) - 1) + [True]
    assert [p.number for p in pictures] == list(range(1, len(pictures) + 1))
    assert pictures[-1].image.shape == (32, 64, 3)
    session.handle(m.Look(0.1, 0.0))
    assert session.wants_picture
    assert settle(session)[-1].number > pictures[-1].number


def test_slow_moving_pictures_become_smaller_and_full_where_all_is_still(session, painting):
    painting.seconds = 0.08
    for _ in range(12):
        session.handle(m.Look(0.1, 0.0))
        session.next_picture()
    moving = session.picture.frame.settings.size
    assert moving[0] < 64 and moving[1] < 32
    painting.seconds = 0.0
    assert settle(session)[-1].frame.settings.size == (64, 32)


def test_what_stands_still_is_drawn_as_large_as_is_quick_at_first_and_then_in_full(session, painting):
    class Slow(Pace):
        def spent(self, seconds):
            super().spent(0.1)

    session._pace = Slow(15.0)
    session.settings = session.settings.replace(size=(400, 300))
    size = lambda: session.picture.frame.settings.size  # noqa: E731
    for _ in range(6):
        session.handle(m.Look(0.1, 0.0))
        session.next_picture()
    assert size() == (100, 75)
    for _ in range(2):
        session.next_picture(rested=False)
        assert size() == (140, 105)  # twice its pixels fit into 0.2 s
    assert [p.frame.settings.size for p in settle(session)] == [(400, 300)] * 4
    session.handle(m.Look(0.1, 0.0))
    while session.wants_picture:
        session.next_picture(rested=False)
    assert size() == (400, 300)  # in the end


@pytest.mark.parametrize("message", [m.Pick(0.36, 0.5), m.Select(None), m.Show("depth")])
def test_what_changes_marks_alone_shows_the_same_frame_again(session, painting, message):
    before, drawn = settle(session)[-1], len(painting.drawn)
    session.handle(message)
    assert session.moves
    after = session.next_picture()
    assert (after.frame, after.still) == (before.frame, True) and after.number == before.number + 1
    assert len(painting.drawn) == drawn and not session.wants_picture


def test_the_camera_is_dragged_and_comes_home(session, painting):
    session.handle(m.Look(0.5, 0.25))
    session.handle(m.Pan(0.1, 0.1))
    session.handle(m.Zoom(1.0))
    session.next_picture()
    assert np.abs(painting.drawn[-1][2].pose - CAMERA_POSE).max() > 0.1
    session.handle(m.UseCamera())
    session.next_picture()
    np.testing.assert_array_equal(painting.drawn[-1][2].pose, CAMERA_POSE)


CAMERA_POSE = ispm.Camera.look_at((0, 0, 5), (0, 0, 0)).pose


@pytest.mark.parametrize(
    ("x", "name"), [(0.36, "left"), (0.64, "right"), (0.5, None), (0.0, None), (1.0, None)]
)
def test_a_click_selects_what_is_there(session, x, name):
    settle(session)
    found = []
    session.on_pick = found.append
    session.handle(m.Pick(x, 0.5))
    assert (session.selected.name if session.selected else None) == name
    assert [f.name for f in found] == ([name] if name else [])
    for each in found:  # the boxes' fronts are at z = 0.5, 4.5 m off
        assert each.distance == pytest.approx(4.5)
        assert each.position[2] == pytest.approx(0.5, abs=1e-6)
        assert abs(each.position[0] - {"left": -1.0, "right": 1.0}[name]) < 0.5


def test_a_click_selects_as_well_where_something_is_hidden_or_time_goes_by(session):
    node = session.scene["left"]
    session.scene.animations.append(
        Animation([Channel(node, "translation", np.array([0.0, 1.0]), np.array([[-1, 0, 0], [-1, 5, 0]]))])
    )
    session.open(session.scene, "")
    session.handle(m.Change("node", number(session, "left"), "hidden", True))
    settle(session)
    session.handle(m.Pick(0.64, 0.5))
    assert session.selected.name == "right"
    session.handle(m.Pick(0.36, 0.5))
    assert session.selected is None
    session.handle(m.Undo())
    session.handle(m.Play(time=1.0))
    settle(session)
    session.handle(m.Pick(0.36, 0.5))
    assert session.selected is None  # it went up, and away
    session.handle(m.Play(time=0.0))
    settle(session)
    session.handle(m.Pick(0.36, 0.5))
    assert session.selected is session.scene["left"]


def test_hidden_things_are_not_drawn_but_saved(session, painting, tmp_path):
    session.handle(m.Change("node", number(session, "left"), "hidden", True))
    session.handle(m.Change("node", number(session, "lamp"), "hidden", True))
    session.next_picture()
    drawn = painting.drawn[-1][0]
    assert not drawn["left"].parts and drawn["right"].parts and not drawn.lights
    assert session.scene["left"].parts and session.scene.lights
    save(session.scene, tmp_path / "a.glb")
    assert load(tmp_path / "a.glb")["left"].parts


def test_edits_reach_the_scene_the_panels_and_the_file(session, tmp_path):
    lamp, left = number(session, "lamp"), number(session, "left")
    session.handle(m.Select(lamp))
    session.handle(m.Change("light", lamp, "strength", 50.0))
    session.handle(m.Change("light", lamp, "color", [1.0, 0.5, 0.0]))
    session.handle(m.Change("node", lamp, "place", [1.0, 2.0, 3.0]))
    session.handle(m.Change("material", left, "roughness", 0.25))
    session.handle(m.Add("spot"))
    session.handle(m.Duplicate(left))
    session.handle(m.Delete(number(session, "right")))
    save(session.scene, tmp_path / "a.glb")
    scene = load(tmp_path / "a.glb")
    assert scene["lamp"].light.intensity == (50.0, 25.0, 0.0)
    np.testing.assert_array_equal(scene["lamp"].translation, (1, 2, 3))
    assert scene["left"].parts[0].material.roughness == 0.25
    assert "right" not in scene and "left 2" in scene and "spot light 1" in scene
    for _ in range(7):
        session.handle(m.Undo())
    assert [node.name for node in session.scene.nodes] == ["left", "right", "lamp"]
    assert session.scene["lamp"].light.intensity == (9.0, 9.0, 9.0)
    assert describe(session)["history"] == {
        "undo": "",
        "redo": "strength of lamp".replace("strength", "intensity"),
    }


@pytest.mark.parametrize(
    "message",
    [
        m.Select(99),
        m.Delete(0),
        m.Change("node", 1, "parts", 1.0),
        m.Change("node", 1, "__class__", "x"),
        m.Change("light", 1, "strength", 1.0),
        m.Change("material", 1, "roughness", 0.5, 7),
        m.Change("node", 1, "translation", [1e19, 0.0, 0.0]),
        m.Change("node", 1, "scale", [0.0, 1.0, 1.0]),
        m.Change("node", 1, "name", "a\nb"),
        m.Setting("size", [9999.0, 9999.0]),
        m.Setting("passes", 100.0),
        m.Setting("photons", 2e6),
        m.Setting("photons", -1.0),
        m.Setting("fotons", 1.0),
        m.Setting("gather", 5.0),
        m.Show("backdoor"),
        m.Play(playing=True),
        m.UseCamera(3),
    ],
)
def test_what_cannot_be_done_changes_nothing(session, message):
    describe(session)  # numbers the nodes
    before = (
        session.settings,
        session.view,
        session.version,
        len(session.history.undos),
        session.scene.nodes,
    )
    with pytest.raises(IspmError):
        session.handle(message)
    after = (session.settings, session.view, session.version, len(session.history.undos), session.scene.nodes)
    assert before == after


def test_sizes_are_brought_within_limits(session):
    session.handle(m.Resize(40_000, -5))
    assert session.settings.size == (2048, 16)


def test_settings_change_and_come_back(session):
    session.handle(m.Setting("photons", 1000.0))
    session.handle(m.Setting("exposure", 1.5))
    assert (session.settings.photons, session.settings.exposure) == (1000, 1.5)
    session.handle(m.Setting("preset", "talk"))
    assert session.settings.photons == 20_356 and session.settings.exposure == 1.5
    session.handle(m.Undo())
    session.handle(m.Setting("photons", None))
    assert session.settings.photons == 40_000
    session.handle(m.Setting("gather", "auto"))
    assert session.settings.gather == "auto"


def test_the_time_line_plays_and_begins_again(session, painting):
    node = session.scene["left"]
    session.scene.animations.append(
        Animation(
            [Channel(node, "translation", np.array([0.0, 2.0]), np.array([[0, 0, 0], [4, 0, 0]]))], "slide"
        )
    )
    session.open(session.scene, "")
    assert describe(session)["time"]["animations"] == [["slide", 2.0]]
    session.handle(m.Play(playing=True, time=1.0))
    session.pass_time(0.5)
    session.next_picture()
    np.testing.assert_allclose(painting.drawn[-1][0]["left"].translation, (3, 0, 0))
    session.pass_time(0.75)
    assert session.timeline.time == pytest.approx(0.25)
    session.next_picture()
    assert painting.drawn[-1][0] is painting.drawn[-2][0]  # a live renderer knows its nodes again
    session.handle(m.Play(playing=False))
    settle(session)
    session.pass_time(1.0)
    assert not session.wants_picture
    with pytest.raises(SceneError, match="no animation is called"):
        session.handle(m.Play(animation="jump"))


def test_a_picture_that_fails_is_not_tried_again_until_something_changes(session, painting):
    painting.fault = SceneError("no")
    with pytest.raises(SceneError):
        session.next_picture()
    session.fail()
    assert not session.wants_picture
    painting.fault = None
    session.handle(m.Look(0.1, 0.1))
    assert settle(session)[-1].still


def test_a_view_that_cannot_be_made_gives_way_and_says_so(session):
    session.handle(m.Show("bounce-map"))
    session.next_picture()
    assert session.view == "full"
    assert "there is none" in session.line


def test_the_description_is_json_and_has_a_control_for_each_setting(session):
    import msgspec

    session.handle(m.Select(number(session, "left")))
    text = msgspec.json.encode(describe(session))
    shown = msgspec.json.decode(text)
    assert [row[1] for row in shown["scene"]["rows"]] == ["left", "right", "lamp"]
    assert {"node", "material"} == {group["what"] for group in shown["selection"]["groups"]}
    names = {f["name"] for f in shown["settings"]["fields"]}
    assert {"photons", "exposure", "gather", "seed"} <= names
    assert not {"size", "passes", "time_limit", "target_error"} & names
    settle(session)
    about = msgspec.json.decode(msgspec.json.encode(header(session, session.picture, 5.0)))
    np.testing.assert_allclose(about["handle"]["place"], (-1, 0, 0), atol=1e-6)
    assert about["lights"] == [[number(session, "lamp"), 0.0, 3.0, 0.0, "point"]]


def test_photons_that_light_a_place_are_told_until_the_scene_changes(session):
    import msgspec

    with pytest.raises(SceneError, match="about to change"):
        session.handle(m.Inspect(0.36, 0.5))  # nothing was drawn
    settle(session)
    session.handle(m.Inspect(0.36, 0.5))
    assert not session.wants_picture
    told = msgspec.json.decode(msgspec.json.encode(describe(session)["inspected"]))
    assert told == {
        "point": [0.36, 0.5, 0.0],
        "light": 0.75,
        "photons": 2,
        "paths": [
            {
                "bounce": 1,
                "light": 0.5,
                "flux": [2.0, 2.0, 1.0],
                "places": [[0.0, 3.0, 0.0], [1.0, 0.0, 0.0], [0.36, 0.5, 0.0]],
                "events": ["light", "diffuse", "stored"],
            }
        ],
    }
    session.handle(m.Look(0.1, 0.0))  # which leaves the light where it is
    settle(session)
    assert session.inspected
    nothing = {"point": None, "paths": []}
    for message in (
        m.Change("node", number(session, "lamp"), "place", [0.0, 2.0, 0.0]),
        m.Undo(),
        m.Inspect(),
        m.Inspect(0.01, 0.01),  # where nothing is
    ):
        session.inspected = session.inspected or session.draw.light_paths(session.picture.frame, 0.36, 0.5)
        session.handle(message)
        assert describe(session)["inspected"] == nothing
        settle(session)


def test_photons_are_forgotten_as_time_goes_by(session):
    node = session.scene["left"]
    slide = Channel(node, "translation", np.array([0.0, 2.0]), np.array([[-1, 0, 0], [4, 0, 0]]))
    session.scene.animations.append(Animation([slide], "slide"))
    session.open(session.scene, "")
    for message in (m.Play(playing=True), m.Play(time=1.0)):
        settle(session)
        session.timeline = session.timeline.at(0.0)
        session.inspected = session.draw.light_paths(session.picture.frame, 0.36, 0.5)
        session.handle(message)
        session.pass_time(0.1)
        assert session.inspected is None
        session.handle(m.Play(playing=False))


def test_the_command_makes_the_picture_again(session):
    import shlex

    from ispm.cli.commands import app

    session.source = "a room.glb"
    session.handle(m.Setting("exposure", -1.5))
    session.handle(m.Look(0.3, 0.2))
    words = shlex.split(describe(session)["about"]["command"])
    assert words[:3] == ["ispm", "render", "a room.glb"]
    _, bound, _ = app.parse_args(words[1:], exit_on_error=False, print_error=False)
    assert bound.kwargs["exposure"] == "-1.5" and bound.kwargs["preset"] == "fast"
    eye = [float(v) for v in bound.kwargs["look_from"].split(",")]
    np.testing.assert_allclose(eye, session.orbit.eye, rtol=1e-3)


def test_a_scene_of_thousands_is_described_in_part(painting):
    from ispm.settings import Settings
    from ispm.viewer.session import Session

    scene, box = boxes_of(4000), ispm.Camera.look_at((0, 0, 5), (0, 0, 0))
    shown = describe(Session(scene, painting, Settings(), box))["scene"]
    assert len(shown["rows"]) == 3000 and shown["more"] == 1000


def boxes_of(count):
    mesh, scene = ispm.shapes.box(), ispm.Scene()
    scene.roots = [ispm.Node(f"box {k}", parts=[ispm.Part(mesh, ispm.Material())]) for k in range(count)]
    return scene


def test_the_command_names_the_environment(session, tmp_path):
    path = tmp_path / "sky.hdr"
    path.write_bytes(b"#?RADIANCE\n\n-Y 1 +X 2\n" + bytes((128, 128, 128, 128)) * 2)
    assert "--environment" not in describe(session)["about"]["command"]
    session.scene.environment = ispm.Environment(path)
    assert f"--environment {path} --preset" in describe(session)["about"]["command"]
    session.scene.environment.rotation, session.scene.environment.intensity = np.pi / 2, 0.0
    words = describe(session)["about"]["command"]
    assert "--environment-rotation 90 --environment-intensity 0 " in words
