"""Registration of the environments with Gymnasium, which happens when the package is imported."""

from gymnasium.envs.registration import register, registry

NAVIGATION = "RelmIrl/Navigation-v0"
"""Target-driven navigation in one scene, for one agent or many in lockstep."""

TASK = "RelmIrl/Task-v0"
"""A task of the paper, with the scenes and targets that the tables are made with."""


def register_environments() -> None:
    """Register the environments with Gymnasium; their code is imported when one is made."""
    for name, kind in ((NAVIGATION, "Navigation"), (TASK, "Task")):
        if name not in registry:
            register(
                name,
                entry_point=f"relm_irl_jax.gym.single:{kind}Env",
                vector_entry_point=f"relm_irl_jax.gym.vector:{kind}VectorEnv",
            )
