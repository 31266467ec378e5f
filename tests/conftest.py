"""Settings of JAX for all tests and the commands that they start: JAX reads them when it is imported, after this."""

import os
from importlib.metadata import version
from pathlib import Path

FOLDER = Path(__file__).parents[1] / ".cache" / "jax"

# Compiled programs are kept and shared.
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(FOLDER))
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES", "-1")
# Compiling takes most of the time of tests and hardly any program runs long, so most optimisations are left out.
# `make slow`, whose tests train, and everything else that `.ci/run` starts have them.
os.environ.setdefault("JAX_DISABLE_MOST_OPTIMIZATIONS", "1")
# XLA's older emitter of loops compiles in half of the time. Newer versions end at a flag that they do not know.
OLDER_EMITTER, FLAGS = "--xla_cpu_use_fusion_emitters=false", os.environ.get("XLA_FLAGS", "")
if (
    os.environ["JAX_DISABLE_MOST_OPTIMIZATIONS"] == "1"
    and version("jaxlib").startswith("0.10.")
    and OLDER_EMITTER not in FLAGS
):
    os.environ["XLA_FLAGS"] = f"{FLAGS} {OLDER_EMITTER}".strip()
# A product of arrays of two types is an error, not silently an array of the wider type.
os.environ.setdefault("JAX_NUMPY_DTYPE_PROMOTION", "strict")
