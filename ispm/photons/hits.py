"""What a photon leaves at a hit, until its kernel is measured."""

from __future__ import annotations

import numpy as np
from numba import literal_unroll

from ispm.accel.surface import inner_side
from ispm.optics.jit import jit

u32 = np.uint32


@jit
def store_photon(photon, x, flux, d, clear, length, scatters):
    """Write a PHOTON that came along d to the SurfacePoint x. Its kernel is measured later; until then its
    `radius` is the distance in m to the plane of the surface that it comes from, `clear`, and its `height`
    the length of its last segment, m."""
    for k in literal_unroll((0, 1, 2)):
        photon.position[k] = x.position[k]
        photon.normal[k] = x.ng[k]
        photon.flux[k] = flux[k]
        photon.wi[k] = -d[k]
    photon.radius = clear
    photon.height = length
    photon.bounce = u32(scatters)
    photon.instance = x.hit.instance | inner_side(x)


@jit
def store_beam(beams, row, beam, wider, plane):
    """Write a row of (n, BEAM): a Beam's vectors in m, `wider` times as long, and the normal of the surface
    that it comes from."""
    for k in literal_unroll((0, 1, 2)):
        beams[row, k] = wider * beam.dx_u[k]
        beams[row, k + 3] = wider * beam.dx_v[k]
        beams[row, k + 6] = plane[k]
