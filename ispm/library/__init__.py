"""The built-in scenes, and the shapes that they and tests are made of.

In come a name and a few choices, such as an albedo; out goes a `Scene`. It imports `scene` alone.
"""
