"""Compiled programs are kept and shared by the test processes and the commands that they start."""

import os
from pathlib import Path

FOLDER = Path(__file__).parents[1] / ".cache" / "jax"

# Read by JAX when it is imported, which is after this file.
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(FOLDER))
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES", "-1")
