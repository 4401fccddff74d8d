"""What eye paths leave behind: the records of their ends, and of the surfaces they left from."""

from __future__ import annotations

import numpy as np
from numba import literal_unroll

from ispm.optics.bsdf import transmits
from ispm.optics.jit import jit
from ispm.optics.vector import dot, luminance

f32, u32 = np.float32, np.uint32

_GLOSS_ALPHA_MIN = f32(0.25)  # as in stages/receivers.wgsl
_BLUR_SHARE = f32(0.2)  # of a rough surface's blur, that its pixels may be averaged over

# places in a Bsdf tuple
_F0, _F90, _ALPHA, _DIELECTRIC_F0, _DIELECTRIC_F90, _TINT, _ETA, _THIN = 3, 6, 7, 8, 9, 10, 13, 14

BLACK = (f32(0),) * 15  # the Bsdf of what is unlit

# A surface that photons may light, or that is unlit, seen by way of mirrors and glass. slot: the ray's row;
# lane: what the first surface did to its path; weight: of the radiance that leaves it, in the ray's. f0
# and f90 are 0 where the path goes on instead.
END = np.dtype([
    ("slot", "<u4"), ("lane", "<u4"), ("weight", "<f4", 3), ("diffuse", "<f4", 3), ("f0", "<f4", 3),
    ("f90", "<f4"), ("dielectric_f0", "<f4"), ("dielectric_f90", "<f4"), ("instance", "<u4"),
])  # fmt: skip

# The mirror or glass that a pixel shows; blur: pixels over which its light may be averaged, 0: it is smooth.
FIRST = np.dtype([
    ("n", "<f4", 3), ("alpha", "<f4"), ("ng", "<f4", 3), ("tint", "<f4"), ("blur", "<f4"),
    ("instance", "<u4"),
])  # fmt: skip


@jit
def store_end(end, slot, lane, weight, b, instance):
    """Write an END."""
    gloss = f32(1) if b[_ALPHA] > f32(0) and not transmits(b) else f32(0)
    end.slot = u32(slot)
    end.lane = u32(lane)
    end.instance = instance
    for k in literal_unroll((0, 1, 2)):
        end.weight[k] = weight[k]
        end.diffuse[k] = b[k]
        end.f0[k] = gloss * b[_F0 + k]
    end.f90 = gloss * b[_F90]
    end.dielectric_f0 = b[_DIELECTRIC_F0]
    end.dielectric_f90 = b[_DIELECTRIC_F90]


@jit
def store_point(point, position, ng, n, wo, b, width):
    """Write its RECEIVER."""
    for k in literal_unroll((0, 1, 2)):
        point.position[k] = position[k]
        point.ng[k] = ng[k]
        point.n[k] = n[k]
        point.wo[k] = wo[k]
    glossy = b[_F90] > f32(0) or b[_F0] + b[_F0 + 1] + b[_F0 + 2] > f32(0)
    point.alpha = max(b[_ALPHA], _GLOSS_ALPHA_MIN) if glossy else f32(0)
    point.valid = u32(1)
    point.footprint = width
    point.slant = f32(1) / max(abs(dot(wo, ng)), f32(0.02))


@jit
def store_first(first, n, ng, b, instance, angle):
    """Write a FIRST: what lies behind is blurred by as much as facets turned by alpha deflect light.

    angle  over a pixel's width, by which neighbouring pixels look on what lies behind
    """
    bent = f32(1) if b[_THIN] > f32(0) else abs(f32(1) - f32(1) / b[_ETA])
    for k in literal_unroll((0, 1, 2)):
        first.n[k] = n[k]
        first.ng[k] = ng[k]
    first.alpha = b[_ALPHA]
    first.tint = luminance((b[_TINT], b[_TINT + 1], b[_TINT + 2]))
    first.blur = _BLUR_SHARE * f32(2) * bent * b[_ALPHA] * angle
    first.instance = instance
