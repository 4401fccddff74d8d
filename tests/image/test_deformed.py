"""Pictures of meshes that deform are those of the same geometry at rest."""

import math

import numpy as np
import pytest

import ispm
from ispm.scene.packed import pack

SETTINGS = ispm.Settings(size=(64, 36), photons=2000, exposure=0.0)
LAYERS = ("full", "direct", "indirect", "emission", "depth", "normal")


def figure(glow=0.0):
    """A post that bends and a lump that grows, on a floor; one of them may glow."""
    scene = ispm.Scene()
    scene.add(ispm.shapes.plane(6, 6), name="floor")
    scene.add(ispm.PointLight((60, 60, 60)), translation=(1, 3, 2))
    post = ispm.shapes.cylinder(0.25, 2.0, segments=24)
    lower = np.clip(0.5 - post.positions[:, 1], 0.0, 1.0)
    post.joints = np.tile([0, 1], (len(lower), 1))
    post.joint_weights = np.stack([lower, 1.0 - lower], axis=1)
    scene.roots += [ispm.Node("foot", (0, 1, 0)), ispm.Node("head", (0, 1, 0), ispm.euler(z=0.6, x=0.3))]
    material = ispm.Material((0.8, 0.3, 0.2), emission=(glow, glow, 0.5 * glow))
    scene.add(post, name="post", material=material).skin = ispm.Skin([scene["foot"], scene["head"]])
    lump = ispm.shapes.sphere(0.4)
    lump.morphs = [ispm.Morph(lump.positions * np.array([1.0, 0.2, 0.5], np.float32), 0.2 * lump.normals)]
    scene.add(lump, name="lump", translation=(-1.2, 0.4, 0.5), rotation=ispm.euler(y=0.5)).weights = [0.7]
    return scene


def baked(scene):
    """The same nodes with meshes in the shapes that they have."""
    shapes = {r.mesh.name: r.mesh for r in pack(scene).geometry.ranges}
    result = scene.at_rest()
    for name in ("post", "lump"):
        node, mesh = result[name], shapes[scene[name].parts[0].mesh.name]
        node.parts = [
            ispm.Part(ispm.Mesh(mesh.positions, mesh.triangles, mesh.normals), node.parts[0].material)
        ]
        node.parts[0].mesh.uv0 = mesh.uv0
        node.skin = node.weights = None
    return result


@pytest.mark.parametrize("glow", [0.0, 3.0])
def test_a_deformed_mesh_shows_as_the_same_geometry_at_rest(gpu, glow):
    """To the byte, photons too: with a light as with a lamp that is itself bent."""
    scene = figure(glow)
    camera = ispm.Camera.look_at((2.5, 2.0, 4.0), (0, 0.8, 0))
    frames = []
    for each in (scene, baked(scene)):
        with ispm.Renderer(each, SETTINGS, camera, gpu=gpu) as renderer:
            frames.append((renderer.render(), renderer.photons()))
    (first, photons), (second, others) = frames
    assert [name for name in LAYERS if not np.array_equal(first[name], second[name])] == []
    assert photons.tobytes() == others.tobytes() and len(photons)
    assert (first["emission"].max() > 0.0) == (glow > 0.0)


def test_the_area_of_a_bent_lamp_tells_its_light(gpu):
    """A lamp that a morph makes four times as large sends out four times the flux."""
    scene = ispm.Scene()
    scene.add(ispm.shapes.plane(6, 6))
    square = ispm.shapes.plane(0.5, 0.5)
    square.morphs = [ispm.Morph(square.positions)]
    lamp = scene.add(square, material=ispm.Material(emission=(5, 5, 5)), translation=(0, 2, 0), name="lamp")
    lamp.rotation, lamp.weights = ispm.euler(x=math.pi), [0.0]
    camera = ispm.Camera.look_at((2.5, 2.0, 4.0), (0, 0.8, 0))
    with ispm.Renderer(scene, SETTINGS, camera, gpu=gpu) as renderer:
        one = renderer.render()
        lamp.weights = [1.0]
        four = renderer.render()
    np.testing.assert_allclose(four.stats.flux_emitted, 4.0 * one.stats.flux_emitted, rtol=1e-5)
    assert four.stats.dynamic_polygons == 2 and one.stats.dynamic_polygons == 0
    # the floor below, where the cosines of the larger lamp are at least those at its corners
    ratio = four["direct"].sum() / one["direct"].sum()
    assert 3.0 < ratio < 4.2
