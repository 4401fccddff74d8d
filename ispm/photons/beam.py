"""How wide the beam is that a photon stands for: the differentials of its path, through mirrors and glass.

Sources: Igehy, Tracing Ray Differentials, SIGGRAPH 1999; Schjoth et al., Photon Differentials, GRAPHITE 2007.
"""

from __future__ import annotations

import numpy as np

from ispm.accel.mesh import normal_change
from ispm.lights.emitted import Beam
from ispm.optics.jit import jit
from ispm.optics.vector import add, dot, scale, sub

f32 = np.float32

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
