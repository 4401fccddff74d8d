"""Bright first bounces, whose light photons bring: what gather rays are left with is never a spike."""

import math

import numpy as np
import pytest

from ispm.lights.bright import is_bright
from ispm.optics.bsdf import Bsdf, eval_bsdf
from ispm.optics.facets import NO_ANISOTROPY
from ispm.optics.jit import jit

f32 = np.float32
COUNT, TURN = 40_000, 0.24  # radians that shading normals turn by at most


@jit
def look(b, ng, n, wo, wi, limit, out):
    """Whether light of 1 lx is bright, and pi times the radiance that it makes."""
    one = f32(1), f32(1), f32(1)
    for k in range(len(out)):
        g = ng[k, 0], ng[k, 1], ng[k, 2]
        s = n[k, 0], n[k, 1], n[k, 2]
        o, i = (wo[k, 0], wo[k, 1], wo[k, 2]), (wi[k, 0], wi[k, 1], wi[k, 2])
        cosine = s[0] * i[0] + s[1] * i[1] + s[2] * i[2]
        out[k, 0] = is_bright(b, g, o, one, i, limit)
        out[k, 1] = f32(math.pi) * cosine * eval_bsdf(b, s, g, o, i)[0]


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def metal(roughness):
    zero, none = f32(0), (f32(0),) * 3
    rest = f32(1), f32(roughness**2), zero, zero, none, f32(1.5), zero, zero, NO_ANISOTROPY
    return Bsdf(none, (f32(0.9),) * 3, *rest)


@pytest.mark.parametrize("roughness", [0.06, 0.2, 0.4])
def test_what_gather_rays_keep_is_no_spike_on_facets_that_look_smooth(roughness):
    """Directions near and far from each other's mirror images, on facets whose shading normals turn by up to
    14 degrees: pi times the radiance of what is not bright is below the limit, but for the cosine at the
    light's side, of which the geometric normal's counts."""
    random = np.random.default_rng(4)
    ng = np.tile(np.array([0.0, 0.0, 1.0]), (COUNT, 1))
    turn, around = TURN * random.random(COUNT), 2.0 * math.pi * random.random(COUNT)
    n = np.stack([np.sin(turn) * np.cos(around), np.sin(turn) * np.sin(around), np.cos(turn)], axis=1)
    wo = unit(np.column_stack([random.uniform(-1, 1, (COUNT, 2)), random.uniform(0.3, 1, COUNT)]))
    off = roughness**2 * 10.0 ** random.uniform(-0.3, 1.7, (COUNT, 1))
    facet = unit(n + off * random.normal(size=(COUNT, 3)))
    wi = 2.0 * (wo * facet).sum(axis=1, keepdims=True) * facet - wo
    limit = 0.02 / roughness**4  # a tenth of the lobe's peak, 0.9 / (4 alpha^2) and more
    seen = ((wi * n).sum(axis=1) > 0.05) & (wi[:, 2] > 0.05) & ((wo * n).sum(axis=1) > 0.05)
    out = np.zeros((COUNT, 2), f32)
    look(metal(roughness), *(a.astype(f32) for a in (ng, n, wo, wi)), f32(limit), out)
    bright, light = out[seen].T
    share = (n * wi).sum(axis=1)[seen] / wi[seen, 2]
    kept = light[bright == 0]
    assert (kept <= 1.001 * limit * np.maximum(share[bright == 0], 1.0)).all()
    assert len(kept) > 100 and (light > 5.0 * limit).sum() > 100
