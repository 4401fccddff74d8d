"""The halls of the talk's table: their numbers, closed paths, and the shapes they are made of."""

from functools import cache

import numpy as np
import pytest

from ispm.library.builtin import BUILTINS
from ispm.library.elephant import elephant
from ispm.library.forms import (
    averaged,
    beveled_box,
    loft,
    pipe,
    placed,
    pose,
    prism,
    refined,
    unwrapped,
)
from ispm.library.ironworks import COLUMNS
from ispm.library.ironworks_water import LEVEL, PERIOD, water_positions, water_surface
from ispm.library.shapes import box, face_normals, sheet
from ispm.library.steelwork import i_section
from ispm.renderer.motion import moved
from ispm.scene.mesh import Mesh
from ispm.scene.packed import pack

# scene: triangles that stand still, that move, moving objects, lights; rows of the talk's table
ROWS = {
    "ironworks-car": (141_492, 20_120, 20, 2),
    "cargo-bay": (58_319, 14_762, 1, 4),
    "cargo-level": (257_153, 147_620, 10, 4),
    "cargo-map": (880_403, 310_002, 21, 30),
    "glass-figure": (138_912, 138_902, 1, 1),
}
MOVING = [*ROWS, "million"]


@cache
def builtin(name):
    """A built-in scene, made once for all tests, which do not change it."""
    return BUILTINS[name]()


def open_edges(mesh: Mesh) -> int:
    """Directed edges without exactly one partner the other way round, after welding equal positions."""
    _, weld = np.unique(np.round(mesh.positions, 6), axis=0, return_inverse=True)
    t = weld.reshape(-1)[mesh.triangles].astype(np.int64)
    edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    forth = np.sort(edges[:, 0] * len(weld) + edges[:, 1])
    back = np.sort(edges[:, 1] * len(weld) + edges[:, 0])
    return int((forth != back).sum() + (np.diff(forth) == 0).sum())


def volume(mesh: Mesh) -> float:
    """Enclosed volume; negative where the fronts face inwards."""
    corner = mesh.positions.astype(np.float64)[mesh.triangles[:, 0]]
    return float(np.einsum("ij,ij->", corner, face_normals(mesh)) / 6.0)


@pytest.mark.parametrize("name", ROWS)
def test_halls_have_the_numbers_of_the_talk(name):
    scene = builtin(name)
    still, moving, objects, lights = ROWS[name]
    start, later = pack(scene.at(0.0)), pack(scene.at(1.3))
    places = [(start.instances[k] != later.instances[k]).any(axis=1) for k in ("world0", "world1", "world2")]
    moved = np.any(places, axis=0)
    assert int(start.instances["triangle_count"][moved].sum()) == moving
    assert int(start.instances["triangle_count"][~moved].sum()) == still
    assert len(np.unique(start.instances["node"][moved])) == objects
    assert len(scene.lights) == lights


@pytest.mark.parametrize("name", MOVING)
def test_halls_begin_as_they_stand_and_end_where_they_began(name):
    scene = builtin(name)
    (animation,) = scene.animations
    for moment in (0.0, animation.duration):
        for here, there in zip(scene.placed(), scene.at(moment).placed(), strict=True):
            assert np.allclose(here[1], there[1], atol=1e-5), here[0].name


@pytest.mark.parametrize("name", [*MOVING, "ironworks-water"])
def test_halls_name_each_node_once_and_keep_meshes_shared(name):
    scene = builtin(name)
    names = [node.name for node in scene.nodes]
    assert len(set(names)) == len(names)
    assert len(scene.cameras) >= 3
    # 44 bytes a vertex: under the least limit of a storage buffer, 128 MiB
    assert len(pack(scene).geometry.vertices) < 128 * 2**20 / 44


def test_million_has_a_million_triangles_and_thirty_moving_lights():
    scene = builtin("million")
    assert 1_000_000 < scene.triangle_count < 1_010_000
    lights = [[world[:3, 3] for node, world in scene.at(t).placed() if node.light] for t in (0.0, 2.0)]
    assert len(lights[0]) == 30
    assert (np.linalg.norm(np.subtract(*lights), axis=1) > 0.05).all()


