"""The photon map: photons followed through the scene, and the kernels by which they light points.

In come first hits from `lights`; out go stored photons, their kernels (a priori, measured by their density,
shaped by their beams, ended at walls, with the light given back that falls past edges), and grids that find
the photons near points. It imports `lights`, `accel` and what those may.
"""
