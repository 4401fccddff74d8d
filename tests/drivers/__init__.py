"""Whether every driver draws the same, and every compiler takes the shaders. `make drivers` runs it all."""