@pytest.mark.parametrize("name", ["ironworks-car", "cargo-bay"])
def test_moving_things_meet_nothing_that_stands_still(name):
    """No light and no vertex of the rest lies within the box round what moves, in its own axes."""
    scene = builtin(name)
    ways = {id(c.node): c.node for c in scene.animations[0].channels if c.path == "translation"}
    movers = {n.name for way in ways.values() for n in (way, *way.nodes)}
    points = []
    for node, world in scene.placed():
        for part in node.parts if node.name not in movers else []:
            for matrix in node.places(world):
                points.append(part.mesh.positions @ matrix[:3, :3].T + matrix[:3, 3])
        if node.light and node.name not in movers:
            points.append(world[None, :3, 3])
    still = np.concatenate(points)
    still = still[still[:, 1] > 0.02]  # lines on the floor are driven over
    for moment in np.linspace(0.0, scene.animations[0].duration, 16, endpoint=False):
        placed_then = [(node, world) for node, world in scene.at(float(moment)).placed()]
        roots = {way.name for way in ways.values()}
        for root, place in [(n, w) for n, w in placed_then if n.name in roots]:
            back = np.linalg.inv(place)
            inside = {n.name for n in (root, *root.nodes)}
            corners = [
                p.mesh.positions @ (back @ world)[:3, :3].T + (back @ world)[:3, 3]
                for n, world in placed_then
                if n.name in inside
                for p in n.parts
            ]
            low, high = (
                np.min([c.min(axis=0) for c in corners], axis=0),
                np.max([c.max(axis=0) for c in corners], axis=0),
            )
            own = still @ back[:3, :3].T + back[:3, 3]
            assert not ((own > low) & (own < high)).all(axis=1).any(), (root.name, moment)


def water_then(time):
    """The water of the flooded hall at a time in s, as it is packed."""
    ranges = pack(builtin("ironworks-water").at(time)).geometry.ranges
    (mesh,) = (each.mesh for each in ranges if each.mesh.name == "water")
    return mesh


def test_water_is_where_its_waves_are_and_comes_back():
    x, _, z = builtin("ironworks-water")["water"].parts[0].mesh.positions.T
    column, line = np.rint((x / 24.0 + 1.0) * 0.5 * 218), np.rint((z / 9.3 + 1.0) * 0.5 * 127)
    row = (line * 219 + column).astype(int)
    # a straight line between keys of a sine of amplitude A is at most A (w dt)^2 / 8 off, A w^2 = .03 g
    bound = 12 * 0.03 * 9.81 / 8.0 * (PERIOD / 240) ** 2
    for time in (0.0, 0.4, 1.3 + PERIOD / 480, 5.77, PERIOD):
        mesh, waves = water_then(time), water_positions(time)[row]
        assert np.abs(mesh.positions - waves).max() < bound + 1e-5
        normals = mesh.normals / np.linalg.norm(mesh.normals, axis=1, keepdims=True)
        expected = averaged(Mesh(waves, mesh.triangles)).normals
        assert np.abs(normals - expected).max() < 2e-3  # 12 slopes of .03 (w dt)^2 / 8, w < 8.7 / s: 1.3e-3
        assert (face_normals(mesh)[:, 1] > 0.0).all()
    assert np.allclose(water_positions(0.4), water_positions(0.4 + PERIOD), atol=1e-5)
    assert np.allclose(water_then(0.0).positions, water_then(PERIOD).positions, atol=1e-5)
    assert np.abs(water_then(0.0).positions - water_then(1.0).positions).max() > 0.05
    heights = water_positions(0.7)[:, 1]
    assert abs(heights.mean() - LEVEL) < 0.02 and heights.min() > 0.8


def test_water_moves_alone_and_has_the_numbers_of_the_talk():
    scene = builtin("ironworks-water")
    first = pack(scene.at(0.0))
    then = pack(scene.at(0.1), first)
    dynamic = then.instances[moved(then.placed, first.placed)]
    assert dynamic["triangle_count"].tolist() == [55_228]
    assert (scene.triangle_count, len(scene.lights)) == (66_734 + 55_228, 1)
    assert then.geometry.indices is first.geometry.indices  # the rest is not packed again
    frozen = pack(BUILTINS["ironworks-water"](time=0.1))
    assert frozen.geometry.vertices.tobytes() == then.geometry.vertices.tobytes()


