"""The built-in scenes: what they promise about their geometry, lights and animation."""

import math
from collections.abc import Iterator

import numpy as np
import pytest

from ispm.errors import SceneError, SettingsError
from ispm.library.builtin import BUILTINS, builtin
from ispm.library.common import quaternion
from ispm.library.shapes import ball, face_normals, icosphere, merge, moved, tube
from ispm.scene.camera import look_at_pose
from ispm.scene.mesh import Mesh
from ispm.scene.packed import pack
from ispm.scene.rotation import rotation_matrix
from ispm.scene.scene import Scene


def meshes(scene: Scene) -> Iterator[Mesh]:
    """Each mesh of a scene once."""
    seen = {id(part.mesh): part.mesh for node in scene.nodes for part in node.parts}
    yield from seen.values()


def open_edges(mesh: Mesh) -> int:
    """Directed edges without exactly one partner the other way round, after welding equal positions."""
    _, weld = np.unique(np.round(mesh.positions, 5), axis=0, return_inverse=True)
    t = weld.reshape(-1)[mesh.triangles]
    edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    forth, there = np.unique(edges[:, 0] * len(weld) + edges[:, 1], return_counts=True)
    back, here = np.unique(edges[:, 1] * len(weld) + edges[:, 0], return_counts=True)
    return int((there != 1).sum() + (here != 1).sum() + len(np.setxor1d(forth, back)))


def volume(mesh: Mesh) -> float:
    """Enclosed volume; negative where the fronts face inwards."""
    corner = mesh.positions.astype(np.float64)[mesh.triangles[:, 0]]
    return float(np.einsum("ij,ij->", corner, face_normals(mesh)) / 6.0)


@pytest.mark.parametrize("name", BUILTINS)
def test_builtin_has_sound_meshes(name: str) -> None:
    for mesh in meshes(builtin(name)):
        assert np.isfinite(mesh.positions).all()
        n = face_normals(mesh)
        assert (np.linalg.norm(n, axis=1) > 1e-6).all(), mesh.name  # no slivers: 1 mm x 1 mm and up
        if mesh.normals is not None:
            assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-5)
            # a corner's normal stands on the front side of its triangle
            cosine = np.einsum("tcj,tj->tc", mesh.normals[mesh.triangles].astype(float), n)
            assert (cosine > 0.0).all(), mesh.name


@pytest.mark.parametrize("name", BUILTINS)
def test_builtin_has_a_named_camera_and_light_and_a_description(name: str) -> None:
    scene = builtin(name)
    assert scene.name == name
    for node in (*scene.cameras, *scene.lights):
        assert scene[node.name] is node and node.matrix is None  # moved by setting its translation
    assert scene.cameras and scene.lights
    assert (BUILTINS[name].__doc__ or "").splitlines()[0].strip()


@pytest.mark.parametrize("name", BUILTINS)
def test_builtin_is_the_same_each_time_and_shares_nothing(name: str) -> None:
    first, second = builtin(name), builtin(name)
    assert pack(first).geometry.vertices.tobytes() == pack(second).geometry.vertices.tobytes()
    assert not {id(m) for m in first.materials} & {id(m) for m in second.materials}


def test_builtin_names_the_nearest() -> None:
    with pytest.raises(SceneError, match="did you mean 'cornell-box'"):
        builtin("cornel-box")
    with pytest.raises(SettingsError, match="did you mean 'radius'"):
        builtin("integrating-sphere", radus=2.0)
    with pytest.raises(SettingsError, match=r"albedo cannot be 1\.0"):
        builtin("integrating-sphere", albedo=1.0)


def test_quaternion_gives_the_rotation_back() -> None:
    for eye in np.random.default_rng(0).normal(size=(50, 3)):
        r = look_at_pose(eye, np.zeros(3))[:3, :3]
        assert np.allclose(rotation_matrix(np.array(quaternion(r))), r, atol=1e-12)


def test_icosphere_is_closed_and_counts() -> None:
    for segments in (1, 2, 7):
        ball = icosphere(1.0, segments)
        assert len(ball.triangles) == 20 * segments**2
        assert len(ball.positions) == 10 * segments**2 + 2  # Euler: V = 2 + T / 2
        assert open_edges(ball) == 0 and volume(ball) > 0.0


def test_ball_is_closed_and_counts() -> None:
    mesh = ball(2.0, 12, 9)
    assert len(mesh.triangles) == 2 * 12 * 8
    assert open_edges(mesh) == 0 and volume(mesh) > 0.0
    assert mesh.normals is not None
    assert np.allclose(2.0 * mesh.normals, mesh.positions, atol=1e-6)  # exact, the poles too


