"""How wide the beam is that a photon stands for: the differentials of its path, through mirrors and glass.

Sources: Igehy, Tracing Ray Differentials, SIGGRAPH 1999; Schjoth et al., Photon Differentials, GRAPHITE 2007.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ispm.accel.mesh import normal_change
from ispm.optics.jit import jit
from ispm.optics.light import cone_falloff
from ispm.optics.records import LIGHT_DIRECTIONAL
from ispm.optics.sampling import orthonormal_basis
from ispm.optics.vector import Vector, add, dot, scale, sub

f32, u32 = np.float32, np.uint32

_GRAZING = f32(1e-4)  # least cosine at which a beam is spread over a surface


class Beam(NamedTuple):
    """How the place where a path is (dx, m) and its direction (dd) change from one side of the photon's share
    of the light to the other, along one direction (_u) and along another (_v); float32.

    On a surface dx_u and dx_v span the area that the photon alone lights.
    """

    dx_u: Vector
    dx_v: Vector
    dd_u: Vector
    dd_v: Vector


@jit
def emitted_beam(light, flux, d):
    """Return the beam of a photon where it leaves its light along d: a square of its share of the light.

    flux  (3,) lm as emitted: the light's intensity times the solid angle that is the photon's own, in sr;
          of a directional light its irradiance times an area, in m2
    """
    brightest = max(light.intensity[0], max(light.intensity[1], light.intensity[2])) * cone_falloff(light, d)
    side = math.sqrt(max(flux[0], max(flux[1], flux[2])) / max(brightest, f32(1e-30)))
    s, t = orthonormal_basis(d)
    none = (f32(0), f32(0), f32(0))
    if light.kind == u32(LIGHT_DIRECTIONAL):
        return Beam(scale(side, s), scale(side, t), none, none)
    return Beam(none, none, scale(side, s), scale(side, t))


@jit
def beam_at(beam, way, d, ng):
    """Return a beam at the surface of normal ng that it meets after `way` metres along d."""
    inv = f32(-1) / max(-dot(d, ng), _GRAZING)
    u = add(beam.dx_u, scale(way, beam.dd_u))
    v = add(beam.dx_v, scale(way, beam.dd_v))
    u, v = sub(u, scale(dot(u, ng) * inv, d)), sub(v, scale(dot(v, ng) * inv, d))
    return Beam(u, v, beam.dd_u, beam.dd_v)


@jit
def redirected_beam(table, hit, beam, d, wi, ng, n, eta):
    """Return a beam that a smooth surface sends from d along wi.

    ng, n  normals against d, the latter bent as smooth surfaces are
    eta    index of refraction beyond the surface over that before it; 1: a sheet, which light passes as it is
    """
    dn_u, dn_v = normal_change(table, hit, n, beam.dx_u), normal_change(table, hit, n, beam.dx_v)
    if dot(wi, ng) > f32(0):
        dd_u, dd_v = _mirrored(beam.dd_u, dn_u, d, n), _mirrored(beam.dd_v, dn_v, d, n)
    elif eta == f32(1):
        return beam
    else:
        dd_u, dd_v = _refracted(beam.dd_u, dn_u, d, wi, n, eta), _refracted(beam.dd_v, dn_v, d, wi, n, eta)
    return Beam(beam.dx_u, beam.dx_v, dd_u, dd_v)


@jit
def _mirrored(dd, dn, d, n):
    """The change of a reflected direction."""
    along = dot(dd, n) + dot(d, dn)
    return sub(sub(dd, scale(f32(2) * dot(d, n), dn)), scale(f32(2) * along, n))


@jit
def _refracted(dd, dn, d, wi, n, eta):
    """The change of a refracted direction: that of wi = d / eta - m n."""
    c, beyond = dot(d, n), min(dot(wi, n), -_GRAZING)
    m = c / eta - beyond
    dm = (f32(1) - c / (eta * beyond)) / eta * (dot(dd, n) + dot(d, dn))
    return sub(sub(scale(f32(1) / eta, dd), scale(m, dn)), scale(dm, n))
