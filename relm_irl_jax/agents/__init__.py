"""Agents. Each has its own folder and implements `relm_irl_jax.types.Agent`."""
