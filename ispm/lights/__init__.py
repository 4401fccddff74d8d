"""What lights send out, and what arrives directly from them.

In come the lights of a packed scene; out go the maps through which each sees the scene, the plan of how
many photons leave through which, the photons' first hits, and, at any point, the light that comes directly,
by shadow rays (next-event estimation). It imports `accel` and what that may.
"""
