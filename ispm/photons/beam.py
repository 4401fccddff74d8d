"""How wide the beam is that a photon stands for: the differentials of its path, through mirrors and glass.

Differentials hold where a surface is nearly flat. Beams of a sky are as wide as photons are few in the scene,
and would spread what a small ball reflects over many times its size. So a beam keeps to the part of a curved
surface over which the normal turns by no more than `_TURN_MAX`.

Sources: Igehy, Tracing Ray Differentials, SIGGRAPH 1999; Schjoth et al., Photon Differentials, GRAPHITE 2007.
"""

from __future__ import annotations

import math

import numpy as np

from ispm.accel.mesh import normal_change
from ispm.lights.emitted import Beam
from ispm.optics.jit import jit
from ispm.optics.vector import add, dot, scale, sub

f32 = np.float32

_TURN_MAX = f32(0.5)  # rad, of the normal from a beam's middle to its side; .25 is noisier, hardly more exact
_GRAZING = f32(1e-4)  # least cosine at which a beam is spread over a surface


@jit
def beam_at(beam, distance, d, ng):
    """Return a Beam at the surface of unit normal ng that it meets after `distance` m along d."""
    inv = f32(-1) / max(-dot(d, ng), _GRAZING)
    u = add(beam.dx_u, scale(distance, beam.dd_u))
    v = add(beam.dx_v, scale(distance, beam.dd_v))
    u, v = sub(u, scale(dot(u, ng) * inv, d)), sub(v, scale(dot(v, ng) * inv, d))
    return Beam(u, v, beam.dd_u, beam.dd_v)


@jit
def redirected_beam(table, hit, beam, d, wi, ng, n, eta):
    """Return the Beam that a smooth surface makes of one that meets it along d and leaves along wi.

    table  (8,) uint64 addresses of a SurfaceTable;  hit  the Hit
    ng, n  unit normals against d, the latter bent as smooth surfaces are
    eta    index of refraction beyond the surface over that before it; 1: a sheet, which light passes as it is
    """
    dx_u, dd_u, dn_u = _where_flat(beam.dx_u, beam.dd_u, normal_change(table, hit, n, beam.dx_u))
    dx_v, dd_v, dn_v = _where_flat(beam.dx_v, beam.dd_v, normal_change(table, hit, n, beam.dx_v))
    if dot(wi, ng) > f32(0):
        dd_u, dd_v = _mirrored(dd_u, dn_u, d, n), _mirrored(dd_v, dn_v, d, n)
    elif eta == f32(1):
        return beam
    else:
        dd_u, dd_v = _refracted(dd_u, dn_u, d, wi, n, eta), _refracted(dd_v, dn_v, d, wi, n, eta)
    return Beam(dx_u, dx_v, dd_u, dd_v)


@jit
def _where_flat(dx, dd, dn):
    """The changes of a beam's position, direction and of the normal under it to one of its sides, or to where
    the normal turns by _TURN_MAX, if that is nearer."""
    turn = f32(math.sqrt(dot(dn, dn)))
    share = _TURN_MAX / turn if turn > _TURN_MAX else f32(1)
    return scale(share, dx), scale(share, dd), scale(share, dn)


@jit
def _mirrored(dd, dn, d, n):
    """The change of a reflected direction; dd, dn: the changes of d and of the unit normal n."""
    along = dot(dd, n) + dot(d, dn)
    return sub(sub(dd, scale(f32(2) * dot(d, n), dn)), scale(f32(2) * along, n))


@jit
def _refracted(dd, dn, d, wi, n, eta):
    """The change of a refracted direction: that of wi = d / eta - m n; the rest as of `_mirrored`."""
    c, beyond = dot(d, n), min(dot(wi, n), -_GRAZING)
    m = c / eta - beyond
    dm = (f32(1) - c / (eta * beyond)) / eta * (dot(dd, n) + dot(d, dn))
    return sub(sub(scale(f32(1) / eta, dd), scale(m, dn)), scale(dm, n))
