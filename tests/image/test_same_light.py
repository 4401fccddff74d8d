"""What must make no difference: where a scene stands, how its meshes are cut, in which order they come.

Depth and direct light along exact rays are the same but for rounding; light from photons, which then fall
elsewhere, is the same in the mean.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import Phase, assume, given, settings
from hypothesis import strategies as st
from scipy import stats
from scipy.spatial.transform import Rotation
from test_any_scene import NEVER_SLOW, lamps, things, turn
from transport import SIDES, Tracer, box_room

from ispm.accel.intersect import STACK_WORDS
from ispm.accel.records import Scratch
from ispm.accel.surface import closest_surface, scene_tables, surface
from ispm.kernels.simd import alloca
from ispm.lights.nee import direct_light
from ispm.optics.jit import jit
from ispm.optics.light import light_arriving, reaches
from ispm.optics.vector import LUMINANCE, dot, scale, sub
from ispm.renderer import Renderer
from ispm.scene.camera import Camera
from ispm.scene.scene import Node, Part, Scene
from ispm.settings import Settings
from ispm.stages.camera import CameraView

f32 = np.float32

SIZE = (48, 27)
AS_FOUND = settings(NEVER_SLOW, phases=[Phase.reuse, Phase.generate])  # to shrink would take minutes
SEEDS = 16
T = float(stats.t.isf(0.5e-5, SEEDS - 1))
RING = [(0.002 * math.cos(a), 0.002 * math.sin(a)) for a in np.arange(8) * math.pi / 4]  # pixels
EYE = Camera.look_at((1.0, 1.0, 9.0), (0.0, -0.3, 0.0))
ASIDE = np.array([0.0137, 0.0071, 0.0193])  # m, so that no two surfaces lie in one plane, nor a light in one
TILT = np.array([0.11, 0.23, 0.31, 0.915])  # and none is parallel to another or to a light's rays


def scene_of(things, lamps):
    """A room open to the front, with things and lamps, none of them in line with another."""
    scene = box_room((-3, -3, -3), (3, 3, 3), albedo=0.6)
    scene.roots.pop(SIDES.index("+z"))
    for k, (shape, at, turned, size, material) in enumerate(things):
        place = tuple(np.array(at) + (k + 1) * ASIDE)
        scene.add(shape, material=material, translation=place, rotation=tilted(turned, k), scale=(size,) * 3)
    for k, (lamp, at, turned) in enumerate(lamps):
        place = tuple(np.array(at) - (k + 1) * ASIDE)
        scene.add(lamp, translation=place, rotation=tilted(turned, k + 7))
    return scene


def tilted(quaternion, k):
    """A rotation turned a little aside, differently for each k."""
    return (Rotation.from_quat(quaternion) * Rotation.from_quat((*TILT[:3], TILT[3] + 0.1 * k))).as_quat()


def move(scene, rotation, translation):
    """All under a node that is turned and elsewhere."""
    return Scene([Node("moved", translation, rotation, children=scene.roots)])


def cut(scene, rotation, translation):
    """Each mesh in two, every other triangle in each."""
    halves = []
    for node in scene.roots:
        for part in node.parts:
            for triangles in (part.mesh.triangles[::2], part.mesh.triangles[1::2]):
                half = Part(replace(part.mesh, triangles=triangles), part.material)
                halves.append(Node(node.name, node.translation, node.rotation, node.scale, parts=[half]))
    return Scene(halves + [node for node in scene.roots if not node.parts])


def reverse(scene, rotation, translation):
    """Nodes in the opposite order, lights too."""
    return Scene(scene.roots[::-1])


def camera_after(change, rotation, translation):
    if change is not move:
        return EYE
    return replace(EYE, pose=Node("", translation, rotation).local_matrix() @ EYE.pose)


@jit
def _look(tables, origins, directions, out):
    scratch = Scratch(alloca(STACK_WORDS), alloca(2))
    for i in range(len(origins)):
        start = origins[i, 0], origins[i, 1], origins[i, 2]
        d = directions[i, 0], directions[i, 1], directions[i, 2]
        found, hit = closest_surface(tables, start, d, f32(0.5), scratch)
        if found:
            x = surface(tables, hit, d)
            wo = scale(f32(-1), d)
            light, _ = direct_light(tables, x, wo, f32(0.5), scratch, f32(np.inf))
            way = sub(x.position, start)
            out[i, 0] = math.sqrt(dot(way, way))
            for c in range(3):
                out[i, 1 + c] = light[c]
            for k in range(len(tables.lights)):
                if reaches(tables.lights[k], x.position):
                    irradiance, _, _ = light_arriving(tables.lights[k], x.position)
                    for c in range(3):
                        out[i, 4 + c] += x.bsdf.diffuse[c] * irradiance[c] * f32(1 / math.pi)


def along_rays(scene, camera, aside=(0.0, 0.0)):
    """(h w, 7) float64 along rays through the pixels, `aside` of their centers: distance, direct light, and
    what of that matte surfaces would send if they faced all lights that are points."""
    tracer = Tracer(scene)
    view = CameraView(SIZE, camera.pose, camera.yfov)
    x, y = np.arange(SIZE[0]) + 0.5 + aside[0], np.arange(SIZE[1])[:, None] + 0.5 + aside[1]
    origins, directions = (np.ascontiguousarray(a.reshape(-1, 3), f32) for a in view.rays_through(x, y))
    out = np.zeros((len(origins), 7), f32)
    _look(scene_tables(tracer.packed, tracer.world, tracer.surfaces), origins, directions, out)
    return out.astype(float)


def hangs_free(scene):
    """Whether no lamp is within 2 mm of a surface: shadow rays end 1e-4 of their length before it."""
    tracer = Tracer(scene)
    ways = np.random.default_rng(0).normal(size=(256, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    places = tracer.packed.lights["position"]  # the origin of those that are far away
    hits = tracer.world.trace(np.repeat(places, len(ways), axis=0), np.tile(ways, (len(places), 1)))
    return hits["t"].min() > 2e-3


anywhere = st.tuples(*[st.floats(-20, 20, width=32)] * 3)
CHANGES = [move, cut, reverse]


@pytest.mark.parametrize("change", CHANGES)
@settings(AS_FOUND, max_examples=25)
@given(things, lamps, turn, anywhere)
def test_depth_and_direct_light_are_the_same(change, things, lamps, rotation, translation):
    """Within what they vary by over a 500th of a pixel, edges of things and shadows included.

    Rounding of places, 40 m from the origin at most, is some 1e-5 m; so far are rays 7 m away apart. Over 1 m
    it turns a surface by 1e-5 radians, and cosines of light that grazes it change by as much.
    """
    assume(hangs_free(scene_of(things, lamps)))
    expected = along_rays(scene_of(things, lamps), EYE)
    around = [along_rays(scene_of(things, lamps), EYE, aside) for aside in RING]
    low, high = np.min([expected, *around], axis=0), np.max([expected, *around], axis=0)
    changed = change(scene_of(things, lamps), rotation, translation)
    found = along_rays(changed, camera_after(change, rotation, translation))
    assert (expected[:, 0] > 0).mean() > 0.1
    margin = 1e-4 * np.abs(expected) + 1e-5 * expected.mean(axis=0)
    margin[:, 1:4] += 1e-5 * expected[:, 4:]
    outside = (found < low - margin) | (found > high + margin)
    assert not outside[:, :4].any()


def light_of_seeds(gpu, scene, camera):
    """Mean luminance of the indirect light of a picture for each of some seeds."""
    means = []
    with Renderer(scene, Settings(size=SIZE, photons=1500), camera, gpu=gpu) as renderer:
        for seed in range(SEEDS):
            renderer.settings = renderer.settings.replace(seed=seed)
            means.append((renderer.render().indirect @ LUMINANCE).mean(dtype=float))
    return np.array(means)


@pytest.mark.parametrize("change", CHANGES)
@settings(AS_FOUND, max_examples=4)
@given(things, lamps, turn, anywhere)
def test_light_of_photons_is_the_same_in_the_mean(gpu, change, things, lamps, rotation, translation):
    """Means over the picture of 16 seeds each, by Student's t of their differences, confidence 1 - 1e-5."""
    expected = light_of_seeds(gpu, scene_of(things, lamps), EYE)
    changed = change(scene_of(things, lamps), rotation, translation)
    found = light_of_seeds(gpu, changed, camera_after(change, rotation, translation))
    differences = found - expected
    error = differences.std(ddof=1) / math.sqrt(SEEDS)
    # a cut mesh has two boxes that say how wide it is; lamps within boxes leak less than 5e-5, of some 0.02
    assert abs(differences.mean()) <= T * error + (0.01 if change is cut else 1e-4) * expected.mean() + 5e-5
