"""The physics, twice: `x.py` (numba) and `x.wgsl` are twins with the same names in the same order.

In come single values: directions, a material at a point, random numbers, texture coordinates; out go what
BSDFs, lights, textures and kernels make of them, and the records that both processors share. It imports
`kernels` alone, and knows of no scene.
"""
