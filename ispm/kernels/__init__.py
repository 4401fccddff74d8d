"""Compiled kernels: how they are written, what they depend on, how they are linked, kept and compiled.

In come Python functions for numba; out go the same bits in every process, from a cache that is keyed by
content. `simd` and `threads` are what kernels and their callers are written with.
"""
