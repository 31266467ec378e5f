"""A training whose numbers stop being finite ends with a sentence and keeps its last valid state."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from interruption import EVERY_CHUNK
from tiny import CHUNK, SMALL, problem

from relm_irl_jax.agents.siamese.agent import SiameseAgent
from relm_irl_jax.agents.siamese.behaviour_cloning import BehaviourCloningAgent
from relm_irl_jax.agents.training import Chunks, check_finite, run_chunks
from relm_irl_jax.checkpoints import Checkpoints
from relm_irl_jax.errors import DivergenceError
from relm_irl_jax.parameters import save_parameters
from relm_irl_jax.rewards.functions import ManualReward
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.stages.training_log import RunFolderLog
from relm_irl_jax.types import TrainingLog

BAD = [np.nan, np.inf, -np.inf]


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("agent", [SiameseAgent(SMALL), BehaviourCloningAgent(SMALL)], ids=["siamese", "cloning"])
def test_a_reward_or_feature_that_is_not_finite_ends_every_training(agent, bad):
    world = problem().world
    features = world.features.at[5, 3].set(bad)
    diverging = problem()
    object.__setattr__(diverging, "world", type(world)(**{**vars(world), "features": features}))
    if isinstance(agent, SiameseAgent) and not np.isnan(bad):
        rewards = ManualReward(jnp.float32(0), jnp.float32(-1), jnp.float32(bad))
        diverging = problem(reward=rewards)
    with pytest.raises(DivergenceError, match=f"diverged.*after {CHUNK} frames"):
        agent.train(jax.random.key(0), diverging, TrainingLog())


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("column", ["reward", "loss", "distance_loss", "3/reward"])
def test_rewards_and_losses_are_finite_and_other_columns_may_be_undefined(bad, column):
    check_finite({}, {"frames": 7.0, "success_rate": np.nan, column: 0.0})
    with pytest.raises(DivergenceError, match="after 7 frames"):
        check_finite({}, {"frames": 7.0, column: bad})


def test_the_last_valid_state_is_kept(tmp_path, capsys):
    def chunk(state, number):
        weight = state["weight"] + 1 if number < 2 else state["weight"] * jnp.nan
        return {"weight": weight}, {"frames": 10.0 * (number + 1), "reward": 0.0}

    start = {"weight": jnp.zeros(3, jnp.float32)}
    seldom = type(EVERY_CHUNK)()
    folder = RunFolder(tmp_path)
    with (
        pytest.raises(DivergenceError, match=r"`weight` is not finite after 30 frames"),
        RunFolderLog(folder, seldom, "rl", 0, lambda frames: None) as log,
    ):
        run_chunks(start, chunk, Chunks(count=5, updates=1, frames=10), log)
    with Checkpoints(folder.checkpoints("rl", 0), seldom) as kept:
        state, rows = kept.restore(start)
    np.testing.assert_array_equal(state["weight"], [2.0, 2.0, 2.0])
    assert [row["frames"] for row in rows] == [10.0, 20.0]
    assert "Checkpoint" in capsys.readouterr().err


@pytest.mark.parametrize("bad", BAD)
def test_weights_that_are_not_finite_are_never_saved(tmp_path, bad):
    with pytest.raises(DivergenceError, match="`params/kernel`"):
        save_parameters(tmp_path / "w.safetensors", {"params": {"kernel": np.asarray([1.0, bad], np.float32)}})
    assert not list(tmp_path.iterdir())
