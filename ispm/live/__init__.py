"""What is kept of light from frame to frame, and how it is told to be out of date.

In: points of this frame and the one before, their light, photons. Out: light of earlier frames at points of
this one, the share of it that no longer holds, light at points in the world. Imports what `paths` does.
"""
