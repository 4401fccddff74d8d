"""What frames cost, and how far they are from the truth: the benchmark, metrics, and Embree to compare with.

In come scenes and settings, or two reports; out go medians with their spread, tables and verdicts.
"""
