"""The tracer against Embree, over many rays."""

import numpy as np
import pytest
from tracer_scenes import corners_of, crowd, hall, intersect64, rays_inside

from ispm.accel.world import World
from ispm.library.builtin import builtin
from ispm.optics.records import NO_HIT
from ispm.scene.packed import pack
from ispm.scene.scene import Scene

pytest.importorskip("embreex", reason="embreex, the reference tracer, is not installed")

RAYS = 1_000_000


def hall_scene():
    scene = Scene()
    scene.add(hall())
    return scene


def atrium():
    return builtin("atrium")


@pytest.mark.parametrize("make", [hall_scene, crowd, atrium])
def test_distances_agree_with_embree(make):
    # N = 1e6 rays, seed 21. Both round in float32: distances may part by 1e-3 of themselves, and at a
    # silhouette either may see past it. At most 1e-5 of the rays do, and each of those is at an edge.
    from ispm.bench.embree import EmbreeScene

    packed = pack(make())
    world = World()
    world.update(packed)
    low, high = ([0.5, 0.5, 0.5], [29.5, 11.5, 13.5]) if make is not atrium else packed.bounds
    origins, directions = rays_inside(RAYS, low, high, 21)
    own = world.trace(origins, directions)
    # not the robust mode: both count edges as part of the triangle
    reference = EmbreeScene(packed).trace(origins, directions, world.threads)
    open_to_the_sky = (own["instance"] == NO_HIT) & np.isinf(reference["t"])
    assert make is atrium or not open_to_the_sky.any()  # the others are closed
    with np.errstate(invalid="ignore"):  # infinity less infinity
        near_each_other = np.abs(own["t"] - reference["t"]) <= 1e-3 * np.maximum(1.0, reference["t"])
    apart = ~near_each_other & ~open_to_the_sky
    assert apart.sum() <= 1e-5 * RAYS
    near = np.where(own["t"] < reference["t"], own, reference)[apart]
    _, least, cosine = intersect64(origins[apart], directions[apart], corners_of(packed, near))
    at_edge, grazing = np.abs(least) < 1e-3, cosine < 1e-3
    assert (at_edge | grazing).all(), f"unexplained: {near[~(at_edge | grazing)]}"
