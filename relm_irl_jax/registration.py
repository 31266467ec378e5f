"""The names under which Gymnasium finds the environments; importing the package registers them."""

from gymnasium.envs.registration import register, registry

NAVIGATION = "RelmIrl/Navigation-v0"
"""The target-driven navigation task, for one agent or many in step."""


def register_environments() -> None:
    """Tell Gymnasium of the environments; their code is loaded when one is made."""
    if NAVIGATION not in registry:
        register(
            NAVIGATION,
            entry_point="relm_irl_jax.gym:NavigationEnv",
            vector_entry_point="relm_irl_jax.gym:NavigationVectorEnv",
        )
