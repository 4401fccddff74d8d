"""No kernel of `ispm.optics` slips into float64, which would halve the speed of the hot loops."""

import numpy as np
import pytest
from numba import types

from ispm.optics import bsdf, bsdf_sampling, density, facets, rng, sampling, sheen, texture
from ispm.photons.scatter import adjoint_factor

F, U, B = types.float32, types.uint32, types.boolean
VECTOR = types.UniTuple(F, 3)
ANISOTROPY = types.NamedTuple([F, VECTOR], facets.Anisotropy)
BSDF = types.NamedTuple([VECTOR, VECTOR, F, F, F, F, VECTOR, F, F, F, ANISOTROPY], bsdf.Bsdf)
DIELECTRIC = types.NamedTuple([F, VECTOR, F, F, B], bsdf.Dielectric)
TEXELS, ROWS = types.Array(U, 1, "C"), types.Array(types.int64, 2, "C")


@pytest.mark.parametrize(
    ("kernel", "arguments"),
    [
        (rng.random4, (U, U, U, U)),
        (sampling.cosine_hemisphere, (F, F)),
        (sampling.octahedral_encode, (VECTOR,)),
        (sampling.octahedral_decode, (F, F)),
        (sampling.equal_area_octahedral, (F, F)),
        (bsdf.surface_bsdf, (VECTOR, F, F, F, DIELECTRIC, B)),
        (bsdf.fresnel_dielectric, (F, F)),
        (bsdf.refract, (VECTOR, VECTOR, F)),
        (bsdf.specular_split, (BSDF, VECTOR, VECTOR)),
        (bsdf.eval_bsdf, (BSDF, VECTOR, VECTOR, VECTOR, VECTOR)),
        (sheen.eval_sheen, (F, VECTOR, VECTOR, VECTOR, VECTOR)),
        (sheen.sheen_albedo, (F, F)),
        (facets.visible_pdf, (BSDF, VECTOR, VECTOR, VECTOR)),
        (facets.visible_facet, (BSDF, VECTOR, VECTOR, F, F)),
        (bsdf.gloss_terms, (F, VECTOR, VECTOR, VECTOR)),
        (bsdf_sampling.pdf_bsdf, (BSDF, VECTOR, VECTOR, VECTOR)),
        (bsdf_sampling.sample_bsdf, (BSDF, VECTOR, VECTOR, VECTOR, F, F, F, B)),
        (adjoint_factor, (F, F, F, F)),
        (density.density_kernel, (VECTOR, VECTOR, F, F)),
        (density.cosine_ratio, (F, F)),
        (texture.sample_texture, (TEXELS, ROWS, types.int64, F, F, F)),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_kernel_returns_float32(kernel, arguments):
    kernel.compile(arguments)
    found = str(kernel.overloads[arguments].signature.return_type)
    assert "float32" in found
    assert "float64" not in found


def test_random_bits_are_those_of_the_published_hash():
    """pcg4d of Jarzynski and Olano, evaluated here with Python's integers."""
    v = [7, 11, 13, 2**32 - 5]
    v = [(x * 1664525 + 1013904223) % 2**32 for x in v]
    for shift in (16, 0):
        for i, j, k in ((0, 1, 3), (1, 2, 0), (2, 0, 1), (3, 1, 2)):
            v[i] = (v[i] + v[j] * v[k]) % 2**32
        v = [x ^ x >> shift if shift else x for x in v]
    assert rng.pcg4d(*(np.uint32(x) for x in (7, 11, 13, 2**32 - 5))) == tuple(v)
