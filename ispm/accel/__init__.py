"""Trees and rays: a scene's triangles in trees, rays against them, and the surface at a hit.

In come a packed scene's triangles and instances; out go a World of trees (one for each mesh, one over all
instances), the kernels that find what a ray hits, and the surface there: position, normals and BSDF. It
imports `optics`, `scene` and `kernels`, and knows nothing of lights, photons or pictures.
"""
