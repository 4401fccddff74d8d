"""Paths from the eye and from receivers to the surfaces whose light they bring.

In come pixels that show mirrors or glass, and receivers that want light; out go the ends of specular paths
and of gather rays, with what they bring. It imports `photons`, `lights`, `accel` and what those may.
"""
