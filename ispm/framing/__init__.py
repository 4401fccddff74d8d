"""The camera and the light of scenes that have none, and checks of a scene before it is rendered.

In come a scene, its packed arrays and its trees; out go a camera that shows it, from within where it is a
room, and a light. It imports `accel`, `library` and `scene`.
"""
