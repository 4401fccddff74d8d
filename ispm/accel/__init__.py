"""Trees and rays: the triangles of a scene, made ready to be met.

In come a packed scene's triangles and instances; out go a world of trees (one for each mesh, one over all
instances), the kernels that meet a ray with it, and the surface at what was met: its place, normals and
BSDF. It imports `optics`, `scene` and `kernels`, and knows nothing of lights, photons or pictures.
"""
