"""Scenes: the structure, the file format and the sources."""