def test_water_is_open_at_walls_and_within_plinths_alone():
    mesh = water_surface()
    t = mesh.triangles.astype(np.int64)
    edges = np.sort(np.concatenate([t[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    single, count = np.unique(edges, axis=0, return_counts=True)
    x, _, z = mesh.positions[np.unique(single[count == 1])].T
    wall = (np.abs(np.abs(x) - 24.0) < 1e-3) | (np.abs(np.abs(z) - 9.3) < 1e-3)
    plinth = np.any([(np.abs(x - a) < 0.38) & (np.abs(z - b) < 0.38) for a, b in COLUMNS], axis=0)
    assert (wall | plinth).all()


@pytest.mark.parametrize("count", [76_200, 138_902])
def test_elephant_is_one_closed_smooth_surface(count):
    mesh = elephant(count)
    assert len(mesh.triangles) == count
    assert len(mesh.positions) == count // 2 + 2  # Euler's formula for what has no hole
    assert open_edges(mesh) == 0
    assert 2.5 < volume(mesh) < 3.5  # m3; some 3 t weigh 2.9
    cosine = np.einsum("tcj,tj->tc", mesh.normals[mesh.triangles].astype(float), face_normals(mesh))
    assert (cosine > 0.0).all()
    low, high = mesh.bounds
    assert abs(low[1]) < 0.02 and high[1] > 2.0


SOLIDS = {
    "prism": (lambda: prism([(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)], -1.0, 1.0), 20, 10.0),
    "beam": (
        lambda: prism(i_section(0.4, 0.3, 0.02, 0.03), 0.0, 2.0),
        44,
        2.0 * (2 * 0.3 * 0.03 + 0.34 * 0.02),
    ),
    # the cuts take 12 prisms of b^2 / 2 along the edges, and 8 corners, of b^3 (2 / 3 + 1 / 6) in all each
    "beveled box": (
        lambda: beveled_box((0, 0, 0), (1, 2, 3), 0.1),
        44,
        6.0 - 0.005 * 4 * (6 - 0.6) - 8 * 0.005 / 6,
    ),
    "pipe": (lambda: pipe([(0, 0, 0), (2, 0, 0)], 0.1, 8), 2 * 8 + 12, 2.0 * 0.01 * 4 * np.sin(np.pi / 4)),
    "loft": (
        lambda: loft(
            np.array([[(-1, -1, z), (1, -1, z), (1, 1, z), (-1, 1, z)] for z in (0.0, 1.0, 2.5)], float)
        ),
        16 + 4,
        10.0,
    ),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_forms_are_closed_and_count(name):
    make, count, inside = SOLIDS[name]
    mesh = make()
    assert len(mesh.triangles) == count
    assert open_edges(mesh) == 0
    assert volume(mesh) == pytest.approx(inside, rel=1e-5)


def test_pipe_with_bends_is_closed_and_as_thick_as_asked():
    mesh = pipe([(0, 0, 0), (2, 0, 0), (2, 2, 0), (2, 2, 3)], 0.1, 12, 0.4)
    assert open_edges(mesh) == 0 and volume(mesh) > 0.0
    assert np.allclose(mesh.bounds[0], [0.0, -0.1, -0.1], atol=0.02)


@pytest.mark.parametrize("count", [24, 26, 500])
def test_refined_keeps_the_surface_and_has_the_count(count):
    mesh = refined(box((0, 0, 0), (1, 2, 3)), count)
    assert len(mesh.triangles) == count
    assert open_edges(mesh) == 0 and volume(mesh) == pytest.approx(6.0)
    assert 0.5 * np.linalg.norm(face_normals(mesh), axis=1).sum() == pytest.approx(22.0)


def test_refined_makes_an_odd_number_at_a_border_alone():
    grid = np.zeros((3, 3, 3))
    grid[..., 0], grid[..., 2] = np.arange(3.0), np.arange(3.0)[:, None]
    assert len(refined(sheet(grid), 31).triangles) == 31
    with pytest.raises(ValueError, match="cannot have 13"):
        refined(box((0, 0, 0), (1, 1, 1)), 13)
    with pytest.raises(ValueError, match="more than 4"):
        refined(box((0, 0, 0), (1, 1, 1)), 4)


def test_placed_turns_normals_with_the_surface():
    ball = averaged(refined(box((-1, -1, -1), (1, 1, 1)), 400))
    stretched = pose(1.0, 2.0, 3.0, 40.0, 25.0, 10.0) @ np.diag([1.0, 2.0, 0.5, 1.0])
    mesh = placed(ball, stretched, pose(z=9.0))
    assert volume(mesh) == pytest.approx(16.0, rel=1e-5)
    # the outside normals of a flat face stay across it
    flat = np.abs(ball.normals).max(axis=1) > 0.9999
    n = mesh.normals[: len(flat)][flat]
    sides = stretched[:3, :3] / np.linalg.norm(stretched[:3, :3], axis=0)
    assert np.allclose(np.abs(n @ sides).max(axis=1), 1.0, atol=1e-5)


def test_unwrapped_shows_pictures_to_scale_and_upright():
    mesh = unwrapped(box((0, 0, 0), (1, 2, 3)), 0.5)
    p, uv = (values.astype(np.float64)[mesh.triangles] for values in (mesh.positions, mesh.uv0))
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    area = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    flat = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    assert np.allclose(area, np.linalg.norm(flat, axis=1) / 0.25)
    wall = np.abs(flat[:, 1]) < 1e-6
    assert np.allclose(uv[wall, :, 1], -p[wall, :, 1] / 0.5)  # v points down
