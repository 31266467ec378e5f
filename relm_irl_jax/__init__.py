"""Target-driven visual navigation with learned rewards, in JAX."""

from importlib.metadata import version

from relm_irl_jax.registration import register_environments

__version__ = version("relm-irl-jax")
"""Version of the installed package."""

register_environments()
