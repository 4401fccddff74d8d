"""Compiled kernels: what they depend on, how they are linked, where they are kept, and who compiles them."""
