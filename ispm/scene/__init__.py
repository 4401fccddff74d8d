"""What is lit: plain data, numpy only, no GPU object inside.

In come meshes, materials, lights and cameras from users, files or `library`; out goes the packed scene, the
flat arrays that trees, kernels and the GPU read.
"""
