"""Registration of the environments with Gymnasium, which happens when the package is imported."""

from gymnasium.envs.registration import register, registry

NAVIGATION = "RelmIrl/Navigation-v0"
"""The target-driven navigation task, for one agent or many in lockstep."""


def register_environments() -> None:
    """Register the environments with Gymnasium; their code is imported when one is made."""
    if NAVIGATION not in registry:
        register(
            NAVIGATION,
            entry_point="relm_irl_jax.gym:NavigationEnv",
            vector_entry_point="relm_irl_jax.gym:NavigationVectorEnv",
        )
