"""The physics, twice: `x.py` (numba) and `x.wgsl` are twins with the same names in the same order."""
