"""Agents: what learns to navigate. Each has a folder of its own and implements `relm_irl_jax.types.Agent`."""
