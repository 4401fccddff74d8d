"""`ispm.shapes`: areas and volumes by formula, closed, faced outwards, and pictures upright on them."""

import math

import numpy as np
import pytest

from ispm import shapes
from ispm.errors import SceneError
from ispm.scene.mesh import Mesh

N, K = 24, 10  # segments and rings
STEP = 2.0 * math.pi / N
POLYGON = 0.5 * N * math.sin(STEP)  # area of the regular N-gon in the unit circle

SOLIDS = {
    "box": shapes.box((0.7, 1.1, 1.9)),
    "sphere": shapes.sphere(0.8, segments=N, rings=K),
    "cylinder": shapes.cylinder(0.6, 1.7, segments=N),
    "cone": shapes.cone(0.6, 1.7, segments=N),
    "torus": shapes.torus(0.9, 0.25, segments=N, sides=K),
}
ALL = SOLIDS | {
    "plane": shapes.plane(0.7, 1.9),
    "pipe": shapes.cylinder(0.6, 1.7, segments=N, caps=False),
    "hat": shapes.cone(0.6, 1.7, segments=N, caps=False),
}


def corners(mesh: Mesh):
    """(T, 3, 3) float64 corners of the triangles."""
    return mesh.positions.astype(np.float64)[mesh.triangles]


def area(mesh: Mesh) -> float:
    p = corners(mesh)
    return 0.5 * np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum()


def volume(mesh: Mesh) -> float:
    """By the divergence theorem: positive only where fronts look outwards."""
    return np.linalg.det(corners(mesh)).sum() / 6.0


def rings(radius, y):
    """Area and volume of what N segments make of a profile from top to bottom: frusta of N-gons."""
    inner = math.cos(STEP / 2.0)  # of the radius: the middle of an edge
    lengths = np.hypot(np.diff(radius) * inner, np.diff(y))
    surface = (N * math.sin(STEP / 2.0) * (radius[:-1] + radius[1:]) * lengths).sum()
    a, b = radius[:-1], radius[1:]
    return surface, POLYGON / 3.0 * ((a * a + a * b + b * b) * -np.diff(y)).sum()


def expected(name):
    if name == "box":
        return 2.0 * (0.7 * 1.1 + 1.1 * 1.9 + 0.7 * 1.9), 0.7 * 1.1 * 1.9
    if name == "cylinder":
        side, inside = rings(np.array([0.6, 0.6]), np.array([0.85, -0.85]))
        return side + 2.0 * POLYGON * 0.36, inside
    if name == "cone":
        side, inside = rings(np.array([0.0, 0.6]), np.array([0.85, -0.85]))
        return side + POLYGON * 0.36, inside
    if name == "sphere":
        angle = np.linspace(0.0, math.pi, K + 1)
        return rings(0.8 * np.sin(angle), 0.8 * np.cos(angle))
    angle = np.linspace(math.pi, -math.pi, K + 1)
    return rings(0.9 + 0.25 * np.cos(angle), 0.25 * np.sin(angle))


@pytest.mark.parametrize("name", SOLIDS)
def test_areas_and_volumes_are_those_of_their_polygons(name):
    surface, inside = expected(name)
    assert area(SOLIDS[name]) == pytest.approx(surface, rel=1e-6)  # float32 coordinates
    assert volume(SOLIDS[name]) == pytest.approx(inside, rel=1e-6)


@pytest.mark.parametrize(
    ("fine", "surface", "inside"),
    [
        (shapes.sphere(0.5, segments=512, rings=256), math.pi, math.pi / 6.0),
        (shapes.cylinder(0.5, 2.0, segments=512), 2.5 * math.pi, 0.5 * math.pi),
        (shapes.cone(0.3, 0.4, segments=512), 0.24 * math.pi, 0.012 * math.pi),
        (shapes.torus(0.5, 0.2, segments=512, sides=256), 0.4 * math.pi**2, 0.04 * math.pi**2),
    ],
)
def test_fine_ones_are_round(fine, surface, inside):
    # the error of a polygon's area falls with the square of its corners: (2 pi / 256)^2 / 6 = 1e-4
    assert area(fine) == pytest.approx(surface, rel=2e-4)
    assert volume(fine) == pytest.approx(inside, rel=2e-4)


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_are_closed(name):
    """Each edge, by places in space, is passed once each way: seams and poles meet bit for bit."""
    mesh = SOLIDS[name]
    _, place = np.unique(mesh.positions, axis=0, return_inverse=True)
    welded = place.reshape(-1)[mesh.triangles]
    edges = np.concatenate([welded[:, [0, 1]], welded[:, [1, 2]], welded[:, [2, 0]]])
    assert (edges[:, 0] != edges[:, 1]).all()  # no triangle without area
    there, counts = np.unique(edges, axis=0, return_counts=True)
    assert (counts == 1).all()
    np.testing.assert_array_equal(there, np.unique(there[:, ::-1], axis=0))


def test_trimesh_finds_them_watertight():
    trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed")
    for mesh in SOLIDS.values():
        theirs = trimesh.Trimesh(mesh.positions, mesh.triangles, process=False)
        theirs.merge_vertices(merge_tex=True, merge_norm=True)
        assert theirs.is_watertight and theirs.is_winding_consistent
        assert theirs.volume == pytest.approx(volume(mesh), rel=1e-6) and theirs.volume > 0.0