def test_tube_is_closed_and_its_normals_leave_the_curve() -> None:
    t = 2.0 * np.pi * np.arange(40) / 40
    curve = np.stack([np.cos(t), np.sin(t), 0.5 * np.sin(3.0 * t)], axis=1)  # twists the carried frame
    mesh = tube(curve, 0.1, 7)
    assert len(mesh.triangles) == 2 * 40 * 7
    assert open_edges(mesh) == 0 and volume(mesh) > 0.0
    assert mesh.normals is not None
    assert np.allclose(mesh.positions - 0.1 * mesh.normals, np.repeat(curve, 7, axis=0), atol=1e-6)
    # the last ring joins the first without a twist: quads across the seam are as wide as the others
    rings = mesh.positions.reshape(40, 7, 3)
    steps = np.linalg.norm(np.roll(rings, -1, axis=0) - rings, axis=2)
    assert steps[-1].max() < 1.3 * steps[:-1].max()


# scene: triangles that stand still, that move, moving objects, lights; rows of the talk's table
ROWS = {
    "caustic-ring": (412, 400, 1, 1),
    "glass-sphere": (4022, 4012, 2, 5),
    "objects-in-box": (9826, 9816, 3, 2),
}


@pytest.mark.parametrize("name", ROWS)
def test_still_lifes_have_the_numbers_of_the_talk(name: str) -> None:
    scene = builtin(name)
    still, moving, objects, lights = ROWS[name]
    start, later = pack(scene.at(0.0)), pack(scene.at(1.3))
    places = [(start.instances[k] != later.instances[k]).any(axis=1) for k in ("world0", "world1", "world2")]
    moved = np.any(places, axis=0)
    assert int(start.instances["triangle_count"][moved].sum()) == moving
    assert int(start.instances["triangle_count"][~moved].sum()) == still
    assert len(np.unique(start.instances["node"][moved])) == objects
    assert len(scene.lights) == lights


@pytest.mark.parametrize("name", ROWS)
def test_still_lifes_begin_as_they_stand_and_end_where_they_began(name: str) -> None:
    scene = builtin(name)
    for moment in (0.0, scene.animations[0].duration):
        for here, there in zip(scene.placed(), scene.at(moment).placed(), strict=True):
            assert np.allclose(here[1], there[1], atol=1e-5), here[0].name


@pytest.mark.parametrize("name", ROWS)
def test_still_lifes_moving_things_are_closed_and_meet_nothing(name: str) -> None:
    """Moving solids stay clear of each other and of what stands still, by the boxes round them."""
    scene = builtin(name)
    channels = [c for c in scene.animations[0].channels if c.node.parts]
    for moment in np.linspace(0.0, 8.0, 17):
        boxes = []
        for node, world in scene.at(float(moment)).placed():
            for part in node.parts:
                points = part.mesh.positions @ world[:3, :3].T + world[:3, 3]
                moving = any(c.node.name == node.name for c in channels)
                boxes.append((moving, node.name, points.min(axis=0), points.max(axis=0)))
        for k, (moving, one, low, high) in enumerate(boxes):
            for _, other, below, above in boxes[:k] + boxes[k + 1 :] if moving else []:
                if {one, other} == {"ring", "plate"} or other == "backdrop":
                    continue  # the ring's foot is in the plate; a backdrop is a bent sheet
                assert (high < below).any() or (above < low).any(), (one, other, moment)
    for channel in channels:
        assert open_edges(channel.node.parts[0].mesh) == 0


def test_caustic_ring_has_the_cusp_in_the_middle_of_the_picture() -> None:
    """The mirror formula for a cylinder (method, V15): 1/s + 1/s' = 2/R from the far wall."""
    scene = builtin("caustic-ring")
    (light,) = (world[:3, 3] for node, world in scene.placed() if node.light)
    radius, flat = 0.1, light * (1.0, 0.0, 1.0)
    away = -flat / np.linalg.norm(flat)
    cusp = (radius - 1.0 / (2.0 / radius - 1.0 / (radius + np.linalg.norm(flat)))) * away
    # light falls from the far wall, 4 cm high, as far as the cusp, and passes over the near one
    assert 0.04 * np.linalg.norm(flat) / light[1] > radius - np.linalg.norm(cusp)
    assert 2.0 * radius * light[1] / np.linalg.norm(flat) > 0.04
    (camera,) = (np.linalg.inv(world) for node, world in scene.placed() if node.camera)
    seen = camera[:3, :3] @ cusp + camera[:3, 3]
    half = math.tan(0.5 * math.radians(27.0))
    assert np.abs(seen[:2] / seen[2]).max() < 0.05 * half


def test_cornell_box_is_closed_but_for_its_front() -> None:
    scene = builtin("cornell-box")
    walls = merge([scene[name].parts[0].mesh for name in ("room", "green wall", "red wall")])
    assert open_edges(walls) > 0
    front = Mesh([[552.8, 0, 0], [556, 548.8, 0], [0, 548.8, 0], [0, 0, 0]], [[0, 1, 2], [0, 2, 3]])
    front.positions /= 100.0
    inwards = Mesh(front.positions, front.triangles[:, ::-1])
    closed = min((merge([walls, lid]) for lid in (front, inwards)), key=open_edges)
    assert open_edges(closed) == 0
    assert volume(closed) == pytest.approx(-5.53 * 5.488 * 5.592, rel=0.01)  # fronts face the air


