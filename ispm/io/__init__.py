"""Files: scenes that are read, pictures that are written.

In come paths and untrusted bytes, within limits of memory and work; out go scenes, textures and files that
are whole or not there. It imports `scene`, `library` and what those may.
"""
