"""The passes over images, in frame order: G-buffer, receivers, bounce maps, shadows, direct light and so on.

In come GPU images and buffers of the stages before, and the packed scene; out go images of the next. `x.py`
prepares and calls `x.wgsl`. `filter` is numba alone, as the light that it filters was gathered by rays on the
CPU. Stages do not import each other, but for the camera and the face of a map; the renderer joins them.

A stage owns the textures, buffers and pipelines that it makes, and lends them for a frame. Nothing is closed
by hand: they are freed when the stage is dropped, as the renderer does when it closes or when settings want
another.
"""
