"""Image size of the tests."""

IMAGE_SIZE = 32
"""Rows and columns of all rendered views: the renderer compiles once for each size."""
