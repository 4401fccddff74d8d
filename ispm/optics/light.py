"""Light that arrives at a point straight from a punctual light, shadows aside. Twin of light.wgsl.

A light is a LIGHT record, directions are tuples of three float32.
Source: glTF extension KHR_lights_punctual.
"""

import math

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.records import LIGHT_DIRECTIONAL
from ispm.optics.vector import dot, scale, sub, vec3

f32, u32 = np.float32, np.uint32

FAR = f32(3.4e38)  # metres to a directional light


@jit
def light_arriving(light, position):
    """Return (irradiance, distance, wi): lx on a surface facing the light, metres, unit and towards it."""
    direction = vec3(light.direction)
    intensity = vec3(light.intensity)
    if light.kind == u32(LIGHT_DIRECTIONAL):
        return intensity, FAR, scale(f32(-1), direction)
    to_light = sub(vec3(light.position), position)
    square = max(dot(to_light, to_light), f32(1e-30))
    distance = f32(math.sqrt(square))
    wi = scale(f32(1) / distance, to_light)
    kept = range_window(distance, light.range) * cone_falloff(light, scale(f32(-1), wi))
    return scale(kept / square, intensity), distance, wi


@jit
def reaches(light, position):
    """Return whether a point lies within a light's range; in less time than `light_arriving` takes."""
    to_light = sub(vec3(light.position), position)
    return light.range <= f32(0) or dot(to_light, to_light) < light.range * light.range


@jit
def range_window(distance, reach):
    """Return 1 falling to 0 at a light's range, `reach` in m; 1 everywhere where that is 0."""
    if reach <= f32(0):
        return f32(1)
    x = distance / reach
    return min(max(f32(1) - x * x * x * x, f32(0)), f32(1))


@jit
def cone_falloff(light, d):
    """Return the share of its intensity that a light sends along `d`, unit: 1 but for spots."""
    cosine = dot(vec3(light.direction), d)
    edge = min(max(cosine * light.cone_scale + light.cone_offset, f32(0)), f32(1))
    return edge * edge
