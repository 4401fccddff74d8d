"""Files: scenes that are read, pictures that are written."""
