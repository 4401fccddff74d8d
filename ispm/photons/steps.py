"""What a photon meets on its way, written down while it is followed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.records import MATERIAL_THIN
from ispm.optics.vector import dot

f32, u32 = np.float32, np.uint32

STEP = np.dtype(
    [("position", f32, 3), ("flux", f32, 3), ("key", u32), ("number", u32), ("event", u32), ("light", u32)]
)
"""A place of a photon's way: m in world space, and the flux, lm, that arrives there; at the light, that which
leaves it. `key` is that of a hit, see `Walk`; `number` counts the places of the way from 0, the light;
`event` is a row of EVENTS; `light` that of the lights."""

EVENTS = ("end", "light", "diffuse", "gloss", "mirror", "glass", "sheet")
"""What happens to a photon at a place: it goes no further; leaves the light; is reflected by a rough surface,
by one without a Lambert lobe, by a smooth one; goes into or out of a solid; through a thin sheet."""
_END, _LIGHT, _DIFFUSE, _GLOSS, _MIRROR, _GLASS, _SHEET = map(u32, range(len(EVENTS)))


class Steps(NamedTuple):
    """Where steps are written: (n,) STEP, and how many there are, (1,) int64, those without room as well."""

    rows: np.ndarray
    written: np.ndarray


@jit
def write_step(steps, position, flux, photon, key, number):
    """Add a place, (3,) m, where `flux` of an EMITTED photon arrives, and ends until more is known; key and
    number as of a STEP."""
    count = steps.written[0]
    steps.written[0] = count + 1
    if count < len(steps.rows):
        step = steps.rows[count]
        for c in range(3):
            step.position[c] = position[c]
            step.flux[c] = flux[c]
        step.key, step.number = key, u32(number)
        step.event = _END if number > 0 else _LIGHT
        step.light = photon.light


@jit
def write_event(steps, x, wi, specular):
    """Write to the last step how its photon left the SurfacePoint x along wi."""
    if steps.written[0] > len(steps.rows):
        return
    step = steps.rows[steps.written[0] - 1]
    if dot(wi, x.ng) < f32(0):
        step.event = _SHEET if x.flags & u32(MATERIAL_THIN) else _GLASS
    elif specular:
        step.event = _MIRROR
    else:
        diffuse = x.bsdf.diffuse
        step.event = _DIFFUSE if max(diffuse[0], max(diffuse[1], diffuse[2])) > f32(0) else _GLOSS
