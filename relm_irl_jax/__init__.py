"""Target-driven visual navigation with learned rewards, in JAX."""

from relm_irl_jax.registration import register_environments

register_environments()
