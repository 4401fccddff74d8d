"""What a plane cuts off a kernel is folded back before it, as a second kernel, the image of the first.

Light that is even up to a wall then stays even: where the rest of each kernel is scaled up instead, ln 2 of
it is left at the wall, and 1.09 of it .6 of a kernel's radius away, a dark line along all mirrors.
Source: Silverman 1986, section 2.10 (reflection at a boundary).
"""

from __future__ import annotations

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.records import take
from ispm.optics.vector import cross, dot, normalize, scale, sub, vec3
from ispm.photons.footprint import extent, part_before

f32 = np.float32

_ACROSS = f32(1e-3)  # sine of the angle between a plane and a surface, below which the kernel is only scaled


def with_images(kernels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (N + K,) CAUSTIC, the kernels and then the images of those that planes cut, and the rows of
    these, (K,) int64.

    kernels  (N,) CAUSTIC, the rest of those that planes cut scaled up (`end_kernel`)
    An image lies behind its plane and counts before it, as `reach` below 0 says.
    """
    folded = np.zeros(len(kernels), np.bool_)
    _find_folded(kernels, folded)
    rows = np.flatnonzero(folded)
    whole, images = kernels.copy(), take(kernels, rows)
    _fold(rows, whole, images)
    return np.concatenate([whole, images]), rows


@jit
def _find_folded(kernels, folded):
    """Write (N,) bool: which of (N,) CAUSTIC a plane cuts that does not lie along their surface."""
    for i in range(len(kernels)):
        front, along = vec3(kernels[i].front), _along(kernels[i])
        is_cut = dot(front, front) > f32(0) and kernels[i].reach < extent(kernels[i], front)
        folded[i] = is_cut and dot(along, along) > _ACROSS * _ACROSS


@jit
def _fold(rows, kernels, images):
    """Give (K,) CAUSTIC of (N,), at the rows, their own flux again, and make copies of them their images."""
    for i in range(len(rows)):
        kernel, image = kernels[rows[i]], images[i]
        along, u, v = _along(kernel), vec3(kernel.u), vec3(kernel.v)
        twice = f32(2) / dot(along, along)
        u_along, v_along = twice * dot(u, along), twice * dot(v, along)
        part = part_before(kernel.reach / extent(kernel, vec3(kernel.front)))
        for k in range(3):
            kernel.flux[k] *= part
            image.flux[k] = kernel.flux[k]
            image.position[k] -= twice * kernel.reach * along[k]
            image.u[k] = u[k] - u_along * along[k]
            image.v[k] = v_along * along[k] - v[k]  # u x v stays on the same side
        image.reach = -kernel.reach


@jit
def _along(kernel):
    """The part of the normal of a CAUSTIC's plane that lies along its surface."""
    front, n = vec3(kernel.front), normalize(cross(vec3(kernel.u), vec3(kernel.v)))
    return sub(front, scale(dot(front, n), n))
