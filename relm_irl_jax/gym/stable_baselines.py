"""The vector environments for stable-baselines3, which has an interface of its own for them."""

from typing import TYPE_CHECKING

from relm_irl_jax.errors import InputError
from relm_irl_jax.gym.vector import ProblemVectorEnv

if TYPE_CHECKING:
    from stable_baselines3.common.vec_env import VecEnv


def stable_baselines3_env(environment: ProblemVectorEnv) -> "VecEnv":
    """Make a `VecEnv` of stable-baselines3 from a vector environment of this package.

        environment = TaskVectorEnv(64, task="II", seed=0, split="train", autoreset_mode="SameStep")
        model = stable_baselines3.PPO("MultiInputPolicy", stable_baselines3_env(environment))

    Args:
        environment: a vector environment that resets in the same step.

    Returns:
        The same agents, with stable-baselines3's interface; their episodes are recorded for its logger.

    Raises:
        InputError: stable-baselines3 is not installed, or the environment resets in the next step.
    """
    if environment.metadata["autoreset_mode"].value != "SameStep":
        raise InputError('autoreset_mode: stable-baselines3 resets in the same step; give autoreset_mode="SameStep".')
    try:
        from relm_irl_jax.gym.stable_baselines_env import StableBaselines3Env
    except ImportError as error:
        raise InputError(f"stable-baselines3 cannot be used ({error}); run `pip install stable-baselines3`.") from error
    return StableBaselines3Env(environment)
