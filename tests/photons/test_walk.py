"""One photon's way: where it is stored, what it carries, and what ends it."""

import numpy as np
import pytest
from transport import Tracer, box_room, lit, on_instance, trace

from ispm.library.common import lambert
from ispm.lights.bright import SPLIT_COUNT
from ispm.optics.records import EMITTED, NO_HIT
from ispm.photons import walk as walk_module
from ispm.scene.light import PointLight, SphereLight
from ispm.scene.material import Material, Texture, TextureUse
from ispm.scene.mesh import Mesh
from ispm.scene.scene import Scene


def test_photons_lie_on_the_walls_and_point_back_to_the_last_one():
    path = trace(lit(box_room(albedo=0.9), (0.1, 0.2, -0.3)), 2000, 4)
    photons = path.photons
    place, wi, normal = photons["position"], photons["wi"], photons["normal"]
    assert np.abs(place).max(axis=1) == pytest.approx(0.5, abs=1e-6)
    wall = np.arange(6)[photons["instance"]]
    inwards = normal[np.arange(len(photons)), wall // 2] * np.where(wall % 2, -1.0, 1.0)
    assert inwards == pytest.approx(1.0, abs=1e-6)
    assert np.linalg.norm(wi, axis=1) == pytest.approx(1.0, abs=1e-5)
    assert ((wi * normal).sum(axis=1) > 0.0).all()
    # bounces of one path follow each other: wi of each leads back to the one stored before; rays leave
    # 16 roundings off their surface
    later = np.flatnonzero(photons["bounce"][1:] > 1) + 1
    way = place[later - 1] - place[later]
    assert way == pytest.approx(wi[later] * np.linalg.norm(way, axis=1, keepdims=True), abs=3e-6)


@pytest.mark.parametrize("bounces", [1, 2, 5])
def test_paths_end_after_the_scatters_allowed(bounces):
    path = trace(lit(box_room(albedo=1.0)), 1000, bounces)
    assert np.bincount(path.photons["bounce"]).tolist() == [0, *[path.photon_count] * bounces]
    assert path.dropped == pytest.approx(path.emitted) and path.rays == bounces * path.photon_count


def test_photons_leave_bright_spots_in_parts_and_one_goes_on():
    """All first hits are spots; white walls keep all flux, so that each bounce carries what was emitted."""
    tracer = Tracer(lit(box_room(albedo=1.0)))
    path = tracer.walk(tracer.emit(1000), 3, limit=0.0)
    count, bounce = path.photon_count, path.photons["bounce"]
    assert np.bincount(bounce).tolist() == [0, SPLIT_COUNT * count, count, count]
    assert (path.not_gathered == (bounce == 1)).all()
    for n in (1, 2, 3):
        assert path.photons["flux"][bounce == n].sum(axis=0, dtype=float) == pytest.approx(
            path.emitted, rel=1e-6
        )
    places = path.photons["position"][bounce == 1]
    assert len(np.unique(places, axis=0)) == len(places)  # each part goes its own way


def test_photons_that_hit_nothing_escape():
    tracer = Tracer(lit(box_room()))
    lost = np.zeros(10, EMITTED)
    lost["instance"], lost["flux"] = NO_HIT, 0.5
    path = tracer.walk(lost, 8)
    assert (path.escaped == 5.0).all() and path.rays == 0 and not len(path.photons)
    nothing = tracer.walk(lost[:0], 8)
    assert nothing.photon_count == 0 and not len(nothing.photons) and (nothing.emitted == 0.0).all()


def test_photons_scatter_back_to_the_side_they_came_from():
    """Light below a single sheet in a room: what the sheet stores second-hand comes from below."""
    scene = box_room(albedo=1e-6)
    sheet = np.array([(-0.4, 0, -0.4), (-0.4, 0, 0.4), (0.4, 0, 0.4), (0.4, 0, -0.4)])
    scene.add(Mesh(sheet, np.array([(0, 1, 2), (0, 2, 3)])), material=lambert((0.9,) * 3))
    path = trace(lit(scene, (0, -0.2, 0)), 5000, 2)
    assert len(path.photons) > 100
    assert path.photons["position"][:, 1].max() < 0.0


def normal_mapped_square(tilt):
    """A Lambert square of side 2 in y = 0 whose shading normal leans by `tilt` towards +X everywhere."""
    texel = np.rint((np.array([np.sin(tilt), 0, np.cos(tilt)]) + 1) * 127.5).astype(np.uint8)
    pixels = np.full((2, 2, 4), 255, np.uint8)
    pixels[..., :3] = texel
    material = Material((0.8,) * 3, specular=0.0, normal_texture=TextureUse(Texture(pixels, srgb=False)))
    square = Mesh(
        np.array([(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)]), np.array([(0, 1, 2), (0, 2, 3)]),
        uv0=np.array([(0, 0), (0, 1), (1, 1), (1, 0)]),
    )  # fmt: skip
    scene = Scene()
    scene.add(square, material=material)
    n = texel / 127.5 - 1
    n /= np.linalg.norm(n)
    return scene, np.array([n[0], n[2], -n[1]])


@pytest.mark.parametrize("tilt", [0.0, 0.4, 0.9])
def test_a_normal_map_reflects_the_flux_that_the_eye_sees(tilt):
    """The radiance of a normal-mapped surface, integrated over directions, is the photons' flux.

    L = albedo / pi E (in.n / in.ng) over the directions above both planes (Veach 1997, 5.3); the
    adjoint factor's clamp to [0.1, 10] is part of the integrand. 200 000 photons: 4.5 sigma.
    """
    scene, n = normal_mapped_square(tilt)
    tracer = Tracer(lit(scene, (0.0, 1e4, 0.0)))
    path = tracer.walk(on_instance(tracer.packed, 0, 200_000, seed=2), 1)
    z, phi = np.meshgrid((np.arange(1000) + 0.5) / 1000, (np.arange(2000) + 0.5) * np.pi / 1000)
    r = np.sqrt(1 - z * z)
    out = np.stack([r * np.cos(phi), z, r * np.sin(phi)], -1)  # equal solid angles above the surface
    above = np.maximum(out @ n, 0.0)
    factor = np.clip(n[1] * z / np.maximum(above, 1e-9), 0.1, 10.0)
    expected = 0.8 * 2 * np.mean(above * factor)
    got = path.escaped[0] / path.emitted[0]
    # the second moment of the factor bounds that of a photon's weight
    sigma = 0.8 * np.sqrt(2 * np.mean(above * factor**2)) / np.sqrt(200_000)
    assert got == pytest.approx(expected, abs=4.5 * sigma + 1e-4)
    if tilt == 0.0:
        assert got == pytest.approx(0.8, rel=5e-3)


@pytest.mark.parametrize("scale", [(-1.0, 1.0, 1.0), (1.0, 3.0, 0.5), (-2.0, 0.5, -1.0)])
def test_a_scaled_instance_scatters_like_the_same_shape_without_scale(scale):
    """Photons over an instance against a mesh with the scale in its vertices: the same photons."""
    paths = []
    for baked in (True, False):
        scene = lit(box_room((-3, -3, -3), (3, 3, 3), albedo=0.5), (0, 2.5, 0))
        points = np.array([(-1, 0, -1), (0, 0.5, 1), (1, 0, -1)], float)
        triangle = np.array([(0, 1, 2)])
        if baked:
            points, scale_left = points * scale, (1.0, 1.0, 1.0)
        else:
            scale_left = scale
        scene.add(Mesh(points, triangle), material=lambert((0.9, 0.5, 0.2)), scale=scale_left)
        tracer = Tracer(scene)
        paths.append(tracer.walk(on_instance(tracer.packed, 6, 3000, seed=4), 1).photons)
    a, b = paths
    assert len(a) == len(b) == 3000
    # float32 rounding of a few photons near edges may choose another wall
    assert np.mean(np.abs(a["position"] - b["position"]).max(axis=1) < 1e-3) > 0.995
    assert a["flux"] == pytest.approx(b["flux"], rel=1e-4)


def test_chunks_without_room_are_walked_again(monkeypatch):
    """White walls: photons scatter on to the limit, more often than there is room for at first."""
    tracer = Tracer(lit(box_room(albedo=1.0)))
    emitted = tracer.emit(1000)
    found = []
    for room in (3, 100_000):
        monkeypatch.setattr(walk_module, "_HITS", room)
        found.append(tracer.walk(emitted, 40))
    few, much = found
    assert len(few.photons) == 40 * len(emitted)
    for name in ("photons", "focused", "not_gathered", "keys", "beams"):
        assert getattr(few, name).tobytes() == getattr(much, name).tobytes()
    for name in ("emitted", "absorbed", "escaped", "dropped", "stored"):
        assert (getattr(few, name) == getattr(much, name)).all()
    assert few.rays == much.rays
    assert len(np.unique(few.keys)) > 0.999 * len(few.keys)


def test_photons_that_meet_a_black_lamp_are_not_kept():
    """Nothing shows them, but their kernels reach past it. What the lamp takes up is absorbed."""
    scene = box_room()
    scene.add(SphereLight((100.0,) * 3, radius=0.2), name="lamp")
    scene.add(PointLight((1.0,) * 3), translation=(0.3, 0.3, 0.3))
    path = trace(scene, 20_000, 4)
    away = np.linalg.norm(path.photons["position"], axis=1)
    assert len(away) > 20_000 and away.min() > 0.4
    np.testing.assert_allclose(path.emitted, path.absorbed + path.escaped + path.dropped, rtol=1e-4)
