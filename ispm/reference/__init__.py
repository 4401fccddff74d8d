"""Slow truth: a path tracer, eye paths and gathering without maps, filters or kernels.

In comes a packed scene; out go unbiased means with their errors, which tests and the accuracy table compare
with.
"""
