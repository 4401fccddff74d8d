"""The opaque surface of glTF 2.0 (appendix B) for Mitsuba 3, whose own plugins mix and shadow otherwise."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

_FACETS = 0.5  # chance to draw from the facets where there is a Lambert lobe too


def register_gloss() -> None:
    """Make `glossy` known to the variant in use: one GGX lobe over Lambert.

    diffuse  albedo below the reflection, RGB; black: a metal
    f0, f90  reflectance along the facets' normals, RGB, and at grazing incidence (Schlick)
    alpha    roughness squared
    Facets know of each other in shadowing and masking (Heitz, JCGT 2014, equation 99), where `roughconductor`
    takes the two as independent; Lambert gives way to the half vector's reflectance.
    """

    class Glossy(mi.BSDF):
        def __init__(self, properties: Any) -> None:
            mi.BSDF.__init__(self, properties)
            self._diffuse, self._f0 = (mi.Color3f(properties[name]) for name in ("diffuse", "f0"))
            self._alpha, self._f90 = float(properties["alpha"]), float(properties["f90"])
            self._metal = not dr.any(dr.ravel(self._diffuse) > 0.0)
            self._facets = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, self._alpha)
            flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
            if not self._metal:
                flags |= mi.BSDFFlags.DiffuseReflection
            self.m_components, self.m_flags = [flags], flags

        def sample(self, context: Any, at: Any, one: Any, two: Any, active: Any = True) -> Any:
            facet, _ = self._facets.sample(at.wi, two)
            mirrored = 2.0 * dr.dot(at.wi, facet) * facet - at.wi
            cosine = mi.warp.square_to_cosine_hemisphere(two)
            drawn = mi.BSDFSample3f()
            drawn.wo = mirrored if self._metal else dr.select(one < _FACETS, mirrored, cosine)
            drawn.pdf = self.pdf(context, at, drawn.wo, active)
            drawn.eta = 1.0
            drawn.sampled_type = mi.UInt32(+self.m_flags)
            drawn.sampled_component = mi.UInt32(0)
            weight = self.eval(context, at, drawn.wo, active) / drawn.pdf
            return drawn, dr.select(drawn.pdf > 0.0, weight, 0.0)

        def eval(self, context: Any, at: Any, wo: Any, active: Any = True) -> Any:
            ci, co = mi.Frame3f.cos_theta(at.wi), mi.Frame3f.cos_theta(wo)
            h, square = dr.normalize(at.wi + wo), self._alpha**2
            spread = mi.Frame3f.sin_theta_2(h) + square * mi.Frame3f.cos_theta_2(h)
            d = square / (dr.pi * spread**2)
            v = 0.5 / (
                co * dr.sqrt(square + (1.0 - square) * ci**2) + ci * dr.sqrt(square + (1.0 - square) * co**2)
            )
            away = (1.0 - dr.maximum(dr.dot(at.wi, h), 0.0)) ** 5
            reflected = self._f0 + (self._f90 - self._f0) * away
            below = self._diffuse * (1.0 - dr.max(reflected)) / dr.pi
            return dr.select(active & (ci > 0.0) & (co > 0.0), (below + d * v * reflected) * co, 0.0)

        def pdf(self, context: Any, at: Any, wo: Any, active: Any = True) -> Any:
            ci, co = mi.Frame3f.cos_theta(at.wi), mi.Frame3f.cos_theta(wo)
            h = dr.normalize(at.wi + wo)
            facets = self._facets.pdf(at.wi, h) / (4.0 * dr.dot(wo, h))
            if not self._metal:
                facets = dr.lerp(mi.warp.square_to_cosine_hemisphere_pdf(wo), facets, _FACETS)
            return dr.select(active & (ci > 0.0) & (co > 0.0), facets, 0.0)

        def eval_pdf(self, context: Any, at: Any, wo: Any, active: Any = True) -> Any:
            return self.eval(context, at, wo, active), self.pdf(context, at, wo, active)

    mi.register_bsdf("glossy", Glossy)