@pytest.mark.parametrize("name", ALL)
def test_normals_are_unit_and_look_as_the_triangles_do(name):
    mesh = ALL[name]
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1.0, abs=1e-6)
    p = corners(mesh)
    flat = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    along = np.einsum("tij,tj->ti", mesh.normals[mesh.triangles], flat)
    half_steps = math.cos(math.pi / K) * math.cos(math.pi / N)  # round the tube and round the axis
    assert along.min() > half_steps - 1e-6


def test_normals_are_those_of_the_smooth_solid():
    ball = SOLIDS["sphere"]
    np.testing.assert_allclose(ball.normals, ball.positions / 0.8, atol=1e-6)
    ring = SOLIDS["torus"]
    middle = ring.positions * (1.0, 0.0, 1.0)
    middle *= 0.9 / np.linalg.norm(middle, axis=1, keepdims=True)
    np.testing.assert_allclose(ring.normals, (ring.positions - middle) / 0.25, atol=1e-5)
    hat = ALL["hat"]
    slope = hat.normals[:, 1]  # the side falls 1.7 over 0.6
    np.testing.assert_allclose(slope, 0.6 / math.hypot(0.6, 1.7), atol=1e-6)


@pytest.mark.parametrize("name", ALL)
def test_pictures_are_whole_upright_and_not_mirrored(name):
    mesh = ALL[name]
    assert (mesh.uv0.min(), mesh.uv0.max()) == (0.0, 1.0)
    p, uv = corners(mesh), mesh.uv0.astype(np.float64)[mesh.triangles]
    # v points down: seen from the front, a triangle's corners go round its picture the other way
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    turn = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    assert (turn < 0.0).all()
    if name in ("sphere", "pipe", "hat"):  # up in the picture is up in space
        low, high = mesh.uv0[:, 1].argmax(), mesh.uv0[:, 1].argmin()
        assert mesh.positions[low, 1] < mesh.positions[high, 1]
        middle = np.abs(mesh.uv0 - 0.5).sum(axis=1).argmin()
        assert mesh.positions[middle, 2] > 0.0 and abs(mesh.positions[middle, 0]) < 1e-6
    assert len(p) == len(uv)


@pytest.mark.parametrize(
    ("out", "right", "up"),
    [
        ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
        ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
        ((0, 0, -1), (-1, 0, 0), (0, 1, 0)),
        ((-1, 0, 0), (0, 0, 1), (0, 1, 0)),
        ((0, 1, 0), (1, 0, 0), (0, 0, -1)),
        ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
    ],
)
@pytest.mark.parametrize("name", ["box", "cylinder", "plane"])
def test_flat_faces_show_the_picture_as_documented(name, out, right, up):
    mesh = {"box": shapes.box(), "cylinder": shapes.cylinder(segments=N), "plane": shapes.plane()}[name]
    face = (mesh.normals @ np.array(out) > 0.999).nonzero()[0]
    if name != "box" and out[1] <= (0 if name == "plane" else -2):
        assert name == "plane" and not len(face)
        return
    if name == "cylinder" and out[1] == 0:
        return  # its side is round
    where = mesh.positions[face]
    expected = np.stack([where @ right + 0.5, 0.5 - where @ up], axis=1)
    np.testing.assert_allclose(mesh.uv0[face], expected, atol=1e-6)


def test_counts_and_bounds_are_as_documented():
    counts = {name: len(mesh.triangles) for name, mesh in ALL.items()}
    turned = dict(sphere=2 * N * (K - 1), cylinder=4 * N, cone=2 * N, torus=2 * N * K, pipe=2 * N, hat=N)
    assert counts == dict(box=12, plane=2) | turned
    for shape in (shapes.box, shapes.sphere, shapes.cylinder, shapes.cone):
        np.testing.assert_allclose(shape().bounds, [[-0.5] * 3, [0.5] * 3], atol=1e-7)
    np.testing.assert_allclose(shapes.torus().bounds, [[-0.5, -0.125, -0.5], [0.5, 0.125, 0.5]], atol=1e-7)
    np.testing.assert_allclose(shapes.plane().bounds, [[-0.5, 0.0, -0.5], [0.5, 0.0, 0.5]])
    assert shapes.box(2.0).bounds.tolist() == [[-1.0] * 3, [1.0] * 3]
    assert shapes.sphere().name == "sphere"


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: shapes.sphere(0.0), "sphere: radius, in metres, must be a number of"),
        (lambda: shapes.sphere(segments=2), "sphere: segments must be a number of 3 to 4096, not 2"),
        (lambda: shapes.sphere(rings=8.5), "rings must be a whole number, not 8.5"),
        (lambda: shapes.box((1.0, 2.0)), "box: size must be 3 numbers"),
        (lambda: shapes.box(-1.0), "box: size, in metres,"),
        (lambda: shapes.plane(depth=math.nan), "plane: depth"),
        (lambda: shapes.cone(height="1"), "cone: height"),
        (lambda: shapes.torus(0.2, 0.3), "torus: tube, less than the radius"),
        (lambda: shapes.torus(-1.0), "torus: radius"),
    ],
)
def test_what_makes_no_solid_is_refused(make, says):
    with pytest.raises(SceneError, match=says):
        make()