def test_cornell_box_blocks_face_outwards_and_stand_on_the_floor() -> None:
    scene = builtin("cornell-box")
    for name, height in (("short block", 1.65), ("tall block", 3.30)):
        mesh = scene[name].parts[0].mesh
        assert mesh.positions[:, 1].min() == 0.0
        x, _, z = mesh.positions[:4].T.astype(float)  # the top
        area = 0.5 * abs(np.sum(x * np.roll(z, -1) - z * np.roll(x, -1)))
        # an open underside at y = 0 adds nothing to the volume
        assert volume(mesh) == pytest.approx(area * height, rel=1e-5)
    assert (scene.triangle_count, len(scene.lights)) == (30, 1)


def test_cornell_box_light_hangs_under_the_ceiling() -> None:
    assert tuple(builtin("cornell-box")["light"].translation) == (2.78, 5.0, 2.795)


def test_integrating_sphere_is_closed_and_nearly_round() -> None:
    scene = builtin("integrating-sphere", radius=3.0)
    mesh = scene["sphere"].parts[0].mesh
    assert open_edges(mesh) == 0
    area = 0.5 * np.linalg.norm(face_normals(mesh), axis=1).sum()
    assert area == pytest.approx(4.0 * math.pi * 3.0**2, rel=1e-3)
    assert volume(mesh) == pytest.approx(-4.0 / 3.0 * math.pi * 3.0**3, rel=1e-3)  # seen from inside


def test_integrating_sphere_light_has_the_flux_asked_for() -> None:
    scene = builtin("integrating-sphere", flux=50.0)
    light = scene["light"].light
    assert light is not None
    assert [4.0 * math.pi * i for i in light.intensity] == pytest.approx([50.0] * 3)
    assert np.linalg.norm(scene["camera"].translation) < 2.0


def test_atrium_has_its_count_of_triangles() -> None:
    scene = builtin("atrium")
    assert scene.triangle_count == 67_414
    moving = {id(c.node) for a in scene.animations for c in a.channels}
    assert sum(len(p.mesh.triangles) for n in scene.nodes if id(n) in moving for p in n.parts) == 480
    assert len(scene.nodes) < 400


def test_atrium_ends_where_it_began() -> None:
    scene = builtin("atrium")
    start, quarter, end = (scene.at(t) for t in (0.0, 3.0, scene.animations[0].duration))
    for name in ("lantern", "sun"):
        a, b, c = (np.asarray(s[name].local_matrix()) for s in (start, quarter, end))
        assert np.allclose(a, c, atol=1e-3) and np.linalg.norm(a[:3, 3] - b[:3, 3]) > 1.0
    assert np.array_equal(np.asarray(start["lantern"].translation), scene["lantern"].translation)


def test_atrium_at_a_time_is_the_animation_at_that_time() -> None:
    frozen, played = builtin("atrium", time=2.5), builtin("atrium").at(2.5)
    assert np.array_equal(frozen["sun"].translation, played["sun"].translation)


def test_atrium_solids_are_closed() -> None:
    sheets = {"floor", "curtain", "banner", "tapestry"}
    buried = {"column", "upper column", "balustrade"}  # turned ends lie within plinths and rails
    for node in builtin("atrium").nodes:
        parts = [part.mesh for part in node.parts if part.mesh.name not in sheets | buried]
        if parts:
            whole = merge(parts)
            assert open_edges(whole) == 0, node.name
            assert volume(whole) > 0.0, node.name


def test_atrium_shows_no_back_of_a_surface_and_lets_no_light_through() -> None:
    embreex = pytest.importorskip("embreex.mesh_construction", reason="embreex has no build for this machine")
    from embreex.rtcore_scene import EmbreeScene

    scene = builtin("atrium")
    corners, cloth = [], []
    for node, world in scene.placed():
        for part in node.parts:
            placed = part.mesh.positions @ world[:3, :3].T + world[:3, 3]
            corners.append(placed[part.mesh.triangles])
            cloth.append(np.full(len(part.mesh.triangles), part.material.double_sided))
    triangles = np.concatenate(corners).astype(np.float32)
    double_sided = np.concatenate(cloth)
    embree = EmbreeScene()
    embreex.TriangleMesh(embree, triangles)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])

    random = np.random.default_rng(5)
    court = [(x, y, 0.5) for x in (-9.6, -4.0, 4.8, 9.0) for y in (2.5, 7.5, 10.5)]
    galleries = [(x, y, z) for x in (-13.4, 0.3, 13.0) for y in (2.0, 5.5, 9.0, 11.2) for z in (-7.2, 6.3)]
    for eye in court + galleries:
        d = random.normal(size=(4000, 3)).astype(np.float32)
        o = np.tile(np.float32(eye), (len(d), 1))
        hit = embree.run(o, d, query="INTERSECT")
        out = hit < 0
        assert (d[out, 1] > 0.0).all(), eye  # the sky is the only way out
        facing = np.einsum("ij,ij->i", normals[hit], d) < 0.0
        assert (facing | double_sided[hit])[~out].all(), eye


def test_moved_keeps_normals() -> None:
    ball = icosphere(1.0, 2)
    assert np.array_equal(moved(ball, y=2.0).normals, ball.normals)
