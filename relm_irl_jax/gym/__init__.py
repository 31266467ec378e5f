"""Gymnasium environments: target-driven navigation, for one agent or for many in lockstep.

    gymnasium.make("RelmIrl/Navigation-v0", scene="bathroom-0", target="toilet", cap=100)
    gymnasium.make("RelmIrl/Task-v0", task="II", seed=0, split="train")
    gymnasium.make_vec("RelmIrl/Task-v0", num_envs=64, task="II", seed=0, split="test")

`Navigation-v0` is one scene with targets of your choice; `Task-v0` is one of the paper's tasks with the scenes and
targets that the tables are made with. Both are the decision process of `relm_irl_jax.env`, on tables of NumPy: stepping
them uses no JAX, so worker processes may be forked.

The actions are `relm_irl_jax.scenes.scene.ACTIONS`. An observation contains the current view and the target's view, as
feature vectors or as frames; with `history` above 1, the last views, the latest first. `info` contains `distance`
(length of a shortest path from the current state), `shortest` (the same from the start), `steps` and `success`, from
which success weighted by path length can be computed.

Two adapters serve other interfaces: `stable_baselines3_env` for vector environments, and `functional_env` for programs
that jit and vmap the environment together with the agent. Names are imported on first use.
"""

from typing import TYPE_CHECKING

from relm_irl_jax.lazy import lazy_getattr

if TYPE_CHECKING:
    from relm_irl_jax.gym.functional import EnvParams as EnvParams
    from relm_irl_jax.gym.functional import FunctionalEnv as FunctionalEnv
    from relm_irl_jax.gym.functional import functional_env as functional_env
    from relm_irl_jax.gym.scenes import find_scene as find_scene
    from relm_irl_jax.gym.scenes import target_states as target_states
    from relm_irl_jax.gym.single import NavigationEnv as NavigationEnv
    from relm_irl_jax.gym.single import TaskEnv as TaskEnv
    from relm_irl_jax.gym.stable_baselines import stable_baselines3_env as stable_baselines3_env
    from relm_irl_jax.gym.vector import NavigationVectorEnv as NavigationVectorEnv
    from relm_irl_jax.gym.vector import TaskVectorEnv as TaskVectorEnv

_MODULES = {
    "EnvParams": "functional",
    "FunctionalEnv": "functional",
    "NavigationEnv": "single",
    "NavigationVectorEnv": "vector",
    "TaskEnv": "single",
    "TaskVectorEnv": "vector",
    "find_scene": "scenes",
    "functional_env": "functional",
    "stable_baselines3_env": "stable_baselines",
    "target_states": "scenes",
}

__all__ = sorted(_MODULES)

__getattr__ = lazy_getattr(__name__, _MODULES)
