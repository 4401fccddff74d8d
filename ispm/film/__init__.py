"""Films: pictures of a scene whose time goes on, as a video or as numbered files.

In come a scene, settings, and what moves: the file's animations, a path of the camera, a turn round the
scene, a function of the time. Out goes one file, or one for each picture. `animate` is the whole of it;
finished pictures are kept beside the film until it is whole (`kept`), so that it goes on where it was killed.
"""
